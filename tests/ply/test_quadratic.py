"""Quadratic triangles: elements, meshes and runs."""

from dataclasses import replace

import meshio
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
from skfem_textile.io import write_fields
from skfem_textile.io.results import cell_fields
from skfem_textile.mesh.selection import SINGULAR
from skfem_textile.mesh.splitting import cut
from skfem_textile.scenes import picture_frame, strip
from skfem_textile.scenes.rectangle import rectangle
from skfem_textile.solve.conditions import Constraints
from skfem_textile.solve.linear.superlu import SuperLU
from skfem_textile.solve.problem import Problem
from tests.helpers import distorted_for, random_u
from tests.helpers.intervals import without_interval
from tests.helpers.plies import ONE, SQUARES, dofs, ply_on, run

# Quadratic triangles: nodes, gradients, modes, and conditions on all nodes


def test_nodes_are_vertices_and_then_middles_of_edges():
    ply = ply_on(distorted_for(Quadratic(), 1))
    n = ply.mesh.nvertices
    np.testing.assert_array_equal(ply.nodes[:, :n], ply.mesh.p)
    ends = ply.mesh.p[:, ply.mesh.facets]
    np.testing.assert_allclose(ply.nodes[:, n:], 0.5 * (ends[:, 0] + ends[:, 1]))
    positions = dofs(ply, ply.nodes).reshape(-1, 2).T
    np.testing.assert_allclose(positions, ply.basis.doflocs[:, ::2])


def test_gradients_of_quadratic_motions_are_exact_at_any_point():
    ply = ply_on(distorted_for(Quadratic(), 2))
    C = np.random.default_rng(0).standard_normal((2, 2, 2))
    X = ply.nodes
    u = dofs(ply, np.einsum("ijk,jn,kn->in", C, X, X))
    for points in (None, ply.centre, ply.fine_points):
        x = ply.basis.mapping.F(ply.basis.X if points is None else points)
        exact = np.einsum("ijk,k...->ij...", C + C.swapaxes(1, 2), x)
        np.testing.assert_allclose(ply.gradient(u, points), exact, atol=1e-12)


@pytest.mark.parametrize(("shear", "modes"), [(0.0, 6), (1.0, 3)])
def test_zero_energy_modes_of_one_triangle(shear, modes):
    ply = ply_on(ONE, shear)
    stiffness = np.linalg.eigvalsh(ply.tangent(ply.basis.zeros()).toarray())
    assert np.sum(stiffness < 1e-12) == modes


def test_a_homogeneous_motion_of_the_boundary_gives_a_homogeneous_state():
    """The finite patch test: shear, stretch and rotation."""
    mesh = cut(rectangle(3, 2, (4, 3), "irregular", 0.2, 3)).with_defaults()
    mesh = mesh.with_boundaries({"rim": mesh.boundary_facets()})
    H = np.array([[0.1, 0.3], [-0.1, 0.05]])
    ply = ply_on(mesh)
    held = {"rim": Condition("rim", lambda X, t: t * H @ X)}
    result = LoadStepper(ply, held, 2).run()
    np.testing.assert_allclose(ply.nodal(result.u), H @ ply.nodes, atol=1e-9)
    np.testing.assert_allclose(np.ptp(ply.shear_angle(result.u)), 0.0, atol=1e-9)


def test_the_node_order_of_a_triangle_has_no_effect():
    mesh = distorted_for(Quadratic(), 3)
    turned = MeshTri(mesh.p, mesh.t[[2, 0, 1]], sort_t=False)
    mirrored = MeshTri(mesh.p, mesh.t[::-1], sort_t=False)
    plies = [ply_on(m) for m in (mesh, turned, mirrored)]
    columns = plies[0].nodal(random_u(plies[0], 3))
    energies = [ply.energy(dofs(ply, columns)) for ply in plies]
    assert energies == pytest.approx([energies[0]] * 3, rel=1e-12)


def test_an_inclined_roller_acts_at_the_middles_of_edges():
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


def test_elements_around_the_middle_of_an_edge_are_adjacent_to_it():
    ply = ply_on(SQUARES)
    problem = Problem(ply, Constraints(ply.basis, {"c": Condition("bottom")}), SuperLU)
    edge = np.flatnonzero(SQUARES.f2t[1] >= 0)[3]
    u = ply.basis.zeros()
    u[ply.nodal(np.arange(ply.basis.N))[1, SQUARES.nvertices + edge]] = 1.0
    np.testing.assert_array_equal(problem.around(u), np.sort(SQUARES.f2t[:, edge]))


def test_a_corner_that_folds_between_the_points_is_rejected():
    """The middle of an edge is so near its end that the corner there folds."""
    ply = ply_on(ONE)
    move = np.zeros((2, 6))
    move[0, 3] = -0.4
    u = dofs(ply, move)
    assert ply.area_ratio(u).min() > 0.1
    assert ply.area_ratio(u, ply.fine_points).min() < -0.1
    held = {"all": Condition(np.arange(6), lambda X, t: t * move)}
    with pytest.raises(StepError, match=r"1 element\(s\) folded.*\(element 0\)"):
        LoadStepper(ply, held, 1, max_halvings=0).run()


