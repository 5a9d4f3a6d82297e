"""Clamps: springs along an edge that let go at a force."""

import logging
import re
from functools import cache

import numpy as np
import pytest
from skfem import MeshQuad

from skfem_textile import (
    CheckpointError,
    Clamp,
    Condition,
    Fabric,
    Force,
    Holder,
    LoadStepper,
    Macro,
    OnePoint,
    Ply,
    Programme,
    Quadratic,
    StepError,
    Tool,
    Traction,
    drape,
)
from skfem_textile.fabric import CrimpToe

WIDTH, LENGTH = 10.0, 20.0
K, F = 50.0, 30.0
FABRIC, ONE_POINT = Fabric(1e3, 1.0), OnePoint()
PULLED = {"bottom": Condition("bottom", (0.0, -1.0))}


def strip(*terms, fabric=FABRIC, formulation=ONE_POINT, half=False):
    x = np.linspace(0, WIDTH / (1 + half), 3 - half)
    mesh = MeshQuad.init_tensor(x, np.linspace(0, LENGTH, 5)).with_defaults()
    return Ply(mesh, fabric, formulation, terms)


def run(ply, conditions=PULLED, steps=1, **options):
    return LoadStepper(ply, conditions, steps, **options).run()


def let_go(result, name="clamp"):
    """Load factor and force at which a clamp lets go, and the states around it."""
    p = result.states[-1].parameters[name]
    at = float(p["released_at"])
    before, after, *_ = [x for x in result.states if x.load_factor == at]
    return at, float(p["release_force"]), before, after


@pytest.mark.parametrize("formulation", [OnePoint(), Macro(), Quadratic()], ids=repr)
def test_force_is_stiffness_times_displacement(formulation):
    """Also on edges of different lengths; the support carries the opposite force."""
    x = np.array([0.0, 1.0, 4.0, 10.0])
    mesh = MeshQuad.init_tensor(x, np.linspace(0, LENGTH, 5)).with_defaults()
    ply = Ply(mesh, FABRIC, formulation, [Clamp("top", K)])
    state = run(ply).states[-1]
    travel, force = state.displacements["clamp"], state.reactions["clamp"]
    assert force == pytest.approx(-K * travel, rel=1e-12, abs=1e-12)
    assert force == pytest.approx(-state.reactions["bottom"], rel=1e-9, abs=1e-9)
    assert state.energies["clamp"] == pytest.approx(0.5 * K * travel @ travel, rel=1e-9)
    # In series with the strip, whose tension is E ε per deformed length.
    strain = np.log(1 + (1 + travel[1]) / LENGTH)
    tension = 1e3 * strain / np.exp(strain) * WIDTH
    assert force[1] == pytest.approx(tension, rel=1e-9)


def test_energy_is_stationary_at_the_equilibrium():
    ply = strip(Clamp("top", K, direction=(1.0, 2.0)), Traction("top", (0.3, 0.5)))
    u = run(ply).u
    rng = np.random.default_rng(1)
    moving = 1e-4 * rng.standard_normal(len(u))
    moving[ply.basis.get_dofs("bottom")] = 0.0
    ends = [ply.energy(u + x * moving) for x in (-1, 0, 1)]
    assert min(ends[0], ends[2]) > ends[1]
    assert abs(ends[2] - ends[0]) < 1e-2 * (ends[0] + ends[2] - 2 * ends[1])


def test_a_clamp_along_a_direction_leaves_the_others_free():
    """A force along them moves the ply as if there were no clamp."""
    across = Force("top", (0.01, 0.0))
    free = run(strip(across)).u
    held = run(strip(across, Clamp("top", 1e3, direction=(0.0, -3.0)))).states[-1]
    assert held.reactions["clamp"][0] == 0.0
    term = strip(Clamp("top", 1e3, direction=(0.0, -3.0))).terms[-1]
    sideways = np.zeros_like(free)
    sideways[::2] = 1.0
    assert not term.residual(sideways, 1.0).any()
    ply = strip(Clamp("top", 1e3, direction=(1.0, 1.0)))
    force = run(ply).states[-1].reactions["clamp"]
    assert force[0] == pytest.approx(force[1], rel=1e-12)


