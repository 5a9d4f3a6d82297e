"""Nets on tubes and closed tools, against exact areas and shear angles."""

import json

import meshio
import numpy as np
import pytest

from skfem_textile import drape
from skfem_textile.cli import main as cli
from skfem_textile.drape.part import first_layer
from tests.helpers import tool_shapes
from tests.helpers.command_line import rejected

RADIUS, LENGTH = 30.0, 90.0


def tube(radii=(RADIUS, RADIUS), around=48, along=16):
    """Vertices and triangles of a tube or a cone along z."""
    t = np.linspace(0, 2 * np.pi, around, endpoint=False)
    s = np.linspace(0, 1, along)
    S, T = np.meshgrid(s, t, indexing="ij")
    r = radii[0] + (radii[1] - radii[0]) * S
    i, j = (a.ravel() for a in np.meshgrid(np.arange(along - 1), np.arange(around)))
    a, b = i * around + j, i * around + (j + 1) % around
    up = a + around, b + around
    triangles = np.hstack([[a, b, up[1]], [a, up[1], up[0]]])
    x = np.array([r * np.cos(T), r * np.sin(T), LENGTH * S]).reshape(3, -1)
    return x, triangles


def sphere(radius=30.0, n=16):
    """Vertices and triangles of a closed sphere."""
    b, t = np.linspace(0, np.pi, n + 1)[1:-1], np.arange(2 * n) * np.pi / n
    B, T = np.meshgrid(b, t, indexing="ij")
    x = np.array([np.sin(B) * np.cos(T), np.sin(B) * np.sin(T), np.cos(B)])
    x = radius * np.column_stack([x.reshape(3, -1), [0, 0, 1], [0, 0, -1]])
    m, top, j = 2 * n, x.shape[1] - 2, np.arange(2 * n)
    after, last = (j + 1) % m, (n - 2) * m
    triangles = [np.array([top + 0 * j, j, after])]
    for k in range(n - 2):
        p, q = k * m + j, k * m + after
        triangles += [np.array([p, p + m, q + m]), np.array([p, q + m, q])]
    triangles.append(np.array([top + 1 + 0 * j, last + after, last + j]))
    return x, np.hstack(triangles)


def file_of(path, x, triangles):
    meshio.write_points_cells(path, x.T, [("triangle", triangles.T)])
    return path


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
    return file_of(tmp_path_factory.mktemp("tube") / "tube.stl", *tube())


POINT = ("--point", RADIUS, 0, 45, "--cell", 4)


def test_a_net_around_a_tube_covers_it_once_without_shear(tmp_path, tool, capsys):
    summary = laid(tmp_path / "out", tool, *POINT, code=1)
    exact = 2 * np.pi * RADIUS * LENGTH
    assert summary["area_of_part_mm2"] == pytest.approx(exact, rel=4e-3)
    assert summary["area_not_covered_mm2"] == 0
    assert summary["max_shear_angle_deg"] < 0.1
    assert summary["n_cells"] * 4.0**2 == pytest.approx(exact, rel=0.05)
    shown = "".join(capsys.readouterr())
    assert "covers the whole part and meets itself around the tool" in shown
    assert "hole(s)" not in shown


def test_a_part_of_a_tube_is_exact(tmp_path, tool):
    words = (*POINT, "--trim", rectangle(tmp_path / "trim.csv"))
    summary = laid(tmp_path / "out", tool, *words)
    exact = 2 * np.pi / 3 * RADIUS * 50
    for key in ("area_of_part_mm2", "pattern_area_mm2"):
        assert summary[key] == pytest.approx(exact, rel=4e-3)
    assert summary["max_shear_angle_deg"] < 0.1


@pytest.mark.parametrize("fibres", [0, 90])
def test_courses_around_a_tube_end_where_they_meet(tmp_path, tool, fibres):
    words = (*POINT, "--roll-width", 40, "--fibres", fibres)
    summary = laid(tmp_path / "out", tool, *words)
    assert summary["courses"] == {0: 5, 90: 3}[fibres]
    assert summary["area_not_covered_mm2"] == 0


