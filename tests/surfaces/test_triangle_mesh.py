"""Values of smoothed triangles at many points, against all vertices one by one."""

import numpy as np
import pytest
from scipy.integrate import cumulative_trapezoid

from skfem_textile import drape
from skfem_textile.surfaces.tool_mesh import (
    Elements,
    ElementTree,
    _may_be_closest,
    closest_on_triangles,
)
from tests.helpers import tool_shapes
from tests.helpers.tool_shapes import (
    curved_ring,
    facing_up,
    hemisphere_with_flange,
    ring,
    stitched,
)
from tests.helpers.tools import plate

PARTS = "level", "gradient", "hessian"


def points(kind):
    """Points near a bump, far from it, equally far from vertices, and at vertices."""
    x, t = plate(n=15)
    rng = np.random.default_rng(1)
    return {
        "near": x[:, ::3] + rng.normal(size=(3, 75)),
        "far": 300 * rng.normal(size=(3, 40)),
        "beyond": x[:, :15] - [[0], [30], [0]],
        "edges": x[:, t[:2]].mean(axis=1)[:, ::5],
        "vertices": x[:, ::7],
    }[kind]


def straightened(t):
    """The factor of ½t² whose second derivative falls from 1 to 0 between 1 and 2."""
    s = np.linspace(0, max(2, t.max()), 20001)
    fall = np.clip(s - 1, 0, 1)
    once = cumulative_trapezoid(1 - fall**2 * (3 - 2 * fall), s, initial=0)
    twice = cumulative_trapezoid(once, s, initial=0)
    return np.where(t > 1, np.interp(t, s, twice) / np.maximum(t, 1) ** 2 * 2, 1)


KINDS = "near", "far", "beyond", "edges", "vertices"


@pytest.fixture(scope="module")
def tool():
    return drape.TriangleMesh(*plate(n=15))


@pytest.mark.parametrize("kind", KINDS)
def test_the_level_is_the_mean_over_all_vertices(tool, kind):
    """With weights that vanish at two edges, or at 1.5 times the nearest distance."""
    vertices, a, b, H = tool._quadrics._quadrics
    limit = tool._quadrics._straight
    tolerance = 1e-5 if kind == "far" else 1e-10  # of the integration
    for x in points(kind).T:
        d = x - vertices
        r = np.linalg.norm(d, axis=1)
        s = np.minimum(r / max(tool._quadrics._reach, 1.5 * r.min()), 1)
        w = (1 - s) ** 6 * (35 * s**2 + 18 * s + 3)
        bend = 0.5 * np.einsum("ni,nij,nj->n", d, H, d)
        q = a + (b * d).sum(axis=1) + bend * straightened(r / limit)
        level = tool.level(x[:, None])[0]
        assert level == pytest.approx((w @ q) / w.sum(), rel=tolerance, abs=tolerance)


@pytest.mark.parametrize("kind", KINDS)
def test_many_points_have_the_values_of_each_alone(tool, kind):
    x = points(kind)
    for part in PARTS:
        together = getattr(tool, part)(x)
        alone = [getattr(tool, part)(x[:, [i]])[..., 0] for i in range(x.shape[1])]
        np.testing.assert_allclose(together, np.moveaxis(alone, 0, -1), atol=1e-10)


def test_derivatives_of_the_continuation_are_those_of_its_level(tool):
    """Where the quadrics straighten, from one to two times their limit and beyond."""
    rng = np.random.default_rng(3)
    x = np.array([1, 1, 0.2])[:, None] * rng.uniform(-300, 300, (3, 60))
    step = 1e-3
    for axis in range(3):
        move = step * np.eye(3)[:, [axis]]
        slope = (tool.level(x + move) - tool.level(x - move)) / (2 * step)
        np.testing.assert_allclose(tool.gradient(x)[axis], slope, atol=1e-5)
        bend = (tool.gradient(x + move) - tool.gradient(x - move)) / (2 * step)
        np.testing.assert_allclose(tool.hessian(x)[axis], bend, atol=1e-5)


# Beyond the edges of a tool


def turned(x, angle=0.4):
    """Points turned about y."""
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]]) @ x


def circles(*radii, n=200):
    """A flat ring between circles of equally many vertices, as CAD exports it."""
    around = 2 * np.pi * np.arange(n + 1) / n
    r = np.array(radii)[:, None, None]
    chains = r * np.array([np.cos(around), np.sin(around), 0 * around])
    return facing_up(*stitched(list(chains), [around] * len(radii), closed=True))


@pytest.mark.parametrize("scatter", [0.0, 1e-4])
@pytest.mark.parametrize("mesh", [ring(), circles(40, 100), circles(40, 60, 80, 100)])
def test_the_plane_of_a_flat_ring_continues_in_its_hole(mesh, scatter):
    """All neighbours of a vertex may be on one circle, with no curvature to fit."""
    x, t = mesh
    noise = np.random.default_rng(0).uniform(-scatter, scatter, x.shape)
    tool = drape.TriangleMesh(turned(x) + noise, t)
    r = np.array([0.0, 10, 20, 30, 38, 110, 150])
    level = tool.level(turned(np.array([r, 0 * r, 0 * r])))
    assert np.abs(level).max() < 1e-9 + 100 * scatter