def test_a_stiff_clamp_approaches_a_condition_as_one_over_its_stiffness():
    held = PULLED | {"top": Condition("top")}
    exact = run(strip(), held).u
    off = [np.abs(run(strip(Clamp("top", k))).u - exact).max() for k in (1e5, 1e6, 1e7)]
    assert np.log10(off[:-1]) - np.log10(off[1:]) == pytest.approx(1.0, abs=0.02)


def test_a_preload_pulls_the_edge_until_the_springs_are_slack():
    hung = {"bottom": Condition("bottom")}
    ply = strip(Clamp("top", K, direction=(0, 1), preload=F))
    state = run(ply, hung).states[0]
    force = state.reactions["clamp"][1]
    assert force == pytest.approx(F - K * state.displacements["clamp"][1], rel=1e-12)
    assert 0.9 * F < force < F


STIFFENING = Fabric(CrimpToe(1e3, 0.02, 20.0), 1.0)


@pytest.mark.parametrize("steps", [1, 5, 20, pytest.param(50, marks=pytest.mark.slow)])
@pytest.mark.parametrize("fabric", [FABRIC, STIFFENING], ids=["linear", "stiffening"])
def test_a_clamp_lets_go_within_one_per_cent_of_its_force(fabric, steps):
    """At the same load factor, whatever the number of steps, also of a stiff law."""
    result = run(strip(Clamp("top", K, release=F), fabric=fabric), steps=steps)
    at, force, before, after = let_go(result)
    assert F <= force <= 1.01 * F
    assert np.linalg.norm(before.reactions["clamp"]) == pytest.approx(force, rel=1e-12)
    assert not after.reactions["clamp"].any()
    assert result.converged
    rows = result.history()
    assert max(row["clamp_force_N"] for row in rows) == pytest.approx(force)
    assert 0 < at < 1


def test_the_load_factor_of_release_does_not_depend_on_the_steps():
    ply = strip(Clamp("top", K, release=F), fabric=STIFFENING)
    at = [let_go(run(ply, steps=n))[0] for n in (1, 2, 7)]
    assert np.ptp(at) < 0.01 * max(at)


@pytest.mark.parametrize("release", [1.0, 3.0])
def test_a_release_far_from_the_end_of_a_step_takes_one_further_state(release):
    """Of a stiffening ply, whose force is far from linear in the first steps."""
    result = run(strip(Clamp("top", K, release=release), fabric=STIFFENING), steps=5)
    assert len(result.states) <= 6 + 2 + 1


def test_after_its_release_the_ply_is_as_without_the_clamp():
    loads = Traction("top", (0.02, 0.1)), Traction("right", (0.05, 0.0))
    ply = strip(*loads, Clamp("top", K, release=2.0))
    result = run(ply, steps=5)
    without = run(strip(*loads), steps=5)
    assert let_go(result)[0] < 1
    assert result.u == pytest.approx(without.u, abs=1e-9)
    assert result.states[-1].reactions["bottom"] == pytest.approx(
        without.states[-1].reactions["bottom"], rel=1e-9
    )


def test_the_energy_lost_is_that_of_the_springs_and_of_the_ply():
    """Which is stress-free after the release of its only other support."""
    result = run(strip(Clamp("top", K, release=F)), steps=20)
    _, force, before, after = let_go(result)
    lost = after.energy_lost["clamp"]
    assert lost == pytest.approx(sum(before.energies.values()), rel=1e-9)
    in_series = 0.5 * force**2 * (1 / K + LENGTH / (1e3 * WIDTH))
    assert lost == pytest.approx(in_series, rel=0.01)  # of a linear strip
    moved = [x.displacements["bottom"][1] for x in result.states]
    pull = [x.reactions["bottom"][1] for x in result.states]
    assert np.trapezoid(pull, moved) == pytest.approx(lost, rel=1e-3)
    assert result.summary()["energy_lost"] == lost
    work = result.history()[-1]["work"]
    assert work == pytest.approx(sum(result.states[-1].energies.values()), rel=1e-3)


