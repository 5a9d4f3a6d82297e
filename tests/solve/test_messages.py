"""Messages about arguments, displacements of other plies, and solvers.

Those about conditions and settings in the plane are in `test_hostile_arguments`.
"""

import sys
from functools import cache, partial

import numpy as np
import pytest
from skfem import MeshQuad

from skfem_textile import (
    Condition,
    ErrorInterval,
    Fabric,
    LoadStepper,
    OnePoint,
    Ply,
    Result,
    ToleranceStepper,
    Tool,
    contact,
    drape,
    equilibrium_near,
    scenes,
)
from skfem_textile.mesh.bases import GAUSS, quad_basis
from skfem_textile.solve.conditions import Constraints
from skfem_textile.solve.linear import check_solver, solver_named
from skfem_textile.solve.linear import solver as linear
from tests.helpers import refused

SQUARE = MeshQuad().refined(2).with_defaults()
IN_SPACE = quad_basis(SQUARE, GAUSS, 3)


IN_SPACE_ONLY = [
    (Condition("top", (1.0, 2.0)), r"must have shape \(3, 5\), not \(2,\)"),
    (Condition("top", (1.0, None)), "must have 3 components"),
    (Condition("top", (None, None, None)), "must have 3 components"),
    (Condition("top", (1, None, 2), (0, 0, 1)), "cannot be combined with a direction"),
    (Condition("top", (1, None, np.zeros(4))), "must be real-valued"),
    (Condition("top", 1.0, direction=(0, 1)), r"shape \(3, n_elements\)"),
    (Condition("top", (1, None, np.inf)), "not finite"),
]


@pytest.mark.parametrize(("condition", "text"), IN_SPACE_ONLY)
def test_a_condition_in_space_has_three_components(condition, text):
    def resolved():
        Constraints(IN_SPACE, {"c": condition}).fixed_values(1.0)

    refused(resolved, f"condition 'c'.*{text}")


# States and displacements of another ply

MESH = SQUARE.scaled(100.0)
HELD = {"bottom": Condition("bottom"), "top": Condition("top", (1.0, 5.0))}
FABRIC = Fabric(1e4, 0.5, (1, 1), (-1, 1))
OTHERS = {
    "mesh": (FABRIC, MESH.refined()),
    "tension": (Fabric(2e4, 0.5, (1, 1), (-1, 1)), MESH),
    "shear": (Fabric(1e4, 1.5, (1, 1), (-1, 1)), MESH),
    "height": (FABRIC, MESH.scaled((1.0, 1.1))),
}


@cache
def run(other=None):
    fabric, mesh = OTHERS[other] if other else (FABRIC, MESH)
    return LoadStepper(Ply(mesh, fabric, OnePoint()), HELD, 1).run()


@pytest.mark.parametrize("other", OTHERS)
def test_an_interval_is_not_given_for_a_state_of_another_ply(other):
    state = run(other).states[-1]
    refused(lambda: run().interval(state), "states of the same run only: use one of ")


def test_an_interval_is_given_for_states_alone():
    for other in (3, None, np.zeros(162)):
        refused(lambda x=other: run().interval(x), "states of the same run only: use ")
    refused(lambda: ErrorInterval(reason="why").of(len), "there is no interval: why")
    for value in (np.zeros(2), np.eye(2), np.nan, None, "1"):
        refused(lambda x=value: run().error.of(lambda *_: x), "the quantity must be")


OF_DISPLACEMENTS = (
    *("energy", "energies", "residual", "residuals", "tangent", "parts"),
    *("stiffness", "gradient", "deformation_gradient", "area_ratio"),
    *("fibre_strain", "law_strain", "fibre_tension", "fibre_direction", "shear_angle"),
    *("nodal", "positions", "least_area_ratio", "largest_gradient"),
)


def test_a_displacement_of_another_ply_is_refused():
    ply, state, text = run().ply, run("mesh").states[-1], "of this ply has the shape"
    calls = [
        *(partial(getattr(ply, name), state.u) for name in OF_DISPLACEMENTS),
        *(partial(getattr(ply, name), state.u[:160]) for name in OF_DISPLACEMENTS),
        partial(ply.load, state.u, 1.0),
        partial(ply.updated, ply.parameters_at_rest, state.u),
        partial(ply.predicted_tension, state.u, state.u),
        partial(equilibrium_near, ply, HELD, state.u),
        *(partial(Result.of_state, ply, HELD, x) for x in (state, None, np.zeros(3))),
    ]
    for call in calls:
        refused(call, text)
    refused(partial(Result.of_state, ply, HELD, "u"), "u must be real-valued, got 'u'")
    nan = ply.basis.zeros() + np.nan
    refused(partial(Result.of_state, ply, HELD, nan), "u must be finite")


def test_a_displacement_is_an_array_of_real_numbers():
    ply, u = run().ply, run().ply.basis.zeros()
    for name in ("energy", "residual", "tangent", "shear_angle"):
        call = getattr(ply, name)
        refused(partial(call, list(u)), "array of real numbers, not a list")
        refused(partial(call, u + 0j), "array of real numbers, not complex128")


def test_scenes_and_tools_refuse_states_of_others():
    state, strip = run().states[-1], scenes.strip(size=(2, 3))
    for call in (strip.reaction, strip.driven_displacement):
        refused(partial(call, state), r"no condition 'right': .* of the scene st")
    tool = Tool(drape.Plane((0, 0, -1)), side=1, name="die")
    ply = Ply(MESH, Fabric(1e4, 0.5), terms=[tool], dimension=3)
    (die,) = contact.contacts(ply)
    for function in (contact.tool_force, contact.tool_pressure, contact.touching):
        call = partial(function, ply, die, state)
        refused(call, "of another ply than the tool 'die'")


# Runs to a tolerance, and linear solvers


def stepper(density):
    return LoadStepper(Ply(SQUARE, FABRIC, OnePoint()), HELD, 1)


TOLERANCES = [
    *(
        ({"tolerance": x}, r"tolerance must be (between|a number)")
        for x in (0.0, 1.0, -0.1, np.nan, "0.1", None)
    ),
    *(
        ({name: x}, f"{name} must be a number above 0")
        for name in ("density", "most_unknowns")
        for x in (0, -1, np.nan, np.inf, "1", None)
    ),
    ({"most_unknowns": 49}, "has 50 unknowns, more than most_unknowns"),
]


@pytest.mark.parametrize(("arguments", "text"), TOLERANCES, ids=str)
def test_arguments_of_a_tolerance_are_refused_before_any_work(arguments, text):
    refused(lambda: ToleranceStepper(stepper, **{"tolerance": 0.1} | arguments), text)


def test_a_run_to_a_tolerance_cannot_be_resumed():
    refused(lambda: ToleranceStepper(stepper, 0.1).run(resume=True), "cannot be resume")


def test_a_missing_broken_or_unknown_solver_is_named(monkeypatch):
    text = "choose one of auto, cholmod, pardiso, rslab, superlu, petsc"
    refused(lambda: solver_named("umfpack"), text)
    monkeypatch.setitem(sys.modules, "cvxopt.cholmod", None)
    text = "'cholmod' needs cvxopt: pip install cvxopt"
    refused(lambda: solver_named("cholmod"), text)

    def broken(name):
        raise ImportError("a library is missing")

    monkeypatch.setattr(linear, "import_module", broken)
    refused(lambda: check_solver("rslab"), "import: ImportError: a library is missing")
