"""Conditions in the plane and in space, nodes that move together, and reactions."""

from dataclasses import replace

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
from skfem_textile.mesh.bases import GAUSS, quad_basis, triangle_basis
from skfem_textile.mesh.selection import with_named_nodes
from skfem_textile.mesh.splitting import cut
from skfem_textile.solve.conditions import Constraints, reactions, travels
from skfem_textile.solve.linear import solver_named
from skfem_textile.solve.problem import Problem, reduced
from tests.helpers import forces_of, refused

MESH = MeshQuad().refined(2).with_defaults()
FABRIC, CLAMP = Fabric(100.0, 5.0), Condition("bottom")
PLY, IN_SPACE = (Ply(MESH, FABRIC, Full(), dimension=d) for d in (2, 3))
RIGHT, TOP = MESH.p[0] == 1, MESH.p[1] == 1
CORNER = RIGHT & TOP


def resolved(t=1.0, ply=PLY, **conditions):
    """Constraints, and the displacement with all that is not fixed left at zero."""
    constraints = Constraints(ply.basis, conditions)
    q = ply.basis.zeros()
    q[constraints.fixed] = constraints.fixed_values(t)
    u = q if constraints.turn is None else constraints.turn @ q
    return constraints, ply.nodal(u)


def test_a_constant_value_grows_with_the_load_factor():
    _, u = resolved(0.5, pull=Condition("top", (1.0, 2.0)))
    np.testing.assert_allclose(u[:, TOP].T, [[0.5, 1.0]] * 5)


def test_a_value_may_depend_on_position_and_load_factor():
    constraints, u = resolved(
        0.25, right=Condition("right", lambda X, t: t * X[1] ** 2, direction=(-2, 0))
    )
    np.testing.assert_allclose(u[0, RIGHT], -0.25 * MESH.p[1, RIGHT] ** 2)
    assert constraints.turn is None
    assert len(constraints.fixed) == 5


def test_named_nodes_are_constrained_with_the_edges_of_that_name():
    inner = np.flatnonzero((MESH.p > 0).all(axis=0) & (MESH.p < 1).all(axis=0))
    mesh = with_named_nodes(MESH, {"inner": inner, "top": inner[:1]})
    for cells in (mesh, replace(mesh, doflocs=2 * mesh.p)):
        basis = quad_basis(cells, GAUSS)
        assert Condition("inner").nodes("", basis).tolist() == inner.tolist()
        top = [*np.flatnonzero(MESH.p[1] == 1), inner[0]]
        assert Condition("top").nodes("", basis).tolist() == sorted(top)
    with pytest.raises(ValueError, match=r"no boundary 'x\\n' .*'top', 'inner'\)"):
        Condition("x\n").nodes("a", quad_basis(mesh, GAUSS))
    quadratic = triangle_basis(cut(mesh))
    assert Condition("inner").nodes("", quadratic).tolist() == inner.tolist()
    assert len(Condition("top").nodes("", quadratic)) == 5 + 1 + 4


def test_values_keep_the_order_of_the_node_numbers():
    nodes, values = [19, 18, 17, 16], np.array([1.0, 2.0, 3.0, 4.0])
    _, u = resolved(lift=Condition(nodes, values, direction=(0, 1)))
    np.testing.assert_array_equal(u[1, nodes], values)
    _, u = resolved(move=Condition(nodes, np.array([values, -values])))
    np.testing.assert_array_equal(u[:, nodes], [values, -values])

    def height(X, t):
        return X[1]

    _, u = resolved(lift=Condition(nodes, height, direction=(0, 1)))
    np.testing.assert_array_equal(u[1, nodes], MESH.p[1, nodes])


def test_a_node_may_be_named_twice_but_moves_once():
    twice = Condition([7, 3, 7], np.array([1.0, 2.0, 1.0]), direction=(0, 1))
    constraints, u = resolved(lift=twice)
    np.testing.assert_array_equal(u[1, [7, 3]], [1.0, 2.0])
    assert constraints.nodes["lift"].tolist() == [3, 7]
    torn = Condition([7, 3, 7], np.array([1.0, 2.0, 5.0]), direction=(0, 1))
    with pytest.raises(ValueError, match="disagree at node 7"):
        resolved(lift=torn)