def test_loads_that_go_on_acting_do_work_on_the_way():
    """Energies with the energy lost, and potentials, have the same sum before it."""
    loads = Traction("top", (0.0, 0.4), factor=1.0)
    ply = strip(loads, Clamp("top", K, release=F))
    _, _, before, after = let_go(run(ply, steps=10))
    total = [sum((x.energies | x.potentials).values()) for x in (before, after)]
    assert total[0] == pytest.approx(total[1], rel=1e-9)
    assert after.verdict.work == pytest.approx(
        before.potentials["traction on top"] - after.potentials["traction on top"]
    )


def on_a_plate(elastic_slip):
    """Ply that a holder presses on a plate, and that is pulled from a clamp."""
    rub = {"side": 1, "friction": 0.3, "elastic_slip": elastic_slip}
    plate = Tool(drape.Plane(), name="plate", **rub)
    holder = Holder(drape.Plane(), pressure=0.01, **rub)
    clamp = Clamp("left", K, direction=(1, 0, 0), release=6.0)
    x, y = np.linspace(0, 50.0, 6), np.linspace(0, WIDTH, 2)
    mesh = MeshQuad.init_tensor(x, y).with_defaults()
    fabric, terms = Fabric(1e4, 1.0, bending=(1.0, 1.0)), [plate, holder, clamp]
    return Ply(mesh, fabric, ONE_POINT, terms, dimension=3)


PULLED_FROM_CLAMP = {"pull": Condition("right", (0.15, 0.0, None))}
COARSE = "work", "stabilisation", "deviation"


@pytest.mark.parametrize("elastic_slip", [0.2, 0.005])
def test_a_clamp_does_not_lose_what_friction_with_tools_takes(elastic_slip):
    """The ply loses the work of the force of the clamp, which falls to 0.

    Half of the force times the travel of its edge.  Sliding takes half as much where
    all nodes slide, with a short elastic slip; a long one stores energy instead.
    """
    ply = on_a_plate(elastic_slip)
    result = run(ply, PULLED_FROM_CLAMP, warn_only=COARSE)
    _, force, before, after = let_go(result)
    moved = after.displacements["clamp"] - before.displacements["clamp"]
    lost = after.energy_lost["clamp"] - 0.5 * force**2 / K
    assert lost == pytest.approx(0.5 * force * np.linalg.norm(moved), rel=1e-4)
    rubbed = (s.energy_lost["plate"] + s.energy_lost["holder"] for s in (after, before))
    assert elastic_slip == 0.2 or np.subtract(*rubbed) > 0.4 * lost
    assert "work" not in after.warnings


def test_a_negative_loss_is_a_warning(monkeypatch):
    spent = iter([1.0, 0.0])  # in the state without the clamp, and before
    name = "skfem_textile.solve.clamp_release._spent_on_friction"
    monkeypatch.setattr(name, lambda *state: next(spent))
    result = run(on_a_plate(0.02), PULLED_FROM_CLAMP, warn_only=COARSE)
    *_, after = let_go(result)
    assert "an energy lost by the ply of -0.9" in after.warnings["work"]
    assert sum(after.energy_lost.values()) < 0


def test_two_clamps_let_go_one_after_the_other():
    """The second takes over the force of the first, at once if it is too weak."""
    sides = [
        Clamp("top", K, release=F, within=(0, 0, 5, LENGTH), name="left"),
        Clamp("top", K, release=1.2 * F, within=(5, 0, 10, LENGTH), name="right"),
    ]
    pulled = {"bottom": Condition("bottom", (0.0, -4.0))}
    result = run(strip(*sides, fabric=Fabric(1e3, 20.0)), pulled, steps=4)
    first, second = let_go(result, "left"), let_go(result, "right")
    assert F <= first[1] <= 1.01 * F
    assert 1.2 * F <= second[1] <= 1.01 * 1.2 * F
    assert first[0] <= second[0]
    lost = result.states[-1].energy_lost
    assert lost["left"] > 0 < lost["right"]
    assert sum(result.states[-1].energies.values()) == pytest.approx(
        sum(lost.values()), rel=1e-6
    )


def test_a_clamp_that_another_one_overloads_lets_go_on_the_way():
    """While the force of the first decreases; the work check holds there too."""
    both = [
        Clamp("top", K, direction=(0, 1), release=F, name="first"),
        Clamp("top", 0.95 * K, direction=(0, 1), release=F, name="second"),
    ]
    result = run(strip(*both), {"bottom": Condition("bottom", (0.0, -2.0))}, steps=3)
    (t, *_), (other, force, *_) = let_go(result, "first"), let_go(result, "second")
    assert t == other
    assert F <= force <= 1.01 * F
    lost = result.states[-1].energy_lost
    before = next(x for x in result.states if x.load_factor == t)
    assert sum(lost.values()) == pytest.approx(sum(before.energies.values()), rel=1e-9)
    assert "work" not in result.states[-1].warnings


