"""Load programmes, energy lost over cycles, and conditions that end."""

from contextlib import nullcontext

import numpy as np
import pytest
from skfem import MeshQuad

from skfem_textile import (
    Condition,
    Fabric,
    Force,
    Full,
    Linear,
    LoadStepper,
    Locking,
    Macro,
    OnePoint,
    OnSurface,
    Ply,
    Pressure,
    Programme,
    Quadratic,
    WithFriction,
)
from skfem_textile.drape import Sphere
from skfem_textile.fabric import along
from skfem_textile.ply.amount import Following
from skfem_textile.scenes import bias_extension, picture_frame
from skfem_textile.solve.conditions import constraints_after

ELASTIC = Locking(0.5, np.radians(65.0))
LAW = WithFriction(ELASTIC, [0.02, 0.03, 0.05], [0.02, 0.1, 0.4])
IN_TENSION = WithFriction(Linear(1e3), [1.0, 2.0], [2e-3, 0.01])
FULL = Full()
FORMULATIONS = Macro(), OnePoint(), FULL, Quadratic(80.0)
SIDE = 100.0


# Programmes


def test_a_programme_is_linear_between_its_levels():
    programme = Programme([1.0, -0.5, 0.5, 0.5])
    t = np.array([0.0, 0.125, 0.25, 0.375, 0.5, 0.75, 0.9, 1.0])
    expected = [0.0, 0.5, 1.0, 0.25, -0.5, 0.5, 0.5, 0.5]
    assert [round(programme(x), 12) for x in t] == expected
    thirds = Programme([1.0, 0.0, 1.0])
    assert [thirds(i / 3) for i in range(4)] == [0.0, 1.0, 0.0, 1.0]


@pytest.mark.parametrize("levels", [[], [1.0, np.nan], [[1.0]], "up", None])
def test_invalid_levels_are_refused(levels):
    with pytest.raises(ValueError, match="levels of a programme"):
        Programme(levels)


def frame_test(law, levels, steps, formulation=FULL, **others):
    """Load stepper of a picture frame that passes through levels."""
    scene = picture_frame(size=(2, 2), side=SIDE, shear_angle=0.6).through(levels)
    ply = Ply(scene.mesh, Fabric(1e5, law, scene.warp, scene.weft), formulation)
    stepper = LoadStepper(ply, scene.conditions, steps * len(levels), **others)
    return scene, stepper


def shear_moments(result):
    """Shear angles, and moments by the virtual work of all nodal forces."""
    ply, h, found = result.ply, 1e-6, []
    for state in result.states:
        gamma = float(ply.shear_angle(state.u).mean())
        at = (np.array([np.sin(g), np.cos(g) - 1]) for g in (gamma - h, gamma + h))
        low, high = (np.outer(ply.nodes[1], direction).ravel() for direction in at)
        f = ply.residual(state.u, state.load_factor, state.parameters)
        found.append((gamma, f @ (high - low) / (2 * h * SIDE**2)))
    return np.transpose(found)


def test_a_function_may_follow_a_programme():
    squared = Following(lambda x, t: x * t**2, Programme([1.0, 0.5]))
    assert [squared(3.0, t) for t in (0.0, 0.25, 0.5, 1.0)] == [0.0, 0.75, 3.0, 0.75]
    assert squared.load_factors == [0.0, 0.5, 1.0]
    with pytest.raises(ValueError, match="steps must be a multiple of 2"):
        squared.check_steps([1 / 3, 2 / 3, 1.0])


