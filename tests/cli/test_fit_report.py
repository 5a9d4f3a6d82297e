"""The page of the command ``fit``."""

import re
import tomllib
from html import unescape

import numpy as np
import pytest

from skfem_textile import CrimpInterchange, CrimpToe, Linear, Locking, Polynomial
from skfem_textile.calibration import selection
from skfem_textile.cases import case_from_tables
from skfem_textile.cli import main as cli
from skfem_textile.cli.fit_report import _call, _law_row, _prediction_row
from skfem_textile.fabric.files import fabric_text
from skfem_textile.io import read_fabric
from tests.helpers.command_line import fit, summary_in
from tests.helpers.curves import (
    BIAS,
    BIAXIAL,
    QUINTIC,
    joint_file,
    shear_file,
    shear_files,
    write_columns,
)
from tests.helpers.fits import FRAME, noisy
from tests.helpers.pages import Page, references

TOE = CrimpToe(4e3, 0.004, 20.0)


def biaxial_file(path, law, ratio):
    e = np.linspace(0.0, 0.02, 7)[1:]
    strain = np.array([e, ratio * e])
    force = 100 * np.asarray(law.value(np.log1p(strain))) / (1 + strain)
    force = [noisy(one, 0.005, 0) for one in force]
    both = (x for pair in zip(strain, force, strict=True) for x in pair)
    return write_columns(path, BIAXIAL, *both)


FRAME_SIZES = "--frame-side 200 --fabric-side 160"
OF_BIAS = "bias-extension", BIAS, "--width 100 --height 200"
OF_FRAME = "picture-frame", FRAME, FRAME_SIZES

#: Fits of shear laws: kind of test, the test, its sizes, the law of the data, options.
FITS = {
    "polynomial": (*OF_BIAS, QUINTIC, ""),
    "sin2": (*OF_FRAME, QUINTIC, "--law sin2"),
    "locking": (*OF_FRAME, Locking(0.1, np.radians(60.0)), "--law locking"),
    "tabulated": (*OF_BIAS, QUINTIC, "--law tabulated --points 3"),
    "linear": (*OF_FRAME, QUINTIC, "--law linear"),
}


def fit_shear(name, folder):
    """Folder of one of the `FITS`."""
    kind, test, sizes, law, how = FITS[name]
    data = shear_files(folder, test, law, n=2, share=0.005)
    fit(kind, *data, sizes, how, "--slack 0 --out", out := folder / "out")
    return out


def fit_biaxial(folder):
    """Folder of a fit of crimp interchange."""
    law = CrimpInterchange((2e3, 1.5e3), (0.01, 0.015), 5.0, 2e-3, 0.15)
    data = [biaxial_file(folder / f"{x}.csv", law, x) for x in (0.5, 1.0, 2.0)]
    how = "--warp-width 100 --weft-width 100 --slack 0 --law crimp-interchange --out"
    fit("biaxial", *data, how, out := folder / "out")
    return out


def block(out, name):
    """Text of a block of a page, as it is copied."""
    text = (out / "report.html").read_text(encoding="utf-8")
    return unescape(re.search(rf'<pre id="{name}">(.*?)</pre>', text, re.S)[1])


def same_laws(one, other):
    for law, expected in zip(one.laws, other.laws, strict=True):
        assert type(law) is type(expected)
    x = np.linspace(0.0, 0.02, 9)
    for a, b in (
        (one.shear_law.value(x), other.shear_law.value(x)),
        (one.tensions.value(np.array([x, x])), other.tensions.value(np.array([x, x]))),
        (one.bending, other.bending),
    ):
        np.testing.assert_allclose(a, b, rtol=1e-12)


def keep_panels(panels, folder):
    """A file in place of each picture."""
    for i in range(len(panels)):
        (folder / f"{i}.png").write_bytes(b"\x89PNG")
    return {f"{i}.png": caption for i, caption in enumerate(panels)}


