"""Adaptive runs to a tolerance: accuracy, messages and rejected arguments."""

from dataclasses import replace

import numpy as np
import pytest

from skfem_textile import (
    AdaptiveStepper,
    Condition,
    Fabric,
    Full,
    LoadStepper,
    MeshError,
    OnePoint,
    Ply,
    StepError,
    equilibrium_near,
    marked,
    refine,
    shear_angle_jumps,
    split,
)
from skfem_textile.scenes import bias_extension
from skfem_textile.solve import adaptive as stepper_module
from skfem_textile.solve.adaptive import counted
from skfem_textile.solve.error_estimate import problem_at, work_of
from skfem_textile.solve.states import ErrorEstimate, NoEquilibriumError
from skfem_textile.solve.stepper import Run

LONG = pytest.mark.long


def pull(kind="delaunay", size=(4, 8)):
    scene = bias_extension(kind, size)
    return scene, Ply(scene.mesh, Fabric(1e5, 0.5, scene.warp, scene.weft))


@pytest.mark.parametrize("kind", ["delaunay", pytest.param("irregular", marks=LONG)])
def test_the_load_is_within_the_tolerance_of_the_reference(kind):
    """The load on a graded mesh along the fibres: `docs/angles/references.json`."""
    scene, ply = pull(kind)
    messages, stepped = [], []
    stepper = AdaptiveStepper(
        ply, scene.conditions, 0.02, 2, on_round=messages.append, on_step=stepped.append
    )
    result = stepper.run()
    assert abs(result.states[-1].reactions["top"][1] / 43.214 - 1) < 0.02
    assert result.tolerance_met
    assert result.converged
    assert tuple(messages) == result.rounds
    unknowns = [one.unknowns for one in messages]
    assert unknowns == sorted(unknowns)
    assert unknowns[-1] > unknowns[0] == ply.basis.N
    assert messages[-1].whole_path
    assert not all(one.whole_path for one in messages)
    assert {state.u.size for state in result.states} == {unknowns[-1]}
    assert stepped[-1] is result.states[-1]
    summary = scene.summary(result)
    assert summary["tolerance_met"] is True
    assert len(summary["rounds"]) == len(messages)


def test_a_sufficiently_fine_mesh_is_not_refined():
    scene, ply = pull("aligned")
    result = AdaptiveStepper(ply, scene.conditions, 0.5, 4).run()
    assert [one.unknowns for one in result.rounds] == [ply.basis.N]
    plain = LoadStepper(ply, scene.conditions, 4).run()
    np.testing.assert_array_equal(result.u, plain.u)


def test_a_limit_of_unknowns_is_reported_and_the_result_is_kept():
    scene, ply = pull()
    stepper = AdaptiveStepper(ply, scene.conditions, 1e-4, 2, most_unknowns=1000)
    with pytest.raises(
        StepError, match="the tolerance is not met with at most 1000 unknowns"
    ) as error:
        stepper.run()
    result = error.value.result
    assert result.converged
    assert not result.tolerance_met
    assert ply.basis.N < result.ply.basis.N <= 1000
    assert result.rounds[-1].whole_path
    assert result.summary()["tolerance_met"] is False


def test_a_load_that_cannot_be_applied_ends_the_run_and_keeps_its_states(monkeypatch):
    scene, ply = pull()
    advance = Run._step

    def stuck(run, t):
        if t > 0.5:
            raise NoEquilibriumError("stuck")
        return advance(run, t)

    monkeypatch.setattr(Run, "_step", stuck)
    with pytest.raises(
        StepError, match=r"stopped at load factor 0\.5 .*mm\): stuck"
    ) as error:
        AdaptiveStepper(ply, scene.conditions, 0.05, 4).run()
    assert not error.value.result.converged
    assert not error.value.result.tolerance_met
    assert error.value.result.summary()["rounds"] == []


@pytest.mark.parametrize("tolerance", [0.0, 1.0, -0.1, np.nan, "0.1", None])
def test_invalid_arguments_are_rejected_before_any_work(tolerance):
    scene, ply = pull()
    with pytest.raises(ValueError, match="tolerance must be between 0 and 1"):
        AdaptiveStepper(ply, scene.conditions, tolerance)


def test_plies_that_cannot_be_refined_are_rejected_before_any_work():
    scene, ply = pull()
    with pytest.raises(ValueError, match=f"has {ply.basis.N} unknowns, more than"):
        AdaptiveStepper(ply, scene.conditions, 0.1, most_unknowns=10)
    nodes = np.flatnonzero(ply.nodes[1] > 99.9)
    with pytest.raises(ValueError, match="specify a boundary by name"):
        AdaptiveStepper(ply, {**scene.conditions, "top": Condition(nodes)}, 0.1)
    parts = Ply(split(scene.mesh), ply.fabric, Full())
    with pytest.raises(MeshError, match="before it is split"):
        AdaptiveStepper(parts, scene.conditions, 0.1)
    with pytest.raises(ValueError, match="writes no checkpoint"):
        AdaptiveStepper(ply, scene.conditions, 0.1).run(resume=True)