def test_half_a_ply_has_half_the_clamp():
    mirror = {"left": Condition("left", (0.0, None))}
    whole = run(strip(Clamp("top", K, release=F, direction=(0, 1))), steps=5)
    half = strip(Clamp("top", K / 2, release=F / 2, direction=(0, 1)), half=True)
    part = run(half, PULLED | mirror, steps=5)
    (t, force, *_), (t_half, of_half, *_) = let_go(whole), let_go(part)
    assert t_half == pytest.approx(t, rel=1e-9)
    assert 2 * of_half == pytest.approx(force, rel=1e-9)


def test_a_released_clamp_does_not_hold_again():
    pulled = {"bottom": Condition("bottom", (0.0, -1.0), factor=Programme([1, 0, 1]))}
    result = run(strip(Clamp("top", K, release=F)), pulled, steps=6)
    at, _, _, after = let_go(result)
    later = [x for x in result.states if x.load_factor > at]
    assert not any(x.reactions["clamp"].any() for x in [after, *later])
    assert after.energies["clamp"] == later[-1].energies["clamp"] > 0


def test_a_load_at_rest_may_release_a_clamp():
    """Of two that carry a load of 10 N; the other one then carries it alone."""
    weight = Traction("bottom", (0, -1.0), factor=1.0)
    clamps = Clamp("top", K, release=4.0), Clamp("top", K, name="other")
    held = {"x": Condition("top", 0.0, direction=(1, 0))}
    result = run(strip(weight, *clamps), held, steps=2)
    summary = result.summary()
    assert summary["clamp_released_at"] == 0
    assert 4 <= summary["clamp_release_force_N"] <= 1.01 * 4
    assert result.states[0].reactions["other"][1] == pytest.approx(10.0)
    assert result.states[0].energy_lost["clamp"] > 0


def test_an_initial_guess_that_overloads_a_clamp_is_not_used():
    ply = strip(Clamp("top", K, release=F))
    guess = run(strip(Clamp("top", K))).u
    result = run(ply, steps=2, initial_guess=guess)
    assert F <= let_go(result)[1] <= 1.01 * F


def test_it_says_in_one_line_when_a_clamp_lets_go(caplog):
    with caplog.at_level(logging.INFO, "skfem_textile"):
        result = run(strip(Clamp("top", K, release=F, name="gripper")))
    lines = [x.getMessage() for x in caplog.records if "lets go at" in x.getMessage()]
    assert len(lines) == 1
    assert re.fullmatch(
        r"load factor 0\.\d+: clamp 'gripper' lets go at 30\.\d* N", lines[0]
    )
    summary = result.summary()
    at, force, *_ = let_go(result, "gripper")
    assert summary["gripper_released_at"] == at
    assert summary["gripper_release_force_N"] == force
    assert summary["gripper_force_N"] == 0.0
    text = f"'gripper' let go at load factor {at:.4g} with {force:.4g} N"
    assert f"Largest clamp force     {force:.4g} N; {text}" in repr(result)
    assert summary["clamps_let_go"] == text
    assert "clamps have let go" in summary["error_interval"]
    holding = run(strip(Clamp("top", K, release=1e3, name="gripper"))).summary()
    assert holding["gripper_released_at"] is None
    assert holding["gripper_force_N"] == pytest.approx(
        K * holding["gripper_travel_mm"], rel=1e-9
    )
    assert holding["load_half_width"] is not None


ACROSS = Traction("right", (0.5, 0.0))


def with_end(until=0.5):
    return PULLED | {"side": Condition("left", 0.0, (1, 0), until=until)}


@cache
def at_the_same_load_factor():
    """Run in which a clamp lets go where a condition ends, and one without the end."""
    clamped = run(strip(ACROSS, Clamp("top", K)), with_end(1.0), 2).states[1]
    release = np.linalg.norm(clamped.reactions["clamp"]) / 1.005
    ply = strip(ACROSS, Clamp("top", K, release=release))
    return run(ply, with_end(), 2), run(ply, with_end(1.0), 2)


