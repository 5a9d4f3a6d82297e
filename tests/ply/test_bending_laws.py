"""Bending laws: energy, derivatives, the sign of the curvature, and domains."""

import numpy as np
import pytest
from skfem import MeshQuad, MeshTri

from skfem_textile import (
    Bilinear,
    BodyForce,
    Condition,
    Fabric,
    Full,
    LoadStepper,
    Macro,
    OnePoint,
    Ply,
    Polynomial,
    Quadratic,
    Sin2,
    StepError,
    Tabulated,
)
from studies.bending.study import KINDS, RandomLaw
from tests.helpers import random_u, refused
from tests.helpers.plies import square

#: A law that the library does not recognise as linear.
SLOPE = Polynomial((3.0,))
BOTH_SIGNS = Polynomial((3.0, 10.0, 100.0))

FORMULATIONS = [OnePoint(), Macro(), Quadratic()]
every_formulation = pytest.mark.parametrize("formulation", FORMULATIONS)
in_plane_and_space = pytest.mark.parametrize("dimension", [2, 3])


def ply_of(warp, weft, formulation, dimension):
    """A distorted ply of inclined fibres with every kind of fibre end."""
    turn = 0.5 if dimension == 2 else np.array([0.0, 0.5, 0.0])
    ends = {"left": "clamped", "top": "mirror", "right": lambda t: t * turn}
    fibres = {"warp": (1.0, 0.2), "weft": (-0.1, 1.0)}
    fabric = Fabric(50.0, 0.5, bending=(warp, weft), **fibres)
    mesh = square(2, 0.2, 10.0)
    return Ply(mesh, fabric, formulation, dimension=dimension, fibre_ends=ends)


def bending(ply):
    return next(term for term in ply.terms if term.name == "bending")


@every_formulation
@in_plane_and_space
def test_a_straight_law_is_its_stiffness(formulation, dimension):
    """Also beside clamps that rotate, and planes of symmetry."""
    number = bending(ply_of(3.0, 1.0, formulation, dimension))
    law = bending(ply_of(SLOPE, Polynomial((1.0,)), formulation, dimension))
    u = random_u(ply_of(3.0, 1.0, formulation, dimension), 3, 0.1)
    assert law.energy(u, 0.7) == pytest.approx(number.energy(u, 0.7), rel=1e-12)
    np.testing.assert_allclose(
        law.residual(u, 0.7), number.residual(u, 0.7), atol=1e-10
    )
    off = law.tangent(u, 0.7) - number.tangent(u, 0.7)
    assert abs(off).max() < 1e-11 * abs(number.tangent(u, 0.7)).max()


@every_formulation
@in_plane_and_space
@pytest.mark.parametrize("law", [Bilinear(3.0, 0.05, 0.5), BOTH_SIGNS])
def test_forces_and_stiffness_are_derivatives(formulation, dimension, law):
    ply = ply_of(law, law, formulation, dimension)
    term, u, h = bending(ply), random_u(ply, 3, 0.1), 1e-6
    d = random_u(ply, 4, 1.0)
    rise = term.energy(u + h * d, 0.7) - term.energy(u - h * d, 0.7)
    assert rise == pytest.approx(2 * h * term.residual(u, 0.7) @ d, rel=1e-6)
    change = term.residual(u + h * d, 0.7) - term.residual(u - h * d, 0.7)
    Kd = 2 * h * term.tangent(u, 0.7) @ d
    assert np.abs(change - Kd).max() < 1e-6 * np.abs(Kd).max()
    ply.tangent(u, 0.7)  # has room for all couplings


@pytest.mark.parametrize("kind", KINDS)
def test_laws_agree_with_an_independent_evaluation(kind):
    (row,) = RandomLaw(kind, 0).rows()
    for name in ("energy", "force", "tangent"):
        assert abs(row[f"{name}_error"]) < 1e-9


@every_formulation
@pytest.mark.parametrize("upwards", [1, -1])
def test_curvature_towards_the_normal_is_positive(formulation, upwards):
    """A cylinder z = ± ½ κ x²: the energies of both signs of a law that differs."""
    law = Tabulated([-0.1, 0.0, 0.1], [-0.2, 0.0, 0.6])
    ply = Ply(
        *(square(8, side=8.0), Fabric(bending=(law, 0.0)), formulation),
        dimension=3,
    )
    u = np.zeros((ply.nodes.shape[1], 3))
    u[:, 2] = 0.5 * upwards * 0.05 * (ply.nodes[0] - 4.0) ** 2
    energy = ply.energies(u.ravel())["bending"] / 64
    kappa = np.array([upwards * 0.05])
    # along the edge free ends count with the curvature beside them
    assert energy == pytest.approx(law.energy(kappa)[0], rel=0.15)