@pytest.fixture(scope="module")
def of_joint(tmp_path_factory):
    """Folder of a joint fit with a comparison of two laws, without pictures."""
    figure = pytest.importorskip("skfem_textile.calibration.figure")
    folder = tmp_path_factory.mktemp("joint")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(figure, "draw_panels", keep_panels)
        laws = {f"polynomial of degree {n}": ("polynomial", n) for n in (3, 7)}
        patch.setattr(selection, "_SHEAR_CANDIDATES", laws)
        data, out = joint_file(folder, TOE), folder / "out"
        fit("joint", data, "--shear-law auto --out", out, draw=True)
    return out


@pytest.mark.parametrize("name", [*FITS, "crimp-interchange", "joint"])
def test_the_laws_of_a_page_are_those_of_the_fit(name, of_joint, tmp_path, monkeypatch):
    out = of_joint
    if name != "joint":
        of_name = name in FITS
        out = fit_shear(name, tmp_path) if of_name else fit_biaxial(tmp_path)
    fabric, _, origin = read_fabric(out / "fabric.json")
    monkeypatch.chdir(out)
    names = {}
    exec(block(out, "python"), names)
    text = (out / "fabric.json").read_text()
    assert fabric_text(names["fabric"], origin) == text
    tables = tomllib.loads(block(out, "toml"))
    tension = {"law": "linear", "stiffness_N_per_mm": 1e5}
    shear = {"law": "linear", "stiffness_N_per_mm": 0.0}
    if "fabric" not in tables:
        known = {"tension": tension, "shear": shear} | tables
        assert ("tension" in tables) == (name == "joint")
    else:
        assert name in ("tabulated", "crimp-interchange")
        known = tables
    mesh = {"source": "irregular", "size": [2, 4]}
    scene = {"name": "bias_extension"}
    same_laws(case_from_tables({"scene": scene, "mesh": mesh} | known).fabric, fabric)


@pytest.mark.dear("the only fit that a page repeats")
def test_the_page_of_a_joint_fit_repeats_it_in_python(tmp_path, monkeypatch):
    file = joint_file(tmp_path, TOE, ["bias"])
    file.write_text(f"{file.read_text()}\nslack = 0\nforce_at_rest = 0\n")
    how = "--degree 3 --up-to 25 --bound c1=0,1 --simulate 2 --out"
    fit("joint", file, how, out := tmp_path / "out")
    monkeypatch.chdir(out)
    names = {}
    exec(f"{block(out, 'python')}\n{block(out, 'repetition')}", names)
    found = names["fabric_fit"].fit.joint
    summary = summary_in(out)
    assert summary["laws"]["Shear"]["compared_with"] == "simulations"
    summary = summary["joint"]
    assert [*found.model.parameters] == summary["parameters"]
    assert summary["parameters"] == ["shear c1", "shear c3"]
    assert found.values.tolist() == pytest.approx(summary["values"], rel=1e-6)
    deviations = found.deviation(np.eye(2))[0].tolist()
    assert deviations == pytest.approx(summary["standard_deviations"], rel=1e-6)


def test_a_page_has_every_part_and_no_external_references(of_joint):
    out = of_joint
    assert references(out / "report.html") == []
    page = Page((out / "report.html").read_text(encoding="utf-8"))
    summary = summary_in(out)
    for part in (
        "follows the data within the noise",
        "separator comma, decimal point, displacement from column 1",
        "strip along the weft, 50 × 200 mm",
        "a slack of",
        "points are fitted, up to a theoretical shear angle of",
        "specify --slack to fit it",
        "Correlations of the parameters",
        "polynomial of degree 7",
        "shear_law",
    ):
        assert part in page.text
    joint_fit = summary["joint"]
    i, j = (joint_fit["parameters"].index(f"warp {x}") for x in ("stiffness", "toe"))
    assert f"{joint_fit['correlations'][i][j]:+.2f}" in page.text
    for one in summary["laws"].values():
        for p in one["parameters"]:
            assert f"{p['value']:.5g}" in page.text
            assert f"{p['low']:.4g} to {p['high']:.4g}" in page.text
    # data except of the cantilever without angles; laws; residuals
    assert page.tags.count("img") == 3 + 6 + 4
    assert sorted(file.suffix for file in out.iterdir()) == [".html", *[".json"] * 5]


