"""Reactions of conditions that share nodes, and their prescribed displacements."""

import numpy as np
import pytest
from skfem import MeshQuad

from skfem_textile import (
    Condition,
    Fabric,
    Force,
    Full,
    LoadStepper,
    OnSurface,
    Ply,
    StepError,
    Tabulated,
    drape,
)
from skfem_textile.solve.conditions import Constraints, reactions, travels
from skfem_textile.solve.states import State
from tests.helpers import forces_of

MESH = MeshQuad().refined(2).with_defaults()
PLY = Ply(MESH, Fabric(100.0, 5.0), Full())


def solved(conditions, ply=PLY) -> State:
    return LoadStepper(ply, conditions, steps=1).run().states[-1]


def test_reactions_of_clamp_pull_and_roller_sum_to_the_opposite_of_the_load():
    conditions = {
        "clamp": Condition("bottom"),
        "pull": Condition("top", (0.1, 0.2)),
        "roller": Condition("right", lambda X, t: 0.1 * t * X[1], direction=(1, 0)),
    }
    state = solved(conditions)
    largest = max(np.abs(r).max() for r in state.reactions.values())
    assert np.abs(sum(state.reactions.values())).max() < 1e-7 * largest
    assert np.abs(sum(state.forces.values())).max() > 0.01 * largest
    loaded = Ply(MESH, Fabric(100.0, 5.0), Full(), terms=[Force("left", (3.0, -2.0))])
    total = sum(solved(conditions, loaded).reactions.values())
    np.testing.assert_allclose(total, (-3.0, 2.0), atol=1e-8)


def resolved(forces, dimension=2, u=None, t=1.0, **conditions):
    """Reactions of conditions on nodes, with a nodal force on each node given."""
    ply = Ply(MESH, Fabric(100.0, 5.0), Full(), dimension=dimension)
    f = np.zeros((dimension, ply.nodes.shape[1]))
    for node, force in forces.items():
        f[:, node] = force
    u = np.zeros(ply.basis.N) if u is None else u
    return reactions(Constraints(ply.basis, conditions), f, u, t)


def test_a_component_that_two_conditions_fix_is_divided_equally():
    shared = resolved(
        {3: (6.0, 4.0)},
        clamp=Condition([0, 3]),
        roller=Condition([3, 5], direction=(1, 0)),
        other=Condition([3], (0.0, None)),
    )
    np.testing.assert_allclose(shared["clamp"], (2.0, 4.0), atol=1e-12)
    np.testing.assert_allclose(shared["roller"], (2.0, 0.0), atol=1e-12)
    np.testing.assert_allclose(shared["other"], (2.0, 0.0), atol=1e-12)


def test_a_component_that_one_condition_fixes_belongs_to_it():
    shared = resolved(
        {3: (6.0, 4.0), 5: (1.0, 7.0)},
        x=Condition([3, 5], direction=(1, 0)),
        y=Condition([3], direction=(0, 1)),
    )
    np.testing.assert_allclose(shared["x"], (7.0, 0.0), atol=1e-12)
    np.testing.assert_allclose(shared["y"], (0.0, 4.0), atol=1e-12)


def test_each_of_two_inclined_rollers_pushes_across_its_slope():
    n, m = np.array([0.6, 0.8]), np.array([0.0, 1.0])
    shared = resolved(
        {3: 2.0 * n - 5.0 * m},
        one=Condition([3], direction=n),
        other=Condition([3], direction=m),
    )
    np.testing.assert_allclose(shared["one"], 2.0 * n, atol=1e-12)
    np.testing.assert_allclose(shared["other"], -5.0 * m, atol=1e-12)


def test_an_inclined_roller_on_a_clamped_node_carries_half_across_its_slope():
    n, force = np.array([0.6, 0.8]), np.array([1.0, 3.0])
    shared = resolved(
        {3: force}, clamp=Condition([3]), roller=Condition([3], direction=n)
    )
    np.testing.assert_allclose(shared["roller"], 0.5 * (n @ force) * n, atol=1e-12)
    np.testing.assert_allclose(shared["clamp"] + shared["roller"], force, atol=1e-12)


