"""Nodes that move together: one unknown for each free direction of a rigid clamp."""

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
    drape,
)
from skfem_textile.solve.conditions import Constraints
from skfem_textile.solve.linear import solver_named
from skfem_textile.solve.problem import Problem, Tangent
from tests.helpers import refused

MESH = MeshQuad().refined(2).with_defaults()
FABRIC = Fabric(100.0, 5.0)
CLAMP = Condition("bottom")
PLY = Ply(MESH, FABRIC, Full())
TURN = np.array([[0.8, -0.6], [0.6, 0.8]])


def rigid(*args):
    return Condition("top", *args, together=True)


SIDE = Condition(lambda x: (x[0] == 1) & (x[1] == 0.5))

# Dimension and conditions.
RIGID = {
    "along an axis": (2, {"clamp": CLAMP, "top": rigid((0.1, None))}),
    "along a slope": (2, {"clamp": CLAMP, "top": rigid(0.1, (3, 4))}),
    "free": (2, {"clamp": CLAMP, "top": rigid((None, None))}),
    "in space": (3, {"clamp": CLAMP, "top": rigid((0.1, None, None))}),
    "in space, along a slope": (3, {"clamp": CLAMP, "top": rigid(0.1, (1, 2, 2))}),
    "two clamps": (
        2,
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
    d, conditions = RIGID[name]
    ply = Ply(MESH, FABRIC, Full(), dimension=d)
    problem = Problem(ply, Constraints(ply.basis, conditions), solver_named("superlu"))
    u = 0.02 * np.sin(np.arange(ply.basis.N))
    tangent = Tangent.at(problem, u, ply.parameters_at_rest, tension=None)
    constraints = problem.constraints
    R = constraints.turn.toarray()
    np.testing.assert_allclose(R.T @ R, np.eye(len(R)), atol=1e-12)
    blocks = ply.stiffness(u, 0.0, ply.parameters_at_rest)
    K = R.T @ ply.pattern.matrix(blocks).toarray() @ R
    free, fixed = constraints.free, constraints.fixed
    upper, coupling = (x.toarray() for x in tangent._matrix)
    np.testing.assert_allclose(upper, np.triu(K[np.ix_(free, free)]), atol=1e-11)
    np.testing.assert_allclose(coupling, K[np.ix_(free, fixed)], atol=1e-11)


@pytest.mark.parametrize("solver", ["rslab", "superlu"])
@pytest.mark.parametrize("direction", [(1.0, 0.0), (0.8, 0.6)])
def test_a_rigid_clamp_carries_its_load_and_does_not_rotate(solver, direction):
    n = np.array(direction)
    across = np.array([-n[1], n[0]])
    clamp = Condition("top", 0.05, direction, together=True)
    ply = Ply(MESH, FABRIC, Full(), [Force("top", 2.0 * across)])
    held = {"clamp": CLAMP, "top": clamp}
    result = LoadStepper(ply, held, steps=1, solver=solver).run()
    state, top = result.states[-1], ply.nodes[1] == 1
    u = ply.nodal(result.u)[:, top]
    assert np.ptp(u, axis=1).max() < 1e-13
    np.testing.assert_allclose(n @ u, 0.05, rtol=1e-12)
    inner = ply.nodal(ply.residual(result.u) + ply.load(result.u, 1.0))
    assert across @ inner[:, top].sum(axis=1) == pytest.approx(2.0, rel=1e-9)
    assert across @ state.reactions["top"] == pytest.approx(0.0, abs=1e-12)
    np.testing.assert_allclose(state.forces["top"], state.reactions["top"], atol=1e-9)


def test_nodes_that_are_free_to_move_apart_have_another_equilibrium():
    ply = Ply(MESH, FABRIC, Full(), [Force("top", (0.0, 2.0))])

    def height(**together):
        held = {"clamp": CLAMP, "top": Condition("top", (0.2, None), **together)}
        u = LoadStepper(ply, held, steps=1).run().u
        return ply.nodal(u)[1, ply.nodes[1] == 1]

    assert np.ptp(height()) > 100 * np.ptp(height(together=True))


def test_the_condition_rotates_with_its_problem():
    ply = Ply(MESH, FABRIC, Full())
    for condition in (
        Condition("top", (0.1, None), together=True),
        Condition("top", 0.1, (0.6, 0.8), together=True),
        Condition("top", (None, None), together=True),
    ):
        plain, turned = (
            Constraints(ply.basis, {"top": c})
            for c in (condition, condition.turned(TURN))
        )
        # The free motions: all nodes along one direction.
        free = [c.turn.toarray()[:, c.shared].T for c in (plain, turned)]
        Q = np.kron(np.eye(ply.nodes.shape[1]), TURN)
        ours, theirs = free[0] @ Q.T, free[1]
        np.testing.assert_allclose(ours.T @ ours, theirs.T @ theirs, atol=1e-12)


@pytest.mark.parametrize(
    ("conditions", "text"),
    [
        (
            {"top": Condition("top", (0.1, 0.2), together=True)},
            "'top': together has no effect, because every component is fixed",
        ),
        (
            {"top": Condition("top", 0.0, lambda x: x + 1.0, together=True)},
            "'top': nodes that move together must be fixed in one direction",
        ),
        (
            {"a": Condition("top", (0, None), together=True), "b": Condition("left")},
            "'a': its nodes move together, but 'b' restrains this motion at node",
        ),
        (
            {
                "a": Condition("top", (0, None), together=True),
                "b": Condition("left", (None, None), together=True),
            },
            "'b': its nodes move together, but 'a' restrains this motion at node",
        ),
    ],
)
def test_contradictions_are_refused(conditions, text):
    refused(lambda: Constraints(PLY.basis, conditions), text)


def test_nodes_on_a_surface_do_not_move_together():
    ply = Ply(MESH, FABRIC, Full(), dimension=3)
    sphere = OnSurface(drape.Sphere(5.0, (0.0, 0.0, -5.0)))
    rigid = Condition("top", (0.0, None, None), together=True)
    conditions = {"on": sphere, "top": rigid}
    refused(lambda: Constraints(ply.basis, conditions), "combined with a surface .'on'")


def test_a_checkpoint_of_nodes_that_move_apart_is_of_another_run(tmp_path):
    def stepper(together):
        held = {"clamp": CLAMP, "top": Condition("top", (0.1, None), together=together)}
        return LoadStepper(PLY, held, 2, checkpoint=tmp_path)

    first, again = stepper(True).run(), stepper(True).run(resume=True)
    np.testing.assert_array_equal(first.u, again.u)
    with pytest.raises(ValueError, match="fixed unknowns differ"):
        stepper(False).run(resume=True)
