"""The search finds the start with the least shear, and its net covers the part."""

import numpy as np
import pytest

from skfem_textile import drape
from skfem_textile.nets import start_search
from tests.helpers import tool_shapes


def panel(s, t):
    """Two bumps, without symmetry."""
    x, y = 300 * (s - 0.5), 220 * (t - 0.5)
    z = 45 * np.exp(-(((x - 40) / 70) ** 2) - ((y + 20) / 50) ** 2)
    return np.array([x, y, z + 30 * np.exp(-(((x + 80) / 60) ** 2) - (y / 60) ** 2)])


TOOL = drape.TriangleMesh(*tool_shapes.patch(panel, 300.0, 220.0, 25.0))
POINTS = TOOL.facets.points
CELL = 50.0


def largest(nets):
    return np.array([np.abs(drape.shear_over(net, POINTS)).max() for net in nets])


@pytest.fixture(scope="module", autouse=True)
def _few_local_nets():
    """They are laid one by one."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(start_search, "_LOCAL", 8)
        yield


@pytest.fixture(scope="module")
def best():
    return drape.best_start(TOOL, CELL, trials=64)


def test_the_best_start_is_better_than_random_ones_and_reproduces_its_net(best):
    rng = np.random.default_rng(3)
    points = POINTS[:, rng.integers(0, POINTS.shape[1], 30)]
    starts = [
        drape.NetStart(p, (np.cos(a), np.sin(a), 0.0))
        for p, a in zip(points.T, rng.uniform(0, np.pi, 30), strict=True)
    ]
    shear = largest(drape.nets(TOOL, CELL, [best.start, *starts]))
    assert shear[0] == pytest.approx(best.measure, abs=1e-9)
    known = shear[1:][np.isfinite(shear[1:])]
    assert known.size > 10
    assert best.measure < known.min() + np.radians(0.2)
    found = best.measures[np.isfinite(best.measures)]
    assert found.min() == best.measure
    assert found.max() > 2 * best.measure
    assert best.points.shape == best.directions.shape == (3, len(best.measures))
    assert not best.net.folds.size


def test_shear_between_cells_is_second_order():
    """On the sphere, against a net of small cells; points beyond have no angle."""
    ball = drape.Sphere(100.0, (0, 0, -100))
    t = np.linspace(0, 2 * np.pi, 30)
    x, y = 40 * np.cos(t), 40 * np.sin(t)
    points = np.array([x, y, np.sqrt(1e4 - x**2 - y**2) - 100])
    fine, coarse, middle = (
        drape.shear_over(drape.net(ball, h, (n, n), (n, n)), points)
        for h, n in ((2.0, 30), (10.0, 6), (5.0, 12))
    )
    errors = [np.abs(of - fine).max() for of in (coarse, middle)]
    assert np.degrees(errors[1]) < 0.3
    assert errors[0] / errors[1] > 2.5
    net = drape.net(drape.Plane(), 5.0, (2, 2), (2, 2))
    shear = drape.shear_over(net, np.array([[0.0, 11, 40], 3 * [0], 3 * [0]]))
    np.testing.assert_array_equal(np.isfinite(shear), [True, True, False])


@pytest.fixture
def few_nets(monkeypatch):
    monkeypatch.setattr(start_search, "_SIDE_BY_SIDE", 6)
    monkeypatch.setattr(start_search, "_FINALISTS", 2)


def test_the_best_start_is_not_worse_than_others_with_smaller_cells(best, few_nets):
    """A search with large cells and few trials does not find a better one."""
    others = [best.start]
    found = drape.best_start(TOOL, CELL, search_cell=100.0, others=others, trials=1)
    assert found.measure <= largest(drape.nets(TOOL, CELL, others))[0] + 1e-12
    assert found.net.cell == pytest.approx(CELL)


def test_a_fixed_direction_is_the_projected_x_axis(few_nets):
    found = drape.best_start(TOOL, 100.0, fixed_direction=True, trials=1)
    first = found.directions
    np.testing.assert_allclose(first[1], 0.0, atol=1e-9 + np.abs(first[2]).max())
    axes = drape.Axes.at(TOOL, np.asarray(found.start.point))
    np.testing.assert_allclose(found.start.first, axes.turn[:, 0])


def test_a_part_that_no_net_covers_is_rejected():
    """Two plates side by side: a net ends at the edges of one of them."""
    x, t = tool_shapes.plate(100.0, 60.0, 20.0)
    other = x + np.array([[300.0], [0.0], [0.0]])
    tool = drape.TriangleMesh(np.hstack([x, other]), np.hstack([t, t + x.shape[1]]))
    with pytest.raises(ValueError, match=r"no net .* misses \d+ % of it, around \("):
        drape.best_start(tool, 30.0, trials=1)


@pytest.mark.parametrize(("n", "compared"), [(1500, 1500), (4000, 2000)])
def test_shear_is_compared_at_up_to_two_thousand_points(n, compared):
    assert start_search._thinned(np.ones((3, n)), 0).shape == (3, compared)