@pytest.mark.parametrize("angle", [0.0, 1e-8, 1e-5])
def test_rollers_that_differ_by_round_off_share_equally(angle):
    """A larger angle is another direction, whose roller carries nothing here."""
    shared = resolved(
        {3: (0.0, 2.0)},
        one=Condition([3], direction=(0.0, 1.0)),
        other=Condition([3], direction=(np.sin(angle), np.cos(angle))),
    )
    expected = (0.0, 2.0) if angle > 1e-6 else (0.0, 1.0)
    np.testing.assert_allclose(shared["one"], expected, atol=1e-6)


def test_a_tool_pushes_along_its_normal_and_a_support_along_its_direction():
    sphere = drape.Sphere(100.0, (0, 0, -100))
    node = int(np.flatnonzero((MESH.p == 1).all(axis=0))[0])
    ply = Ply(MESH, Fabric(100.0, 5.0), Full(), dimension=3)
    u = np.zeros((MESH.p.shape[1], 3))
    u[:, 2] = np.sqrt(100.0**2 - (MESH.p**2).sum(axis=0)) - 100.0
    normal = np.array([1.0, 1.0, 100.0 + u[node, 2]]) / 100.0
    x = np.array([1.0, 0.0, 0.0])
    conditions = {"tool": OnSurface(sphere), "x": Condition([node], (0.0, None, None))}
    f = np.zeros_like(u)
    f[node] = 3.0 * normal + 0.5 * x
    constraints = Constraints(ply.basis, conditions)
    shared = reactions(constraints, f.T, u.ravel(), 1.0)
    np.testing.assert_allclose(shared["tool"], 3.0 * normal, atol=1e-9)
    np.testing.assert_allclose(shared["x"], 0.5 * x, atol=1e-9)


def test_forces_on_all_nodes_of_a_condition_are_summed():
    result = LoadStepper(
        PLY,
        {"clamp": Condition("bottom"), "roller": Condition("right", direction=(1, 0))},
        steps=1,
    ).run()
    right = forces_of(result)[:, MESH.p[0] == 1].sum(axis=1)
    np.testing.assert_allclose(result.states[-1].forces["roller"], right, atol=1e-12)


def test_only_prescribed_components_count_as_travel():
    u = np.array([[3.0], [4.0]]) + 0 * MESH.p
    conditions = {
        "rail": Condition("top", direction=(0, 1)),
        "y": Condition("top", (None, 0.0)),
        "clamp": Condition("bottom"),
        "slope": Condition("right", direction=(0.6, 0.8)),
    }
    ply = Ply(MESH, Fabric(100.0, 5.0), Full())
    far = travels(Constraints(ply.basis, conditions), u)
    np.testing.assert_allclose(far["rail"], (0.0, 4.0))
    np.testing.assert_allclose(far["y"], (0.0, 4.0))
    np.testing.assert_allclose(far["clamp"], (3.0, 4.0))
    np.testing.assert_allclose(far["slope"], (3.0, 4.0))  # along it: 5 mm


def test_a_run_that_stops_states_the_prescribed_displacement():
    """The load moves the top along x, in which its condition leaves it free."""
    law = Tabulated([0, 0.3], [0, 1.5], odd=True)
    fabric = Fabric(100.0, law)
    mesh = MeshQuad().refined(1).with_defaults()
    ply = Ply(mesh, fabric, Full(), terms=[Force("top", (10.0, 0.0))])
    rail = {"clamp": Condition("bottom"), "rail": Condition("top", (None, 0.01))}
    with pytest.raises(StepError, match=r"\(rail moved by 0\.00\d+ mm\)") as stop:
        LoadStepper(ply, rail, steps=4, max_halvings=1, method="plain").run()
    moved = stop.value.result.states[-1].displacements["rail"]
    assert moved[0] > 0.1
