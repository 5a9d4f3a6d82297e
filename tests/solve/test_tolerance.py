"""Runs to a tolerance: accuracy, messages, and arguments that are refused."""

import json
from dataclasses import replace
from functools import cache
from itertools import pairwise

import numpy as np
import pytest

from skfem_textile import (
    Condition,
    ErrorInterval,
    Fabric,
    LoadStepper,
    OnePoint,
    Ply,
    Quadratic,
    Round,
    StepError,
    ToleranceStepper,
)
from skfem_textile.cases.schema import Stepping
from skfem_textile.scenes import bias_extension
from skfem_textile.scenes.rectangle import rectangle
from skfem_textile.solve.states import NoEquilibriumError
from skfem_textile.solve.stepper import Run
from skfem_textile.solve.tolerance import ToleranceResult

FABRIC = Fabric(1e5, 0.5)


def on_nets(steps=2):
    """Load stepper of a bias extension on nets along the singular fibres."""
    scene = bias_extension(size=(4, 8))

    def at(density):
        graded = scene.graded(FABRIC, density)
        directed = replace(FABRIC, warp=scene.warp, weft=scene.weft)
        ply = Ply(graded.mesh, directed, Quadratic(400, points=6))
        return LoadStepper(ply, graded.conditions, steps=steps)

    return at


def on_squares(value=(0.0, 4.0), formulation=None, fabric=None, steps=2):
    """Load stepper of a square on denser and denser triangles, which takes a moment."""
    fabric = fabric or Fabric(1e3, 0.5, (1, 1), (-1, 1))
    held = {"bottom": Condition("bottom"), "top": Condition("top", value)}

    def at(density):
        n = max(1, round(2 * density))
        mesh = rectangle(20, 20, (n, n), "irregular")
        ply = Ply(mesh, fabric, formulation or OnePoint())
        return LoadStepper(ply, held, steps=steps)

    return at


def failed(stepper, message):
    """The error of a run to a tolerance, and its result on the last mesh."""
    with pytest.raises(StepError, match=message) as error:
        stepper.run()
    result = error.value.result
    assert isinstance(result, ToleranceResult)
    assert not result.tolerance_met
    return error.value, result


@cache
def at_once():
    """A result on a first mesh that is fine enough."""
    return ToleranceStepper(on_squares(), 0.9, 2.0).run()


def with_intervals(monkeypatch, *halves):
    """Half-widths of successive results, instead of theirs; None for no interval."""
    remaining = iter(halves)
    made = ErrorInterval(reason="not known")

    def interval(*_):
        half = next(remaining)
        return made if half is None else ErrorInterval(half, 0.0)

    monkeypatch.setattr("skfem_textile.solve.interval.error_interval", interval)


def test_the_load_on_nets_is_within_the_tolerance():
    """The load on the finest nets: `docs/angles/references.json`."""
    told = []
    result = ToleranceStepper(on_nets(), 0.002, 0.5, on_round=told.append).run()
    assert result.tolerance_met
    assert result.converged
    assert abs(result.states[-1].reactions["top"][1] / 43.214 - 1) < 0.002
    assert result.error.load <= 0.002
    assert tuple(told) == result.rounds
    assert 2 <= len(told) <= 5
    densities, unknowns, halves = zip(
        *((one.density, one.unknowns, one.half_width) for one in told), strict=True
    )
    assert densities[0] == 0.5
    assert list(densities) == sorted(densities)
    assert list(unknowns) == sorted(unknowns)
    assert unknowns[-1] == result.ply.basis.N
    assert halves[-1] == result.error.load < 0.002 < min(halves[:-1])
    assert told[-1].linear_solves == result.linear_solves
    assert result.states[-1].load_factor == 1.0
    assert {state.u.size for state in result.states} == {unknowns[-1]}
    summary = json.loads(json.dumps(result.summary(), default=float))
    assert summary["tolerance_met"] is True
    assert summary["tolerance"] == 0.002
    assert summary["load_half_width"] == halves[-1]
    assert [Round(**one) for one in summary["rounds"]] == list(told)
    assert str(told[-1]).endswith(f"error of the load: ± {halves[-1]:.2%}")