def test_steps_that_pass_a_level_are_refused():
    scene, _ = frame_test(LAW, [1.0, 0.0, 1.0], 1)
    ply = Ply(scene.mesh, Fabric(1e5, LAW, scene.warp, scene.weft))
    with pytest.raises(ValueError, match=r"steps must be a multiple of 3, .* got 10"):
        LoadStepper(ply, scene.conditions, 10)
    blown = Pressure(1e-3, Programme([1.0, 0.0]))
    sheet = Ply(scene.mesh, Fabric(1e5), FULL, [blown], dimension=3)
    with pytest.raises(ValueError, match=r"steps must be a multiple of 2, .* got 3"):
        LoadStepper(sheet, {"edges": Condition(scene.mesh.boundary_nodes())}, 3)
    with pytest.raises(ValueError, match=r"or 3 numbers of steps, .* got 6"):
        LoadStepper(ply, scene.conditions, (2, 4))
    LoadStepper(ply, scene.conditions, (1, 2, 1))
    pulled = ply.with_terms(Force("top", (0.0, 1.0), Programme([1.0, 0.0])))
    with pytest.raises(ValueError, match="multiple of 2"):
        LoadStepper(pulled, {"held": Condition("bottom")}, 3)


# Loops


@pytest.mark.parametrize("formulation", FORMULATIONS, ids=lambda x: x.name)
def test_a_picture_frame_follows_the_law_in_one_step_per_part(formulation):
    levels = [1.0, -0.4, 0.7, 0.1]
    _, stepper = frame_test(LAW, levels, 1, formulation)
    gamma, moment = shear_moments(stepper.run())
    moments, lost = along(LAW, 0.6 * np.array(levels))
    np.testing.assert_allclose(gamma[1:], 0.6 * np.array(levels), rtol=1e-9)
    np.testing.assert_allclose(moment[1:], moments, rtol=1e-6)
    end = stepper.states[-1]
    assert end.energy_lost["shear"] == pytest.approx(lost * SIDE**2, rel=1e-9)


def test_energy_lost_in_shear_is_the_area_of_the_loop():
    """The steps end at the kinks of the loop, so that trapezoids are exact."""
    n = 15
    _, stepper = frame_test(LAW, [1.0, 0.0, 1.0], n)
    result = stepper.run()
    gamma, moment = shear_moments(result)
    lost = [sum(x.energy_lost.values()) for x in result.states]
    area = SIDE**2 * np.trapezoid(moment[n:], gamma[n:])
    assert lost[-1] - lost[n] == pytest.approx(area, rel=1e-6)
    row, before = result.history()[-1], result.history()[n]
    assert row["energy_lost"] == row["shear_energy_lost"] == lost[-1]
    work = row["work"] - before["work"]
    assert row["energy"] - before["energy"] == pytest.approx(work, rel=1e-3)
    summary = result.summary()
    assert summary["energy_lost"] == lost[-1]
    assert summary["error_interval"].startswith("none: intervals are measured")


def test_energy_lost_in_tension_is_the_area_of_the_loop():
    """Steps of equal strain, which end at the kinks of the loop."""
    n, mesh = 15, MeshQuad().with_defaults()
    ply, factor = Ply(mesh, Fabric(IN_TENSION, 1.0), FULL), Programme([1.0, 0.0, 1.0])

    def stretched(X, t):
        return np.full(X.shape[1], np.expm1(0.03 * t))

    conditions = {
        "left": Condition("left", (0.0, None)),
        "right": Condition("right", stretched, direction=(1.0, 0.0), factor=factor),
        "bottom": Condition("bottom", (None, 0.0)),
    }
    states = LoadStepper(ply, conditions, 3 * n).run().states
    strain = np.log1p([x.displacements["right"][0] for x in states])
    tension = np.array([x.reactions["right"][0] for x in states]) * np.exp(strain)
    np.testing.assert_allclose(tension, along(IN_TENSION, strain)[0], atol=1e-6)
    lost = [x.energy_lost["tension"] for x in states]
    area = np.trapezoid(tension[n:], strain[n:])
    assert lost[-1] - lost[n] == pytest.approx(area, rel=1e-6)


def test_without_friction_the_way_back_is_the_way_there():
    scene, stepper = frame_test(ELASTIC, [1.0, 0.0], 5)
    result = stepper.run()
    _, force = scene.driven_curve(result)
    np.testing.assert_allclose(force[5:], force[5::-1], atol=1e-6 * force.max())
    assert not any(x.energy_lost for x in result.states)
    assert "energy_lost" not in result.summary()


