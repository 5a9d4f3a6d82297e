"""States hold all on which their energies and forces depend."""

import numpy as np
import pytest

from skfem_textile import (
    Fabric,
    Full,
    LoadStepper,
    Macro,
    OnePoint,
    Ply,
    Quadratic,
    Sin2,
    Traction,
    equilibrium_near,
)
from skfem_textile.scenes import bias_extension
from skfem_textile.solve.conditions import Constraints
from tests.helpers import place_of

FORMULATIONS = {
    "macro": Macro(),
    "one point": OnePoint(),
    "one point, C_s": OnePoint(4.0),
    "rate": OnePoint(1.0, "rate"),
    "quadratic": Quadratic(),
    "quadratic, mean": Quadratic(80.0),
    "full": Full(),
}
every_formulation = pytest.mark.parametrize(
    "formulation", FORMULATIONS.values(), ids=FORMULATIONS
)


def extended(formulation):
    """Ply and conditions of a bias extension, its sides under a traction."""
    scene = bias_extension(size=(4, 8))
    fabric = Fabric(1e4, Sin2(0.5), scene.warp, scene.weft)
    loads = [Traction(side, (0.0, 0.002)) for side in ("left", "right")]
    return Ply(scene.mesh, fabric, formulation, loads), scene.conditions


@every_formulation
def test_the_parameters_of_a_state_give_its_energies_and_forces(formulation):
    ply, conditions = extended(formulation)
    free = Constraints(ply.basis, conditions).free
    states = LoadStepper(ply, conditions, 2).run().states
    assert len(states) > 2
    for state in states:
        assert state.parameters.keys() == ply.parameters_at_rest.keys()
        energies = ply.energies(*place_of(state))
        assert energies == state.energies | state.potentials
        f = ply.residual(*place_of(state))
        assert np.abs(f[free]).max() <= state.tolerance
        for name, reaction in state.reactions.items():
            nodes = conditions[name].nodes(name, ply.basis)
            np.testing.assert_array_equal(ply.nodal(f)[:, nodes].sum(axis=1), reaction)


@pytest.mark.parametrize("formulation", [Macro(), OnePoint(), Quadratic(80.0)])
def test_other_parameters_do_not_balance_a_state(formulation):
    ply, conditions = extended(formulation)
    free = Constraints(ply.basis, conditions).free
    last = LoadStepper(ply, conditions, 2).run().states[-1]
    f = ply.residual(last.u, last.load_factor)
    assert np.abs(f[free]).max() > 1e3 * last.tolerance
    assert ply.energies(last.u) != last.energies | last.potentials


@pytest.mark.parametrize("formulation", [Macro(), OnePoint(), Quadratic(80.0)])
def test_a_state_is_found_again_from_its_displacement_and_parameters(formulation):
    ply, conditions = extended(formulation)
    last = LoadStepper(ply, conditions, 2).run().states[-1]
    place, warn_only = (ply, conditions, last.u), ("stabilisation", "deviation")
    near, far = (
        equilibrium_near(*place, parameters=parameters, warn_only=warn_only)
        for parameters in (last.parameters, None)
    )
    assert near.linear_solves < far.linear_solves
    energy, found = (sum(state.energies.values()) for state in (last, near))
    assert found == pytest.approx(energy, rel=1e-2)
    np.testing.assert_allclose(near.u, last.u, atol=1e-2)