def test_a_curved_ring_continues_into_its_hole_as_a_sphere():
    """Its quadrics alone miss the top of the sphere, 40 mm away, by 0.24 mm."""
    tool = drape.TriangleMesh(*curved_ring(120.0))
    r = np.array([0.0, 10, 20, 30, 38])
    level = tool.level(np.array([r, 0 * r, np.sqrt(120**2 - r**2)]))
    assert np.abs(level).max() < 0.25


@pytest.mark.parametrize("scatter", [0.0, 0.005])
def test_a_continuation_does_not_bend_back(scatter):
    """The foot of a point far from an edge is not on a parabola that rolls up.

    The flange is two triangles wide, so that its edge has the curvature of the fillet.
    """
    x, t = hemisphere_with_flange(flange=6.0)
    noise = np.random.default_rng(0).normal(scale=scatter * 3, size=x.shape)
    tool = drape.TriangleMesh(x + noise, t)
    r = np.linspace(64.0, 200.0, 40)
    normal = tool.gradient(np.array([r, 0 * r, 0 * r]))
    tilt = np.degrees(np.arccos(normal[2] / np.linalg.norm(normal, axis=0)))
    assert tilt.max() < 45


def test_points_beyond_edges_are_the_same_one_by_one_and_after_a_move():
    x, t = ring()
    tool = drape.TriangleMesh(x, t)
    points = np.random.default_rng(1).uniform(-130, 130, (3, 300)) * [[1], [1], [0.05]]
    beyond = tool.beyond_edges(points)
    r = np.hypot(*points[:2])
    expected = np.maximum(np.maximum(40 - r, r - 100), 0)
    clear = np.abs(expected - 0.5) > 0.5
    np.testing.assert_allclose(beyond[clear], expected[clear], atol=0.2)
    shift = np.array([5.0, -3.0, 7.0])
    moved = tool.moved(shift, np.eye(3)[:, [1, 2, 0]])
    there = np.eye(3)[[1, 2, 0]] @ (points - shift[:, None])
    np.testing.assert_allclose(moved.beyond_edges(there), beyond, atol=1e-9)


def test_separate_parts_keep_their_outlines():
    x, t = tool_shapes.plate(100.0, 100.0)
    beside = x + np.array([[200.0], [0.0], [0.0]])
    both = np.hstack([x, beside]), np.hstack([t, t + x.shape[1]])
    tool = drape.TriangleMesh(*both)
    area = tool.without_holes().facets.area
    assert area == pytest.approx(tool.facets.area)


# Closest points of the triangles


def distances(x, t, points):
    """Distances of points from triangles, one by one, by the regions of a triangle."""

    def to_segment(p, a, b):
        share = np.clip(
            ((p - a) * (b - a)).sum(axis=1) / ((b - a) ** 2).sum(axis=1), 0, 1
        )
        return np.linalg.norm(p - a - share[:, None] * (b - a), axis=1)

    a, b, c = x.T[t]
    normal = np.cross(b - a, c - a)
    normal /= np.linalg.norm(normal, axis=1)[:, None]
    for p in points.T:
        edges = np.array([to_segment(p, *e) for e in ((a, b), (b, c), (c, a))])
        height = ((p - a) * normal).sum(axis=1)
        inside = [
            (np.cross(v - u, p - u) * normal).sum(axis=1) >= 0
            for u, v in ((a, b), (b, c), (c, a))
        ]
        yield min(
            edges.min(), np.abs(height)[np.all(inside, axis=0)].min(initial=np.inf)
        )


@pytest.mark.parametrize("mesh", [ring(), plate(n=8), hemisphere_with_flange()])
def test_closest_points_are_those_among_all_triangles(mesh):
    """Near, far, beyond the edges, and where many triangles are equally far away."""
    x, t = mesh
    rng = np.random.default_rng(2)
    axis = np.array([[0.0], [0.0], [1.0]]) * [-300, -40, 0, 1e-9, 25, 50, 400]
    points = np.hstack(
        [s * rng.normal(size=(3, 12)) for s in (30, 100, 1e3, 1e6)] + [axis]
    )
    triangle, shares = closest_on_triangles(x, t, points)
    closest = (shares * x[:, t[:, triangle]]).sum(axis=1)
    assert shares.min() >= 0
    np.testing.assert_allclose(shares.sum(axis=0), 1)
    found = np.linalg.norm(points - closest, axis=0)
    np.testing.assert_allclose(found, [*distances(x, t, points)], rtol=1e-12, atol=1e-9)


def test_a_triangle_below_a_far_point_is_a_candidate_and_its_neighbours_are_not():
    x, t = plate(n=40)
    points = np.array([[3.0], [4.0], [400.0]])
    corners, tree = x[:, t], ElementTree(x[:, t])
    point, triangle = tree.pairs(points)
    possible = _may_be_closest(corners, tree.radii, points, point, triangle)
    assert possible.sum() < 20 < len(possible)


def test_distances_of_local_coordinates_from_elements():
    """Inside, beyond each side, and beyond two of them."""
    x = np.array([[0.2, 0.5], [-0.3, 0.5], [0.5, -0.1], [0.8, 0.7], [1.4, -0.2]]).T
    triangle, square = (Elements(np.arange(k)[:, None]) for k in (3, 4))
    np.testing.assert_allclose(
        triangle.beyond(x).max(axis=0), [0.0, 0.3, 0.1, 0.5, 0.2]
    )
    np.testing.assert_allclose(square.beyond(x).max(axis=0), [0.0, 0.3, 0.1, 0.0, 0.4])
