"""Error intervals of forces and angles of plies between tools."""

import numpy as np
import pytest
from skfem import MeshQuad

from skfem_textile import Condition, Fabric, LoadStepper, Ply, Tool, drape
from skfem_textile.solve import between_nodes
from skfem_textile.solve.between_nodes import changes_of_tools, pushed_out
from skfem_textile.solve.conditions import Constraints
from skfem_textile.solve.interval import work_of
from skfem_textile.solve.linear import solver_named
from skfem_textile.solve.problem import Problem, Tangent
from tests.helpers.forming import over_punch

EDGES = {name: Condition(name) for name in ("left", "right", "top", "bottom")}


def pushed_by_sphere(cells=4, thickness=0.0):
    """Square ply with held edges, pushed up by a sphere."""
    x = np.linspace(-50, 50, cells + 1)
    mesh = MeshQuad.init_tensor(x, x).with_defaults()
    sphere = drape.Sphere(30.0, (0, 0, -30.0 - thickness / 2))
    motion = (0, 0, 20.0 + thickness / 2)
    punch = Tool(sphere, motion=motion, side=1, thickness=thickness, name="punch")
    fabric = Fabric(10.0, shear=0.5, bending=(1.0, 1.0))
    ply = Ply(mesh, fabric, terms=[punch], dimension=3)
    return LoadStepper(ply, EDGES, steps=1).run()


@pytest.fixture(scope="module")
def pushed():
    return pushed_by_sphere()


def problem_of(result):
    constraints = Constraints(result.ply.basis, EDGES)
    return Problem(result.ply, constraints, solver_named("superlu")).at(1.0)


def test_the_work_of_tools_is_their_force_along_their_travel(pushed):
    state = pushed.states[-1]
    force = state.reactions["punch"][2]
    assert force > 1.0
    assert work_of(problem_of(pushed), state) == pytest.approx(20.0 * force, rel=1e-3)


def test_pushing_out_is_the_derivative_by_the_thickness(pushed, monkeypatch):
    """A ply that is thicker by 2 mm is pushed out by 1 mm."""
    monkeypatch.setattr(between_nodes, "_mean_depth", lambda x, el, n: np.ones(n))
    problem, state = problem_of(pushed), pushed.states[-1]
    tangent = Tangent.at(problem, state.u, state.parameters)
    response = pushed_out(problem, tangent, state)
    work, forces = changes_of_tools(problem, state, response)
    h = 1e-3
    thicker = pushed_by_sphere(thickness=2 * h).states[-1]
    assert response.motion == pytest.approx((thicker.u - state.u) / h, abs=0.02)
    change = (thicker.reactions["punch"] - state.reactions["punch"])[2] / h
    assert forces["punch"][2] == pytest.approx(change, rel=0.02)
    assert work == pytest.approx(20.0 * change, rel=0.02)


def test_the_interval_contains_the_force_of_a_finer_mesh(pushed):
    finer = pushed_by_sphere(8)
    error = pushed.error
    force, expected = (x.states[-1].reactions["punch"][2] for x in (pushed, finer))
    half = error.reactions["punch"][2]
    assert abs(force - expected) < half < 0.5 * force
    assert error.load == pytest.approx(half / force, rel=0.05)
    summary = pushed.summary()
    assert summary["punch_force_N_half_width"] == pytest.approx(half)
    assert summary["error_interval"].endswith("and the contact between nodes")
    assert "±" in repr(pushed)


def test_the_largest_angle_is_recovered_with_an_interval(hemisphere):
    key = "recovered_max_shear_angle_deg"
    finer = LoadStepper(*over_punch((0.0, 0.0, 15.0), 6), steps=1).run().summary()
    summary = hemisphere.summary()
    half = summary[f"{key}_half_width"]
    assert abs(summary[key] - finer[key]) < half < 10
    assert finer[f"{key}_half_width"] < half


def test_half_widths_of_a_quarter_are_those_of_the_whole_ply(hemisphere):
    summary = hemisphere.summary()
    of_quarter = summary["punch_force_N_half_width"]
    assert summary["punch_force_on_whole_ply_N_half_width"] == 4 * of_quarter > 0
