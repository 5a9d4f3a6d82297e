"""Meshes of triangles as tools: their edges, and what a ply on them asks of them."""

import numpy as np
import pytest

from skfem_textile import drape

SIDE, CELLS = 60.0, 30


def bowl(hole=0.0):
    """A shallow bowl over a square of triangles, with a square hole in its middle."""
    s = np.linspace(-SIDE / 2, SIDE / 2, CELLS + 1)
    x, y = np.meshgrid(s, s)
    p = np.array([x, y, (x**2 + y**2) / 200]).reshape(3, -1)
    k = np.add.outer((CELLS + 1) * np.arange(CELLS), np.arange(CELLS)).ravel()
    across = k + CELLS + 2
    t = np.hstack([[k, k + 1, across], [k, across, across - 1]])
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
    a, b, c = x[:, t].swapaxes(0, 1)
    inwards = (np.cross(b - a, c - a, axis=0) * a).sum(axis=0) < 0
    t[1:, inwards] = t[:0:-1, inwards]
    rng = np.random.default_rng(2)
    assert not drape.TriangleMesh(x, t).beyond_edges(rng.normal(size=(3, 99))).any()