def test_a_state_from_a_transferred_displacement_equals_the_state_of_the_whole_path():
    scene, ply = pull()
    u = LoadStepper(ply, scene.conditions, 4).run().u
    finer = refine(ply, marked(shear_angle_jumps(ply, u), 0.3))
    near = equilibrium_near(finer.ply, scene.conditions, finer.carry(u))
    whole = LoadStepper(finer.ply, scene.conditions, 4).run()
    assert near.verdict.stable
    assert near.linear_solves < whole.linear_solves
    load, exact = (x.reactions["top"][1] for x in (near, whole.states[-1]))
    assert load == pytest.approx(exact, rel=0.01)


def test_a_displacement_far_from_any_equilibrium_is_rejected():
    scene, ply = pull(size=(2, 4))
    folded = ply.basis.zeros()
    folded[::2] = -3 * ply.nodes[0]
    with pytest.raises(NoEquilibriumError):
        equilibrium_near(ply, scene.conditions, folded)


def test_the_error_target_falls_by_half_at_most_and_never_without_an_estimate():
    scene, ply = pull("irregular", (4, 8))
    rounds = []
    stepper = AdaptiveStepper(ply, scene.conditions, 0.9, 2, on_round=rounds.append)
    stepper.run()
    (first,) = rounds
    assert first.error == 1.5 * first.estimated_load_error
    more = first.unknowns + 1
    assert counted(rounds, more, 0.0, 0.0) == first.error / 2
    assert counted(rounds, more, 0.7, 0.0) == 0.7
    assert counted(rounds, more, 0.0, None) == np.inf
    assert counted(rounds, first.unknowns, 0.0, 1e-3) == 1.5e-3
    assert counted([], 10, None, None) == np.inf
    refined = replace(first, unknowns=more, load_change=0.6)
    assert counted([first, refined], more, 0.0, 0.0) == 0.6
    unknown = replace(first, unknowns=more, error=np.inf)
    assert counted([first, unknown], more + 1, 0.0, 0.0) == first.error / 2


def test_values_per_node_of_one_mesh_are_rejected_before_any_work():
    scene, ply = pull(size=(2, 4))
    n = len(ply.mesh.p[0, np.unique(ply.mesh.facets[:, ply.mesh.boundaries["top"]])])
    held = {**scene.conditions, "top": Condition("top", np.ones((2, n)))}
    with pytest.raises(
        ValueError, match="on a refined mesh: condition 'top': the value"
    ):
        AdaptiveStepper(ply, held, 0.1)
    with pytest.raises(
        ValueError, match="most_unknowns must be a real number, got None"
    ):
        AdaptiveStepper(ply, scene.conditions, 0.1, most_unknowns=None)


def test_an_interruption_on_a_finer_mesh_keeps_the_previous_run(monkeypatch):
    """Intermediate rounds are on other meshes: the tolerance is not met."""
    scene, ply = pull()
    stepper = AdaptiveStepper(ply, scene.conditions, 0.04, 2)
    advance = Run._step

    def interrupted(one, t):
        if t > 0.5 and one.problem.ply is not ply:
            raise KeyboardInterrupt
        return advance(one, t)

    monkeypatch.setattr(Run, "_step", interrupted)
    with pytest.raises(KeyboardInterrupt):
        stepper.run()
    assert stepper.result.ply is ply
    assert stepper.result.converged
    assert stepper.states[-1].load_factor == 1.0
    assert not stepper.result.tolerance_met


def test_a_run_that_fails_on_a_finer_mesh_keeps_the_previous_run(monkeypatch):
    scene, ply = pull()
    advance = Run._step

    def stuck(one, t):
        if t > 0.5 and one.problem.ply is not ply:
            raise NoEquilibriumError("stuck", elements=[3])
        return advance(one, t)

    monkeypatch.setattr(Run, "_step", stuck)
    stepper = AdaptiveStepper(ply, scene.conditions, 0.04, 4)
    message = r"on a finer mesh with \d+ unknowns: stopped at .* 0\.5 .*: stuck"
    with pytest.raises(StepError, match=message) as error:
        stepper.run()
    result = error.value.result
    assert result.ply is ply
    assert result.converged
    assert not result.tolerance_met
    assert len(result.states) == 5
    assert result.estimated_error.load == result.rounds[0].estimated_load_error
    assert result.rounds[-1].unknowns > ply.basis.N
    assert error.value.elements.size == 0  # belongs to another mesh
    assert stepper.states == tuple(result.states)


@pytest.mark.parametrize("ever", [True, False], ids=["on the first mesh", "never"])
def test_without_an_estimate_the_tolerance_is_never_met(ever, monkeypatch):
    scene, ply = pull()
    find = stepper_module.estimated_error

    def estimated(on, conditions, solver, state):
        if ever and on is ply:
            return find(on, conditions, solver, state)
        return ErrorEstimate(reason="not known")

    monkeypatch.setattr(stepper_module, "estimated_error", estimated)
    stepper = AdaptiveStepper(ply, scene.conditions, 0.06, 2, most_unknowns=1000)
    text = r"unknowns: the error of the load cannot be estimated \(not known\)"
    with pytest.raises(StepError, match=text) as error:
        stepper.run()
    result = error.value.result
    assert not result.tolerance_met
    assert result.ply is not ply
    assert result.summary()["error_estimate"] == "none: not known"
    assert result.summary()["rounds"][-1]["error"] is None
    assert "error used" not in str(result.rounds[-1])
    assert "converged at load factor" in str(result)