def test_loading_does_not_depend_on_the_number_of_steps():
    ends = []
    for steps in 1, 8:
        _, stepper = frame_test(LAW, [1.0], steps)
        ends.append(stepper.run().states[-1])
    one, eight = ends
    np.testing.assert_allclose(one.u, eight.u, atol=1e-9)
    assert one.energy_lost == pytest.approx(eight.energy_lost, rel=1e-9)
    assert stepper.result.path_resolved


class Killed(BaseException):
    """Ends a run like a signal."""


def interrupted(stepper_with, folder, states):
    """A run that is killed after a number of states, and resumed."""

    def kill(state):
        seen.append(state)
        if len(seen) == states:
            raise Killed

    seen = []
    with pytest.raises(Killed):
        stepper_with(checkpoint=folder, on_step=kill).run()
    return stepper_with(checkpoint=folder).run(resume=True)


def assert_same(one, other):
    """The states of both results are equal, bit for bit."""
    assert len(one.states) == len(other.states)
    assert one.linear_solves == other.linear_solves
    for a, b in zip(one.states, other.states, strict=True):
        assert np.array_equal(a.u, b.u)
        assert a.energies == b.energies
        assert a.energy_lost == b.energy_lost
        assert all(np.array_equal(a.reactions[k], b.reactions[k]) for k in a.reactions)
        assert all(a.parameters[k].same_as(x) for k, x in b.parameters.items())


@pytest.mark.parametrize("formulation", [Macro(), Full()], ids=lambda x: x.name)
def test_a_killed_run_resumes_bit_for_bit(formulation, tmp_path):
    scene = bias_extension(size=(2, 4)).through([1.0, 0.3])

    def stepper(**others):
        fabric = Fabric(IN_TENSION, LAW, scene.warp, scene.weft)
        ply = Ply(scene.mesh, fabric, formulation)
        return LoadStepper(ply, scene.conditions, 4, **others)

    assert_same(stepper().run(), interrupted(stepper, tmp_path / "run", 3))


# Conditions that end


def let_go(law, formulation=FULL, until=0.5, steps=8, **others):
    """A square sheared along its edges, which end; two nodes remain."""
    mesh = MeshQuad().refined(1).scaled((SIDE, SIDE))

    def arc(X, t):
        angle = min(2 * t, 1.0) * np.radians(40.0)
        return np.stack([X[1] * np.sin(angle), X[1] * (np.cos(angle) - 1)])

    conditions = {
        "edges": Condition(mesh.boundary_nodes(), arc, until=until),
        "corner": Condition(lambda x: (x[0] == 0) & (x[1] == 0)),
        "other": Condition(lambda x: (x[0] == SIDE) & (x[1] == 0), direction=(0, 1)),
    }
    ply = Ply(mesh, Fabric(1e4, law), formulation)
    return LoadStepper(ply, conditions, steps, **others)


@pytest.mark.parametrize("formulation", FORMULATIONS, ids=lambda x: x.name)
def test_an_elastic_ply_that_is_let_go_is_flat(formulation):
    result = let_go(ELASTIC, formulation).run()
    assert np.abs(result.ply.shear_angle(result.states[4].u)).max() > 0.6
    assert np.abs(result.ply.shear_angle(result.u)).max() < 1e-6
    assert np.abs(result.u).max() < 1e-6 * SIDE


def test_friction_leaves_the_shear_angle_at_which_the_law_is_zero():
    result = let_go(LAW).run()
    gamma = result.ply.shear_angle(result.u)
    np.testing.assert_allclose(gamma, gamma.mean(), rtol=1e-6)
    moments, _ = along(LAW, np.array([np.radians(40.0), gamma.mean()]))
    assert gamma.mean() > np.radians(5.0)
    assert abs(moments[1]) < 1e-8 * moments[0]