def test_a_first_mesh_that_is_fine_enough_is_the_last():
    result, plain = at_once(), on_squares()(2.0).run()
    np.testing.assert_array_equal(result.u, plain.u)
    assert [one.density for one in result.rounds] == [2.0]
    assert result.error.load == pytest.approx(plain.error.load, rel=1e-12)


def test_a_second_run_begins_on_the_first_mesh(monkeypatch):
    with_intervals(monkeypatch, 0.4, 0.05, 0.4, 0.05)
    stepper = ToleranceStepper(on_squares(steps=1), 0.1)
    first, second = stepper.run(), stepper.run()
    assert len(first.rounds) == 2
    assert second.rounds == first.rounds


def test_the_next_density_follows_from_the_half_width(monkeypatch):
    """At least 1.2 and at most 4 times the last, and 2 without an interval."""
    with_intervals(monkeypatch, 0.4, None, 0.101, 0.2, 0.05)
    rounds = ToleranceStepper(on_squares((0.0, 0.5), steps=1), 0.1, 0.5).run().rounds
    steps = [after.density / one.density for one, after in pairwise(rounds)]
    expected = [1.15 * 4 ** (1 / 1.9), 2.0, 1.2, 1.15 * 2 ** (1 / 1.9)]
    assert steps == pytest.approx(expected)
    with_intervals(monkeypatch, 0.999, 1e-3)
    again = ToleranceStepper(on_squares(steps=1), 1e-3, 0.5).run()
    assert again.rounds[1].density == 4 * 0.5


def test_a_limit_of_unknowns_is_reported_and_the_result_is_kept():
    stepper = ToleranceStepper(on_squares(steps=1), 1e-4, most_unknowns=60)
    words = "the tolerance is not met with at most 60 unknowns: the error of the load "
    words += r"is ± \d+\.\d\d%, but ± 0\.01 % was requested; increase most_unknowns"
    error, result = failed(stepper, words)
    assert result.converged
    assert result.ply.basis.N <= 60
    assert result.rounds[-1].unknowns == result.ply.basis.N
    assert result.summary()["tolerance_met"] is False
    assert error.elements.size == 0


def test_the_largest_mesh_allowed_is_tried_once(monkeypatch):
    """Nine elements per side have 200 unknowns, the limit."""
    at = on_squares((0.0, 0.5), steps=1)
    stepper = ToleranceStepper(at, 0.1, most_unknowns=200)
    with_intervals(monkeypatch, 0.9, 0.11, 0.09)
    met = stepper.run()
    assert met.tolerance_met
    with_intervals(monkeypatch, 0.9, 0.11, 0.11)
    _, result = failed(stepper, "with at most 200 unknowns")
    for rounds in (met.rounds, result.rounds):
        assert [one.unknowns for one in rounds] == [18, 128, 200]


@pytest.mark.parametrize("carrying", ["stabilisation", "deviation"])
@pytest.mark.parametrize("of", ["energy", "work"])
def test_a_tolerance_is_not_met_if_numerical_stiffness_carries_a_tenth(of, carrying):
    result = at_once()
    assert result.tolerance_met
    state = result.states[-1]
    for share, met in ((0.099, True), (0.101, False)):
        shares = {k: dict.fromkeys(x, 0.0) for k, x in state.shares.items()}
        shares[of][carrying] = share
        states = (*result.states[:-1], replace(state, shares=shares))
        assert replace(result, states=states).tolerance_met is met


def test_without_an_interval_the_tolerance_is_never_met(monkeypatch):
    with_intervals(monkeypatch, 0.3, *[None] * 9)
    stepper = ToleranceStepper(on_squares((0.0, 0.5), steps=1), 0.1, most_unknowns=100)
    text = r"the error of the load has no interval \(not known\), but ± 10 %"
    _, result = failed(stepper, text)
    assert result.summary()["error_interval"] == "none: not known"
    assert result.rounds[-1].half_width is None
    assert str(result.rounds[-1]).endswith("error of the load: none")