def test_a_ply_without_error_estimate_is_rejected_before_any_work():
    scene = bias_extension("irregular", (2, 4))
    fabric = Fabric(1e5, 0.5, scene.warp, scene.weft)
    ply = Ply(scene.mesh, fabric, OnePoint(5.0, kind="rate"))
    with pytest.raises(ValueError, match="cannot be estimated: term 'stabilisation'"):
        AdaptiveStepper(ply, scene.conditions, 0.1)


@pytest.mark.parametrize(
    ("error", "message"),
    [
        (MemoryError(), "there is not enough memory for a finer mesh"),
        (ValueError("the value fails"), "on a finer mesh: the value fails"),
    ],
)
def test_an_error_on_a_finer_mesh_keeps_the_previous_run(error, message, monkeypatch):
    scene, ply = pull()
    stepper = AdaptiveStepper(ply, scene.conditions, 0.04, 2)

    def fails(*_, **__):
        raise error

    monkeypatch.setattr(stepper_module, "equilibrium_near", fails)
    with pytest.raises(StepError, match=message) as raised:
        stepper.run()
    assert raised.value.result.ply is ply
    assert raised.value.result.converged


def test_the_error_of_the_last_mesh_is_estimated_once(monkeypatch):
    scene, ply = pull("aligned")
    result = AdaptiveStepper(ply, scene.conditions, 0.5, 4).run()
    (last,) = result.rounds
    monkeypatch.setattr(Ply, "finer", lambda *_: pytest.fail("estimated again"))
    assert result.summary()["estimated_load_error"] == last.estimated_load_error


def there_and_back(X, t):
    return np.array([np.zeros(X.shape[1]), np.full(X.shape[1], 20 * t * (1 - t))])


@pytest.mark.parametrize("value", [0.0, there_and_back], ids=["still", "back"])
def test_a_load_that_vanishes_at_the_end_stops_on_the_first_mesh(value):
    _, ply = pull("irregular", (2, 4))
    held = {"bottom": Condition("bottom"), "top": Condition("top", value)}
    with pytest.raises(StepError, match="no moving condition carries a load") as error:
        AdaptiveStepper(ply, held, 0.1, 4).run()
    result = error.value.result
    assert result.ply is ply
    assert result.converged
    assert not result.tolerance_met
    assert result.rounds == ()
    assert result.summary()["error_estimate"].startswith("none: no moving condition")


def rotated(X, t):
    """Rotates the edge by half a radian about its middle, so that its mean vanishes."""
    x = X[0] - X[0].mean()
    return np.array([x * (np.cos(0.5 * t) - 1), x * np.sin(0.5 * t)])


def test_the_load_of_a_rotated_edge_is_the_rate_of_the_energy():
    ply = Ply(pull(size=(2, 4))[0].mesh, Fabric(1e3, 0.5, (1, 1), (-1, 1)), Full())
    held = {"bottom": Condition("bottom"), "top": Condition("top", rotated)}
    result = LoadStepper(ply, held, n := 40).run()
    problem = problem_at(ply, held, result.solver.name, 1.0)
    of_reactions, of_loads = work_of(problem, result.states[-1])
    *_, before, middle, end = (sum(s.energies.values()) for s in result.states)
    assert of_reactions == pytest.approx((3 * end - 4 * middle + before) / 2 * n, 1e-3)
    assert of_loads == 0


def test_the_load_of_a_rotated_edge_is_refined():
    """Its mean displacement is zero and gives no load."""
    _, ply = pull(size=(2, 4))
    held = {"bottom": Condition("bottom"), "top": Condition("top", rotated)}
    with pytest.raises(StepError, match="tolerance is not met") as error:
        AdaptiveStepper(ply, held, 1e-6, 2, most_unknowns=500).run()
    assert 0.02 < error.value.result.rounds[1].load_change < 0.5


def test_node_numbers_that_refinement_changes_are_rejected():
    """Refinement renumbers the nodes of macro-elements after the vertices."""
    scene, ply = pull("irregular", (2, 4))
    n = ply.users_mesh.nvertices
    pinned = {**scene.conditions, "pin": Condition([n], 0.0, (1, 0))}
    with pytest.raises(
        ValueError,
        match="'pin' selects nodes by number, some of which are not vertices",
    ):
        AdaptiveStepper(ply, pinned, 0.1)
    AdaptiveStepper(ply, pinned | {"pin": Condition([n - 1], 0.0, (1, 0))}, 0.1)


def test_an_error_in_a_callback_ends_the_run_and_keeps_its_result():
    scene, ply = pull()

    def stop(_):
        raise KeyError("seen enough")

    stepper = AdaptiveStepper(ply, scene.conditions, 0.04, 4, on_round=stop)
    with pytest.raises(StepError, match=r"KeyError: .*seen enough"):
        stepper.run()
    assert stepper.result.converged
