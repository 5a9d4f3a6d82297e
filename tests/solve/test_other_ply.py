"""States and displacements of another ply are refused."""

from functools import cache

import numpy as np
import pytest
from skfem import MeshQuad

from skfem_textile import (
    Condition,
    Fabric,
    LoadStepper,
    OnePoint,
    Ply,
    Result,
    Tool,
    drape,
    equilibrium_near,
    forming,
    scenes,
)

MESH = MeshQuad().refined(2).scaled(100.0).with_defaults()
HELD = {"bottom": Condition("bottom"), "top": Condition("top", (5.0, 1.0))}
FABRIC = Fabric(1e4, 0.5, (1, 1), (-1, 1))


def run(fabric, mesh):
    return LoadStepper(Ply(mesh, fabric, OnePoint()), HELD, 2).run()


@cache
def pulled():
    return run(FABRIC, MESH)


@pytest.mark.parametrize(
    "other",
    [
        (FABRIC, MESH.refined()),
        (Fabric(2e4, 0.5, (1, 1), (-1, 1)), MESH),
        (Fabric(1e4, 1.5, (1, 1), (-1, 1)), MESH),
        (FABRIC, MESH.scaled((1.0, 1.1))),
    ],
    ids=["mesh", "tension", "shear", "height"],
)
def test_an_interval_is_not_given_for_a_state_of_another_ply(other):
    with pytest.raises(ValueError, match=r"states of the same run only: use one of "):
        pulled().interval(run(*other).states[-1])


@pytest.mark.parametrize("other", [3, None, np.zeros(162)])
def test_an_interval_is_given_for_states_alone(other):
    with pytest.raises(ValueError, match=r"states of the same run only: use one of "):
        pulled().interval(other)


def test_an_interval_is_given_for_every_state_of_the_run():
    for state in pulled().states[1:]:
        assert pulled().interval(state).load is not None


WITHOUT_OTHERS = (
    *("energy", "energies", "residual", "residuals", "tangent", "parts"),
    *("stiffness", "gradient", "deformation_gradient", "area_ratio"),
    *("fibre_strain", "law_strain", "fibre_tension", "fibre_direction", "shear_angle"),
    *("nodal", "positions", "least_area_ratio", "largest_gradient", "beyond_peak"),
)


@pytest.mark.parametrize("size", [-2, 2])
@pytest.mark.parametrize("method", WITHOUT_OTHERS)
def test_a_displacement_of_another_ply_is_refused(method, size):
    ply = pulled().ply
    u = np.zeros(ply.basis.N + size)
    with pytest.raises(ValueError, match="a displacement of this ply has the shape"):
        getattr(ply, method)(u)


@pytest.mark.parametrize("method", ["energy", "residual", "tangent", "shear_angle"])
def test_a_displacement_is_an_array_of_real_numbers(method):
    ply = pulled().ply
    call, u = getattr(ply, method), ply.basis.zeros()
    with pytest.raises(ValueError, match="array of real numbers, not a list"):
        call(list(u))
    with pytest.raises(ValueError, match="array of real numbers, not complex128"):
        call(u + 0j)


def test_other_functions_refuse_a_displacement_of_another_ply():
    ply, state = pulled().ply, run(FABRIC, MESH.refined()).states[-1]
    for call in (
        lambda: ply.load(state.u, 1.0),
        lambda: ply.updated(ply.parameters_at_rest, state.u),
        lambda: ply.predicted_tension(state.u, state.u),
        lambda: equilibrium_near(ply, HELD, state.u),
        lambda: Result.of_state(ply, HELD, state),
    ):
        with pytest.raises(ValueError, match="a displacement of this ply has the sh"):
            call()


def test_scenes_and_tools_refuse_states_of_others():
    state = pulled().states[-1]
    with pytest.raises(ValueError, match=r"no condition 'right': .* of the scene st"):
        scenes.strip(size=(2, 3)).reaction(state)
    with pytest.raises(ValueError, match=r"no condition 'right': .* of the scene st"):
        scenes.strip(size=(2, 3)).driven_displacement(state)
    tool = Tool(drape.Plane((0, 0, -1)), side=1, name="die")
    ply = Ply(MESH, Fabric(1e4, 0.5), terms=[tool], dimension=3)
    (contact,) = forming.contacts(ply)
    for function in (forming.tool_force, forming.tool_pressure, forming.touching):
        with pytest.raises(ValueError, match="of another ply than the tool 'die'"):
            function(ply, contact, state)