def test_a_condition_may_end_where_a_clamp_lets_go():
    """First without the clamp, whose energy lost is its own, then also without it."""
    result, held = at_the_same_load_factor()
    assert [x.load_factor for x in result.states] == [0, 0.5, 0.5, 0.5, 1]
    _, both, condition, none, last = result.states
    assert np.abs(both.reactions["clamp"]).max() > 1
    assert not condition.reactions["clamp"].any()
    assert np.abs(condition.reactions["side"]).max() > 1
    for state in none, last:
        assert not state.reactions["clamp"].any()
        assert np.abs(state.reactions["side"]).max() < 1e-6
        assert state.energy_lost == condition.energy_lost == held.states[2].energy_lost
    free = run(strip(ACROSS), steps=2)
    assert result.u == pytest.approx(free.u, rel=1e-8)


# ------------------------------------------------------------------------- checkpoints


class KilledError(Exception):
    pass


def assert_same(result, other):
    """The states of both are equal, bit for bit."""
    for one, same in zip(result.states, other.states, strict=True):
        assert one.load_factor == same.load_factor
        assert np.array_equal(one.u, same.u)
        assert one.energies == same.energies
        assert one.energy_lost == same.energy_lost
        assert one.verdict == same.verdict
        assert one.linear_solves == same.linear_solves


def stopping(number):
    """Callback that ends a run after a number of states."""
    count = iter(range(number))

    def stop(state):
        if next(count) == number - 1:
            raise KilledError

    return stop


@pytest.mark.parametrize("states", [1, 2, 3])
def test_a_run_in_which_a_condition_ends_too_is_resumed(tmp_path, states):
    whole, _ = at_the_same_load_factor()
    with pytest.raises(StepError, match="KilledError"):
        LoadStepper(
            *(whole.ply, with_end(), 2),
            checkpoint=tmp_path,
            on_step=stopping(states),
        ).run()
    resumed = LoadStepper(whole.ply, with_end(), 2, checkpoint=tmp_path)
    assert_same(resumed.run(resume=True), whole)


@pytest.mark.parametrize("states", [1, 2, 3, 4])
def test_a_run_is_resumed_bit_for_bit(tmp_path, states):
    """Before the release, also when it is sought, between its states, and after it."""
    ply = strip(Clamp("top", K, release=8.0), fabric=STIFFENING)
    whole = run(ply, steps=1)
    assert [x.load_factor == let_go(whole)[0] for x in whole.states][1:] == [
        *(False, True, True, False),
    ]
    with pytest.raises(StepError, match="KilledError"):
        run(ply, steps=1, checkpoint=tmp_path, on_step=stopping(states))
    stepper = LoadStepper(ply, PULLED, 1, checkpoint=tmp_path)
    assert_same(stepper.run(resume=True), whole)
    other = strip(Clamp("top", K, release=2 * F), fabric=STIFFENING)
    with pytest.raises(ValueError, match="release of 'clamp' differ"):
        LoadStepper(other, PULLED, 1, checkpoint=tmp_path).run(resume=True)


# -------------------------------------------------------------------------- with tools


def test_a_gripper_lets_go_while_a_punch_forms_the_ply():
    """The force of the punch decreases when it lets go; the ply releases energy."""
    mesh = MeshQuad().refined(2).scaled(50.0).with_defaults()
    punch = Tool(drape.Sphere(15.0, (0, 0, -15)), motion=(0, 0, 8), name="punch")
    gripper = Clamp("right", 1.0, release=0.2, within=(0, 0, 50, 25), name="gripper")
    fabric = Fabric(1e2, 0.5, bending=(5.0, 5.0))
    ends = {"left": "mirror", "bottom": "mirror"}
    terms = [punch, gripper]
    ply = Ply(mesh, fabric, terms=terms, dimension=3, fibre_ends=ends)
    conditions = {
        "x": Condition("left", (0.0, None, None)),
        "y": Condition("bottom", (None, 0.0, None)),
        "top": Condition("top"),
    }
    result = run(ply, conditions, steps=2)
    _, force, before, after = let_go(result, "gripper")
    assert result.converged
    assert 0.2 <= force <= 1.01 * 0.2
    assert before.reactions["punch"][2] > after.reactions["punch"][2] > 0
    assert " N on the computed part of the ply; 'gripper' let go" in repr(result)
    assert after.energy_lost["gripper"] > before.energies["gripper"]


