import numpy as np
import pytest
from skfem import MeshQuad

from skfem_textile import Fabric, Full, Linear, OnePoint, Ply
from tests.helpers import Coupled, derivative, distorted, random_u


@pytest.mark.parametrize(
    ("fabric", "formulation", "names"),
    [
        (Fabric(1.0, 0.5), Full(), "tension shear corners"),
        (Fabric(0.0, 0.5), Full(), "shear corners"),
        (Fabric((1.0, 0.0)), OnePoint(0.0), "tension corners"),
        (Fabric(1.0), OnePoint(1.0), "tension corners stabilisation"),
    ],
)
def test_only_needed_terms_are_built(fabric, formulation, names):
    ply = Ply(distorted(0), fabric, formulation)
    assert [term.name for term in ply.terms] == names.split()


@pytest.mark.parametrize(
    "law", [(10.0, 20.0), Coupled(10.0, 6.0)], ids=["plain", "coupled"]
)
def test_predicted_tension_is_the_first_order_of_tension(law):
    ply = Ply(distorted(2), Fabric(law), Full())
    u, du = random_u(ply, 2), random_u(ply, 3, 1.0)
    rate = derivative(ply.fibre_tension, u, du)
    expected = ply.fibre_tension(u) + rate
    np.testing.assert_allclose(ply.predicted_tension(u, du), expected, atol=1e-6)
    acting, geometric = ply.predicted_tension(u, 0 * u), ply.geometric_tension(u, 0 * u)
    np.testing.assert_array_equal(geometric, ply.arranged(acting))


def test_strains_of_a_homogeneous_stretch():
    ply = Ply(distorted(5), Fabric(Linear(10.0)), Full())
    u = (np.diag([0.1, -0.2]) @ ply.mesh.p).T.ravel()
    warp, weft = ply.fibre_strain(u)
    np.testing.assert_allclose(warp, np.log(1.1))
    np.testing.assert_allclose(weft, np.log(0.8))
    np.testing.assert_allclose(ply.fibre_tension(u)[0], 10 * np.log(1.1))
    np.testing.assert_allclose(ply.area_ratio(u), 1.1 * 0.8)
    centre = np.array([[0.5], [0.5]])
    assert ply.fibre_strain(u, centre).shape == (2, ply.mesh.nelements, 1)
    assert ply.fibre_direction(u).shape == (2, 2, ply.mesh.nelements, 4)


SQUARES = MeshQuad().refined(1)


def test_nearly_flat_corners_and_thin_elements_are_accepted():
    flat = np.array([[0.0, 2.0, 1.0, 0.0], [0.0, 0.0, 1.0 + 1e-2, 2.0]])
    Ply(MeshQuad(flat, np.arange(4)[:, None]), Fabric(), Full())
    Ply(SQUARES.scaled((100.0, 1.0)), Fabric(), Full())