def test_conditions_that_agree_are_merged():
    constraints, _ = resolved(
        clamp=Condition("bottom"),
        again=Condition("bottom", direction=(1, 1)),
        right=Condition("right", lambda X, t: t * X[1], direction=(1, 0)),
    )
    assert len(constraints.fixed) == 2 * 5 + 4


def test_directions_that_differ_by_rounding_are_merged():
    rollers = [(0.5, 3**0.5 / 2), (0.5, 0.866025)]
    constraints, _ = resolved(
        **{f"roller{i}": Condition("right", direction=n) for i, n in enumerate(rollers)}
    )
    assert len(constraints.fixed) == 5


@pytest.mark.parametrize(
    "condition",
    [
        Condition(lambda X: X[1] > 0.9),
        Condition("top", (0.2, 0.3)),
        Condition("top", lambda X, t: 0.3 * t * X),
        Condition("top", 0.3, direction=(0.0, 1.0)),
        Condition("top", lambda X, t: 0.3 * t * X[0], direction=lambda X: X),
    ],
)
def test_any_condition_rotates_with_the_problem(condition):
    angle = 0.7
    Q = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    energies = []
    for turned in (False, True):
        mesh = MeshQuad(Q @ MESH.p, MESH.t, MESH.boundaries) if turned else MESH
        A = (Q if turned else np.eye(2)).T
        ply = Ply(mesh, Fabric(10.0, 1.0, *A), Full())
        c = condition.turned(Q) if turned else condition
        result = LoadStepper(ply, {"clamp": Condition("bottom"), "c": c}, 2).run()
        energies.append(result.history()[-1]["energy"])
    assert energies[1] == pytest.approx(energies[0], rel=1e-9, abs=1e-12)


# In space


@pytest.mark.parametrize(
    "value", [(None, 2.0, None), (1.0, None, 3.0), [None, None, -1.0]]
)
def test_components_of_none_are_free(value):
    constraints, u = resolved(0.5, IN_SPACE, some=Condition("right", value))
    for i, component in enumerate(value):
        expected = 0.0 if component is None else 0.5 * component
        np.testing.assert_array_equal(u[i, RIGHT], expected)
    fixed = [i for i, x in enumerate(value) if x is not None]
    dofs = 3 * np.flatnonzero(RIGHT)[:, None] + fixed
    assert constraints.fixed.tolist() == sorted(dofs.ravel().tolist())


def test_components_that_are_given_may_differ_from_node_to_node():
    heights = np.linspace(0, 1, 5)
    nodes = np.flatnonzero(RIGHT)
    _, u = resolved(ply=IN_SPACE, lift=Condition(nodes, (None, np.zeros(5), heights)))
    np.testing.assert_array_equal(u[2, nodes], heights)


def test_along_an_inclined_direction_two_motions_stay_free():
    n = np.array([2.0, 3.0, 6.0]) / 7
    constraints, u = resolved(ply=IN_SPACE, slope=Condition("right", 2.0, direction=n))
    np.testing.assert_allclose(n @ u[:, RIGHT], 2.0)
    assert len(constraints.fixed) == 5
    turn = constraints.turn
    assert abs(turn.T @ turn - np.eye(IN_SPACE.basis.N)).max() < 1e-15


