"""Printed results: the first quantities that a scene declares, with units."""

import contextlib
import io
import json
import re

import pytest

from skfem_textile.cases.scenes import SCENES
from skfem_textile.cli import main as cli
from skfem_textile.cli import results
from skfem_textile.cli.output import complain
from skfem_textile.solve.quantities import Quantity, first_rows
from tests.helpers.pages import Page
from tests.helpers.tools import plate, write

TOOLS = """
[scene]
name = "forming"
part = "quarter"
width_mm = 100
height_mm = 100
[[tools]]
name = "lower_punch"
surface = "sphere"
radius_mm = 60
centre_mm = [0, 0, -60.2]
motion_mm = [0, 0, 1]
[[tools]]
surface = "plane"
point_mm = [0, 0, 9]
"""

UNIT = r" N| mm|°| %| N/mm²| s\b"
REASON = r"no error interval|within the tolerance|: |^Warnings +none$|^Mesh +\d+ nodes"


def words(scene, folder):
    """A quick run of a scene."""
    quick = "--size", "2x2", "--steps", "1", "--no-render", "--out", str(folder / "out")
    if scene == "forming":
        (file := folder / "formed.toml").write_text(TOOLS)
        mesh = "mesh.size=2,2", "mesh.source=aligned", "stepping.steps=1"
        return ["run", str(file), "--set", *mesh, *quick[4:]]
    more = {
        "drape": ("--tool", str(write(folder / "bump.stl", *plate()))),
        "hemisphere_forming": ("--travel", "1"),
        "double_dome_forming": ("--travel", "1"),
    }
    smaller = ("--width", "100", "--height", "100") if scene == "drape" else ()
    return ["run", scene, *quick, *more.get(scene, ()), *smaller]


@pytest.fixture(scope="module", params=sorted(SCENES))
def ended(request, tmp_path_factory):
    """Folder of the results of a scene, and the words of the command."""
    folder = tmp_path_factory.mktemp(request.param)
    return folder / "out", words(request.param, folder)


@pytest.fixture(scope="module")
def printed(ended):
    _, line = ended
    with contextlib.redirect_stdout(io.StringIO()) as stdout:
        assert cli.main(line) == 0
    return stdout.getvalue().splitlines()


def test_a_run_prints_at_most_15_lines_with_units_or_reasons(ended, printed):
    *lines, last = printed
    assert last == f"results written to {ended[0]}: all values in summary.json"
    assert len(printed) <= 15
    assert [x for x in lines if not re.search(f"{UNIT}|{REASON}", x)] == []
    names = [re.split("  +", line)[0] for line in lines]
    shear, strain, risk = (
        names.index(name)
        for name in ("Largest shear angle", "Largest fibre strain", "Wrinkle risk")
    )
    assert 0 < shear < strain < risk < len(names) - 1
    assert names[-1] == "Run time"
    notes = [i for i, x in enumerate(names) if x in ("Note", "Mesh", "Warning")]
    assert notes == [*range(len(notes))]
    assert ("Warnings" in names[risk + 1 : -1]) == (not notes)
    uncertain = [x for x in lines if re.search(" ± |no error interval|within the", x)]
    assert 1 <= len(uncertain) <= 2
    assert all(re.match(r"Load \(|.+ force |Largest shear", x) for x in uncertain)
    assert re.search(r"°.* at \([-\d., ]+\) mm(; no error .*)?$", lines[shear])


def test_a_report_begins_with_what_the_run_printed(ended, printed):
    out, _ = ended
    (out / "curve.csv").unlink()  # drawing takes a second
    assert cli.main(["report", str(out)]) == 0
    text = Page((out / "report.html").read_text(encoding="utf-8")).text
    (first,) = re.findall(r"Results\n(.*?)Pictures\n", text, re.S)
    assert first.split() == " ".join(printed[:-1]).split()
    before, _, _ = text.partition("All values")
    assert "_deg" not in before.partition("Case\n")[0]


def test_json_is_the_summary_and_notes_are_on_stderr(tmp_path, capsys, monkeypatch):
    monkeypatch.setattr(results, "draw", lambda *of: 1 / 0)
    drawn = [x for x in words("strip", tmp_path) if x != "--no-render"]
    assert cli.main([*drawn, "--json"]) == 0
    out, err = capsys.readouterr()
    file = tmp_path / "out" / "summary.json"
    assert json.loads(out) == json.loads(file.read_text())
    assert json.loads(out)["inputs"]["scene"]["name"] == "strip"
    assert "the pictures were not drawn: division by zero" in err


