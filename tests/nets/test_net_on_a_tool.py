"""Nets that end at the edges of a tool, fold, and follow curves on it."""

import numpy as np
import pytest

from skfem_textile import drape
from tests.helpers import tool_shapes

PLATE = drape.TriangleMesh(*tool_shapes.plate(200.0, 150.0, 10.0))
CAP = drape.TriangleMesh(
    *tool_shapes.patch(
        lambda s, t: np.array(
            [
                100 * np.sin(2 * s - 1) * np.cos(1.4 * t - 0.7),
                100 * np.sin(1.4 * t - 0.7),
                100 * np.cos(2 * s - 1) * np.cos(1.4 * t - 0.7),
            ]
        ),
        *(200.0, 140.0, 8.0),
    )
)


def covered(inside, net, parts=6):
    """Area of the net inside a region in mm², by small parts of its cells."""
    share = (np.arange(parts) + 0.5) / parts
    p, q = (a.reshape(-1, 1) for a in np.meshgrid(share, share))
    cells = net.cells
    x = [
        net.positions[:, i : i + cells.shape[0], j : j + cells.shape[1]][:, None, cells]
        for i, j in ((0, 0), (1, 0), (0, 1), (1, 1))
    ]
    weights = (1 - p) * (1 - q), p * (1 - q), (1 - p) * q, p * q
    points = sum(w * corner for w, corner in zip(weights, x, strict=True))
    return float((inside(*points).mean(axis=0) * net.areas()[cells]).sum())


@pytest.mark.parametrize(
    ("point", "angle"), [((0, 0, 0), 0.0), ((-93, 66, 0), 0.5), ((99, 10, 0), 2.0)]
)
def test_a_net_from_any_start_covers_a_plate_up_to_its_edges(angle, point):
    """Most first threads miss the far corners: their neighbours go on alone."""
    angles = angle, angle + np.pi / 2
    net = drape.net(PLATE, 7.0, angles=angles, point=point)
    area = covered(lambda x, y, z: (abs(x) <= 100) & (abs(y) <= 75), net)
    assert area == pytest.approx(200 * 150, rel=0.01)
    assert not net.folds.size
    np.testing.assert_allclose(net.shear_angle()[net.cells], 0.0, atol=1e-9)
    x, y, _ = net.positions[:, net.status == drape.Status.LAID]
    assert (
        max(np.abs(x).max() - 100, np.abs(y).max() - 75)
        < 7.0 * (0.8 + np.sqrt(2)) + 1.0
    )


BONNET = drape.TriangleMesh(*tool_shapes.bonnet(size=20.0))
CYLINDER = drape.TriangleMesh(*tool_shapes.cylinder(size=12.0))
SADDLE = drape.TriangleMesh(*tool_shapes.saddle(size=12.0))


@pytest.mark.parametrize(
    ("tool", "turn", "between", "cell"),
    [
        (BONNET, 45, 45, 16.0),
        (BONNET, 70, 60, 16.0),
        (CYLINDER, 20, 135, 12.0),
        (SADDLE, 20, 135, 12.0),
    ],
)
def test_a_net_with_any_angle_between_fibres_covers_a_tool(tool, turn, between, cell):
    """An edge that turns back towards the start cuts cells at their last corner."""
    points = tool.facets.points
    middle = points[:, np.hypot(*points[:2]).argmin()]
    warp, weft = np.radians([turn, turn + between])
    net = drape.net(tool, cell, point=middle, angles=(warp, weft))
    assert not net.folds.size
    assert drape.Sheet.of_net(net).at(points).found.all()


def test_a_net_past_the_edges_of_a_tool_does_not_end_there():
    ends = drape.net(PLATE, 7.0, (20, 20), (5, 5))
    goes_on = drape.net(PLATE, 7.0, (20, 20), (5, 5), past_edges=True)
    assert np.isnan(ends.positions[0, 0]).all()
    assert np.isfinite(goes_on.positions).all()
    with pytest.raises(drape.NetError, match="ends at the edge of the tool"):
        ends.at(np.array([[-139.0], [0.0]]))


def test_a_net_ends_where_it_folds_and_only_behind():
    """On the unit sphere the net folds where uv is 1.86."""
    n = 40
    net = drape.net(drape.Sphere(100.0, (0, 0, -100)), 5.0, (0, n), (0, n))
    laid = net.status == drape.Status.LAID
    i, j = np.argwhere(net.status == drape.Status.FOLDED).T
    np.testing.assert_allclose(i * j * 0.05**2, 1.8616, rtol=0.1)
    behind = np.zeros_like(laid)
    for a, b in zip(i, j, strict=True):
        behind[a:, b:] = True
    np.testing.assert_array_equal(laid, ~behind)
    assert net.folds.shape == (3, len(i))
    assert np.isfinite(net.folds).all()
    corners = net.positions[:, i - 1, j - 1]
    assert {tuple(x) for x in net.folds.T} == {tuple(x) for x in corners.T}