def test_a_condition_ends_before_a_punch_moves():
    """A ply that was positioned is then formed as if it had never been held."""
    mesh = MeshQuad().refined(1).scaled(50.0).with_defaults()

    def stroke(t):
        return 0.0, 0.0, 16 * max(t - 0.5, 0.0)

    punch = Tool(drape.Sphere(15.0, (0, 0, -15)), motion=stroke, name="punch")
    fabric = Fabric(1e2, 0.5, bending=(5.0, 5.0))
    ends = {"left": "mirror", "bottom": "mirror"}
    ply = Ply(mesh, fabric, terms=[punch], dimension=3, fibre_ends=ends)
    conditions = {
        "x": Condition("left", (0.0, None, None)),
        "y": Condition("bottom", (None, 0.0, None)),
        "top": Condition("top"),
    }
    edge = Condition(lambda X: (X[0] == 50) & (X[1] < 40), (1.0, None, None), until=0.5)
    free, held = (run(ply, conditions | x, 2) for x in ({}, {"side": edge}))
    assert np.abs(held.states[1].reactions["side"]).max() > 0.1
    assert np.abs(held.states[-1].reactions["side"]).max() < 1e-6
    assert held.states[-1].reactions["punch"] == pytest.approx(
        free.states[-1].reactions["punch"], rel=1e-6
    )
    assert held.u == pytest.approx(free.u, abs=1e-6)


# --------------------------------------------------------------------------- bad input


@pytest.mark.parametrize(
    ("clamp", "message"),
    [
        (Clamp("north", K), "no boundary 'north'"),
        (Clamp("top", K, name="a/b"), "the name contains '/', which names of files"),
        (Clamp([7], K), "no edge of the boundary between the selected nodes"),
        (Clamp(lambda X: X[1] < -1, K), "where selects no nodes"),
        (
            Clamp("top", K, within=(0, 0, 1, 1)),
            "on 'top' in the part that 'within' selects",
        ),
        (
            Clamp("top", K, within=(0, 0, 1, 1)),
            "edge, which extend over x from 0 to 10 mm and y from 20 to 20 mm",
        ),
        (
            Clamp("top", K, within=lambda X: X[0] > 10),
            "on 'top' in the part that 'within' selects",
        ),
        (
            Clamp("top", K, within=lambda x, y: x > 5),
            "within raised TypeError: ",
        ),
        (
            Clamp("top", K, within=lambda X: X[0]),
            "within must return one bool for each position, shape (15,), got float64",
        ),
        (Clamp("top", K, within=lambda X: True), "got bool of shape ()"),
        (Clamp("top", K, within=(5, 0, 0, 20)), "within must be the smallest x and y"),
        (Clamp("top", 0.0), "stiffness must be a finite number > 0, got 0"),
        (Clamp("top", -1.0), "stiffness must be a finite number > 0"),
        (Clamp("top", np.nan), "stiffness must be a finite number > 0"),
        (Clamp("top", K, direction=(0, 0)), "direction must be a non-zero finite"),
        (Clamp("top", K, direction=(0, 0, 1)), "direction must be a vector of 2"),
        (Clamp("top", K, release=0.0), "release must be a finite number > 0, got 0"),
        (Clamp("top", K, release=-1.0), "release must be a finite number > 0"),
        (Clamp("top", K, preload=3.0), "a preload requires a direction"),
        (
            Clamp("top", K, (0, 1), release=3.0, preload=3.0),
            "the preload of 3 N reaches the release of 3 N",
        ),
    ],
)
def test_bad_input_is_refused_in_one_line(clamp, message):
    with pytest.raises(ValueError, match=re.escape(message)) as refused:
        strip(clamp)
    assert str(refused.value).startswith(f"clamp {clamp.name!r}")
    assert "\n" not in str(refused.value)


def test_two_clamps_of_one_name_are_refused():
    with pytest.raises(ValueError, match="other terms have the name 'clamp'"):
        strip(Clamp("top", K), Clamp("right", K))