def test_two_inclined_directions_leave_one_motion_free():
    rng = np.random.default_rng(1)
    m, n = rng.standard_normal((2, 3))
    constraints, u = resolved(
        ply=IN_SPACE,
        one=Condition("right", 2.0, direction=m),
        other=Condition("top", -1.0, direction=n),
    )
    for direction, where, value in ((m, RIGHT, 2.0), (n, TOP, -1.0)):
        along = direction @ u[:, where] / np.linalg.norm(direction)
        np.testing.assert_allclose(along, value)
    assert len(constraints.fixed) == 10
    (corner,) = np.flatnonzero(CORNER)
    dofs = 3 * corner + np.arange(3)
    free = np.setdiff1d(dofs, constraints.fixed)
    motion = constraints.turn.toarray()[np.ix_(dofs, free - 3 * corner + dofs[0])]
    np.testing.assert_allclose([m, n] @ motion, 0.0, atol=1e-15)


def test_three_directions_fix_a_node_and_a_fourth_must_agree():
    m, n, o = np.random.default_rng(2).standard_normal((3, 3))
    three = {
        "m": Condition("right", direction=m),
        "n": Condition("top", direction=n),
        "o": Condition(CORNER, direction=o),
    }
    constraints, u = resolved(
        ply=IN_SPACE, **three, again=Condition(CORNER, direction=(1, 1, 1))
    )
    assert len(constraints.fixed) == 4 + 4 + 3
    np.testing.assert_allclose(u[:, CORNER], 0.0, atol=1e-14)
    with pytest.raises(ValueError, match="disagree at node"):
        resolved(
            ply=IN_SPACE, **three, torn=Condition(CORNER, 1.0, direction=(1, 1, 1))
        )


def test_coplanar_directions_fix_two_components():
    directions = (1, 2, 3), (3, -1, 1), (4, 1, 4)
    conditions = {
        f"roller {i}": Condition("right", direction=n) for i, n in enumerate(directions)
    }
    constraints, _ = resolved(ply=IN_SPACE, **conditions)
    assert len(constraints.fixed) == 2 * 5


def test_an_edge_on_an_inclined_rail_has_no_force_along_it():
    """Two directions of the edge are fixed, and no axis lies in them."""
    m, n = np.array([0.3, 1.0, 0.5]), np.array([0.2, -0.5, 1.0])
    rail = np.cross(m, n) / np.linalg.norm(np.cross(m, n))
    conditions = {
        "clamp": CLAMP,
        "pull": Condition("top", 0.2, direction=m),
        "hold": Condition("top", 0.05, direction=n),
    }
    result = LoadStepper(IN_SPACE, conditions, 2).run()
    forces = forces_of(result)[:, TOP]
    assert np.abs(rail @ forces).max() < 1e-7 * np.abs(forces).max()
    assert np.ptp(rail @ IN_SPACE.nodal(result.u)[:, TOP]) > 1e-4  # it slides
    state = result.states[-1]
    np.testing.assert_allclose(state.forces["pull"], forces.sum(axis=1))
    moved = state.displacements["pull"]
    np.testing.assert_allclose(m @ moved, 0.2 * np.linalg.norm(m))


def test_a_condition_keeps_its_values_when_the_given_arrays_change():
    where, value, direction = np.array([0, 1]), np.array([1.0, 2.0]), np.array([0, 1])
    condition = Condition(where, value, direction)
    for array in (where, value, direction):
        array += 5
    assert condition.where.tolist() == [0, 1]
    assert condition.value.tolist() == [1.0, 2.0]
    assert condition.direction.tolist() == [0, 1]


# Nodes that move together


def rigid(*args):
    return Condition("top", *args, together=True)


SIDE = Condition(lambda x: (x[0] == 1) & (x[1] == 0.5))

# Ply and conditions.
RIGID = {
    "along an axis": (PLY, {"clamp": CLAMP, "top": rigid((0.1, None))}),
    "along a slope": (PLY, {"clamp": CLAMP, "top": rigid(0.1, (3, 4))}),
    "free": (PLY, {"clamp": CLAMP, "top": rigid((None, None))}),
    "in space": (IN_SPACE, {"clamp": CLAMP, "top": rigid((0.1, None, None))}),
    "in space, along a slope": (
        IN_SPACE,
        {"clamp": CLAMP, "top": rigid(0.1, (1, 2, 2))},
    ),
    "two clamps": (
        PLY,
        {
            "clamp": Condition("bottom", (0.0, None), together=True),
            "side": SIDE,
            "top": rigid(0.1, (3, 4)),
        },
    ),
}


