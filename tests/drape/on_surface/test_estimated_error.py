"""The error of plies on surfaces is estimated, and refined away."""

import numpy as np
import pytest
from laid_plies import positions

from skfem_textile import AdaptiveStepper, Macro, OnePoint, equilibrium_near
from skfem_textile.solve.stepping import error_estimate
from skfem_textile.solve.stepping.error_estimate import estimated_error, problem_at
from studies.formulations.drape import chebyshev


def of_constant_angles(ply, u):
    """Root-mean-square error in radians of the angle that is constant in an element."""
    xi = (np.indices((8, 8)).reshape(2, -1) + 0.5) / 8
    exact = chebyshev.shear_angle(ply.basis.mapping.F(xi))
    off = ply.shear_angle(u).mean(axis=1)[:, None] - exact
    return float(np.sqrt(np.mean(off**2)))


@pytest.mark.parametrize("formulation", [Macro(), OnePoint()])
def test_the_error_is_estimated_on_a_surface(formulation):
    cells = 8 if isinstance(formulation, Macro) else 16
    ply, conditions, start = chebyshev.problem(formulation, cells)
    state = equilibrium_near(ply, conditions, start)
    found = estimated_error(ply, conditions, "superlu", state)
    error = of_constant_angles(ply, state.u)
    assert 0.8 * error < found.shear_angle < 1.6 * error
    assert found.load < 0.1


def test_the_estimate_is_of_a_finer_ply_on_the_surface():
    ply, conditions, start = chebyshev.problem(OnePoint(), 4)
    state = equilibrium_near(ply, conditions, start, warn_only=["stabilisation"])
    finer = ply.finer()
    fine = problem_at(finer.ply, conditions, "superlu", 1.0)
    carried, tension = finer.carry(state.u)
    assert not fine.surfaces.are_on(carried, 1.0)
    u, _ = error_estimate._moved(fine, carried, tension, np.zeros(2))
    assert fine.surfaces.are_on(u, 1.0)


def test_a_run_to_a_tolerance_refines_on_a_surface():
    ply, conditions, _ = chebyshev.problem(Macro(), 4)
    result = AdaptiveStepper(
        ply, conditions, 0.05, steps=4, warn_only=["stabilisation", "deviation"]
    ).run()
    assert result.tolerance_met
    assert result.ply.basis.N > ply.basis.N
    x = positions(result.ply, result.u)
    np.testing.assert_allclose(chebyshev.SPHERE.level(x), 0.0, atol=1e-8)
