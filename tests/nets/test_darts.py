"""Darts at the corners of a deep box."""

import numpy as np
import pytest

from skfem_textile import drape
from tests.helpers import tool_shapes

LENGTH, WIDTH, DEPTH, FLANGE = 100.0, 70.0, 40.0, 20.0
LOCKING = np.radians(55)
BOX = drape.TriangleMesh(
    *tool_shapes.deep_box(LENGTH, WIDTH, DEPTH, flange=FLANGE, size=2.5)
)
TOP = (0.0, 0.0, DEPTH)


@pytest.fixture(scope="module")
def laid():
    return drape.net_with_darts(BOX, 4.0, LOCKING, point=TOP)


@pytest.fixture(scope="module")
def pattern(laid):
    (outline,) = BOX.facets.boundary()
    return drape.pattern_with_darts(laid, outline)


def test_a_deep_box_without_darts_locks_at_its_corners():
    net = drape.net(BOX, 4.0, point=TOP)
    assert np.degrees(np.nanmax(np.abs(net.shear_angle()))) > 70


def test_a_deep_box_has_a_dart_at_each_corner(laid):
    assert len(laid.darts) == 4
    for dart in laid.darts:
        tip, end = np.abs(dart.points[:, [0, -1]].T)
        np.testing.assert_allclose(tip[:2], [LENGTH / 2, WIDTH / 2], atol=8)
        assert end[2] < 1
        assert BOX.beyond_edges(dart.points[:, -1:])[0] > 0
        # Down the edge between the walls, and on along the diagonal of the flange.
        corner = np.abs(dart.points[:2]) - [[LENGTH / 2], [WIDTH / 2]]
        assert np.abs(corner[0] - corner[1]).max() < 3


def test_nets_on_both_sides_of_darts_do_not_lock(laid):
    assert laid.locked(BOX).shape == (3, 0)
    for net, mask in laid.pieces:
        assert not net.folds.size
        assert np.abs(net.shear_angle()[mask]).max() < LOCKING
        # All of the curvature is in the spots at the corners.
        beside = np.abs(net.shear_angle()[mask])[~laid.in_spots(net, mask)]
        assert beside.max() < np.radians(5)
        # Only cells at the tips, which are cut, have a free side.
        x, whole = net.positions, mask & ~net.cut
        sides = x[:, 1:, :-1] - x[:, :-1, :-1], x[:, :-1, 1:] - x[:, :-1, :-1]
        for side in sides:
            rods = np.linalg.norm(side[:, whole], axis=0)
            np.testing.assert_allclose(rods, 4.0, rtol=1e-6)
        assert (mask & net.cut).sum() < 4 * (DEPTH + 2 * FLANGE) / 4.0


@pytest.mark.slow
@pytest.mark.parametrize("degrees", [30, 45])
def test_turned_fibres_have_darts_at_the_same_places(laid, degrees):
    """A dart belongs to a place of the tool, not to the direction of the fibres."""
    angles = np.radians([degrees, degrees + 90])
    turned = drape.net_with_darts(BOX, 4.0, LOCKING, point=TOP, angles=tuple(angles))
    assert len(turned.darts) == 4
    for dart in turned.darts:
        tip = dart.points[:, 0]
        away = [np.linalg.norm(tip - other.points[:, 0]) for other in laid.darts]
        assert min(away) < 1.5
    pattern = drape.pattern_with_darts(turned, BOX.facets.boundary()[0])
    check_pattern(pattern)
    assert pattern.shear_angle_beside_spots < np.radians(10)


def check_pattern(pattern):
    """Area of the tool, darts whose edges have one length, and their seams.

    Chords on fillets of 5 mm shorten the walls by 0.4 % with cells of 4 mm.  Cells of
    spots that would lock are left open, another 0.4 % of this small box.
    """
    assert pattern.pattern.area == pytest.approx(BOX.facets.area, rel=5e-3)
    assert pattern.area_on_tool == pytest.approx(BOX.facets.area, rel=1e-2)
    assert len(pattern.darts) == 4
    for dart in pattern.darts:
        one, other = dart.lengths
        assert one == pytest.approx(other, rel=0.01)
    numbers = [seam.number for seam in pattern.pattern.seams]
    assert numbers == [1, 1, 2, 2, 3, 3, 4, 4]