def test_every_declared_quantity_is_in_the_summary_or_a_note(ended, printed):
    summary = json.loads((ended[0] / "summary.json").read_text())
    for one in summary["first"]:
        assert one["key"] in summary or one["name"] == "Note"


def test_the_force_on_a_quarter_is_printed_for_the_whole_ply(ended, printed):
    summary = json.loads((ended[0] / "summary.json").read_text())
    if "forming" not in summary["scene"]:
        pytest.skip("no tools")
    (line,) = (x for x in printed if " force " in x)
    assert "on the whole ply, 4 times that on the computed quarter" in line
    whole = [x for x in summary if x.endswith("_force_on_whole_ply_N")]
    assert len(whole) > 1
    for key in whole:
        part = summary[key.replace("_on_whole_ply", "")]
        assert summary[key] == pytest.approx(4 * part)
    (line,) = (x for x in printed if x.startswith("Largest penetration "))
    assert ("into the tool " in line) == (summary["max_penetration_mm"] > 0)


def test_a_default_fabric_is_a_note(tmp_path, capsys):
    line, note = (
        words("strip", tmp_path),
        "Note  .*the default of the scene strip is used",
    )
    assert cli.main(line) == 0
    both = f"{note} for tension 10000 N/mm and shear 0 N/mm, .*no wrinkling angle"
    assert re.search(both, capsys.readouterr().out)
    (tmp_path / "out" / "report.html").write_text("of the earlier run")
    assert cli.main([*line, "--fibre-stiffness", "2000"]) == 0
    out = capsys.readouterr().out
    assert re.search(f"{note} for shear 0 N/mm, ", out)
    assert "removed from an earlier run: report.html" in out
    given = ["--fibre-stiffness", "2000", "--shear-stiffness", "0.5"]
    assert cli.main([*line, *given]) == 0
    out = capsys.readouterr().out
    assert "default of the scene" not in out
    assert "removed" not in out


def test_the_words_before_a_position_follow_the_note():
    summary = {"risk": 0.5, "risk_at_x_mm": 1.0, "risk_at_y_mm": 2.0}
    risk = Quantity("Risk", "risk", "%", "risk_at", note=" of it", at="; most at")
    assert risk.text(summary) == "50 % of it; most at (1.0, 2.0) mm"
    assert risk.text({"risk": 0.0}) == "0 % of it"
    assert Quantity(**risk.declared()) == risk


def test_surplus_warnings_are_counted():
    first = [Quantity("Load", "load_N", "N").declared()]
    summary = {"load_N": 1.0, "wall_time_s": 2.0, "first": first}
    rows = first_rows(summary | {"warnings": [f"warning {i}" for i in range(40)]})
    assert len(rows) == 14
    assert rows[10] == ("Warning", "bad", "warning 10")
    assert rows[11] == ("Warnings", "bad", "29 more in summary.json")
    assert rows[12] == ("Load", "", "1 N")
    assert len(first_rows(summary | {"warnings": ["one"] * 12})) == 14
    assert first_rows(summary)[1] == ("Warnings", "", "none")


@pytest.mark.parametrize(
    ("figures", "text"),
    [
        ({"load_N": 12.345, "load_N_half_width": 1.2345}, "12.35 ± 1.2 N"),
        ({"load_N": 12356.0, "load_N_half_width": 1235.6}, "12360 ± 1200 N"),
        ({"load_N": -12.0, "load_N_half_width": 1.2}, "-12 ± 1.2 N"),
        ({"load_N": 12.0, "load_N_half_width": 1e-15}, "12 ± 0.012 N"),
        ({"load_N": 0.0, "load_N_half_width": 0.1}, "0 N within the tolerance of"),
        ({"load_N": float("nan")}, ""),
        ({}, ""),
        (
            {"load_N": 2.0, "error_interval": "none: interrupted"},
            "2 N; no error interval: interrupted",
        ),
        (
            {"load_N": 2.0, "error_interval": "by it; none for the load: in space"},
            "2 N; no error interval for the load: in space",
        ),
    ],
)
def test_a_load_has_its_interval_or_a_reason(figures, text):
    quantity = Quantity("Load", "load_N", "N", has_interval=True)
    found = quantity.text(figures)
    assert found.startswith(text)
    assert bool(found) == bool(text)


def test_a_complaint_has_at_most_four_hundred_characters(capsys):
    for n in (400, 401):
        complain("x" * n)
    line, shortened = capsys.readouterr().err.splitlines()
    assert line.endswith(f" {'x' * 400}")
    assert shortened.endswith(f" {'x' * 200} ... {'x' * 200}")
