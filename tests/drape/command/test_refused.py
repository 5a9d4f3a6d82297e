"""What is no tool, no curve and no option of a run on a tool."""

import numpy as np
import pytest

from tests.helpers.command_line import refused
from tests.helpers.tool_files import ball, bump, line, plate, write

EMPTY = "solid nothing\nendsolid nothing\n"


def refused_tools(folder):
    """Files that are no tool, and what is said of them."""
    x, t = plate()
    facing = np.hstack([t, t[::-1]])
    yield folder / "no.stl", "no.stl: no such file"
    empty = folder / "empty.stl"
    empty.write_text(EMPTY)
    yield empty, "empty.stl: it has no triangles"
    yield write(folder / "few.stl", x[:, :], t[:, :3]), "vertices are too few"
    yield write(folder / "facing.stl", x, facing), "orient them alike"
    bad = x.copy()
    bad[2, 5] = np.nan
    yield write(folder / "nan.stl", bad, t), "must be finite"
    steep = plate(height=lambda x, y: 0.3 * x)
    yield write(folder / "steep.stl", *steep), "is at its edge or on a slope"
    hollow = plate(height=lambda x, y: -bump(x, y))
    yield write(folder / "hollow.stl", *hollow), "is at its edge or on a slope"
    yield write(folder / "metres.stl", 1e-3 * x, t), "a smaller ply, or a file in mm"
    for scale in (1e3, 1e30):
        large = write(folder / f"{scale:g}.stl", scale * x, t)
        yield large, "take a larger ply, or a file in mm"


@pytest.mark.parametrize("number", range(10))
def test_what_is_no_tool_is_refused_in_one_line(number, tmp_path, capsys):
    file, reason = list(refused_tools(tmp_path))[number]
    assert reason in refused(capsys, *line(tmp_path / "out", tool=file))
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("options", "reason"),
    [
        (("--point", "0", "0", "nan"), "scene.point_mm must be a finite number"),
        (("--point", "0", "0", "90"), "from the tool: give a point on it"),
        (("--point", "0", "0", "1e306"), "from the tool: give a point on it"),
        (("--point", "130", "0", "0"), "the tool has no triangle at 129.8"),
        (("--point", "0", "0"), "expected 3 arguments"),
        (("--part-mesh", "none.stl"), "none.stl: no such file"),
        (("--trim", "none.csv"), "No such file"),
        (("--width", "-5"), "the width must be positive"),
    ],
)
def test_bad_options_are_refused_in_one_line(tool, options, reason, tmp_path, capsys):
    assert reason in refused(capsys, *line(tmp_path / "out", *options, tool=tool))
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("x,y\n0,0\n", "row 1: the header must name the columns x, y and z"),
        ("x,y,z\n0,0,0\n1,0,0\n1,nan,0\n", "row 4: '1,nan,0' is no point"),
        ("x,y,z\n0,0,0\n1,0\n", "row 3: '1,0' is no point"),
        ("x,y,z\n0,0,0\n1,0,0\n0,0,0\n", "needs three points at least"),
        ("", "the file is empty"),
    ],
)
def test_what_is_no_curve_is_refused_in_one_line(tool, text, reason, tmp_path, capsys):
    curve = tmp_path / "curve.csv"
    curve.write_text(text)
    words = line(tmp_path / "out", "--trim", str(curve), tool=tool)
    assert reason in refused(capsys, *words)


def test_where_no_net_can_be_laid_a_bending_stiffness_is_asked_for(tmp_path, capsys):
    file = ball(tmp_path / "ball.stl", 900)
    large = "--width", "330", "--height", "330", "--tension", "2"
    said = refused(capsys, *line(tmp_path / "out", *large, tool=file))
    assert "give the fibres a bending stiffness" in said
