"""Fibre directions: angles, reference curves, and directions from node numbering."""

import numpy as np
import pytest
from skfem import MeshQuad

from skfem_textile import Fabric, Ply, split
from skfem_textile.fabric.directions import (
    AlongCurve,
    FibreDirections,
    directions_of,
    directions_warning,
    with_smooth_fields,
)
from skfem_textile.fabric.kinematics import rotated
from tests.helpers import distorted, refused

MESH = distorted(1, (6, 5), 0.25)
EDGES = MESH.p[:, MESH.t[1]] - MESH.p[:, MESH.t[0]]
ACROSS = np.stack([-EDGES[1], EDGES[0]])


def test_angles_are_recovered_and_right_angles_are_exact():
    angles = np.array([-179.0, -90.0, -33.3, 0.0, 45.0, 90.0, 180.0])
    directions = FibreDirections.of_angles(angles, angles + 60)
    assert np.allclose(directions.angles_deg()[0], angles, atol=1e-12)
    assert directions.warp[:, [1, 3, 5, 6]].T.tolist() == [
        *([0, -1], [1, 0], [0, 1], [-1, 0])
    ]


def test_a_function_gives_the_directions_of_each_users_element():
    fabric = Fabric(warp=lambda x: np.stack([1 + 0 * x[0], x[0]]))
    centres = MESH.p[:, MESH.t].mean(axis=1)
    slope = np.tan(np.radians(directions_of(MESH, fabric).angles_deg()[0]))
    assert np.allclose(slope, centres[0])
    assert np.allclose(
        directions_of(split(MESH), fabric).warp, directions_of(MESH, fabric).warp
    )


def test_directions_of_each_element_reach_a_ply():
    directions = FibreDirections(EDGES, ACROSS)
    ply = Ply(MESH, directions.on(Fabric(1e3, 0.5)))
    again = directions_of(MESH, directions.on(Fabric(1e3, 0.5)))
    assert np.allclose(again.warp[0] * EDGES[1] - again.warp[1] * EDGES[0], 0.0)
    assert np.isfinite(ply.energy(ply.basis.zeros()))


def test_directions_per_element_become_vectors_or_polynomials():
    x, _ = MESH.p[:, MESH.t].mean(axis=1)
    warp, weft = np.stack([np.cos(0.1 * x), np.sin(0.1 * x)]), np.full((2, x.size), 3.0)
    smooth = with_smooth_fields(MESH, FibreDirections(-warp, weft).on(Fabric()))
    np.testing.assert_allclose(smooth.weft, 0.5**0.5)
    assert smooth.warp.coefficients.shape == (2, 2, 2)  # the lowest degree
    A = smooth.warp(MESH.p)
    np.testing.assert_allclose(np.arctan2(*-A[::-1]), 0.1 * MESH.p[0], atol=2e-3)
    rough = np.random.default_rng(0).standard_normal(warp.shape)
    rough = FibreDirections(warp, rough).on(Fabric())
    refused(lambda: with_smooth_fields(MESH, rough), "^the weft .* a smooth field")


def test_fibres_along_a_fine_arc_follow_the_circle():
    angle = np.linspace(0.0, np.pi / 2, 400)
    arc = 50 * np.stack([np.cos(angle), np.sin(angle)])
    x = np.array([[40.0, 30.0, 20.0], [10.0, 30.0, 45.0]])
    tangent = np.stack([-x[1], x[0]]) / np.hypot(*x)
    assert np.abs(AlongCurve(arc)(x) - tangent).max() < 3e-3
    turned = AlongCurve(arc, np.pi / 2)(x)
    assert np.abs(turned + x / np.hypot(*x)).max() < 3e-3


def test_the_nearest_tangent_applies_past_ends_and_at_corners():
    curve = AlongCurve([[0.0, 10.0, 10.0], [0.0, 0.0, 10.0]])
    x = np.array([[-5.0, 12.0, 15.0], [1.0, -2.0, 20.0]])
    assert np.allclose(curve(x).T, [[1, 0], [0.5**0.5, 0.5**0.5], [0, 1]])
    assert curve(x[:, :, None]).shape == (2, 3, 1)


def test_directions_along_first_edges_are_reported_and_fields_are_not():
    assert "edge 1 in 30 of 30" in directions_warning(
        MESH, FibreDirections(EDGES, ACROSS)
    )
    constant = directions_of(MESH, Fabric(warp=(1, 1), weft=(-1, 1)))
    assert directions_warning(MESH, constant) == ""


@pytest.mark.parametrize(
    ("degrees", "n_others", "is_told"),
    [(0.02, 2, True), (0.2, 2, False), (0, 5, False)],
)
def test_most_directions_follow_edges_if_they_are_reported(degrees, n_others, is_told):
    turn = np.radians(np.where(np.arange(30) < n_others, 10.0, degrees))
    u, v = (np.cos(turn) * x + np.sin(turn) * rotated(x) for x in (EDGES, ACROSS))
    assert bool(directions_warning(MESH, FibreDirections(u, v))) == is_told


@pytest.mark.parametrize(("degrees", "is_told"), [(0.3, False), (3.0, True)])
def test_directions_along_edges_of_nearly_one_direction_are_accepted(degrees, is_told):
    x, y = MeshQuad().refined(3).p
    p = np.array([x, y + np.radians(degrees) * x**2])
    mesh = MeshQuad(p, MeshQuad().refined(3).t)
    edges = mesh.p[:, mesh.t[1]] - mesh.p[:, mesh.t[0]]
    found = directions_warning(mesh, FibreDirections(edges, rotated(edges)))
    assert bool(found) == is_told


def test_directions_from_any_numbering_are_reported():
    rng = np.random.default_rng(0)
    turned = np.stack(
        [np.roll(c, s) for c, s in zip(MESH.t.T, rng.integers(0, 4, 30), strict=True)],
        axis=1,
    )
    mesh = MeshQuad(MESH.p, turned)
    edges = mesh.p[:, mesh.t[2]] - mesh.p[:, mesh.t[1]]
    skew = np.stack([edges[0] - edges[1], edges[0] + edges[1]])
    assert "warp runs along edge 2" in directions_warning(
        mesh, FibreDirections(edges, skew)
    )
    assert directions_warning(mesh, FibreDirections(EDGES, ACROSS)) == ""


def test_fibres_along_the_edges_of_a_regular_mesh_are_accepted():
    mesh = MeshQuad().refined(3)
    assert directions_warning(mesh, directions_of(mesh, Fabric())) == ""
