"""Results of the plies of a stack, and the fields between them."""

import re
from dataclasses import replace

import meshio
import numpy as np
import pytest

from skfem_textile import Fabric, LoadStepper, Ply, Stack
from skfem_textile.io import write_fields
from skfem_textile.scenes import hemisphere_forming

THICKNESS = 0.5


@pytest.fixture(scope="module")
def result():
    scene = hemisphere_forming(
        "aligned", size=(4, 4), travel=10, gap=0.3 + 2 * THICKNESS
    )
    q = np.sqrt(0.5)
    fabrics = [
        Fabric(1e4, 0.1, *axes, bending=(5.0, 5.0))
        for axes in (((1, 0), (0, 1)), ((q, q), (-q, q)))
    ]
    ends = scene.fibre_ends
    plies = [Ply(scene.mesh, x, dimension=3, fibre_ends=ends) for x in fabrics]
    terms = [*scene.loads, *scene.tools]
    stack = Stack(plies, terms=terms, thickness=THICKNESS, friction=0.2)
    return LoadStepper(stack, scene.conditions, steps=2).run()


def test_results_of_plies_add_up_to_the_stack(result):
    stack, whole = result.ply, result.summary()
    one, two = (x.summary() for x in result.plies)
    for key in (
        *("n_elements", "n_dofs", "punch_force_N", "die_force_N", "energy"),
        *("punch_nodes_in_contact", "tension_energy", "stabilisation_energy"),
    ):
        assert one[key] + two[key] == pytest.approx(whole[key], rel=1e-9)
    for key in "max_shear_angle_deg", "max_fibre_tension", "mesh_fibre_strain":
        assert max(one[key], two[key]) == pytest.approx(whole[key], rel=1e-9)
    assert one["punch_nodes_in_contact"] > 0 == two["punch_nodes_in_contact"]
    for number, of_ply in enumerate(result.plies, 1):
        there = stack.positions(result.u)[:, stack.nodes_of(number)]
        np.testing.assert_allclose(of_ply.ply.positions(of_ply.u), there, atol=1e-12)
        assert of_ply.ply.users_mesh is stack.plies[number - 1].users_mesh


def test_there_is_no_error_interval_of_a_stack(result):
    for some in (result, result.of_ply(1)):
        assert some.summary()["error_interval"].startswith("none: intervals are not")


def test_plies_that_do_not_exist_are_refused(result):
    for number in (0, 3, "top"):
        with pytest.raises(ValueError, match=r"plies 1 \(lowest\) to 2, not"):
            result.of_ply(number)
        with pytest.raises(ValueError, match=r"plies 1 \(lowest\) to 2, not"):
            result.ply.gap(result.states[-1], number)
    with pytest.raises(ValueError, match="of_ply requires a Stack"):
        result.of_ply(1).of_ply(1)
    assert result.of_ply(2).plies == []


def test_fields_between_plies(result):
    stack, state = result.ply, result.states[-1]
    gap, slip, pressure = (f(state, 1) for f in (stack.gap, stack.slip, stack.pressure))
    under = np.isfinite(gap)
    assert under.any()
    assert (gap[under] > -1e-9).all()
    assert np.isnan(slip[~under]).all()
    assert np.isnan(pressure[~under]).all()
    pressed = under & (np.nan_to_num(pressure) > 0)
    assert 0 < pressed.sum() < under.sum()
    assert 0 < np.nanmax(slip) < 10
    assert np.isnan(stack.gap(state, 2)).all()


def test_plies_at_rest_touch_without_slip(result):
    stack = result.ply
    state = replace(result.states[0], u=stack.basis.zeros())
    np.testing.assert_allclose(stack.gap(state, 1), 0, atol=1e-12)
    np.testing.assert_allclose(stack.slip(state, 1), 0, atol=1e-9)


def test_slip_is_the_distance_at_rest_of_points_on_each_other(result):
    stack, moved = result.ply, np.zeros((3, result.ply.nodes.shape[1]))
    moved[0, stack.nodes_of(2)] = -3.0
    moved[2, stack.nodes_of(2)] = 1.5
    state = replace(result.states[0], u=moved.T.ravel())
    gap, slip = stack.gap(state, 1), stack.slip(state, 1)
    x = stack.plies[0].nodes[0]
    inner, edge = (x > 0.4 * x.max()) & (x < x.max() - 3), x == x.max()
    np.testing.assert_allclose(gap[inner], 1.5)
    np.testing.assert_allclose(slip[inner], 3.0)
    assert edge.any()
    assert np.isnan(gap[edge]).all()
    assert np.isnan(slip[edge]).all()


def test_summary_of_a_stack_has_figures_of_pairs_and_plies(result):
    summary = result.summary()
    assert "max_draw_in_mm" not in summary
    assert "max_areal_weight_ratio" not in summary
    for i, of_ply in enumerate(result.plies, 1):
        own = of_ply.summary()
        for key in "recovered_max_shear_angle_deg", "max_draw_in_mm":
            assert summary[f"ply_{i}_{key}"] == pytest.approx(own[key])
    lost = "plies_1_and_2_energy_lost"
    assert summary[lost] == result.states[-1].energy_lost["plies 1 and 2"] > 0
    gap = result.ply.gap(result.states[-1], 1)
    assert summary["plies_1_and_2_max_gap_mm"] == pytest.approx(np.nanmax(gap), rel=0.2)
    assert 0 < summary["plies_1_and_2_contact_share_of_area"] < 1
    # The punch is below the lower ply, the die above the upper one.
    pressed = summary["plies_1_and_2_force_N"]
    assert pressed == pytest.approx(summary["punch_force_N"], rel=0.05)
    text = repr(result)
    assert " mm between plies 1 and 2" in text
    assert re.search(r"Largest draw-in +0\.\d+ mm of ply \d", text)


def test_files_of_a_stack_have_the_fields_between_plies(result, tmp_path):
    write_fields(result, tmp_path)
    grid = meshio.read(tmp_path / "step_0002.vtu")
    state, stack = result.states[-1], result.ply
    np.testing.assert_allclose(grid.points.T, stack.at_rest)
    slip = grid.point_data["slip_to_ply_above"]
    np.testing.assert_allclose(slip[stack.nodes_of(1)], stack.slip(state, 1))
    assert np.isnan(slip[stack.nodes_of(2)]).all()
    assert (np.concatenate(grid.cell_data["ply"]) == np.repeat([1, 2], 64)).all()
    write_fields(result.of_ply(2), tmp_path)
    assert (tmp_path / "own_steps.pvd").exists()
