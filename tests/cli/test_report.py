"""The report of a run, and the curves of tests that it shows."""

import json
import re
import shutil
from base64 import b64decode
from pathlib import Path

import numpy as np
import pytest

import skfem_textile
from skfem_textile.cli import main as cli
from skfem_textile.cli.curve import read_test_curve
from skfem_textile.cli.results import CURVES
from tests.helpers.command_line import computed, rejected, summary_in
from tests.helpers.pages import Page, references

# The report of a run: one self-contained page

RUN = ("--size", "2x4", "--steps", "1", "--no-render", "--shear-law", "sin2")
CURVE = "displacement (mm),force (N)\n0,0\n4,1\n8,3\n"


def write_report(out, *more):
    assert cli.main(["report", str(out), *more]) == 0
    return Page((out / "report.html").read_text(encoding="utf-8"))


@pytest.fixture(scope="module")
def results(tmp_path_factory):
    """Results of a run with the curve of a test."""
    folder = tmp_path_factory.mktemp("results")
    (folder / "test.csv").write_text(CURVE)
    test = ("--test-curve", str(folder / "test.csv"))
    out = folder / "out"
    assert cli.main(["run", "bias_extension", "--out", str(out), *RUN, *test]) == 0
    return out


@pytest.fixture(scope="module")
def page(results):
    """The report of this run."""
    return write_report(results)


@pytest.fixture
def copy(results, tmp_path):
    """Its results without the curve of a test."""
    out = tmp_path / "copy"
    out.mkdir()
    (out / "summary.json").write_bytes((results / "summary.json").read_bytes())
    case = (results / "case.toml").read_text()
    (out / "case.toml").write_text(case.partition("[output]")[0])
    return out


def test_a_report_states_the_results_of_the_run(results, page):
    assert references(results / "report.html") == []
    summary = summary_in(results)
    for sentence in (
        f"{summary['load_N']:.4g} ± ",
        "Every step converged",
        "stable",
        "Hamila",
        f"skfem_textile {skfem_textile.__version__}",
        summary["versions"]["numpy"],
        "The folder contains no pictures",
        'law = "sin2"',
    ):
        assert sentence in page.text
    whole = (results / "case.toml").read_text()
    assert whole in page.text
    half = f"{summary['load_half_width'] * summary['load_N']:.2g} N"
    assert f"± {half}" in page.text


def test_curves_of_run_and_test_are_drawn(results, monkeypatch, tmp_path):
    curves = pytest.importorskip("skfem_textile.plot.curves")
    drawn = {}

    def kept(panels, xlabel, ylabel, file):
        drawn[CURVES[file.name][0]] = panels[""]
        file.write_text(f"picture {file.name}")

    monkeypatch.setattr(curves, "curves", kept)
    assert len(write_report(results).sources) == 5  # with icon and numbers
    assert list(drawn) == [
        *("Force against displacement", "Force against shear angle"),
        "Normalised shear force",
    ]
    for lines in drawn.values():
        assert list(lines) == ["run", "test"]
    assert drawn["Force against displacement"]["test"][1].tolist() == [0, 1, 3]
    other = tmp_path / "other.csv"
    other.write_text(CURVE.replace("8,3", "9,7"))
    write_report(results, "--test-curve", str(other))
    assert drawn["Force against displacement"]["test"][1].tolist() == [0, 1, 7]


def test_the_numbers_of_the_curve_are_in_the_page(results, page, copy):
    written = (results / "curve.csv").read_text()
    heading, *lines = written.splitlines()
    for name in heading.split(","):
        assert name in page.text
    for number in lines[-1].split(","):
        assert f"{float(number):.6g}" in page.text
    (file,) = (x for x in page.sources if x.startswith("data:text/csv;base64,"))
    assert b64decode(file.partition(",")[2]) == (results / "curve.csv").read_bytes()
    header = "displacement (mm),force (N),half-width of the force (N)"
    (copy / "curve.csv").write_text(f"{header}\n0,0,\n4,1,2\n")
    text = write_report(copy).text
    assert "half-width" in text
    assert "nan" not in text.split("Pictures")[0]