def test_the_pattern_with_darts_is_the_tool_without_its_darts(pattern):
    check_pattern(pattern)
    assert pattern.shear_angle < LOCKING
    for dart in pattern.darts:
        seam = np.linalg.norm(np.diff(dart.seam), axis=0).sum()
        one, _ = dart.lengths
        # The seam is longer at the corner of the flange, which is curved backwards.
        assert 0.94 * seam < one < seam
        # The walls are taken out twice, and the flange around its corner.
        assert DEPTH**2 < dart.area < (DEPTH + FLANGE) ** 2
    whole = np.prod(np.ptp(pattern.pattern.outline, axis=1))
    assert pattern.pattern.area < whole - 3 * DEPTH**2


def test_a_dart_takes_out_the_curvature_of_its_corner(pattern):
    """The normals of a corner with a draft of 5° cover (1 − sin 5°) π/2."""
    for dart in pattern.darts:
        walls = np.flatnonzero((dart.seam[2] > 12) & (dart.seam[2] < 30))[[0, -1]]
        one, other = (np.diff(edge[:, walls])[:, 0] for edge in dart.edges)
        cosine = one @ other / (np.linalg.norm(one) * np.linalg.norm(other))
        wedge = np.pi / 2 * (1 - np.sin(np.radians(5)))
        assert np.arccos(cosine) == pytest.approx(wedge, abs=np.radians(1))


def test_a_tool_that_does_not_lock_has_no_darts():
    tool = drape.TriangleMesh(*tool_shapes.plate())
    laid = drape.net_with_darts(tool, 15.0, LOCKING)
    assert laid.darts == ()
    (outline,) = tool.facets.boundary()
    pattern = drape.pattern_with_darts(laid, outline)
    assert pattern.pattern.area == pytest.approx(200 * 150, rel=1e-6)
    assert pattern.area_on_tool == pytest.approx(200 * 150, rel=1e-6)


def test_a_hole_is_cut_out_on_its_side_of_the_darts(laid, pattern):
    (outline,) = BOX.facets.boundary()
    turn = np.linspace(0, 2 * np.pi, 24, endpoint=False)
    hole = np.array([8 * np.cos(turn), 8 * np.sin(turn), np.full(24, DEPTH)])
    found = drape.pattern_with_darts(laid, outline, holes=[hole])
    area = 12 * 8**2 * np.sin(2 * np.pi / 24)
    assert pattern.pattern.area - found.pattern.area == pytest.approx(area, rel=1e-3)


@pytest.mark.dear("finds four darts, one after the other")
def test_a_dart_of_a_dome_begins_in_the_curvature_that_causes_the_shear():
    """A hemisphere with a flange, whose curvature is the opposite at its foot.

    A dart that begins where the net locks, at the foot, would take nothing out.
    """
    shape = {"fillet": 10.0, "flange": 10.0, "size": 4.0}
    tool = drape.TriangleMesh(*tool_shapes.hemisphere_with_flange(50.0, **shape))
    limit, point = np.radians(42), (0, 0, 50.0)
    uncut = np.abs(drape.net(tool, 6.0, point=point).shear_angle())
    assert np.nanmax(uncut) > limit
    laid = drape.net_with_darts(tool, 6.0, limit, point=point)
    assert len(laid.darts) == 4
    (outline,) = tool.facets.boundary()
    found = drape.pattern_with_darts(laid, outline)
    assert found.shear_angle < limit
    assert found.area_on_tool == pytest.approx(tool.facets.area, rel=5e-3)
    for dart in found.darts:
        assert 20 < dart.seam[2, 0] < 48
        one, other = dart.lengths
        assert one == pytest.approx(other, rel=0.08)
        assert dart.area > 500


def test_a_cell_of_the_ply_is_on_one_side_of_darts(laid):
    left, right = laid.cells()
    assert not (left & right).any()