@pytest.mark.parametrize("name", RIGID)
def test_the_tangent_is_that_of_the_free_motions(name):
    """RᵀKR, with R orthogonal, on the free unknowns and to the fixed ones."""
    ply, conditions = RIGID[name]
    problem = Problem(ply, Constraints(ply.basis, conditions), solver_named("superlu"))
    u = 0.02 * np.sin(np.arange(ply.basis.N))
    constraints = problem.constraints
    R = constraints.turn.toarray()
    np.testing.assert_allclose(R.T @ R, np.eye(len(R)), atol=1e-12)
    blocks = ply.stiffness(u, 0.0, ply.parameters_at_rest)
    K = R.T @ ply.pattern.matrix(blocks).toarray() @ R
    free, fixed = constraints.free, constraints.fixed
    matrices = reduced(problem.system, blocks, problem.turn(u))
    upper, coupling = (x.toarray() for x in matrices)
    np.testing.assert_allclose(upper, np.triu(K[np.ix_(free, free)]), atol=1e-11)
    np.testing.assert_allclose(coupling, K[np.ix_(free, fixed)], atol=1e-11)


@pytest.mark.parametrize("solver", ["rslab", "superlu"])
@pytest.mark.parametrize("direction", [(1.0, 0.0), (0.8, 0.6)])
def test_a_rigid_clamp_carries_its_load_and_does_not_rotate(solver, direction):
    n = np.array(direction)
    across = np.array([-n[1], n[0]])
    ply = Ply(MESH, FABRIC, Full(), [Force("top", 2.0 * across)])
    held = {"clamp": CLAMP, "top": rigid(0.05, direction)}
    result = LoadStepper(ply, held, steps=1, solver=solver).run()
    state, u = result.states[-1], ply.nodal(result.u)[:, TOP]
    assert np.ptp(u, axis=1).max() < 1e-13
    np.testing.assert_allclose(n @ u, 0.05, rtol=1e-12)
    inner = ply.nodal(ply.residual(result.u) + ply.load(result.u, 1.0))
    assert across @ inner[:, TOP].sum(axis=1) == pytest.approx(2.0, rel=1e-9)
    assert across @ state.reactions["top"] == pytest.approx(0.0, abs=1e-12)
    np.testing.assert_allclose(state.forces["top"], state.reactions["top"], atol=1e-9)


def test_nodes_that_are_free_to_move_apart_have_another_equilibrium():
    ply = Ply(MESH, FABRIC, Full(), [Force("top", (0.0, 2.0))])

    def height(**together):
        held = {"clamp": CLAMP, "top": Condition("top", (0.2, None), **together)}
        u = LoadStepper(ply, held, steps=1).run().u
        return ply.nodal(u)[1, TOP]

    assert np.ptp(height()) > 100 * np.ptp(height(together=True))


@pytest.mark.parametrize(
    "condition",
    [rigid((0.1, None)), rigid(0.1, (0.6, 0.8)), rigid((None, None))],
)
def test_a_rigid_clamp_rotates_with_its_problem(condition):
    """Its free motions move all nodes along one direction."""
    turn = np.array([[0.8, -0.6], [0.6, 0.8]])
    both = (resolved(top=c)[0] for c in (condition, condition.turned(turn)))
    ours, theirs = (c.turn.toarray()[:, c.shared].T for c in both)
    ours = ours @ np.kron(np.eye(MESH.nvertices), turn).T
    np.testing.assert_allclose(ours.T @ ours, theirs.T @ theirs, atol=1e-12)


