"""Recovery of fields at the nodes from values at the element centres."""

import numpy as np
import pytest
from skfem import MeshQuad, MeshTri

from skfem_textile.mesh.recovery import contact_points, recovery
from skfem_textile.scenes.rectangle import rectangle


def quadratic(x):
    return 1.0 - x[0] + 3.0 * x[0] * x[1] + 2.0 * x[1] ** 2


@pytest.mark.parametrize(
    "mesh",
    [
        MeshQuad().refined(2),
        rectangle(1.0, 1.0, (5, 4), "irregular", 0.2, 0, 0.0, 0.0),
        MeshTri().refined(2),
    ],
    ids=["squares", "irregular", "triangles"],
)
def test_quadratic_polynomials_are_recovered_at_all_nodes(mesh):
    at_centres = quadratic(mesh.p[:, mesh.t].mean(axis=1))
    smooth = recovery(mesh) @ at_centres
    assert smooth == pytest.approx(quadratic(mesh.p), abs=1e-6)


def test_smooth_peaks_between_centres_are_recovered():
    mesh = MeshQuad().refined(3)
    at_centres = np.cos(3 * (mesh.p[:, mesh.t].mean(axis=1) - 0.5)).prod(axis=0)
    assert at_centres.max() < 0.97
    assert (recovery(mesh) @ at_centres).max() == pytest.approx(1.0, abs=3e-3)


def test_few_elements_have_finite_values():
    mesh = MeshQuad().refined(1)
    assert np.abs(recovery(mesh) @ np.ones(4) - 1).max() < 1e-3


def test_contact_points_of_a_curved_ply_are_below_its_nodes():
    """By h²/12 times each curvature, at edges too; a sheared plane has none."""
    mesh = MeshQuad.init_tensor(np.linspace(0, 6, 4), np.linspace(0, 4, 5))
    (x, y), points = mesh.p, contact_points(mesh)
    height = 0.5 * (0.3 * x**2 - 0.1 * y**2) + x * y + 3 * x - y + 1
    expected = (0.3 * 2.0**2 - 0.1 * 1.0**2) / 12
    assert points @ height - height == pytest.approx(expected, abs=1e-9)


def test_contact_points_of_a_quarter_are_those_of_the_whole_ply():
    """With images of the nodes around those on planes of symmetry."""
    s = np.linspace(-3, 3, 7)
    whole = MeshQuad.init_tensor(s, s)
    quarter = MeshQuad.init_tensor(s[3:], s[3:]).with_defaults()
    planes = [quarter.boundaries[name] for name in ("left", "bottom")]

    def moved(mesh, *mirrors):
        x, y = mesh.p
        height = np.cos(x) * np.cos(2 * y)
        found = contact_points(mesh, mirrors) @ height
        return {(round(a), round(b)): z for a, b, z in zip(x, y, found, strict=True)}

    of_whole = moved(whole)
    assert all(
        z == pytest.approx(of_whole[at], abs=1e-9)
        for at, z in moved(quarter, *planes).items()
    )


def test_a_mesh_without_nodes_inside_has_its_nodes_as_contact_points():
    points = contact_points(MeshQuad())
    assert (points.toarray() == np.eye(4)).all()
