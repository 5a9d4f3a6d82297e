"""Results of the plies of a stack, and the fields between them."""

from dataclasses import replace

import numpy as np
import pytest

from skfem_textile import Fabric, LoadStepper, Ply, Stack
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
