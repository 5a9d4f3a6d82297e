"""Conditions in the plane and in space."""

from dataclasses import replace

import numpy as np
import pytest
from skfem import MeshQuad

from skfem_textile import Condition, Fabric, Full, LoadStepper, Ply
from skfem_textile.mesh.bases import GAUSS, quad_basis, triangle_basis
from skfem_textile.mesh.selection import with_named_nodes
from skfem_textile.mesh.splitting import cut
from skfem_textile.solve.conditions import Constraints
from tests.helpers import forces_of

MESH = MeshQuad().refined(2).with_defaults()
BASIS = quad_basis(MESH, GAUSS)


def resolved(t=1.0, **conditions):
    """Displacement with all that is not fixed left at zero."""
    constraints = Constraints(BASIS, conditions)
    q = BASIS.zeros()
    q[constraints.fixed] = constraints.fixed_values(t)
    u = q if constraints.turn is None else constraints.turn @ q
    return constraints, u[BASIS.nodal_dofs]


def test_a_constant_value_grows_with_the_load_factor():
    _, u = resolved(0.5, pull=Condition("top", (1.0, 2.0)))
    np.testing.assert_allclose(u[:, MESH.p[1] == 1].T, [[0.5, 1.0]] * 5)


def test_a_value_may_depend_on_position_and_load_factor():
    constraints, u = resolved(
        0.25, right=Condition("right", lambda X, t: t * X[1] ** 2, direction=(-2, 0))
    )
    right = MESH.p[0] == 1
    np.testing.assert_allclose(u[0, right], -0.25 * MESH.p[1, right] ** 2)
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


# Conditions on any component and along any direction of a ply in space


IN_SPACE = quad_basis(MESH, GAUSS, 3)
RIGHT, TOP = MESH.p[0] == 1, MESH.p[1] == 1
CORNER = RIGHT & TOP


def resolved_in_space(t=1.0, **conditions):
    """Constraints, and their prescribed displacement, zero elsewhere."""
    constraints = Constraints(IN_SPACE, conditions)
    q = IN_SPACE.zeros()
    q[constraints.fixed] = constraints.fixed_values(t)
    u = q if constraints.turn is None else constraints.turn @ q
    return constraints, u.reshape(-1, 3).T


@pytest.mark.parametrize(
    "value", [(None, 2.0, None), (1.0, None, 3.0), [None, None, -1.0]]
)
def test_components_of_none_are_free(value):
    constraints, u = resolved_in_space(0.5, some=Condition("right", value))
    for i, component in enumerate(value):
        expected = 0.0 if component is None else 0.5 * component
        np.testing.assert_array_equal(u[i, RIGHT], expected)
    fixed = [i for i, x in enumerate(value) if x is not None]
    dofs = 3 * np.flatnonzero(RIGHT)[:, None] + fixed
    assert constraints.fixed.tolist() == sorted(dofs.ravel().tolist())


def test_components_that_are_given_may_differ_from_node_to_node():
    heights = np.linspace(0, 1, 5)
    nodes = np.flatnonzero(RIGHT)
    _, u = resolved_in_space(lift=Condition(nodes, (None, np.zeros(5), heights)))
    np.testing.assert_array_equal(u[2, nodes], heights)


def test_along_an_inclined_direction_two_motions_stay_free():
    n = np.array([2.0, 3.0, 6.0]) / 7
    constraints, u = resolved_in_space(slope=Condition("right", 2.0, direction=n))
    np.testing.assert_allclose(n @ u[:, RIGHT], 2.0)
    assert len(constraints.fixed) == 5
    turn = constraints.turn
    assert abs(turn.T @ turn - np.eye(IN_SPACE.N)).max() < 1e-15


def test_two_inclined_directions_leave_one_motion_free():
    rng = np.random.default_rng(1)
    m, n = rng.standard_normal((2, 3))
    constraints, u = resolved_in_space(
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
    constraints, u = resolved_in_space(
        **three, again=Condition(CORNER, direction=(1, 1, 1))
    )
    assert len(constraints.fixed) == 4 + 4 + 3
    np.testing.assert_allclose(u[:, CORNER], 0.0, atol=1e-14)
    with pytest.raises(ValueError, match="disagree at node"):
        resolved_in_space(**three, torn=Condition(CORNER, 1.0, direction=(1, 1, 1)))


def test_coplanar_directions_fix_two_components():
    directions = (1, 2, 3), (3, -1, 1), (4, 1, 4)
    conditions = {
        f"roller {i}": Condition("right", direction=n) for i, n in enumerate(directions)
    }
    constraints, _ = resolved_in_space(**conditions)
    assert len(constraints.fixed) == 2 * 5


def test_an_edge_on_an_inclined_rail_has_no_force_along_it():
    """Two directions of the edge are fixed, and no axis lies in them."""
    m, n = np.array([0.3, 1.0, 0.5]), np.array([0.2, -0.5, 1.0])
    rail = np.cross(m, n) / np.linalg.norm(np.cross(m, n))
    ply = Ply(MESH, Fabric(100.0, 5.0), Full(), dimension=3)
    conditions = {
        "clamp": Condition("bottom"),
        "pull": Condition("top", 0.2, direction=m),
        "hold": Condition("top", 0.05, direction=n),
    }
    result = LoadStepper(ply, conditions, 2).run()
    forces = forces_of(result)[:, TOP]
    assert np.abs(rail @ forces).max() < 1e-7 * np.abs(forces).max()
    assert np.ptp(rail @ ply.nodal(result.u)[:, TOP]) > 1e-4  # it slides
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