@pytest.mark.parametrize(
    ("conditions", "text"),
    [
        (
            {"top": rigid((0.1, 0.2))},
            "'top': together has no effect, because every component is fixed",
        ),
        (
            {"top": rigid(0.0, lambda x: x + 1.0)},
            "'top': nodes that move together must be fixed in one direction",
        ),
        (
            {"a": rigid((0, None)), "b": Condition("left")},
            "'a': its nodes move together, but 'b' restrains this motion at node",
        ),
        (
            {
                "a": rigid((0, None)),
                "b": Condition("left", (None, None), together=True),
            },
            "'b': its nodes move together, but 'a' restrains this motion at node",
        ),
        (
            {
                "on": OnSurface(drape.Sphere(5.0, (0.0, 0.0, -5.0))),
                "top": rigid((0.0, None, None)),
            },
            "combined with a surface .'on'",
        ),
    ],
)
def test_contradictions_of_a_rigid_clamp_are_refused(conditions, text):
    ply = IN_SPACE if "on" in conditions else PLY
    refused(lambda: Constraints(ply.basis, conditions), text)


def test_a_checkpoint_of_nodes_that_move_apart_is_of_another_run(tmp_path):
    def stepper(together):
        held = {"clamp": CLAMP, "top": Condition("top", (0.1, None), together=together)}
        return LoadStepper(PLY, held, 2, checkpoint=tmp_path)

    first, again = stepper(True).run(), stepper(True).run(resume=True)
    np.testing.assert_array_equal(first.u, again.u)
    with pytest.raises(ValueError, match="fixed unknowns differ"):
        stepper(False).run(resume=True)


# Reactions of conditions that share nodes, and prescribed displacements


def test_reactions_of_clamp_pull_and_roller_sum_to_the_opposite_of_the_load():
    conditions = {
        "clamp": CLAMP,
        "pull": Condition("top", (0.1, 0.2)),
        "roller": Condition("right", lambda X, t: 0.1 * t * X[1], direction=(1, 0)),
    }
    state = LoadStepper(PLY, conditions, 1).run().states[-1]
    largest = max(np.abs(r).max() for r in state.reactions.values())
    assert np.abs(sum(state.reactions.values())).max() < 1e-7 * largest
    assert np.abs(sum(state.forces.values())).max() > 0.01 * largest
    loaded = PLY.with_terms(Force("left", (3.0, -2.0)))
    total = sum(LoadStepper(loaded, conditions, 1).run().states[-1].reactions.values())
    np.testing.assert_allclose(total, (-3.0, 2.0), atol=1e-8)


def divided(forces, **conditions):
    """Reactions of conditions on nodes, with a nodal force on each node given."""
    f = np.zeros_like(MESH.p)
    for node, force in forces.items():
        f[:, node] = force
    return reactions(Constraints(PLY.basis, conditions), f, PLY.basis.zeros(), 1.0)


SLOPE = np.array([0.6, 0.8])


@pytest.mark.parametrize(
    ("forces", "conditions", "expected"),
    [
        (
            {3: (6.0, 4.0)},
            {
                "clamp": Condition([0, 3]),
                "roller": Condition([3, 5], direction=(1, 0)),
                "other": Condition([3], (0.0, None)),
            },
            {"clamp": (2.0, 4.0), "roller": (2.0, 0.0), "other": (2.0, 0.0)},
        ),
        (
            {3: (6.0, 4.0), 5: (1.0, 7.0)},
            {
                "x": Condition([3, 5], direction=(1, 0)),
                "y": Condition([3], direction=(0, 1)),
            },
            {"x": (7.0, 0.0), "y": (0.0, 4.0)},
        ),
        (
            {3: 2.0 * SLOPE - (0.0, 5.0)},
            {
                "one": Condition([3], direction=SLOPE),
                "other": Condition([3], direction=(0, 1)),
            },
            {"one": 2.0 * SLOPE, "other": (0.0, -5.0)},
        ),
        (
            {3: (1.0, 3.0)},
            {"clamp": Condition([3]), "roller": Condition([3], direction=SLOPE)},
            {"clamp": (0.1, 1.8), "roller": 1.5 * SLOPE},
        ),
    ],
    ids=["equal", "along axes", "two slopes", "clamp and slope"],
)
def test_the_force_of_a_node_is_divided_among_its_conditions(
    forces, conditions, expected
):
    """Equally along a direction that several fix, else to the one that fixes it."""
    shared = divided(forces, **conditions)
    for name, reaction in expected.items():
        np.testing.assert_allclose(shared[name], reaction, atol=1e-12)