def test_pictures_are_embedded_in_the_page(copy):
    (copy / "shear_angle.png").write_bytes(b"\x89PNG" + bytes(100))
    (copy / "animation.gif").write_bytes(b"GIF89a" + bytes(100))
    kinds = [source[:16] for source in write_report(copy).sources]
    assert kinds == ["data:,", "data:image/png;b", "data:image/gif;b"]


def test_an_early_stop_is_reported(results, tmp_path):
    summary = summary_in(results)
    summary |= {"converged": False, "load_factor": 0.25, "stable": None}
    summary["scene"] = "<script>alert(1)</script>"
    (tmp_path / "summary.json").write_text(json.dumps(summary))
    page = write_report(tmp_path)
    assert "The run stopped at load factor 0.25." in page.text
    assert "not applied: the run stopped early" in page.text
    assert "script" not in page.tags
    assert "The folder contains no case.toml." in page.text
    assert "The folder contains no curve.csv." in page.text


@pytest.mark.parametrize(
    ("name", "content", "text"),
    [
        ("summary.json", "{", "summary.json is not the summary of a run"),
        ("summary.json", '{"scene": "strip", "first": [1]}', "summary.json is damaged"),
        ("summary.json", None, "summary.json is missing: name the results folder"),
        ("case.toml", "x", "is damaged: it is not a valid case file"),
        (
            "case.toml",
            "[scene]\nname = 'strip'\n[output]\ntest_curve = 'no.csv'",
            "no.csv",
        ),
        ("curve.csv", "x", "curve.csv: the file contains no rows of numbers"),
    ],
)
def test_damaged_results_have_no_report(results, tmp_path, capsys, name, content, text):
    out = shutil.copytree(results, tmp_path / "out")
    (out / "report.html").unlink(missing_ok=True)
    (out / name).unlink()
    if content is not None:
        (out / name).write_text(content)
    assert text in rejected(capsys, "report", str(out))
    assert not (out / "report.html").exists()


def test_the_citation_equals_the_citation_file(page):
    cited = (Path(__file__).parents[2] / "CITATION.cff").read_text()
    words = " ".join(page.text.split())
    for name in ("title", "journal", "volume", "year"):
        value = re.findall(rf"^ *{name}: *(?:>-)?\s*((?:.+\n?)+?)^ *\w+:", cited, re.M)
        match = re.search(rf"^  +{name}: (?!>-)(.*)", cited, re.M)
        cited_value = match[1] if match else " ".join(value[-1].split())
        assert cited_value in words


# Curves of tests in CSV files


def test_columns_are_read_by_their_headings(tmp_path):
    file = tmp_path / "test.csv"
    text = "\ufeffForce (N) , angle (deg)\n\n0,0\n1.5,\n3,20\n"
    file.write_text(text, encoding="utf-8")
    curve = read_test_curve(file)
    assert set(curve) == {"force (N)", "angle (deg)"}
    assert curve["force (N)"].tolist() == [0, 1.5, 3]
    assert np.array_equal(curve["angle (deg)"], [0, np.nan, 20], equal_nan=True)


def test_the_curve_of_a_run_is_read_as_a_curve_of_a_test(tmp_path):
    options = "--size 4x8 --steps 2 --no-render"
    summary = computed(tmp_path, "bias_extension", options)
    curve = read_test_curve(tmp_path / "curve.csv")
    assert curve["force (N)"][-1] == float(f"{summary['reaction_y']:.12g}")
    numbers = (tmp_path / "curve.csv").read_text().split("\n", 1)[1].replace("\n", ",")
    digits = [re.sub(r"e.*|\D", "", x).strip("0") for x in numbers.split(",")]
    assert max(map(len, digits)) == 12
    assert curve["angle (deg)"] == pytest.approx([0, 20, 40])
    half = curve["half-width of the force (N)"]
    assert half[0] == 0
    assert half[-1] == pytest.approx(summary["load_half_width"] * summary["reaction_y"])
    assert 0 < half[1] < half[-1]
    moment = 0.5 * np.radians(curve["angle (deg)"])
    expected = moment / np.cos(np.radians(curve["angle (deg)"]))
    assert curve["normalised shear force (N/mm)"] == pytest.approx(expected, rel=0.2)
