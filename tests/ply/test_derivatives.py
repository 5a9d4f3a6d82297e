"""Residual and tangent are derivatives at any parameters, which are held fixed.

Central differences of fourth order: energies to 1e-7 of their slope, forces to 1e-6.
"""

import numpy as np
import pytest

from skfem_textile import (
    CrimpToe,
    Fabric,
    Full,
    Macro,
    OnePoint,
    Ply,
    Pressure,
    Quadratic,
    Sin2,
    Values,
)
from tests.helpers import assert_derivatives, derivative, distorted_for, random_u

FORMULATIONS = {
    "macro": Macro(),
    "one point": OnePoint(),
    "one point, C_s": OnePoint(2.0),
    "isotropic": OnePoint(2.0, "isotropic"),
    "quadratic": Quadratic(),
    "quadratic, mean": Quadratic(80.0),
    "full": Full(),
}
WITH_STIFFNESSES = Macro(), OnePoint(), Quadratic(80.0)

LAWS = CrimpToe(1e3, 0.01, 50.0), Sin2(2.0)
FIBRES = {"warp": (2, 1), "weft": (-1, 3)}

# Displacements in mm of a difference; elements have a size of about 1 mm.
_STEP = 5e-6


def parameters_at(ply, u):
    """Parameters after a step to a displacement."""
    return ply.advanced(ply.updated(ply.parameters_at_rest, u), u)


def check(ply, u, before):
    """Derivatives at ``u``, with the parameters of another displacement."""
    parameters = parameters_at(ply, before)
    changed = ply.energy(u, 1.0, parameters) != ply.energy(u)
    assert changed == (ply.formulation in WITH_STIFFNESSES)
    du = random_u(ply, 3, 1.0)
    assert_derivatives(ply, u, du, parameters, _STEP, rel=1e-7)


@pytest.mark.parametrize("formulation", FORMULATIONS.values(), ids=FORMULATIONS)
def test_residual_and_tangent_are_derivatives_in_space_with_bending(formulation):
    """Under a pressure that follows the surface."""
    mesh = distorted_for(formulation, 1).with_defaults()
    fabric = Fabric(*LAWS, **FIBRES, bending=(3.0, 1.0), twist=0.5)
    ply = Ply(mesh, fabric, formulation, [Pressure(0.7)], dimension=3)
    x, y = ply.nodes
    u, before = random_u(ply, 2, 0.01), 2 * random_u(ply, 1, 0.01)
    u[2::3] += 0.3 * np.sin(x) * np.cos(y)
    before[2::3] += 0.4 * np.sin(y)
    check(ply, u, before)


def test_the_error_of_the_tangent_of_rates_is_proportional_to_the_moments():
    """It neglects changes of the area, and of the hourglass matrix at the centre.

    At the start of a step without moments it is exact.
    """
    fabric, formulation = Fabric(*LAWS, **FIBRES), OnePoint(2.0, "rate")
    ply = Ply(distorted_for(formulation, 1), fabric, formulation)
    u, du = random_u(ply, 1), random_u(ply, 2, 1.0)
    values = parameters_at(ply, u)["stabilisation"]

    def error(share):
        p = {"stabilisation": Values(values | {"moment": share * values["moment"]})}
        change = derivative(lambda x: ply.residual(x, 1.0, p), u, du)
        K = ply.tangent(u, 1.0, p)
        assert abs(K - K.T).max() < 1e-12 * abs(K).max()
        return np.abs(K @ du - change).max() / np.abs(change).max()

    assert error(0.0) < 1e-6
    assert 1e-5 < error(1.0) < 1e-3
    assert error(0.1) == pytest.approx(0.1 * error(1.0), rel=0.05)
