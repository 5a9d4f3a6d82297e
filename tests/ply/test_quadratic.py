"""Quadratic triangles: elements, meshes and runs."""

from dataclasses import replace

import meshio
import numpy as np
import pytest
from skfem import MeshQuad, MeshTri, MeshTri2

from skfem_textile import (
    Condition,
    Fabric,
    Full,
    LoadStepper,
    MeshError,
    Ply,
    Quadratic,
    StepError,
)
from skfem_textile.io import write_fields
from skfem_textile.io.results import cell_fields
from skfem_textile.mesh.checks import check_mesh
from skfem_textile.mesh.splitting import cut, split
from skfem_textile.scenes import bias_extension, picture_frame, strip, trellis
from skfem_textile.scenes.rectangle import rectangle
from skfem_textile.solve.conditions import Constraints
from skfem_textile.solve.linear.superlu import SuperLU
from skfem_textile.solve.problem import Problem
from studies.stability.soundness import is_sound
from tests.helpers import distorted, distorted_for, random_u
from tests.helpers.intervals import without_interval
from tests.helpers.plies import ONE, SQUARES, dofs, ply_on, run

# Quadratic triangles: nodes, gradients, modes, and conditions on all nodes


def test_nodes_are_vertices_and_then_middles_of_edges():
    ply = ply_on(distorted_for(Quadratic(), 1))
    n = ply.mesh.nvertices
    np.testing.assert_array_equal(ply.nodes[:, :n], ply.mesh.p)
    ends = ply.mesh.p[:, ply.mesh.facets]
    np.testing.assert_allclose(ply.nodes[:, n:], 0.5 * (ends[:, 0] + ends[:, 1]))
    np.testing.assert_allclose(dofs(ply, ply.nodes)[::2], ply.basis.doflocs[0, ::2])
    np.testing.assert_allclose(dofs(ply, ply.nodes)[1::2], ply.basis.doflocs[1, ::2])


def test_nodes_of_quadrilaterals_are_vertices():
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


def test_conditions_include_the_middles_of_edges():
    basis = ply_on(SQUARES).basis
    nodes = ply_on(SQUARES).nodes
    below = np.flatnonzero(nodes[1] == 0)
    assert len(below) == 2 * 4 + 1
    mask = nodes[1] == 0
    for where in ("bottom", lambda X: X[1] == 0, mask, below):
        numbers = Condition(where).nodes("c", basis)
        np.testing.assert_array_equal(np.sort(numbers), below)


@pytest.mark.parametrize(
    ("where", "message"),
    [
        (SQUARES.p[1] == 0, "one bool for each of the 81 nodes of ply.nodes"),
        ([0, 81], "node numbers must be from 0 to 80"),
    ],
)
def test_conditions_on_other_nodes_are_rejected(where, message):
    with pytest.raises(ValueError, match=f"condition 'c': .*{message}"):
        Constraints(ply_on(SQUARES).basis, {"c": Condition(where)})


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


# Valid and rejected meshes of quadratic triangles, and quadrilaterals cut into them


def moved(node, by):
    p = SQUARES.p.copy()
    p[:, node] += by
    return MeshTri(p, SQUARES.t)


TWO = np.array([[0, 1, 0, 0.2], [0, 0, 1, 0.2]])


@pytest.mark.parametrize(
    ("mesh", "message"),
    [
        (split(MeshQuad()), "quadratic triangles do not accept a split mesh"),
        (MeshTri2(), "a skfem.MeshTri with straight edges, not MeshTri2$"),
        (moved(5, np.nan), r"1 node\(s\) have coordinates that are not finite: 5"),
        (moved(12, 0.6), r"triangle\(s\) overlap a neighbour"),
        (MeshTri(TWO[:, [0, 1, 1]], [[0], [1], [2]]), "inverted or degenerate: 0"),
        (MeshTri([[0, 1, 3], [0, 1, 3.0]], [[0], [1], [2]]), "degenerate: 0"),
        (MeshTri(TWO, [[0], [1], [2]]), r"1 node.* belong to no triangle.*: 3"),
        (MeshTri(TWO, [[0, 0], [1, 1], [2, 3]]), r"2 triangle.* overlap .*: 0, 1"),
        (MeshTri(TWO, [[0] * 3, [1] * 3, [2, 3, 2]]), "share an edge with more than"),
        (MeshTri(TWO, [[0], [1], [4]]), "refer to an undefined node: 0"),
    ],
    ids=[
        *("split", "curved", "nan", "overturned", "collapsed", "flat", "unused"),
        *("overlap", "thrice", "index"),
    ],
)
def test_invalid_meshes_are_rejected(mesh, message):
    with pytest.raises(MeshError, match=message):
        ply_on(mesh)


def test_quadrilaterals_that_are_not_convex_are_cut_inside():
    """A node is so near the middle of an element that one diagonal lies outside."""
    quads = MeshQuad(
        np.array([[0.0, 2.0, 0.8, 0.0], [0.0, 0.0, 0.8, 2.0]]), np.arange(4)[:, None]
    )
    for turn in range(4):
        mesh = MeshQuad(quads.p, np.roll(quads.t, turn, axis=0)).with_defaults()
        check_mesh(mesh)
        triangles = cut(mesh)
        check_mesh(triangles)
        assert triangles.nelements == 2
        assert set(triangles.boundaries) == {"left", "bottom"}