@every_formulation
def test_curvature_to_the_left_is_positive_in_the_plane(formulation):
    law = Tabulated([-0.1, 0.0, 0.1], [-0.2, 0.0, 0.6])
    ply = Ply(square(8, side=8.0), Fabric(bending=(law, 0.0)), formulation)
    energies = []
    for sign in (1, -1):
        u = np.zeros((ply.nodes.shape[1], 2))
        u[:, 1] = 0.5 * sign * 0.02 * (ply.nodes[0] - 4.0) ** 2
        energies.append(ply.energies(u.ravel())["bending"])
    left, right = law.energy(np.array([0.02, -0.02]))
    assert energies[0] / energies[1] == pytest.approx(left / right, rel=0.05)


@every_formulation
def test_the_energy_does_not_change_with_rigid_rotations(formulation):
    """With a law that differs by sign, whose normal rotates with the ply."""
    ply = Ply(
        *(square(4, 0.2, 8.0), Fabric(bending=(BOTH_SIGNS, BOTH_SIGNS)), formulation),
        dimension=3,
    )
    u = random_u(ply, 1, 0.2).reshape(-1, 3)
    X = np.vstack([ply.nodes, np.zeros(ply.nodes.shape[1])]).T
    turn = np.linalg.qr(np.random.default_rng(0).standard_normal((3, 3)))[0]
    turn *= np.sign(np.linalg.det(turn))
    turned = (X + u) @ turn.T - X
    energies = [ply.energies(x.ravel())["bending"] for x in (u, turned)]
    assert energies[1] == pytest.approx(energies[0], rel=1e-10)


def test_laws_vary_by_region_and_element():
    mesh = square(4, side=8.0)
    left = np.flatnonzero(mesh.p[0, mesh.t].mean(axis=0) < 4)
    right = np.setdiff1d(np.arange(16), left)
    mesh = mesh.with_subdomains({"left": left, "right": right})
    numbers = Fabric(bending=(np.where(np.isin(np.arange(16), left), 1.0, 3.0), 0.0))
    regions = {
        "left": Fabric(bending=(1.0, 0.0)),
        "right": Fabric(bending=(Polynomial((3.0,)), 0.0)),
    }
    for formulation in (Full(), Macro()):
        plies = [Ply(mesh, x, formulation, dimension=3) for x in (numbers, regions)]
        u = random_u(plies[0], 2, 0.1)
        one, other = (ply.energies(u)["bending"] for ply in plies)
        assert other == pytest.approx(one, rel=1e-12)
    at_rest = plies[1].fabric.bending_at_rest[0]
    assert set(at_rest.tolist()) == {1.0, 3.0}


def test_a_run_beyond_a_table_is_refused_and_names_the_curvature():
    law = Tabulated([0.0, 1e-3], [0.0, 1e-2], odd=True)
    mesh = MeshQuad.init_tensor(np.linspace(0, 100, 9), np.linspace(0, 20, 2))
    ply = Ply(
        *(mesh.with_defaults(), Fabric(1e4, 0.1, bending=(law, 0.0)), OnePoint()),
        terms=[BodyForce((0.0, 0.0, -1e-5))],
        dimension=3,
        fibre_ends={"left": "clamped"},
    )
    with pytest.raises(StepError, match=r"warp curvature is .* ends at 0\.001 1/mm"):
        LoadStepper(ply, {"left": Condition("left")}, 10, max_halvings=0).run()


@pytest.mark.parametrize(
    ("law", "message"),
    [
        (Tabulated([0.0, 0.1], [0.0, 1.0]), "both signs of the curvature"),
        (Tabulated([0.0, 1.2], [0.0, 1.0], odd=True), "is the value in 1/m?"),
        (Sin2(1.0), "Sin2 is a law of shear"),
        (Bilinear, "pass an instance"),
        ("stiff", "bending of warp"),
    ],
)
def test_other_laws_are_refused_in_one_line(law, message):
    refused(lambda: Fabric(bending=(law, 0.0)), message)


def test_an_inconsistent_law_is_refused():
    class Wrong(Polynomial):
        def value(self, x):
            return 2 * super().value(x)

    mesh = MeshTri().refined(1)
    refused(
        lambda: Ply(mesh, Fabric(bending=(0.0, Wrong((1.0,))))),
        "bending of weft law, value",
    )


def test_numbers_have_a_constant_matrix():
    fabric = Fabric(bending=(Polynomial((1.0,)), 2.0))
    assert fabric.bending_at_rest == (1.0, 2.0)
    ply = Ply(square(2, side=8.0), fabric, OnePoint(), dimension=3)
    assert [x.name for x in bending(ply).bent] == ["warp"]
    assert bending(Ply(square(2, side=8.0), Fabric(bending=(1.0, 2.0)))).bent == []
