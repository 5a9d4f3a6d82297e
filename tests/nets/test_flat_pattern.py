"""Flat patterns of trimmed parts, against exact solutions."""

from dataclasses import replace

import numpy as np
import pytest
from skfem import MeshQuad

from skfem_textile import drape
from skfem_textile.io import write_pattern
from skfem_textile.nets.flat_pattern import spaced
from tests.helpers.tools import SPHERE, on_net, rolled, rolled_ply


def on_cylinder(n):
    return drape.Sheet.of_ply(*rolled_ply(n, 0.4))


def circle(n, middle=50.0, radius=30.0):
    t = np.linspace(0, 2 * np.pi, n, endpoint=False)
    return middle + radius * np.array([np.cos(t), np.sin(t)])


def test_the_pattern_on_a_cylinder_is_the_unrolled_curve():
    """Exact at nodes, and of third order between them, where chords are."""
    square = np.array([[25.0, 75.0, 75.0, 25.0], [25.0, 25.0, 75.0, 75.0]])
    pattern = drape.flat_pattern(on_cylinder(12), rolled(square), spacing=1e3)
    np.testing.assert_allclose(pattern.outline, square, atol=1e-9)
    assert pattern.length == pytest.approx(200)
    assert pattern.area == pytest.approx(2500)
    errors = []
    for n in (6, 12):
        pattern = drape.flat_pattern(on_cylinder(n), rolled(circle(720)), spacing=9.0)
        errors.append(np.abs(pattern.outline - circle(720)).max())
    assert errors[1] < 3e-3
    assert np.log2(errors[0] / errors[1]) == pytest.approx(3, abs=0.3)


def test_the_pattern_on_a_sphere_agrees_with_the_exact_net():
    drawn = circle(360)
    curve = on_net(drawn)
    errors = []
    for n in (16, 32):
        net = drape.net(SPHERE, 100 / n, (0, n), (0, n))
        pattern = drape.flat_pattern(drape.Sheet.of_net(net), curve)
        errors.append(np.abs(pattern.outline - drawn).max())
    assert errors[1] < 0.02
    assert np.log2(errors[0] / errors[1]) == pytest.approx(2, abs=0.3)


def test_a_curve_with_few_points_is_refined():
    """The added points lie on the ply, in a plane through the cylinder's normals."""
    few, sheet = rolled(circle(16)), on_cylinder(24)
    pattern = drape.flat_pattern(sheet, few, spacing=1.0)
    steps = np.linalg.norm(np.diff(pattern.on_tool, axis=1), axis=0)
    assert steps.max() <= 1.0 + 1e-12
    assert pattern.outline.shape[1] > 180
    assert pattern.area == pytest.approx(0.5 * 16 * 900 * np.sin(np.pi / 8), rel=2e-3)
    repeated = np.column_stack([few, few[:, :1]])
    again = drape.flat_pattern(sheet, repeated, spacing=1.0)
    np.testing.assert_array_equal(again.outline, pattern.outline)


def holed_tool():
    """Elements of the rolled square from 20 to 80 mm except for its middle."""
    s = np.linspace(20, 80, 13)
    mesh = MeshQuad.init_tensor(s, s)
    t = mesh.t[::-1]
    centres = mesh.p[:, t].mean(axis=1)
    t = t[:, (np.abs(centres - 50) > 10).any(axis=0)]
    return drape.ToolMesh(rolled(mesh.p), (t,))


@pytest.fixture(scope="module")
def patterns():
    sheet = on_cylinder(20)
    return [drape.flat_pattern(sheet, c) for c in holed_tool().boundary()]


def test_the_boundary_of_a_tool_is_its_outline_and_its_holes(patterns):
    outer, hole = patterns
    assert outer.area == pytest.approx(3600, rel=1e-4)
    assert hole.area == pytest.approx(400, rel=1e-4)
    assert outer.length == pytest.approx(240, rel=1e-4)


def polygon(x, y):
    """Points along the sides of a polygon, 40 a side."""
    corners, share = np.array([x, y]), np.arange(40) / 40
    along = np.roll(corners, -1, axis=1) - corners
    return (corners[:, :, None] + along[:, :, None] * share).reshape(2, -1)