def test_the_ends_of_tubes_are_no_holes():
    """A window in a tube is one, and the narrow edge of a flat cone."""
    x, t = tube()
    assert drape.TriangleMesh(x, t).without_holes().facets.n_elements == t.shape[1]
    cells = np.add.outer(15 * np.arange(10, 13), np.arange(6, 9)).ravel()
    window = np.delete(t, [*cells, *(cells + t.shape[1] // 2)], axis=1)
    open_window = drape.TriangleMesh(x, window)
    assert len(open_window.facets.boundary()) == 3
    assert len(open_window.without_holes().facets.boundary()) == 2
    assert any("1 hole(s)" in line for line in open_window.remarks)
    for radii, n in (((25.0, 35.0), 2), ((30.0, 300.0), 1)):
        cone = drape.TriangleMesh(*tube(radii))
        assert len(cone.without_holes().facets.boundary()) == n


def test_first_layer_of_a_net_that_does_not_meet_itself_is_whole():
    cap = drape.Sphere(100.0, (0, 0, -100))
    net = drape.net(cap, 5.0, (16, 16), (16, 16))
    assert first_layer(net).all()


def test_a_closed_tool_is_trimmed_without_edges(tmp_path, capsys):
    path = file_of(tmp_path / "closed.stl", *sphere())
    t = np.linspace(0, 2 * np.pi, 60, endpoint=False)
    circle = np.array([18 * np.cos(t), 18 * np.sin(t), 24 + 0 * t]).T
    curve = tmp_path / "trim.csv"
    np.savetxt(curve, circle, delimiter=",", header="x,y,z", comments="")
    summary = laid(tmp_path / "out", path, "--cell", 3, "--trim", curve)
    exact = 2 * np.pi * 30 * 6
    assert summary["area_of_part_mm2"] == pytest.approx(exact, rel=0.01)
    assert summary["area_not_covered_mm2"] == 0
    capsys.readouterr()
    words = ("net", "--tool", str(path), "--out", str(tmp_path / "none"))
    assert "specify --trim" in rejected(capsys, *words, warnings=1)


@pytest.mark.parametrize(
    ("turn", "message"),
    [
        (2 * np.pi, "trim.csv: part: the curve runs around the tool and bounds no"),
        (0.8, "trim.csv: part: no triangle of the tool is inside the curve"),
    ],
)
def test_a_curve_that_bounds_no_part_is_refused(tmp_path, capsys, tool, turn, message):
    """Around the tube, and along an arc and back."""
    a = np.linspace(0, turn, 60, endpoint=False)
    a = a if turn > 6 else np.hstack([a, a[-2:0:-1]])
    circle = np.array([RADIUS * np.cos(a), RADIUS * np.sin(a), 45 + 0 * a]).T
    np.savetxt(tmp_path / "trim.csv", circle, delimiter=",", header="x,y,z")
    words = ("net", "--tool", str(tool), "--trim", str(tmp_path / "trim.csv"))
    assert message in rejected(capsys, *words, "--out", str(tmp_path / "out"))


def test_a_part_on_the_far_side_of_a_tube_is_the_part(tmp_path, tool):
    trim = rectangle(tmp_path / "trim.csv", middle=np.pi)
    summary = laid(tmp_path / "out", tool, "--cell", 4, "--trim", trim)
    assert summary["start_at_x_mm"] < 0
    exact = 2 * np.pi / 3 * RADIUS * 50
    assert summary["pattern_area_mm2"] == pytest.approx(exact, rel=4e-3)
    assert summary["area_not_covered_mm2"] == 0


def test_darts_of_a_part_without_outline_are_said_once(tmp_path, capsys, tool):
    words = ("--darts", "--locking-angle", 30)
    laid(tmp_path / "out", tool, *POINT, *words, code=1)
    shown = capsys.readouterr().out
    assert shown.count("no closed curve is the outline of a tube") == 1
    assert "the part has no outline" in shown


def test_courses_of_a_closed_tool_are_refused_with_their_cause():
    with pytest.raises(ValueError, match=r"is closed, and parallel threads meet at a"):
        drape.courses(drape.TriangleMesh(*sphere()), 3.0, 12.0, point=(0, 0, 30))


def test_a_part_without_area_is_left_out():
    x, t = tool_shapes.plate()
    sliver = np.array([[200.0, 210, 220], [0, 0, 0], [0, 0, 0]])
    more = np.column_stack([t, x.shape[1] + np.arange(3)])
    tool = drape.TriangleMesh(np.hstack([x, sliver]), more)
    assert tool.facets.n_elements == t.shape[1]
    assert "1 triangle(s) of parts without area removed" in tool.remarks
