"""What drives a ply on a surface: its loads, or the surface."""

import pytest

from skfem_textile import (
    BodyForce,
    Fabric,
    LoadStepper,
    Macro,
    OnSurface,
    Ply,
    equilibrium_near,
)
from skfem_textile.drape import Sphere
from skfem_textile.scenes.tools import hemisphere
from skfem_textile.solve.continuation import loads_drive, moves
from tests.helpers.laid_plies import RADIUS, SYMMETRY, laid, problem_of, square


def weight(w):
    return BodyForce((0.0, 0.0, -w))


@pytest.mark.parametrize(("w", "drives"), [(1e-12, False), (1e-5, False), (1e-2, True)])
def test_a_load_drives_a_ply_on_a_tool_if_it_does_most_of_the_work(w, drives):
    tool = Sphere(RADIUS, (0.0, 0.0, -RADIUS))
    ply = square(30.0, 4, Fabric(1e3, 0.1, bending=(1.0, 1.0)), loads=[weight(w)])
    conditions = {"on": OnSurface(tool)} | SYMMETRY
    state = equilibrium_near(ply, conditions, laid(ply, tool))
    problem = problem_of(ply, conditions).at(1.0)
    place = state.u, state.parameters, state.energies
    assert loads_drive(problem, *place, moves(problem, [1.0])) == drives


@pytest.mark.long
def test_a_light_ply_takes_the_way_of_one_without_weight():
    """A step that is hard for the ply is not one whose load passes a limit."""
    scene = hemisphere(
        size=(6, 6), radius=60.0, width=120.0, height=120.0, tension=0.0, part="quarter"
    )
    fabric = Fabric(1e4, 0.1, scene.warp, scene.weft, bending=(1.0, 1.0))
    loads = [*scene.loads_of(fabric), weight(1e-12)]
    options = {"dimension": 3, "fibre_ends": scene.fibre_ends}
    ply = Ply(scene.mesh, fabric, Macro(), loads, **options)
    assert LoadStepper(ply, scene.conditions, 4).run().converged
