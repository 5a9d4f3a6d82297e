"""Smooth surface through the nodes of a ply, and its points below others."""

import numpy as np
import pytest
from skfem import MeshQuad

from skfem_textile.contact.ply_surface import PlySurface

RADIUS, CENTRE = 1.5, np.array([[0.3], [0.3], [0.0]])


def on_sphere(X):
    return np.array([*X, np.sqrt(RADIUS**2 - ((X - 0.3) ** 2).sum(axis=0))])


def square(parts):
    x = np.linspace(0, 1, parts + 1)
    mesh = MeshQuad.init_tensor(x, x)
    return mesh, PlySurface(mesh, np.arange(mesh.nelements))


def points(n=200):
    return 0.2 + 0.6 * np.random.default_rng(0).random((2, n))


def test_a_sphere_is_met_with_its_normals_and_curvature():
    errors = []
    for parts in (8, 16, 32):
        mesh, surface = square(parts)
        s = on_sphere(points())
        feet, n = surface.feet(on_sphere(mesh.p), s), (s - CENTRE) / RADIUS
        turn = (np.eye(3)[..., None] - n[:, None] * n) / RADIUS
        off = feet.heights(s), feet.normal - n, feet.turn - turn
        errors.append([np.abs(x).max() for x in off])
    heights, normals, turns = np.array(errors).T
    assert heights[2] < 1e-7  # the chord of an element is 2e-4 deep
    assert heights[2] < heights[1] / 8
    assert normals[2] < normals[1] / 3
    assert turns[2] < 1e-3


def test_the_surface_is_flat_where_the_ply_is():
    mesh, surface = square(4)
    flat = np.pad(mesh.p, ((0, 1), (0, 0)))
    s = np.array([*points(), np.linspace(-0.2, 0.3, 200)])
    feet = surface.feet(flat, s)
    assert feet.heights(s) == pytest.approx(s[2], abs=1e-14)
    assert feet.foot[:2] == pytest.approx(s[:2], abs=1e-12)
    assert (feet.off == 0).all()


def test_a_point_beyond_the_edge_is_off_its_element():
    mesh, surface = square(4)
    flat = np.pad(mesh.p, ((0, 1), (0, 0)))
    s = np.array([[1.1, 1.0, 0.5], [0.5, 0.5, 0.5], [0.1, 0.1, 0.1]])
    assert surface.feet(flat, s).off == pytest.approx([0.4, 0.0, 0.0], abs=1e-9)


def test_weights_reproduce_linear_functions():
    mesh, surface = square(6)
    x = on_sphere(mesh.p)
    feet = surface.feet(x, on_sphere(points()))
    sums = (feet.weights * x[:, feet.nodes]).sum(axis=1)
    assert sums == pytest.approx(feet.foot, abs=1e-12)
    assert feet.weights.sum(axis=0) == pytest.approx(1.0)
