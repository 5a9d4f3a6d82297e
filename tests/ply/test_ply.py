import numpy as np
import pytest
from skfem import MeshHex, MeshQuad

from skfem_textile import (
    Fabric,
    Full,
    Linear,
    Macro,
    MeshError,
    OnePoint,
    Ply,
    Quadratic,
)
from skfem_textile.ply import formulations
from tests.helpers import derivative, distorted, random_u


def term_names(fabric, formulation):
    return [t.name for t in Ply(distorted(0), fabric, formulation).terms]


def test_only_needed_terms_are_built():
    sheared, plain = Fabric(1.0, 0.5), Fabric(1.0)
    assert term_names(plain, Full()) == ["tension", "corners"]
    assert term_names(sheared, Full()) == ["tension", "shear", "corners"]
    assert term_names(plain, OnePoint(0.0)) == ["tension", "corners"]
    stabilised = ["tension", "corners", "stabilisation"]
    assert term_names(plain, OnePoint(1.0)) == stabilised
    assert term_names(Fabric(0.0, 0.5), Full()) == ["shear", "corners"]
    assert term_names(Fabric((1.0, 0.0)), Full()) == ["tension", "corners"]


@pytest.mark.parametrize("formulation", [Full(), OnePoint(0.0)])
def test_no_hourglass_basis_without_stabilisation(formulation, monkeypatch):
    def refuse(*args, **kwargs):
        raise AssertionError("an hourglass basis was built")

    monkeypatch.setattr(formulations, "HourglassBasis", refuse)
    Ply(distorted(0), Fabric(), formulation)


def test_a_fabric_without_stiffness_is_rejected():
    with pytest.raises(ValueError, match="no stiffness"):
        Ply(distorted(0), Fabric(0.0), Full())


@pytest.mark.parametrize("C_s", [-1.0, np.nan, np.inf])
def test_invalid_stabilisation_is_rejected(C_s):
    with pytest.raises(ValueError, match="stabilisation must be a finite number >= 0"):
        OnePoint(C_s)


def test_predicted_tension_is_the_first_order_of_tension():
    ply = Ply(distorted(2), Fabric((10.0, 20.0)), Full())
    u, du = random_u(ply, 2), random_u(ply, 3, 1.0)
    rate = derivative(ply.fibre_tension, u, du)
    np.testing.assert_allclose(
        ply.predicted_tension(u, du), ply.fibre_tension(u) + rate, atol=1e-6
    )


def test_a_direction_per_element_equals_the_constant_one():
    mesh = distorted(4)
    per_element = np.tile([[2.0], [1.0]], mesh.nelements)
    plies = [
        Ply(mesh, Fabric(10.0, 1.0, warp=warp), OnePoint(1.0))
        for warp in ((2.0, 1.0), per_element)
    ]
    u = random_u(plies[0], 4)
    assert plies[0].energy(u) == pytest.approx(plies[1].energy(u), rel=1e-14)


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


def moved(node, by):
    p = SQUARES.p.copy()
    p[:, node] += by
    return MeshQuad(p, SQUARES.t)


CENTRE_NODE = int(np.argmin(np.abs(SQUARES.p - 0.5).sum(axis=0)))


@pytest.mark.parametrize(
    ("mesh", "message"),
    [
        (MeshHex(), "must be a skfem.MeshQuad or a skfem.MeshTri .*, not MeshHex1"),
        (
            moved(CENTRE_NODE, np.nan),
            r"1 node\(s\) have coordinates that are not finite: 8",
        ),
        (
            moved(CENTRE_NODE, 0.8),
            r"1 quadrilateral\(s\) are inverted or degenerate: 2",
        ),
        (
            MeshQuad(np.array([[0, 1, 1, 0], [0, 0, 1, 0.0]]), np.arange(4)[:, None]),
            r"1 quadrilateral\(s\) are inverted or degenerate.*: 0",
        ),
        (
            MeshQuad(np.array([[0, 1, 0, 1], [0, 0, 1, 1.0]]), np.arange(4)[:, None]),
            "inverted or degenerate",
        ),
        (
            MeshQuad(np.hstack([SQUARES.p, [[3.0], [3.0]]]), SQUARES.t),
            r"1 node\(s\) belong to no quadrilateral: 9; remove them",
        ),
        (
            MeshQuad(
                np.array([[0, 1, 1, 0, 0.3, 0.3], [0, 0, 1, 1, 1, 0.0]]),
                np.array([[0, 1, 2, 3], [3, 0, 5, 4]]).T,
            ),
            r"2 quadrilateral\(s\) overlap a neighbour: 0, 1",
        ),
        (
            MeshQuad(SQUARES.p, np.hstack([SQUARES.t, SQUARES.t[:, :1]])),
            "share an edge with more than one other|on top of a neighbour",
        ),
        (
            MeshQuad(SQUARES.p, np.hstack([SQUARES.t, SQUARES.t])),
            r"8 quadrilateral\(s\) share an edge with more than one other",
        ),
    ],
    ids=[
        *("hexahedra", "nan", "inverted", "collapsed", "bow-tie", "unused", "overlap"),
        *("twice", "thrice"),
    ],
)
@pytest.mark.parametrize("formulation", [Full(), Macro(), Quadratic()], ids=repr)
def test_invalid_meshes_are_rejected(mesh, message, formulation):
    """Messages use the user's numbers, for split, cut and other meshes."""
    with pytest.raises(MeshError, match=message):
        Ply(mesh, Fabric(), formulation)


def test_nearly_flat_corners_and_thin_elements_are_accepted():
    flat = np.array([[0.0, 2.0, 1.0, 0.0], [0.0, 0.0, 1.0 + 1e-2, 2.0]])
    Ply(MeshQuad(flat, np.arange(4)[:, None]), Fabric(), Full())
    Ply(SQUARES.scaled((100.0, 1.0)), Fabric(), Full())


@pytest.mark.parametrize(
    ("fabric", "formulation", "message"),
    [
        (1e4, Full(), "fabric must be a Fabric such as .*, not 10000.0"),
        (Fabric, Full(), "fabric must be a Fabric"),
        (Fabric(), "full", "formulation must be a formulation such as .*, not 'full'"),
        (Fabric(), OnePoint, "formulation must be a formulation such as"),
        (Fabric(), None, "formulation must be a formulation such as"),
    ],
)
def test_invalid_fabrics_and_formulations_are_rejected(fabric, formulation, message):
    with pytest.raises(ValueError, match=message):
        Ply(SQUARES, fabric, formulation)