@pytest.mark.parametrize(
    ("height", "slope", "resolves"),
    [(0.4, 0.0, True), (0.4, 3e-4, True), (0.6, 0.0, False), (0.4, 3e-3, False)],
)
def test_long_triangles_along_a_singular_fibre_resolve_its_layer(
    height, slope, resolves
):
    """All stretches of its family have the stiffness E, in series with 10⁸ G."""
    mesh = MeshTri.init_tensor(np.arange(11.0), np.array([5.0, 5.0 + height]))
    mesh = mesh.with_boundaries({SINGULAR: lambda x: x[1] == 5.0})
    ply = Ply(mesh, Fabric(1e4, 1.0, (1.0, slope)), Quadratic(80.0))
    along, across = ply.parameters_at_rest["tension"]["E_d"]
    if resolves:
        np.testing.assert_allclose(along, 1e4 * 1e8 / (1e4 + 1e8))
        np.testing.assert_allclose(across, 1e4 * 80 / (1e4 + 80))
    else:
        of_layer = 4.0 * np.sqrt(20.0) * 1e2  # of one of twenty triangles
        assert along.max() == pytest.approx(1e4 * of_layer / (1e4 + of_layer))


# Runs with quadratic triangles: scenes, methods, checkpoints, files, pictures


STRIP = strip(cut(rectangle(40, 60, (5, 7))))


@pytest.fixture(scope="module")
def pulled():
    """The strip of triangles at its full load."""
    return run(STRIP)


def test_the_strip_locks_less_than_with_more_unknowns_of_quadrilaterals(pulled):
    locked = strip(size=(10, 15))
    ply = Ply(locked.mesh, Fabric(1e4), Full())
    result = LoadStepper(ply, locked.conditions, 4).run()
    load, locked_load = (
        abs(scene.summary(without_interval(x))["reaction_x"])
        for scene, x in ((STRIP, pulled), (locked, result))
    )
    assert load < locked_load / 20


def test_the_displacement_error_is_taken_over_all_nodes():
    scene = picture_frame(cut(rectangle(100, 100, (2, 2))))
    result = run(scene, steps=1)
    ply = result.ply
    columns = scene.displacement(ply.nodes, 1.0)
    columns[:, -1] += [0.3, 0.4]
    state = replace(result.states[-1], u=dofs(ply, columns))
    errors = scene.errors(replace(result, states=[state]))
    assert errors["displacement_error_max"] == pytest.approx(0.5)
    n = ply.nodes.shape[1]
    assert n == ply.mesh.nvertices + ply.mesh.nfacets
    assert errors["displacement_error_rms"] == pytest.approx(0.5 / np.sqrt(n))


def test_the_shear_angle_error_is_evaluated_at_the_centroid(pulled):
    """The mean over the vertices equals a linear exact angle there."""
    angle = pulled.ply.shear_angle(pulled.u, np.full((2, 1), 1 / 3))[:, 0]
    x, y = STRIP.mesh.p[:, STRIP.mesh.t]
    error = angle - y.mean(axis=0) / 55
    area = np.abs((x[1] - x[0]) * (y[2] - y[0]) - (x[2] - x[0]) * (y[1] - y[0]))
    rms = np.degrees(np.sqrt(np.average(error**2, weights=area)))
    assert STRIP.errors(pulled)["shear_angle_error_rms_deg"] == pytest.approx(rms)


def test_fields_are_written_on_straight_triangles(tmp_path):
    scene = strip(rectangle(40, 60, (2, 3), "delaunay"))
    result = run(scene)
    ply, n = result.ply, scene.mesh.nvertices
    write_fields(result, tmp_path)
    saved = meshio.read(tmp_path / "step_0004.vtu")
    np.testing.assert_array_equal(saved.cells_dict["triangle"], scene.mesh.t.T)
    np.testing.assert_array_equal(saved.points[:, :2], scene.mesh.p.T)
    u = ply.nodal(result.u)[:, :n]
    np.testing.assert_allclose(saved.point_data["displacement"][:, :2], u.T)
    fields = cell_fields(ply, result.u)
    strain = ply.fibre_strain(result.u)[0]
    np.testing.assert_array_equal(
        np.abs(fields["warp_strain"]), np.abs(strain).max(axis=1)
    )
    centre = ply.fibre_direction(result.u, np.full((2, 1), 1 / 3))[0, :, :, 0]
    np.testing.assert_allclose(fields["warp_direction"][:, :2], centre.T)
    np.testing.assert_allclose(saved.cell_data["shear_angle"][0], fields["shear_angle"])
    assert not (tmp_path / "own_steps.pvd").exists()