def test_python_and_case_files_have_one_default_of_unknowns():
    assert ToleranceStepper(on_squares(), 0.1).most_unknowns == Stepping().most_unknowns


def stuck_at(monkeypatch, error, unknowns=0):
    """Steps beyond half of the load fail on plies of more than a number of unknowns."""
    advance = Run._step

    def step(run, t):
        if t > 0.5 and unknowns < run.problem.ply.basis.N:
            raise error
        return advance(run, t)

    monkeypatch.setattr(Run, "_step", step)


def test_a_load_that_cannot_be_applied_ends_the_run_and_keeps_its_states(monkeypatch):
    stuck_at(monkeypatch, NoEquilibriumError("stuck", elements=[1]))
    stepper = ToleranceStepper(on_squares(), 1e-3)
    error, result = failed(stepper, r"stopped at load factor 0\.5 .*: stuck")
    assert error.elements.tolist() == [1]
    assert not result.converged
    assert result.states[-1].load_factor == 0.5
    assert result.summary()["rounds"] == []


def test_a_failure_on_a_finer_mesh_keeps_the_last_result(monkeypatch):
    first = on_squares()(1.0).ply
    stuck_at(monkeypatch, NoEquilibriumError("stuck", elements=[1]), first.basis.N)
    stepper = ToleranceStepper(on_squares(), 1e-3)
    message = r"on a finer mesh with \d+ unknowns: stopped at .* 0\.5 .*: stuck"
    error, result = failed(stepper, message)
    assert result.ply.basis.N == first.basis.N
    assert result.converged
    assert len(result.states) == 3
    assert [one.unknowns for one in result.rounds] == [first.basis.N]
    assert result.error.load == result.rounds[0].half_width
    assert error.elements.size == 0  # belongs to another mesh
    assert stepper.states == tuple(result.states)
    stuck_at(monkeypatch, KeyboardInterrupt(), first.basis.N)
    with pytest.raises(KeyboardInterrupt):
        stepper.run()
    assert stepper.states[-1].load_factor == 1.0
    assert not stepper.result.tolerance_met


@pytest.mark.parametrize(
    ("error", "message"),
    [(ValueError("no room"), "ValueError: no room"), (MemoryError(), "MemoryError")],
)
def test_a_finer_mesh_that_cannot_be_built_keeps_the_last_result(error, message):
    """So does an error in a callback."""
    at = on_squares()

    def only_once(density):
        if density > 1:
            raise error
        return at(density)

    def stop(_):
        raise error

    for stepper in (
        ToleranceStepper(only_once, 1e-3),
        ToleranceStepper(at, 1e-3, on_round=stop),
    ):
        _, result = failed(stepper, f"after the mesh of density 1: {message}")
        assert result.converged
        assert len(result.rounds) == 1
    with pytest.raises(KeyError, match="at once"):
        ToleranceStepper(lambda _: {}["at once"], 0.01)


def there_and_back(X, t):
    return np.array([np.zeros(X.shape[1]), np.full(X.shape[1], 4 * t * (1 - t))])


@pytest.mark.parametrize("value", [0.0, there_and_back], ids=["still", "back"])
def test_without_a_load_the_run_stops_on_the_first_mesh(value):
    words = "the tolerance is relative to the load, whose error is not known: no moving"
    _, result = failed(ToleranceStepper(on_squares(value), 0.1), words)
    assert result.converged
    assert len(result.rounds) == 1


def test_the_interval_of_the_last_mesh_is_computed_once(monkeypatch):
    result = ToleranceStepper(on_squares(), 0.9).run()
    monkeypatch.setattr(
        "skfem_textile.solve.interval._interval", lambda *_: pytest.fail("again")
    )
    assert result.summary()["load_half_width"] == result.rounds[-1].half_width


def test_meshes_that_stop_growing_are_refused():
    """A run ends with one message if the mesh does not depend on the density."""
    stepper = ToleranceStepper(lambda density: on_squares()(1.0), 1e-6)
    _, result = failed(stepper, "no mesh with more than")
    assert len(result.rounds) == 1