def test_a_condition_that_ended_has_no_force():
    """At its load factor there is a state with it, and one without it."""
    states = let_go(ELASTIC).run().states
    assert [x.load_factor for x in states[4:6]] == [0.5, 0.5]
    assert np.abs(states[4].reactions["edges"]).max() > 1
    for state in states[5:]:
        np.testing.assert_allclose(state.forces["edges"], 0.0, atol=1e-6)
    for state in states:
        total = sum(state.reactions.values())
        np.testing.assert_allclose(total, 0.0, atol=1e-6)


def test_the_energy_decreases_by_the_work_of_the_forces_that_vanish():
    held, free = let_go(ELASTIC).run().history()[4:6]
    assert held["energy"] > 1 > free["energy"]
    work = free["work"] - held["work"]
    assert work == pytest.approx(free["energy"] - held["energy"], rel=1e-9)


def test_a_state_has_an_interval_until_conditions_end():
    result = let_go(ELASTIC).run()
    held, free, later = (result.interval(x) for x in result.states[4:7])
    assert "conditions have ended" not in held.reason
    assert "conditions have ended" in free.reason
    assert later.reason == free.reason


def test_a_condition_ends_on_a_surface():
    """The ply slides back to where it lies without the condition."""
    mesh = MeshQuad().refined(2).scaled(50.0)
    ply = Ply(mesh, Fabric(1e2, 0.5), dimension=3)
    corners = (lambda X: (X[0] == 0) & (X[1] == 0)), (lambda X: X[0] + X[1] == 100)
    held = {
        "sphere": OnSurface(Sphere(80.0, (0.0, 0.0, -80.0))),
        "corner": Condition(corners[0], (0.0, 0.0, None)),
        "side": Condition(lambda X: (X[0] == 50) & (X[1] == 0), (None, 0.0, None)),
    }
    pulled = {"pulled": Condition(corners[1], (-3.0, None, None), until=0.5)}
    free, result = (LoadStepper(ply, held | x, 2).run() for x in ({}, pulled))
    assert np.abs(result.states[1].reactions["pulled"]).max() > 0.1
    assert np.abs(result.u - free.u).max() < 1e-6


def test_an_initial_guess_of_a_ply_whose_conditions_end_is_refused():
    with pytest.raises(ValueError, match="initial_guess does not apply"):
        let_go(ELASTIC, initial_guess=np.zeros(18))


@pytest.mark.parametrize("states", [2, 3, 4])
def test_a_run_that_is_killed_at_an_end_resumes_bit_for_bit(states, tmp_path):
    def stepper(**others):
        return let_go(LAW, steps=4, **others)

    assert_same(stepper().run(), interrupted(stepper, tmp_path / "run", states))


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (
            {"until": 0.3},
            "condition 'edges' ends at the load factor 0.3, within a step",
        ),
        ({"until": 0.0}, "until must be a load factor above 0 and at most 1, got 0.0"),
        ({"until": 1.5}, "until must be a load factor"),
    ],
)
def test_invalid_ends_are_refused(arguments, message):
    with pytest.raises(ValueError, match=message):
        let_go(LAW, **arguments)


def test_an_end_of_all_conditions_is_refused():
    ply = Ply(MeshQuad().with_defaults(), Fabric(1e4, 1.0), FULL)
    with pytest.raises(ValueError, match="no condition remains beyond the load factor"):
        LoadStepper(ply, {"bottom": Condition("bottom", until=0.5)}, 2)


@pytest.mark.parametrize(("off", "ends"), [(3e-10, True), (3e-9, False)])
def test_a_condition_ends_at_a_load_factor_of_a_step(off, ends):
    ply = Ply(MeshQuad().with_defaults(), Fabric(1e4, 1.0), FULL)
    conditions = {"left": Condition("left", until=0.5 + off), "top": Condition("top")}
    with nullcontext() if ends else pytest.raises(ValueError, match="within a step"):
        assert [*constraints_after(ply.basis, conditions, [0.5, 1.0], {})] == [0.5]


def test_a_programme_is_exact_at_the_rounded_ends_of_its_parts():
    programme = Programme([1.0, 0.0])
    assert programme(0.5 + 4e-16) == 1.0
    assert programme(0.5 + 4e-15) < 1.0
