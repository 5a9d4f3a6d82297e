"""A ply that nothing stops is refused, and tools restrain only what they touch."""

import numpy as np
import pytest
from skfem import MeshQuad

from skfem_textile import (
    BodyForce,
    Condition,
    Fabric,
    LoadStepper,
    OnSurface,
    Ply,
    StepError,
    Tool,
    drape,
)

IN_PLANE = {
    "x": Condition("left", (0.0, None, None)),
    "y": Condition("bottom", (None, 0.0, None)),
}
PULLED = IN_PLANE | {"pull": Condition("right", (1.0, None, None))}


def run(terms, conditions=IN_PLANE, steps=1):
    s = np.linspace(-80, 80, 5)
    mesh = MeshQuad.init_tensor(s, s).with_defaults()
    fabric = Fabric(1e3, 0.1, bending=(5.0, 5.0))
    ply = Ply(mesh, fabric, terms=terms, dimension=3)
    return LoadStepper(ply, conditions, steps).run()


def _on_edges(X):
    return np.abs(X).max(axis=0) > 79


def punch(travel):
    motion = travel if callable(travel) else (0, 0, travel)
    return Tool(drape.Sphere(40.0, (0, 0, -40.1)), motion=motion, name="punch")


def plate(height, side):
    return Tool(drape.Plane((0, 0, height)), side=side, name="plate")


def test_a_ply_that_flies_away_is_no_equilibrium():
    weight = BodyForce((0, 0, 1e-4), factor=1.0)
    with pytest.raises(StepError, match=r"moves by .* far beyond its size"):
        run([weight, punch(25.0)])


def test_a_ply_on_a_surface_flies_if_it_is_far_from_where_the_surface_is():
    s = np.linspace(-80, 80, 5)
    ply = Ply(MeshQuad.init_tensor(s, s), Fabric(1e3, 0.1), dimension=3)
    on = {"ball": OnSurface(drape.Sphere(200.0, (0, 0, -200.0)))}
    problem, fixed = LoadStepper(ply, on, 1).problem, np.zeros(0)
    assert not problem.flies(np.full(ply.basis.N, 1e4), fixed)
    assert problem.flies(np.full(ply.basis.N, 1e5), fixed)


def test_a_plate_stops_it():
    weight = BodyForce((0, 0, 1e-4), factor=1.0)
    last = run([weight, punch(5.0), plate(30.0, -1)]).states[-1]
    assert last.reactions["plate"][2] == pytest.approx(-2.56, rel=1e-6)
    assert last.tolerance < 1e-3 * 2.56 / 25
    assert np.abs(last.u).max() == pytest.approx(30.0, rel=1e-3)


def test_a_tool_that_touches_nothing_restrains_nothing():
    with pytest.raises(StepError, match="a mechanism is present; try supports, or a"):
        run([punch(-10.0)], PULLED)


def test_tools_on_both_sides_restrain_a_ply_that_touches_neither():
    last = run([punch(0.0), plate(1.0, -1)], PULLED).states[-1]
    assert last.verdict.stable
    assert not last.reactions["plate"].any()


def test_a_ply_may_wait_for_its_tools():
    held = {"edges": Condition(_on_edges)}
    states = run([punch(lambda t: (0, 0, 8 * t - 4))], held, 4).states
    touched = [state.reactions["punch"][2] > 0 for state in states]
    assert touched == [False, False, False, True, True]
