"""Meshes of triangles as tools: their edges, and what a ply on them asks of them."""

import numpy as np
import pytest

from skfem_textile import MeshError, drape
from tests.helpers import facing_out, graph

SIDE, CELLS = 60.0, 30


def bowl(hole=0.0):
    """A shallow bowl over a square of triangles, with a square hole in its middle."""
    s = np.linspace(-SIDE / 2, SIDE / 2, CELLS + 1)
    p, t = graph(s, lambda x, y: (x**2 + y**2) / 200)
    centres = p[:2, t].mean(axis=1)
    return drape.TriangleMesh(p, t[:, np.abs(centres).max(axis=0) > hole / 2])


def on_bowl(x, y):
    x, y = np.broadcast_arrays(x, y)
    return np.array([x, y, (x**2 + y**2) / 200])


def test_points_over_the_triangles_are_not_beyond_their_edges():
    rng = np.random.default_rng(1)
    x = on_bowl(*rng.uniform(-SIDE / 2, SIDE / 2, (2, 400)))
    tool = bowl()
    assert not tool.beyond_edges(x).any()
    np.testing.assert_array_equal(tool.beyond_edges(tool.facets.points), 0.0)


@pytest.mark.parametrize("off", [1.0, 5.0, 40.0])
def test_points_beyond_edges_and_corners_are_told_with_their_distance(off):
    side = SIDE / 2
    x = on_bowl(
        np.array([side + off, -side - off, 7.3, side + off]),
        np.array([0.0, 11.1, side + off, side + off]),
    )
    beyond = bowl().beyond_edges(x)
    flat = off * np.array([1, 1, 1, np.sqrt(2)])
    assert (beyond > 0.9 * flat).all()
    assert (beyond < 1.2 * flat).all()


def test_points_in_a_hole_are_beyond_its_edges():
    tool, whole = bowl(hole=20.0), bowl()
    x = on_bowl(np.array([0.0, 8.0, 9.9, 10.1, 20.0]), np.zeros(5))
    np.testing.assert_allclose(tool.beyond_edges(x), [10, 2, 0, 0, 0], rtol=0.05)
    assert not whole.beyond_edges(x).any()


def test_a_closed_surface_has_no_edges_to_go_beyond():
    x, t = drape.triangles_on(drape.Sphere(1.0), *np.full((2, 3), [[-1.1], [1.1]]), 12)
    t = facing_out(x, t)
    rng = np.random.default_rng(2)
    assert not drape.TriangleMesh(x, t).beyond_edges(rng.normal(size=(3, 99))).any()


@pytest.mark.parametrize("scale", [1e-300, 1e160, 1e306])
def test_a_surface_whose_areas_are_not_finite_is_refused(scale):
    facets = bowl().facets
    with pytest.raises(MeshError, match=r"extend over .* mm: give a file in mm"):
        drape.TriangleMesh(scale * facets.points, facets.triangles())


def test_derivatives_at_the_same_points_are_found_once(monkeypatch):
    tool, found = bowl(), []
    mean = tool._quadrics.mean
    monkeypatch.setattr(tool._quadrics, "mean", lambda x: found.append(1) or mean(x))
    x = on_bowl(np.array([1.0, 2.0]), np.array([3.0, 4.0]))
    level, gradient, hessian = tool.level(x), tool.gradient(x), tool.hessian(x.copy())
    assert len(found) == 1
    moved = x.copy()
    moved[0] += 1.0
    assert not np.array_equal(tool.level(moved), level)
    assert len(found) == 2
    x[0] += 1.0  # what was asked for last, changed in place
    np.testing.assert_array_equal(tool.level(x), tool.level(moved))
    for values in (gradient, hessian):
        with pytest.raises(ValueError, match="read-only"):
            values[0] = 0.0


def test_points_near_and_far_are_found_alike_together_and_alone():
    """However many vertices reach them."""
    tool, rng = bowl(), np.random.default_rng(3)
    x = rng.normal(size=(3, 60)) * rng.choice([1.0, 30.0, 900.0], 60)
    level, hessian = tool.level(x), tool.hessian(x)
    for i in range(60):
        one = tool.level(x[:, [i]]), tool.hessian(x[:, [i]])
        np.testing.assert_allclose(one[0], level[i], rtol=1e-12)
        np.testing.assert_allclose(one[1][..., 0], hessian[..., i], rtol=1e-9)


def test_geodesics_on_triangles_are_those_of_the_surface_they_stand_for():
    side = np.linspace(-25, 25, 7)
    X = np.array(np.meshgrid(side, side)).reshape(2, -1)
    exact = drape.HeightField(
        lambda x, y: drape.Height(
            *((x**2 + y**2) / 200, x / 100, y / 100),
            *(0.01 + 0 * x, 0 * x, 0.01 + 0 * x),
        )
    )
    off = drape.exponential_map(bowl(), X) - drape.exponential_map(exact, X)
    assert np.abs(off).max() < 1e-3 * np.linalg.norm(X, axis=0).max()
