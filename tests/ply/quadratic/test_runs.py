"""Runs with quadratic triangles: scenes, methods, checkpoints, files, pictures."""

from dataclasses import replace

import meshio
import numpy as np
import pytest

from skfem_textile import (
    CheckpointError,
    Condition,
    Fabric,
    Full,
    LoadStepper,
    Ply,
    Quadratic,
)
from skfem_textile.io import write_fields
from skfem_textile.io.results import cell_fields
from skfem_textile.mesh.splitting import cut
from skfem_textile.scenes import bias_extension, picture_frame, strip, trellis
from skfem_textile.scenes.rectangle import rectangle
from studies.stability.soundness import is_sound
from tests.helpers.quadratic_plies import dofs, run


@pytest.mark.parametrize(("size", "n_dofs"), [((5, 7), 330), ((5, 8), 374)])
def test_few_triangles_follow_the_smooth_shape_of_the_strip(size, n_dofs):
    scene = strip(cut(rectangle(40, 60, size)))
    result = run(scene)
    summary = scene.summary(result)
    assert summary["n_dofs"] == n_dofs
    assert is_sound(result.ply, scene, result.u, result.states[-1].parameters)
    assert summary["displacement_error_rms"] < 0.008
    assert summary["shear_angle_error_rms_deg"] < 0.11
    assert -3 < summary["reaction_x"] < 0
    assert summary["max_fibre_strain"] < 1.2e-3
    assert summary["max_fibre_strain"] < summary["mesh_fibre_strain"] < 2.5e-3


def test_the_strip_locks_less_than_with_quadrilaterals_and_more_unknowns():
    loads = {}
    for scene, formulation in (
        (strip(cut(rectangle(40, 60, (5, 7)))), Quadratic()),
        (strip(size=(10, 15)), Full()),
    ):
        ply = Ply(scene.mesh, Fabric(1e4), formulation)
        result = LoadStepper(ply, scene.conditions, 4).run()
        loads[formulation] = abs(scene.summary(result)["reaction_x"])
    assert loads[Quadratic()] < loads[Full()] / 20


def test_at_the_kinks_of_bias_extension_triangles_lock():
    scene = bias_extension(cut(rectangle(50, 100, (8, 16), "irregular", 0.25)))
    G = 0.5
    ratios = [
        scene.summary(run(scene, E=E, G=G))["load_over_exact"] for E in (1e4, 1e5)
    ]
    assert 1.2 < ratios[0] < 5
    assert ratios[1] > 3 * ratios[0]


def test_a_uniform_shear_is_exact():
    scene = picture_frame(cut(rectangle(100, 100, (4, 4), "irregular")))
    summary = scene.summary(run(scene, G=0.5))
    assert summary["displacement_error_max"] < 1e-9
    assert summary["max_shear_angle_deg"] == pytest.approx(45)


def test_every_node_of_the_boundary_of_a_trellis_is_led():
    scene = trellis(cut(rectangle(100, 100, (3, 3))))
    result = run(scene, G=0.5)
    boundary = Condition("held").nodes("c", result.ply.basis)
    assert len(boundary) == 2 * 12
    off = result.ply.nodal(result.u) - scene.displacement(result.ply.nodes, 1.0)
    assert np.abs(off[:, boundary]).max() < 1e-9


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


def test_the_shear_angle_error_is_that_at_the_centroid():
    """Where the exact angle is linear the mean of the vertices has it."""
    scene = strip(cut(rectangle(40, 60, (10, 15))))
    result = run(scene)
    angle = result.ply.shear_angle(result.u, np.full((2, 1), 1 / 3))[:, 0]
    x, y = scene.mesh.p[:, scene.mesh.t]
    off = angle - y.mean(axis=0) / 55
    area = np.abs((x[1] - x[0]) * (y[2] - y[0]) - (x[2] - x[0]) * (y[1] - y[0]))
    rms = np.degrees(np.sqrt(np.average(off**2, weights=area)))
    assert scene.errors(result)["shear_angle_error_rms_deg"] == pytest.approx(rms)


def test_a_rotated_problem_has_the_same_answer():
    scene = strip(cut(rectangle(40, 60, (3, 4))))
    turned = scene.rotated(0.7)
    a, b = (s.summary(run(s, G=0.1)) for s in (scene, turned))
    for key in ("energy", "reaction_x", "reaction_y", "displacement_error_rms"):
        assert b[key] == pytest.approx(a[key], rel=1e-6), key


@pytest.mark.parametrize("method", ["newton", "plain"])
def test_every_method_finds_the_same_state(method):
    scene = strip(cut(rectangle(40, 60, (3, 4))))
    energies = [
        run(scene, 10, 100.0, 1.0, **options).summary()["energy"]
        for options in ({}, {"method": method})
    ]
    assert energies[1] == pytest.approx(energies[0], rel=1e-6)


def test_a_checkpoint_is_resumed_to_the_same_states(tmp_path):
    scene = strip(cut(rectangle(40, 60, (3, 4))))
    whole = run(scene)

    def interrupt(state):
        if state.load_factor >= 0.5:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        run(scene, checkpoint=tmp_path, on_step=interrupt)
    other = LoadStepper(
        Ply(scene.mesh, Fabric(2e4), Quadratic()),
        scene.conditions,
        4,
        checkpoint=tmp_path,
    )
    with pytest.raises(CheckpointError, match="warp law was Linear"):
        other.run(resume=True)
    ply = Ply(scene.mesh, Fabric(1e4), Quadratic())
    again = LoadStepper(ply, scene.conditions, 4, checkpoint=tmp_path).run(resume=True)
    assert len(again.states) == len(whole.states)
    np.testing.assert_array_equal(again.u, whole.u)


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
        a.input for a in plotter.renderers[0].actors.values() if hasattr(a, "input")
    ]
    assert any("Shear angle" in text for text in texts)
    colours = np.unique(pv.read(tmp_path / "p.png").point_data.active_scalars, axis=0)
    assert len(colours) > 10
