"""Plies whose laws have friction: derivatives, slip, and energy lost."""

import numpy as np
import pytest
from skfem import MeshQuad

from skfem_textile import (
    CrimpToe,
    Fabric,
    Full,
    Linear,
    Macro,
    OnePoint,
    Ply,
    Quadratic,
    Sin2,
    WithFriction,
)
from skfem_textile.fabric import along
from tests.helpers import assert_derivatives, distorted_for, random_u

FORMULATIONS = {
    "macro": Macro(),
    "one point": OnePoint(),
    "quadratic": Quadratic(),
    "quadratic, mean": Quadratic(80.0),
    "full": Full(),
}
TENSION = WithFriction(CrimpToe(1e3, 0.01, 50.0), [2.0, 3.0], [0.01, 0.03])
SHEAR = WithFriction(Sin2(2.0), [0.1, 0.2, 0.1], [0.02, 0.05, 0.2])


@pytest.mark.parametrize("dimension", [2, 3])
@pytest.mark.parametrize("formulation", FORMULATIONS.values(), ids=FORMULATIONS)
def test_residual_and_tangent_are_derivatives_after_slip(formulation, dimension):
    mesh, bending = distorted_for(formulation, 1), (1.0, 1.0)
    fabric = Fabric((TENSION, Linear(5e2)), SHEAR, (2, 1), (-1, 3), bending=bending)
    ply = Ply(mesh, fabric, formulation, dimension=dimension)
    p = ply.advanced(ply.parameters_at_rest, random_u(ply, 1, 1.0))
    u = random_u(ply, 2, 1.0)
    assert ply.energy_lost(u, 1.0, p).keys() == {"tension", "shear"}
    assert_derivatives(ply, u, random_u(ply, 3, 1.0), p, 5e-6, rel=1e-6)


def sheared(ply, gamma):
    """Displacement of a simple shear without fibre strain."""
    x, y = ply.nodes
    u = np.zeros((2, x.size))
    u[0], u[1] = y * np.sin(gamma), y * (np.cos(gamma) - 1)
    return u.T.ravel()


@pytest.mark.parametrize("formulation", FORMULATIONS.values(), ids=FORMULATIONS)
def test_a_homogeneous_shear_loses_the_energy_of_the_law(formulation):
    ply = Ply(MeshQuad().refined(1), Fabric(1e4, SHEAR), formulation)
    path = np.array([0.5, -0.1, 0.3, 0.7])
    p, total, before = ply.parameters_at_rest, 0.0, 0.0
    for gamma in path:
        u = sheared(ply, gamma)
        lost = ply.energy_lost(u, 1.0, p)["shear"]
        total = ply.energy(u, 1.0, p)
        p = ply.advanced(p, u)
        assert ply.energy(u, 1.0, p) == pytest.approx(total, rel=1e-12)
        assert lost > before
        before = lost
    _, density = along(SHEAR, path)
    assert lost == pytest.approx(density, rel=1e-12)
    stored = SHEAR.law.energy(path[-1]) + 0.5 * sum(
        f * y for f, y in zip(SHEAR.limits, SHEAR.onsets, strict=True)
    )
    assert total - lost == pytest.approx(stored, rel=1e-12)


def test_a_fabric_of_regions_has_friction_where_its_law_has():
    mesh = (
        MeshQuad()
        .refined(1)
        .with_subdomains({"one": np.array([0, 1]), "other": np.array([2, 3])})
    )
    fabrics = {"one": Fabric(1e4, SHEAR), "other": Fabric(1e4, Sin2(2.0))}
    ply = Ply(mesh, fabrics, Full())
    lost = ply.energy_lost(sheared(ply, 0.5))["shear"]
    assert lost == pytest.approx(0.5 * along(SHEAR, np.array([0.5]))[1], rel=1e-12)


def test_a_ply_without_friction_has_no_slip():
    ply = Ply(MeshQuad(), Fabric(1e4, 1.0), Full())
    assert not ply.parameters_at_rest
    assert not ply.energy_lost(ply.basis.zeros())


def test_friction_is_no_deviation_from_the_mean_stretch():
    """A homogeneous stretch has none, also after slip."""
    ply = Ply(MeshQuad().refined(1), Fabric(TENSION, SHEAR), Macro())
    p = ply.advanced(ply.parameters_at_rest, 0.05 * ply.nodes.T.ravel())
    u = 0.02 * ply.nodes.T.ravel()
    (deviation,) = (x for x in ply.parts(u, 1.0, p) if x.role == "deviation")
    assert abs(deviation.energy) < 1e-12 * ply.energy(u, 1.0, p)
    assert np.abs(deviation.forces).max() < 1e-9
