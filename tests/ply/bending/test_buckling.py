"""Compressed plies: where they buckle, with and without bending."""

import numpy as np
import pytest

from skfem_textile import Condition, Fabric, OnePoint, Ply
from skfem_textile.solve.conditions import Constraints
from skfem_textile.solve.linear import solver_named
from skfem_textile.solve.problem import Problem, Tangent
from tests.helpers.bent_plies import SIDE, square

IN_PLANE = {
    "left": Condition("left"),
    "right": Condition("right"),
    "plane": Condition(lambda X: X[0] > -1, (None, None, 0.0)),
}


def critical_tension(n, stiffness, conditions, guess):
    """Where fibres along x, compressed evenly, are no more stable."""
    E = 1e5
    fabric = Fabric(E, 0.1, bending=(stiffness, stiffness))
    ply = Ply(square(n).with_defaults(), fabric, OnePoint(), dimension=3)
    constraints = Constraints(ply.basis, conditions)
    problem = Problem(ply, constraints, solver_named("superlu")).at(1.0)
    low, high = 1.9 * guess, 0.0  # no middle is the guess, where it is singular
    for _ in range(14):
        u, middle = ply.basis.zeros(), (low + high) / 2
        u[::3] = np.expm1(middle / E) * ply.nodes[0]
        stable = Tangent(problem, u, ply.parameters_at_rest).definite
        low, high = (low, middle) if stable else (middle, high)
    return high


@pytest.mark.parametrize("n", [4, 8])
def test_an_inextensible_net_buckles_in_its_plane_at_minus_its_shear_stiffness(n):
    """T = −G without bending (Rosen)."""
    assert critical_tension(n, 0.0, IN_PLANE, -0.1) == pytest.approx(-0.1, rel=5e-3)


@pytest.mark.parametrize("stiffness", [10.0, 100.0])
def test_bending_holds_a_net_that_buckles_in_its_plane(stiffness):
    """T = −(G + D (π/L)²)."""
    exact = -(0.1 + stiffness * (np.pi / SIDE) ** 2)
    found = critical_tension(16, stiffness, IN_PLANE, exact)
    assert found == pytest.approx(exact, rel=5e-3)


@pytest.mark.parametrize("stiffness", [0.1, 10.0, 1000.0])
def test_a_ply_that_is_held_all_round_buckles_out_of_its_plane(stiffness):
    """T = −2 D (π/L)²."""
    sides = ("left", "right", "bottom", "top")
    conditions = {side: Condition(side) for side in sides}
    exact = -2 * stiffness * (np.pi / SIDE) ** 2
    found = critical_tension(16, stiffness, conditions, exact)
    assert found == pytest.approx(exact, rel=1e-2)