@pytest.mark.parametrize("angle", [0.0, 1e-8, 1e-5])
def test_rollers_that_differ_by_round_off_share_equally(angle):
    """A larger angle is another direction, whose roller carries nothing here."""
    shared = divided(
        {3: (0.0, 2.0)},
        one=Condition([3], direction=(0.0, 1.0)),
        other=Condition([3], direction=(np.sin(angle), np.cos(angle))),
    )
    expected = (0.0, 2.0) if angle > 1e-6 else (0.0, 1.0)
    np.testing.assert_allclose(shared["one"], expected, atol=1e-6)


def test_a_tool_pushes_along_its_normal_and_a_support_along_its_direction():
    sphere = drape.Sphere(100.0, (0, 0, -100))
    (node,) = np.flatnonzero(CORNER)
    u = np.zeros((MESH.p.shape[1], 3))
    u[:, 2] = np.sqrt(100.0**2 - (MESH.p**2).sum(axis=0)) - 100.0
    normal = np.array([1.0, 1.0, 100.0 + u[node, 2]]) / 100.0
    x = np.array([1.0, 0.0, 0.0])
    conditions = {"tool": OnSurface(sphere), "x": Condition([node], (0.0, None, None))}
    f = np.zeros_like(u)
    f[node] = 3.0 * normal + 0.5 * x
    constraints = Constraints(IN_SPACE.basis, conditions)
    shared = reactions(constraints, f.T, u.ravel(), 1.0)
    np.testing.assert_allclose(shared["tool"], 3.0 * normal, atol=1e-9)
    np.testing.assert_allclose(shared["x"], 0.5 * x, atol=1e-9)


def test_forces_on_all_nodes_of_a_condition_are_summed():
    held = {"clamp": CLAMP, "roller": Condition("right", direction=(1, 0))}
    result = LoadStepper(PLY, held, 1).run()
    right = forces_of(result)[:, RIGHT].sum(axis=1)
    np.testing.assert_allclose(result.states[-1].forces["roller"], right, atol=1e-12)


def test_only_prescribed_components_count_as_travel():
    u = np.array([[3.0], [4.0]]) + 0 * MESH.p
    conditions = {
        "rail": Condition("top", direction=(0, 1)),
        "y": Condition("top", (None, 0.0)),
        "clamp": CLAMP,
        "slope": Condition("right", direction=(0.6, 0.8)),
    }
    far = travels(Constraints(PLY.basis, conditions), u)
    np.testing.assert_allclose(far["rail"], (0.0, 4.0))
    np.testing.assert_allclose(far["y"], (0.0, 4.0))
    np.testing.assert_allclose(far["clamp"], (3.0, 4.0))
    np.testing.assert_allclose(far["slope"], (3.0, 4.0))  # along it: 5 mm


def test_a_run_that_stops_states_the_prescribed_displacement():
    """The load moves the top along x, in which its condition leaves it free."""
    fabric = Fabric(100.0, Tabulated([0, 0.3], [0, 1.5], odd=True))
    mesh = MeshQuad().refined(1).with_defaults()
    ply = Ply(mesh, fabric, Full(), terms=[Force("top", (10.0, 0.0))])
    rail = {"clamp": CLAMP, "rail": Condition("top", (None, 0.01))}
    with pytest.raises(StepError, match=r"\(rail moved by 0\.00\d+ mm\)") as stop:
        LoadStepper(ply, rail, steps=4, max_halvings=1, method="plain").run()
    moved = stop.value.result.states[-1].displacements["rail"]
    assert moved[0] > 0.1
