"""Nets on tubes and closed tools, against exact areas and shear angles."""

import json

import numpy as np
import pytest

from skfem_textile import drape
from skfem_textile.cli import main as cli
from skfem_textile.nets.part import first_layer
from tests.helpers import sphere, tool_shapes
from tests.helpers.tool_shapes import tube
from tests.helpers.tools import write

RADIUS, LENGTH = 30.0, 90.0


def laid(out, tool, *words, code=0):
    common = ("net", "--tool", str(tool), "--out", str(out), "--no-render")
    assert cli.main([*common, *map(str, words)]) == code
    return json.loads((out / "summary.json").read_text())


def rectangle(path, middle=0.0):
    """Curve around 120° and 50 mm of the tube."""
    t = middle + np.radians(60) * np.array([-1, 1, 1, -1, -1])
    z = np.array([20.0, 20, 70, 70, 20])
    k = np.linspace(0, 4, 80, endpoint=False)
    t, z = (np.interp(k, range(5), of) for of in (t, z))
    rows = np.column_stack([RADIUS * np.cos(t), RADIUS * np.sin(t), z])
    np.savetxt(path, rows, delimiter=",", header="x,y,z", comments="")
    return path


@pytest.fixture(scope="module")
def tool(tmp_path_factory):
    return write(tmp_path_factory.mktemp("tube") / "tube.stl", *tube())


POINT = ("--point", RADIUS, 0, 45, "--cell", 5)


def test_a_net_around_a_tube_covers_it_once_without_shear(tmp_path, tool, capsys):
    summary = laid(tmp_path / "out", tool, *POINT, code=1)
    exact = 2 * np.pi * RADIUS * LENGTH
    assert summary["area_of_part_mm2"] == pytest.approx(exact, rel=4e-3)
    assert summary["area_not_covered_mm2"] == 0
    assert summary["max_shear_angle_deg"] < 0.1
    assert summary["n_cells"] * 5.0**2 == pytest.approx(exact, rel=0.05)
    shown = "".join(capsys.readouterr())
    assert "covers the whole part and meets itself around the tool" in shown
    assert "hole(s)" not in shown


@pytest.mark.dear("lays three nets along a whole tube")
def test_courses_around_a_tube_end_where_they_meet(tmp_path, tool):
    words = (*POINT[:-1], 7, "--roll-width", 63)
    summary = laid(tmp_path / "out", tool, *words)
    assert summary["courses"] == 3
    assert summary["area_not_covered_mm2"] == 0


def test_the_ends_of_tubes_are_no_holes():
    """A window in a tube is one, and the narrow edge of a flat cone."""
    x, t = tube()
    assert drape.TriangleMesh(x, t).without_holes().facets.n_elements == t.shape[1]
    middle = x[:, t].mean(axis=1)
    turn, z = np.degrees(np.arctan2(*middle[1::-1])), middle[2]
    window = (np.abs(turn - 86.25) < 11.25) & (np.abs(z - 45) < 9)
    open_window = drape.TriangleMesh(x, t[:, ~window])
    assert len(open_window.facets.boundary()) == 3
    assert len(open_window.without_holes().facets.boundary()) == 2
    assert any("1 hole(s)" in line for line in open_window.remarks)
    for radii, n in (((25.0, 35.0), 2), ((30.0, 300.0), 1)):
        cone = drape.TriangleMesh(*tube(radii))
        assert len(cone.without_holes().facets.boundary()) == n


@pytest.mark.parametrize("cells", [(10, 40), (40, 10)])
def test_the_first_layer_ends_with_the_cell_that_meets_the_first(cells):
    """Around a cylinder; on a sphere the net does not meet itself."""
    around = drape.net(drape.Cylinder(RADIUS, (0, 0, -RADIUS)), 5.0, cells, (2, 2))
    columns = np.ceil(2 * np.pi * RADIUS / 5.0)
    assert (first_layer(around).sum(axis=0) == columns).all()
    cap = drape.Sphere(100.0, (0, 0, -100))
    assert first_layer(drape.net(cap, 5.0, (16, 16), (16, 16))).all()


@pytest.mark.dear("the net covers the ball several times")
def test_a_closed_tool_is_trimmed_without_edges(tmp_path):
    x, triangles = sphere(450)
    path = write(tmp_path / "closed.stl", 30 * x, triangles)
    t = np.linspace(0, 2 * np.pi, 60, endpoint=False)
    circle = np.array([18 * np.cos(t), 18 * np.sin(t), 24 + 0 * t]).T
    curve = tmp_path / "trim.csv"
    np.savetxt(curve, circle, delimiter=",", header="x,y,z", comments="")
    summary = laid(tmp_path / "out", path, "--cell", 5, "--trim", curve)
    exact = 2 * np.pi * 30 * 6
    assert summary["area_of_part_mm2"] == pytest.approx(exact, rel=0.01)
    assert summary["area_not_covered_mm2"] == 0


def test_a_part_on_the_far_side_of_a_tube_is_the_part(tmp_path, tool):
    trim = rectangle(tmp_path / "trim.csv", middle=np.pi)
    summary = laid(tmp_path / "out", tool, "--cell", 6, "--trim", trim)
    assert summary["start_at_x_mm"] < 0
    exact = 2 * np.pi / 3 * RADIUS * 50
    for key in ("area_of_part_mm2", "pattern_area_mm2"):
        assert summary[key] == pytest.approx(exact, rel=4e-3)
    assert summary["max_shear_angle_deg"] < 0.1
    assert summary["area_not_covered_mm2"] == 0


def test_darts_of_a_part_without_outline_are_said_once(tmp_path, capsys, tool):
    words = ("--cell", 6, "--darts", "--locking-angle", 30)
    laid(tmp_path / "out", tool, *POINT, *words, code=1)
    shown = capsys.readouterr().out
    assert shown.count("no closed curve is the outline of a tube") == 1
    assert "the part has no outline" in shown


def test_a_part_without_area_is_left_out():
    x, t = tool_shapes.plate()
    sliver = np.array([[200.0, 210, 220], [0, 0, 0], [0, 0, 0]])
    more = np.column_stack([t, x.shape[1] + np.arange(3)])
    tool = drape.TriangleMesh(np.hstack([x, sliver]), more)
    assert tool.facets.n_elements == t.shape[1]
    assert "1 triangle(s) of parts without area removed" in tool.remarks
