"""Search of the start with the least shear."""

import numpy as np
import pytest

from skfem_textile import drape
from tests.helpers import tool_shapes


def panel(s, t):
    """Two bumps, without symmetry."""
    x, y = 300 * (s - 0.5), 220 * (t - 0.5)
    z = 45 * np.exp(-(((x - 40) / 70) ** 2) - ((y + 20) / 50) ** 2)
    return np.array([x, y, z + 30 * np.exp(-(((x + 80) / 60) ** 2) - (y / 60) ** 2)])


TOOL = drape.TriangleMesh(*tool_shapes.patch(panel, 300.0, 220.0, 15.0))
CELL = 20.0


@pytest.fixture(scope="module")
def best():
    return drape.best_start(TOOL, CELL, trials=64)


def largest(start):
    net = drape.net(TOOL, CELL, point=start.point, first=start.first)
    return np.abs(drape.shear_over(net, TOOL.facets.points)).max()


def test_the_best_start_is_better_than_random_ones(best):
    rng = np.random.default_rng(3)
    points = TOOL.facets.points[:, rng.integers(0, TOOL.facets.points.shape[1], 60)]
    turns = rng.uniform(0, np.pi, 60)
    starts = [
        drape.NetStart(p, (np.cos(a), np.sin(a), 0.0))
        for p, a in zip(points.T, turns, strict=True)
    ]
    nets = drape.nets(TOOL, CELL, starts)
    shear = [np.abs(drape.shear_over(net, TOOL.facets.points)).max() for net in nets]
    known = np.array(shear)[np.isfinite(shear)]
    assert known.size > 20
    assert best.measure < known.min() + np.radians(0.2)


def test_the_best_start_reproduces_its_net(best):
    assert largest(best.start) == pytest.approx(best.measure, abs=1e-9)
    known = best.measures[np.isfinite(best.measures)]
    assert known.min() == best.measure
    assert known.max() > 2 * best.measure
    assert best.points.shape == best.directions.shape == (3, len(best.measures))
    assert not best.net.folds.size


def test_shear_between_cells_is_second_order():
    """On the sphere, against a net of small cells."""
    ball = drape.Sphere(100.0, (0, 0, -100))
    t = np.linspace(0, 2 * np.pi, 30)
    x, y = 40 * np.cos(t), 40 * np.sin(t)
    points = np.array([x, y, np.sqrt(1e4 - x**2 - y**2) - 100])
    fine = drape.shear_over(drape.net(ball, 1.0, (60, 60), (60, 60)), points)
    errors = [
        np.abs(
            drape.shear_over(drape.net(ball, h, (n, n), (n, n)), points) - fine
        ).max()
        for h, n in ((10.0, 6), (5.0, 12))
    ]
    assert np.degrees(errors[1]) < 0.3
    assert errors[0] / errors[1] > 2.5


def test_points_beyond_a_net_have_no_angle():
    net = drape.net(drape.Plane(), 5.0, (2, 2), (2, 2))
    shear = drape.shear_over(
        net, np.array([[0.0, 11.0, 40.0], [0.0, 0.0, 0.0], 3 * [0.0]])
    )
    np.testing.assert_array_equal(np.isfinite(shear), [True, True, False])


def test_the_best_start_is_not_worse_than_others_with_smaller_cells(best):
    """A search with large cells and few trials does not find a better one."""
    others = [best.start]
    found = drape.best_start(TOOL, 10.0, search_cell=40.0, others=others, trials=32)
    nets = drape.nets(TOOL, 10.0, others)
    known = np.abs(drape.shear_over(nets[0], TOOL.facets.points)).max()
    assert found.measure <= known + 1e-12
    assert found.net.cell == pytest.approx(10.0)


def test_a_fixed_direction_is_the_projected_x_axis():
    found = drape.best_start(TOOL, CELL, fixed_direction=True, trials=32)
    first = found.directions
    np.testing.assert_allclose(first[1], 0.0, atol=1e-9 + np.abs(first[2]).max())
    axes = drape.Axes.at(TOOL, np.asarray(found.start.point))
    np.testing.assert_allclose(found.start.first, axes.turn[:, 0])


def test_nets_require_a_start():
    with pytest.raises(ValueError, match="nets: specify at least one start"):
        drape.nets(TOOL, CELL, [])


def test_a_direction_is_finite():
    start = drape.NetStart(TOOL.facets.points[:, 100], (np.nan, 0.0, 0.0))
    with pytest.raises(ValueError, match="`first` must be three finite numbers"):
        drape.nets(TOOL, CELL, [start])


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"points": np.empty((3, 0))}, "specify at least one point of the part"),
        ({"search_cell": -1.0}, "search cell must be a positive length"),
        ({"measure": "median"}, "measure must be one of largest, mean"),
        ({"points": np.zeros((2, 4))}, "points must be finite numbers"),
        ({"cell": -1.0}, "cell must be a positive length"),
    ],
)
def test_arguments_of_the_search_are_checked(options, message):
    with pytest.raises(ValueError, match=message):
        drape.best_start(TOOL, **{"cell": CELL, **options})


def test_a_part_that_no_net_covers_is_rejected():
    """Two plates side by side: a net ends at the edges of one of them."""
    x, t = tool_shapes.plate(100.0, 60.0, 10.0)
    other = x + np.array([[300.0], [0.0], [0.0]])
    tool = drape.TriangleMesh(np.hstack([x, other]), np.hstack([t, t + x.shape[1]]))
    with pytest.raises(ValueError, match=r"no net .* misses \d+ % of it, around \("):
        drape.best_start(tool, 20.0, trials=32)