def test_at_most_twelve_parameters_are_in_the_table_of_correlations():
    from skfem_textile.cli.fit_report import _correlations

    matrix = np.eye(15)
    matrix[3, 14] = matrix[14, 3] = -0.5
    names = [f"p{i}" for i in range(15)]
    table = _correlations({"correlations": matrix, "parameters": names})
    assert table["left_out"]
    assert len(table["rows"]) == 12
    assert len(table["head"]) == 13
    (row,) = (row for row in table["rows"] if row[0] == "p3")
    assert row[1 + [r[0] for r in table["rows"]].index("p14")] == "-0.50"


LINEAR = "--law linear --slack 0 --force-at-rest 0 --out"


def test_only_deviations_above_the_error_of_a_machine_are_marked(tmp_path):
    """A parabola that a line fits, with a curvature of 1 % or 30 % of the force."""
    rows = []
    for share in (0.01, 0.3):
        law = Polynomial((0.1, 0.0, 0.1 * share / np.radians(40.0) ** 2), odd=True)
        file = shear_file(tmp_path / "pull.csv", FRAME, law, share=0.0, n=60)
        fit("picture-frame", file, FRAME_SIZES, LINEAR, out := tmp_path / "out")
        (one,) = summary_in(out)["laws"].values()
        assert one["systematic"] == ["pull.csv"]
        rows.append(_law_row("Shear", one))
        (curve,) = one["curves"]
        assert rows[-1][2].startswith(
            f"error of the load {100 * curve['residual_rms_over_largest']:.2g} %"
        )
    assert [mark for _, mark, _ in rows] == ["", "bad"]


def test_the_report_of_a_run_does_not_replace_that_of_a_fit(tmp_path, capsys):
    out = fit_shear("linear", tmp_path)
    before = (out / "report.html").read_bytes()
    assert cli.main(["report", str(out)]) == 2
    assert "is not the summary of a run" in capsys.readouterr().err
    assert (out / "report.html").read_bytes() == before


def test_two_files_of_one_name_have_their_own_pictures(tmp_path, monkeypatch):
    figure = pytest.importorskip("skfem_textile.calibration.figure")

    def save(panels, path):
        """The plotted forces in place of a picture."""
        (panel,) = panels
        panel(axes := figure.Figure().add_subplot())
        lines = [np.asarray(line.get_ydata(), float) for line in axes.lines]
        path.write_bytes(b"".join(line.tobytes() for line in lines))

    monkeypatch.setattr(figure, "save_panels", save)
    for i, law in enumerate((Linear(0.1), Linear(0.3))):
        (tmp_path / str(i)).mkdir()
        shear_file(tmp_path / str(i) / "pull.csv", FRAME, law, n=15)
    data = [tmp_path / str(i) / "pull.csv" for i in range(2)]
    fit("picture-frame", *data, FRAME_SIZES, LINEAR, tmp_path / "out", draw=True)
    text = (tmp_path / "out" / "report.html").read_text(encoding="utf-8")
    pictures = re.findall(r'src="([^"]*)" alt="[12]\. pull', text)
    assert len({*pictures}) == 2


@pytest.mark.parametrize(("error", "mark"), [(0.005, ""), (0.02, "bad")])
def test_only_predictions_off_by_more_than_a_machine_are_marked(error, mark):
    one = {"name": "held", "inside_simultaneous": 0.5, "confirmed": False}
    assert _prediction_row(one | {"rms_over_largest_force": error})[1] == mark


def test_lines_of_python_have_at_most_76_characters():
    assert "\n" not in _call("Sin2", ["1" * 70])
    assert _call("Sin2", ["1" * 71]) == f"Sin2(\n    {'1' * 71},\n)"