def test_cut_meshes_keep_the_extent_of_their_names():
    quads = distorted(4).with_subdomains({"part": np.array([0, 2])})
    triangles = cut(quads)
    for name, edges in quads.boundaries.items():
        np.testing.assert_array_equal(
            np.unique(triangles.facets[:, triangles.boundaries[name]]),
            np.unique(quads.facets[:, edges]),
        )
    assert len(triangles.subdomains["part"]) == 4


# Runs with quadratic triangles: scenes, methods, checkpoints, files, pictures


@pytest.mark.parametrize(("size", "n_dofs"), [((5, 7), 330), ((5, 8), 374)])
def test_few_triangles_follow_the_smooth_shape_of_the_strip(size, n_dofs):
    scene = strip(cut(rectangle(40, 60, size)))
    result = run(scene)
    summary = scene.summary(without_interval(result))
    assert summary["n_dofs"] == n_dofs
    assert is_sound(result.ply, scene, result.u, result.states[-1].parameters)
    assert summary["displacement_error_rms"] < 0.008
    assert summary["shear_angle_error_rms_deg"] < 0.11
    assert -3 < summary["reaction_x"] < 0
    assert summary["max_fibre_strain"] < 1.2e-3
    assert summary["max_fibre_strain"] < summary["mesh_fibre_strain"] < 2.5e-3


def test_the_strip_locks_less_than_with_more_unknowns_of_quadrilaterals():
    loads = {}
    for scene, formulation in (
        (strip(cut(rectangle(40, 60, (5, 7)))), Quadratic()),
        (strip(size=(10, 15)), Full()),
    ):
        ply = Ply(scene.mesh, Fabric(1e4), formulation)
        result = LoadStepper(ply, scene.conditions, 4).run()
        loads[formulation] = abs(scene.summary(without_interval(result))["reaction_x"])
    assert loads[Quadratic()] < loads[Full()] / 20


def test_triangles_lock_at_the_kinks_of_bias_extension():
    scene = bias_extension(cut(rectangle(50, 100, (8, 16), "irregular", 0.25)))
    G = 0.5
    ratios = [
        scene.summary(without_interval(run(scene, E=E, G=G)))["load_over_exact"]
        for E in (1e4, 1e5)
    ]
    assert 1.2 < ratios[0] < 5
    assert ratios[1] > 3 * ratios[0]


def test_a_uniform_shear_is_exact():
    scene = picture_frame(cut(rectangle(100, 100, (4, 4), "irregular")))
    summary = scene.summary(without_interval(run(scene, G=0.5)))
    assert summary["displacement_error_max"] < 1e-9
    assert summary["max_shear_angle_deg"] == pytest.approx(45)


def test_every_boundary_node_of_a_trellis_is_prescribed():
    scene = trellis(cut(rectangle(100, 100, (3, 3))))
    result = run(scene, G=0.5)
    boundary = Condition("held").nodes("c", result.ply.basis)
    assert len(boundary) == 2 * 12
    error = result.ply.nodal(result.u) - scene.displacement(result.ply.nodes, 1.0)
    assert np.abs(error[:, boundary]).max() < 1e-9


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


def test_the_shear_angle_error_is_evaluated_at_the_centroid():
    """The mean over the vertices equals a linear exact angle there."""
    scene = strip(cut(rectangle(40, 60, (5, 7))))
    result = run(scene)
    angle = result.ply.shear_angle(result.u, np.full((2, 1), 1 / 3))[:, 0]
    x, y = scene.mesh.p[:, scene.mesh.t]
    error = angle - y.mean(axis=0) / 55
    area = np.abs((x[1] - x[0]) * (y[2] - y[0]) - (x[2] - x[0]) * (y[1] - y[0]))
    rms = np.degrees(np.sqrt(np.average(error**2, weights=area)))
    assert scene.errors(result)["shear_angle_error_rms_deg"] == pytest.approx(rms)


def test_a_rotated_problem_has_the_same_answer():
    scene = strip(cut(rectangle(40, 60, (3, 4))))
    turned = scene.rotated(0.7)
    a, b = (s.summary(without_interval(run(s, G=0.1))) for s in (scene, turned))
    for key in ("energy", "reaction_x", "reaction_y", "displacement_error_rms"):
        assert b[key] == pytest.approx(a[key], rel=1e-6), key


@pytest.mark.parametrize("method", ["newton", "plain"])
def test_every_method_gives_the_same_state(method):
    scene = strip(cut(rectangle(40, 60, (3, 4))))
    energies = [
        run(scene, 10, 100.0, 1.0, **options).history()[-1]["energy"]
        for options in ({}, {"method": method})
    ]
    assert energies[1] == pytest.approx(energies[0], rel=1e-6)


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


def test_triangles_are_drawn(tmp_path):
    plot = pytest.importorskip("skfem_textile.plot")
    pv = pytest.importorskip("pyvista")
    result = run(strip(cut(rectangle(40, 60, (2, 3)))))
    plotter = plot.shear_angle(result, filename=tmp_path / "p.png")
    (drawn,) = (
        actor.mapper.dataset
        for actor in plotter.renderers[0].actors.values()
        if isinstance(actor, pv.Actor) and actor.mapper.scalar_visibility
    )
    assert drawn.n_cells == 12
    texts = [
        a.input
        for renderer in plotter.renderers
        for a in renderer.actors.values()
        if hasattr(a, "input")
    ]
    assert any("Shear angle" in text for text in texts)
    colours = np.unique(pv.read(tmp_path / "p.png").point_data.active_scalars, axis=0)
    assert len(colours) > 10
