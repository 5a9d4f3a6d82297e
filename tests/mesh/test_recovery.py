"""Recovery of fields at the nodes from values at the element centres."""

import numpy as np
import pytest
from skfem import MeshQuad, MeshTri

from skfem_textile.mesh.recovery import recovered
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
    assert recovered(mesh, at_centres) == pytest.approx(quadratic(mesh.p), abs=1e-6)


def test_smooth_peaks_between_centres_are_recovered():
    mesh = MeshQuad().refined(3)
    at_centres = np.cos(3 * (mesh.p[:, mesh.t].mean(axis=1) - 0.5)).prod(axis=0)
    assert at_centres.max() < 0.97
    assert recovered(mesh, at_centres).max() == pytest.approx(1.0, abs=3e-3)


def test_few_elements_have_finite_values():
    mesh = MeshQuad().refined(1)
    assert np.abs(recovered(mesh, np.ones(4)) - 1).max() < 1e-3