def test_nets_side_by_side_are_single_nets():
    starts = [
        drape.NetStart((0, 0, 100.0), (1, 0, 0)),
        drape.NetStart((40, 20, 89.0), (1, 2, 0)),
        drape.NetStart((-50, -30, 81.0), (0, 1, 1)),
    ]
    for start, net in zip(starts, drape.nets(CAP, 16.0, starts), strict=True):
        alone = drape.net(CAP, 16.0, point=start.point, first=start.first)
        np.testing.assert_array_equal(net.status, alone.status)
        np.testing.assert_allclose(net.positions, alone.positions, atol=1e-9)


def arc(angle, n=40):
    """Part of a small circle on the cap, which is not a geodesic."""
    t = np.linspace(-0.8, 0.8, n)
    c = np.cos(angle)
    return 100 * np.array([c * np.sin(t), np.sin(angle) + 0 * t, c * np.cos(t)])


def test_a_first_thread_follows_a_curve_in_equal_chords():
    curve = arc(-0.4, 400)
    net = drape.net(CAP, 6.0, point=curve[:, 150], warp_along=curve)
    i, j = net.start
    thread = net.positions[:, :, j]
    thread = thread[:, np.isfinite(thread[0])]
    np.testing.assert_allclose(np.linalg.norm(np.diff(thread), axis=0), 6.0, rtol=1e-9)
    near = np.abs(np.arctan2(thread[0], thread[2])) < 0.78
    off = np.abs(thread[1, near] - 100 * np.sin(-0.4))
    assert near.sum() > 18
    assert off.max() < 0.05  # a geodesic has left it by 10 mm
    beyond = thread[:, ~near]
    assert np.abs(beyond[1] - 100 * np.sin(-0.4)).max() < 3  # goes on straight
    warp, weft = (
        net.positions[:, i + a, j + b] - net.positions[:, i, j]
        for a, b in ((1, 0), (0, 1))
    )
    assert abs(warp @ weft) / 36 < 0.05
    assert np.cross(warp, weft) @ net.positions[:, i, j] > 0.9 * 36 * 100  # outwards


@pytest.mark.parametrize("sign", [1, -1])
def test_the_second_thread_is_to_the_left_of_a_curve_in_either_sense(sign):
    """Both of its sides, and with the warp and the weft along the curve."""
    curve = np.array([[-90.0, 0.0, 90.0], 3 * [0.0], 3 * [0.0]])[:, ::sign]
    for given, left in (("warp_along", 1.0), ("weft_along", -1.0)):
        net = drape.net(PLATE, 20.0, point=(0, 0, 0), **{given: curve})
        (i, j), x = net.start, net.positions
        along, across = x[:, i + 1, j], x[:, i, j + 1]
        if given == "weft_along":
            along, across = across, along
        np.testing.assert_allclose(along, [sign * 20.0, 0, 0], atol=1e-9)
        np.testing.assert_allclose(across, [0, left * sign * 20.0, 0], atol=1e-9)


def test_both_first_threads_follow_curves():
    warp = arc(-0.4, 400)
    t = np.linspace(-0.4, 0.6, 300)
    weft = 100 * np.array(
        [np.sin(0.3 * t) * np.cos(t), np.sin(t), np.cos(0.3 * t) * np.cos(t)]
    )
    net = drape.net(CAP, 6.0, point=weft[:, 0], warp_along=warp, weft_along=weft)
    i, j = net.start
    thread = net.positions[:, i, j : j + 14]
    distance = np.linalg.norm(thread[:, :, None] - weft[:, None], axis=0).min(axis=1)
    assert distance.max() < 0.2


def test_edges_of_an_outline_end_at_its_corners():
    (outline,) = PLATE.facets.boundary()
    for point, axis, value in (((0, -75, 0), 1, -75), ((100, 0, 0), 0, 100)):
        edge = drape.edge_through(outline, point)
        np.testing.assert_allclose(edge[axis], value)
        assert np.ptp(edge[1 - axis]) == pytest.approx((200, 150)[axis == 0])
    t = np.linspace(0, 2 * np.pi, 50, endpoint=False)
    circle = np.array([np.cos(t), np.sin(t), 0 * t])
    closed = drape.edge_through(circle, (1, 0, 0))
    np.testing.assert_allclose(closed[:, [0, -1]], circle[:, [0, 0]])
