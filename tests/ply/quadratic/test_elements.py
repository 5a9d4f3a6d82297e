"""Quadratic triangles: nodes, gradients, modes, and conditions on all nodes."""

import numpy as np
import pytest
from skfem import MeshTri

from skfem_textile import (
    Condition,
    Fabric,
    Full,
    LoadStepper,
    Ply,
    Quadratic,
    StepError,
)
from skfem_textile.mesh.splitting import cut
from skfem_textile.scenes.rectangle import rectangle
from skfem_textile.solve.conditions import Constraints
from skfem_textile.solve.linear.superlu import SuperLU
from skfem_textile.solve.problem import Problem
from tests.helpers import distorted, distorted_for, wobble
from tests.helpers.quadratic_plies import ONE, SQUARES, dofs, ply_on


def test_nodes_are_vertices_and_then_middles_of_edges():
    ply = ply_on(distorted_for(Quadratic(), 1))
    n = ply.mesh.nvertices
    np.testing.assert_array_equal(ply.nodes[:, :n], ply.mesh.p)
    ends = ply.mesh.p[:, ply.mesh.facets]
    np.testing.assert_allclose(ply.nodes[:, n:], 0.5 * (ends[:, 0] + ends[:, 1]))
    np.testing.assert_allclose(dofs(ply, ply.nodes)[::2], ply.basis.doflocs[0, ::2])
    np.testing.assert_allclose(dofs(ply, ply.nodes)[1::2], ply.basis.doflocs[1, ::2])


def test_quadrilaterals_have_their_vertices_for_nodes():
    ply = Ply(distorted(1), Fabric(), Full())
    np.testing.assert_array_equal(ply.nodes, ply.mesh.p)


def test_gradients_of_quadratic_motions_are_exact_at_any_point():
    ply = ply_on(distorted_for(Quadratic(), 2))
    C = np.random.default_rng(0).standard_normal((2, 2, 2))
    X = ply.nodes
    u = dofs(ply, np.einsum("ijk,jn,kn->in", C, X, X))
    for points in (None, ply.centre, ply.fine_points):
        xi = ply.basis.X if points is None else points
        exact = np.einsum(
            "ijk,k...->ij...", C + C.swapaxes(1, 2), ply.basis.mapping.F(xi)
        )
        np.testing.assert_allclose(ply.gradient(u, points), exact, atol=1e-12)


@pytest.mark.parametrize(("shear", "modes"), [(0.0, 6), (1.0, 3)])
def test_zero_energy_modes_of_one_triangle(shear, modes):
    ply = ply_on(ONE, shear)
    stiffness = np.linalg.eigvalsh(ply.tangent(ply.basis.zeros()).toarray())
    assert np.sum(stiffness < 1e-12) == modes


def test_a_homogeneous_motion_of_the_boundary_is_that_of_the_ply():
    """The patch test, finite: shear, stretch and turn."""
    mesh = cut(rectangle(3, 2, (4, 3), "irregular", 0.2, 3)).with_defaults()
    mesh = mesh.with_boundaries({"rim": mesh.boundary_facets()})
    H = np.array([[0.1, 0.3], [-0.1, 0.05]])
    ply = ply_on(mesh)
    held = {"rim": Condition("rim", lambda X, t: t * H @ X)}
    result = LoadStepper(ply, held, 2).run()
    np.testing.assert_allclose(ply.nodal(result.u), H @ ply.nodes, atol=1e-9)
    np.testing.assert_allclose(np.ptp(ply.shear_angle(result.u)), 0.0, atol=1e-9)


def test_the_listing_order_of_a_triangle_does_not_matter():
    mesh = distorted_for(Quadratic(), 3)
    turned = MeshTri(mesh.p, mesh.t[[2, 0, 1]], sort_t=False)
    mirrored = MeshTri(mesh.p, mesh.t[::-1], sort_t=False)
    plies = [ply_on(m) for m in (mesh, turned, mirrored)]
    columns = plies[0].nodal(wobble(plies[0], 3))
    energies = [ply.energy(dofs(ply, columns)) for ply in plies]
    assert energies == pytest.approx([energies[0]] * 3, rel=1e-12)


def test_conditions_take_the_middles_of_edges():
    basis = ply_on(SQUARES).basis
    nodes = ply_on(SQUARES).nodes
    below = np.flatnonzero(nodes[1] == 0)
    assert len(below) == 2 * 4 + 1
    mask = nodes[1] == 0
    for where in ("bottom", lambda X: X[1] == 0, mask, below):
        found = Condition(where).nodes("c", basis)
        np.testing.assert_array_equal(np.sort(found), below)


@pytest.mark.parametrize(
    ("where", "message"),
    [
        (SQUARES.p[1] == 0, "true or false for each of the 81 of ply.nodes"),
        ([0, 81], "there are nodes 0 to 80 only"),
    ],
)
def test_conditions_on_other_nodes_are_refused(where, message):
    with pytest.raises(ValueError, match=f"condition 'c': .*{message}"):
        Constraints(ply_on(SQUARES).basis, {"c": Condition(where)})


def test_an_inclined_roller_holds_at_the_middles_of_edges():
    n = np.array([0.6, 0.8])
    ply = ply_on(SQUARES)
    conditions = {
        "clamp": Condition("bottom"),
        "slope": Condition("top", lambda X, t: 0.05 * t * X[0], direction=n),
    }
    result = LoadStepper(ply, conditions, 2).run()
    top = ply.nodes[1] == 1
    assert top.sum() == 9
    u = ply.nodal(result.u)[:, top]
    np.testing.assert_allclose(n @ u, 0.05 * ply.nodes[0, top], atol=1e-14)
    force = result.states[-1].reactions["slope"]
    assert abs(force @ [-n[1], n[0]]) < 1e-7 * np.linalg.norm(force)


def test_elements_around_the_middle_of_an_edge_are_those_beside_it():
    ply = ply_on(SQUARES)
    problem = Problem(ply, Constraints(ply.basis, {"c": Condition("bottom")}), SuperLU)
    edge = np.flatnonzero(SQUARES.f2t[1] >= 0)[3]
    u = ply.basis.zeros()
    u[ply.nodal(np.arange(ply.basis.N))[1, SQUARES.nvertices + edge]] = 1.0
    np.testing.assert_array_equal(problem.around(u), np.sort(SQUARES.f2t[:, edge]))


def test_a_corner_that_folds_between_the_own_points_is_refused():
    """The middle of an edge comes so near its end that the corner there folds."""
    ply = ply_on(ONE)
    move = np.zeros((2, 6))
    move[0, 3] = -0.4
    u = dofs(ply, move)
    assert ply.area_ratio(u).min() > 0.1
    assert ply.area_ratio(u, ply.fine_points).min() < -0.1
    held = {"all": Condition(np.arange(6), lambda X, t: t * move)}
    with pytest.raises(StepError, match=r"1 element\(s\) folded.*\(element 0\)"):
        LoadStepper(ply, held, 1, max_halvings=0).run()