def test_a_clamp_on_a_condition_is_refused_and_one_in_part_is_a_warning(caplog):
    both = PULLED | {"held": Condition("top")}
    with pytest.raises(ValueError, match="its edge is held by the condition 'held'"):
        run(strip(Clamp("top", K)), both)
    mirror = PULLED | {"mirror": Condition("left", (0.0, None))}
    run(strip(Clamp("top", K)), mirror)  # shares a corner
    run(
        strip(Clamp("top", K, direction=(0, 1))),
        PULLED | {"x": Condition("top", 0.0, (1, 0))},
    )
    assert "of its" not in caplog.text
    part = PULLED | {"part": Condition(lambda X: (X[1] == LENGTH) & (X[0] <= 5))}
    run(strip(Clamp("top", K)), part)
    assert (
        "clamp 'clamp': 1 of its 2 edges are held by the condition 'part'"
        in caplog.text
    )


def test_a_run_that_stops_at_a_release_at_its_end_has_not_converged(tmp_path):
    """Nothing holds the ply without the clamp, which has lost no energy yet."""
    sides = {"side": Condition("left", (0.0, None))}
    ply = strip(Clamp("top", K, release=F / 1.005), Traction("bottom", (0, -F / WIDTH)))
    with pytest.raises(StepError, match="lets go at 30 N, and then") as stopped:
        run(ply, sides, 2, checkpoint=tmp_path)
    result = stopped.value.result
    assert result.states[-1].load_factor == 1
    assert not result.converged
    assert not result.summary()["converged"]
    assert result.summary()["clamp_energy_lost"] == 0
    assert result.summary()["clamp_energy"] > 1
    with pytest.raises(CheckpointError, match="contains an unfinished run"):
        run(ply, sides, 2, checkpoint=tmp_path)


def test_nodes_of_an_edge_are_those_of_the_mesh_before_it_is_split():
    x = np.linspace(0, WIDTH, 3)
    mesh = MeshQuad.init_tensor(x, x).with_defaults()
    nodes = np.unique(mesh.facets[:, mesh.boundaries["top"]])
    for formulation in (ONE_POINT, Macro(), Quadratic()):
        by_name, by_number = (
            Ply(mesh, FABRIC, formulation, [Clamp(edge, K)]).terms[-1]
            for edge in ("top", nodes)
        )
        springs = [one.tangent(None, 0.0) for one in (by_name, by_number)]
        assert abs(springs[0] - springs[1]).max() == 0
    with pytest.raises(ValueError, match="no edge of the boundary between"):
        Ply(mesh, FABRIC, Macro(), [Clamp(nodes[::2], K)])


def test_a_part_of_an_edge_is_a_rectangle_or_a_function():
    both = (0, 0, WIDTH / 2, LENGTH), lambda X: X[0] <= WIDTH / 2
    one, other = (strip(Clamp("top", K, within=x)).terms[-1] for x in both)
    assert abs(one.tangent(None, 0.0) - other.tangent(None, 0.0)).max() == 0


def test_a_force_that_jumps_over_the_release_is_refused():
    """A state far beyond the release is never accepted; it takes few attempts."""
    tried = []

    def jump(X, t):
        return np.stack([0 * X[0], np.full(X.shape[1], -0.1 * t - 1.0 * (t > 0.3))])

    with pytest.raises(
        StepError, match=r"carries .* at which it lets go: its force jumps there; try a"
    ):
        run(
            strip(Clamp("top", K, release=10.0)),
            {"bottom": Condition("bottom", jump)},
            steps=4,
            on_iteration=lambda x: tried.append(x.load_factor),
        )
    assert len({*tried}) <= 12


def test_a_force_that_rises_in_a_small_part_of_a_step_releases_a_clamp():
    """Within 1/200 of a step; a jump would be refused."""

    def rise(X, t):
        y = -0.1 * t - np.clip(200 * (t - 0.3), 0.0, 1.0)
        return np.stack([0 * X[0], np.full(X.shape[1], y)])

    held = {"bottom": Condition("bottom", rise)}
    at, force, *_ = let_go(run(strip(Clamp("top", K, release=10.0)), held))
    assert 0.3 < at < 0.305
    assert 10 <= force <= 10.1
