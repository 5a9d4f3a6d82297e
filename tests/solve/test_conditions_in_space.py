"""Conditions on any component and along any direction of a ply in space."""

import numpy as np
import pytest
from skfem import MeshQuad

from skfem_textile import Condition, Fabric, Full, LoadStepper, Ply
from skfem_textile.mesh.bases import GAUSS, quad_basis
from skfem_textile.solve.conditions import Constraints
from tests.helpers import forces_of

MESH = MeshQuad().refined(2).with_defaults()
BASIS = quad_basis(MESH, GAUSS, 3)
RIGHT, TOP = MESH.p[0] == 1, MESH.p[1] == 1
CORNER = RIGHT & TOP


def resolved(t=1.0, **conditions):
    """Constraints, and the displacement that they ask for, zero elsewhere."""
    constraints = Constraints(BASIS, conditions)
    q = BASIS.zeros()
    q[constraints.fixed] = constraints.fixed_values(t)
    u = q if constraints.turn is None else constraints.turn @ q
    return constraints, u.reshape(-1, 3).T


def test_a_whole_displacement_has_three_components():
    constraints, u = resolved(pull=Condition("right", (1.0, 2.0, 3.0)))
    np.testing.assert_array_equal(u[:, RIGHT], np.tile([[1.0], [2.0], [3.0]], 5))
    assert len(constraints.fixed) == 3 * 5
    assert constraints.turn is None


@pytest.mark.parametrize(
    "value", [(None, 2.0, None), (1.0, None, 3.0), [None, None, -1.0]]
)
def test_components_that_are_none_are_free(value):
    constraints, u = resolved(0.5, some=Condition("right", value))
    for i, component in enumerate(value):
        expected = 0.0 if component is None else 0.5 * component
        np.testing.assert_array_equal(u[i, RIGHT], expected)
    given = [i for i, x in enumerate(value) if x is not None]
    dofs = 3 * np.flatnonzero(RIGHT)[:, None] + given
    assert constraints.fixed.tolist() == sorted(dofs.ravel().tolist())


def test_components_that_are_given_may_differ_from_node_to_node():
    heights = np.linspace(0, 1, 5)
    nodes = np.flatnonzero(RIGHT)
    _, u = resolved(lift=Condition(nodes, (None, np.zeros(5), heights)))
    np.testing.assert_array_equal(u[2, nodes], heights)


def test_in_the_plane_components_may_be_free_too():
    basis = quad_basis(MESH, GAUSS)
    constraints = Constraints(basis, {"slide": Condition("right", (None, 2.0))})
    assert constraints.fixed.tolist() == (2 * np.flatnonzero(RIGHT) + 1).tolist()
    np.testing.assert_array_equal(constraints.fixed_values(1.0), 2.0)


def test_along_an_inclined_direction_two_motions_stay_free():
    n = np.array([2.0, 3.0, 6.0]) / 7
    constraints, u = resolved(slope=Condition("right", 2.0, direction=n))
    np.testing.assert_allclose(n @ u[:, RIGHT], 2.0)
    assert len(constraints.fixed) == 5
    turn = constraints.turn
    assert abs(turn.T @ turn - np.eye(BASIS.N)).max() < 1e-15


def test_two_inclined_directions_leave_one_motion_free():
    rng = np.random.default_rng(1)
    m, n = rng.standard_normal((2, 3))
    constraints, u = resolved(
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


def test_three_directions_fix_a_node_whole_and_a_fourth_must_agree():
    m, n, o = np.random.default_rng(2).standard_normal((3, 3))
    three = {
        "m": Condition("right", direction=m),
        "n": Condition("top", direction=n),
        "o": Condition(CORNER, direction=o),
    }
    constraints, u = resolved(**three, again=Condition(CORNER, direction=(1, 1, 1)))
    assert len(constraints.fixed) == 4 + 4 + 3
    np.testing.assert_allclose(u[:, CORNER], 0.0, atol=1e-14)
    with pytest.raises(ValueError, match="disagree at node"):
        resolved(**three, torn=Condition(CORNER, 1.0, direction=(1, 1, 1)))


def test_directions_that_lie_in_the_plane_of_two_others_fix_no_more():
    directions = (1, 2, 3), (3, -1, 1), (4, 1, 4)
    conditions = {
        f"roller {i}": Condition("right", direction=n) for i, n in enumerate(directions)
    }
    constraints, _ = resolved(**conditions)
    assert len(constraints.fixed) == 2 * 5


@pytest.mark.parametrize(
    ("condition", "message"),
    [
        (Condition("top", (1.0, 2.0)), r"must have shape \(3, 5\), not \(2,\)"),
        (Condition("top", (1.0, None)), "must have 3 components"),
        (Condition("top", (None, None, None)), "must have 3 components"),
        (Condition("top", (1, None, 2), (0, 0, 1)), "no direction beside it"),
        (Condition("top", (1, None, np.zeros(4))), "must be real numbers"),
        (Condition("top", 1.0, direction=(0, 1)), r"shape \(3, n_elements\)"),
        (Condition("top", (1, None, np.inf)), "not finite"),
    ],
)
def test_bad_conditions_are_refused(condition, message):
    with pytest.raises(ValueError, match=f"condition 'c'.*{message}"):
        resolved(c=condition)


def test_an_edge_on_an_inclined_rail_meets_no_force_along_it():
    """Two directions of the edge are fixed, in neither of which an axis lies."""
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
    np.testing.assert_allclose(state.reactions["pull"], forces.sum(axis=1))
    moved = state.displacements["pull"]
    np.testing.assert_allclose(m @ moved, 0.2 * np.linalg.norm(m))