@pytest.mark.parametrize("side", [1, -1])
def test_curves_that_come_near_themselves_are_accepted(side):
    """A narrow bay, in both senses, and coincident points."""
    x = [20.0, 80.0, 80.0, 50.1, 50.0, 49.9, 20.0, 20.0]
    y = [20.0, 20.0, 80.0, 80.0, 25.0, 80.0, 80.0, 80.0]
    curve = polygon(x, y)[:, ::side]
    pattern = drape.flat_pattern(on_cylinder(24), rolled(curve))
    assert pattern.area == pytest.approx(3600 - 0.2 * 55 / 2, rel=1e-4)


@pytest.fixture(scope="module")
def holed_ply():
    """Rolled ply without the elements from 40 to 50 mm."""
    whole = on_cylinder(20)
    centres = whole.flat[:, whole.elements].mean(axis=1)
    kept = (np.abs(centres - 45) > 5).any(axis=0)
    fibres = whole.warp[:, kept], whole.weft[:, kept]
    return drape.Sheet(whole.flat, whole.positions, whole.elements[:, kept], *fibres)


@pytest.mark.parametrize(
    ("middle", "holes", "cut"),
    [(45.0, [], True), (75.0, [], False), (45.0, [(45.0, 8.0)], False)],
)
def test_a_hole_of_the_ply_is_cut_out_of_the_pattern(
    holed_ply, caplog, middle, holes, cut
):
    """Along its edge in the flat ply, unless another hole contains it."""
    curves = [rolled(circle(360, at, radius)) for at, radius in [(middle, 20), *holes]]
    pattern = drape.flat_pattern(holed_ply, curves[0], holes=curves[1:])
    missing = 100 * cut + sum(np.pi * radius**2 for _, radius in holes)
    assert pattern.area == pytest.approx(np.pi * 20**2 - missing, rel=1e-3)
    lines = [
        text for text in caplog.messages if "the ply has a hole of 100 mm²" in text
    ]
    assert len(lines) == len(caplog.messages) == cut
    if cut:
        (hole,) = pattern.holes
        assert hole.outline.min() == 40
        assert hole.outline.max() == 50
        np.testing.assert_allclose(hole.on_tool, rolled(hole.outline), atol=1e-9)


def test_a_cell_that_a_net_lacks_is_no_hole_of_the_ply():
    net = drape.net(drape.Plane(), 5.0, (4, 4), (4, 4))
    status = net.status.copy()
    status[4, 4] = drape.Status.OMITTED
    sheet = drape.Sheet.of_net(replace(net, status=status))
    assert sheet.elements.shape[1] == 60
    square = np.array([[-15, 15, 15, -15], [-15, -15, 15, 15], 4 * [0]])
    assert drape.flat_pattern(sheet, square).area == pytest.approx(900)


def test_a_dxf_has_outlines_seams_and_fibres_on_separate_layers(tmp_path, patterns):
    ezdxf = pytest.importorskip("ezdxf")
    outer, hole = patterns
    flat = [outer.outline[:, k : k + 5] for k in (0, 9)]
    seams = tuple(drape.SeamLine(7, x, np.zeros((3, 5))) for x in flat)
    write_pattern(tmp_path / "pattern.dxf", [replace(outer, seams=seams), hole])
    drawing = ezdxf.readfile(tmp_path / "pattern.dxf")
    assert drawing.units == 4  # mm
    space = drawing.modelspace()
    for layer, curves in (("CUT", [outer.outline, hole.outline]), ("SEAM", flat)):
        lines = space.query(f"LWPOLYLINE[layer=='{layer}']")
        for line, curve in zip(lines, curves, strict=True):
            assert line.closed == (layer == "CUT")
            points = np.array([p[:2] for p in line.get_points()]).T
            np.testing.assert_array_equal(points, curve)
    assert [text.dxf.text for text in space.query("TEXT[layer=='SEAM']")] == ["7", "7"]
    (warp,) = space.query("LINE[layer=='WARP']")
    along = warp.dxf.end - warp.dxf.start
    assert np.arctan2(along.y, along.x) == pytest.approx(0.4)


def test_an_outline_has_at_most_a_million_points():
    square = np.array([[0.0, 1, 1, 0], [0, 0, 1, 1]])
    assert spaced(square, 8e-6).shape[1] == 500_000
    with pytest.raises(ValueError, match="at most 1000000 are allowed"):
        spaced(square, 2e-6)
