"""Runs of the study: examination of a problem, and the report."""

from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from skfem import MeshQuad

from skfem_textile import Condition, Full, LoadStepper, Newton, OnePoint
from skfem_textile.scenes import Scene, picture_frame, strip
from skfem_textile.solve.verdict import CHECKS
from studies.stability import study
from studies.stability import study as ends
from studies.stability.problems import Extreme, extremes
from studies.stability.study import STUDY

SMALL = partial(strip, size=(4, 6))


@pytest.fixture
def few_steps(monkeypatch):
    monkeypatch.setattr(study, "STEPS", (1, 5))
    monkeypatch.setattr(study, "_REFERENCE", 10)


def rod() -> Scene:
    """A rod in compression: the straight state is an unstable equilibrium."""
    mesh = MeshQuad.init_tensor(np.linspace(0, 1, 9), np.linspace(0, 0.1, 2))
    return Scene(
        name="rod",
        mesh=mesh.with_defaults(),
        warp=(1.0, 0.0),
        weft=(0.0, 1.0),
        conditions={
            "left": Condition("left"),
            "right": Condition(
                "right", lambda X, t: np.stack([-0.2 * t * X[0], 0 * X[0]])
            ),
        },
        driven="right",
        displacement=lambda X, t: np.stack([-0.2 * t * X[0], 0 * X[0]]),
        shear_angle=lambda X, t: 0 * X[0],
    )


ROD = Extreme("rods", "pushed", rod, Full(), E=100.0, G=0.01)


def turned_over() -> Scene:
    """Elements whose nodes are all prescribed, and inverted past two thirds."""
    mesh = MeshQuad.init_tensor(np.linspace(0, 1, 3), np.linspace(0, 1, 2))

    def pushed(X, t):
        return np.stack([-1.5 * t * X[0], 0 * X[0]])

    return Scene(
        name="turned over",
        mesh=mesh.with_defaults(),
        warp=(1.0, 0.0),
        weft=(0.0, 1.0),
        conditions={"all": Condition(lambda X: X[0] >= 0, pushed)},
        driven="all",
        displacement=pushed,
        shear_angle=lambda X, t: 0 * X[0],
    )


FOLDING = Extreme("folding", "turned over", turned_over, Full(), E=0.0, G=0.5)


def outcomes(problem):
    return [row["outcome"] for row in STUDY.examine(problem)]


def test_a_plain_problem_is_right_and_agrees(few_steps):
    rows = STUDY.examine(Extreme("f", "plain", SMALL, OnePoint(10.0)))
    assert [row["outcome"] for row in rows] == [ends.RIGHT, ends.RIGHT]
    assert all(row["agrees"] and row["path_resolved"] for row in rows)
    assert all(0 <= row["energy_off"] < 1e-6 for row in rows)
    assert all(0 <= row["reactions_off"] < 1e-6 for row in rows)


def test_every_run_is_compared_with_the_one_with_most_steps(few_steps, monkeypatch):
    """The energy, or one of the reactions, differs by 2 %."""
    run = study._run

    def perturbed(energy, reaction):
        def off(problem, steps, *method):
            end, figures = run(problem, steps, *method)
            if steps == 5:
                reactions = end.reactions.copy()
                reactions[0] += reaction * np.abs(reactions).max()
                end = replace(end, energy=energy * end.energy, reactions=reactions)
            return end, figures

        return off

    plain = Extreme("f", "plain", SMALL, OnePoint(10.0))
    for energy, reaction in ((1.02, 0.0), (1.0, 0.02)):
        monkeypatch.setattr(study, "_run", perturbed(energy, reaction))
        one, five = STUDY.examine(plain)
        assert (one["outcome"], one["agrees"]) == (ends.RIGHT, True)
        assert (five["outcome"], five["agrees"]) == (ends.WRONG, False)
        assert five["energy_off"] == pytest.approx(1 - 1 / energy, abs=1e-6)
        assert five["reactions_off"] == pytest.approx(reaction, rel=0.03, abs=1e-6)


def test_an_exact_motion_must_be_met(few_steps):
    frame = partial(picture_frame, size=(3, 3))
    exact = Extreme("f", "frame", frame, Full(), G=0.5, exact=True)
    assert outcomes(exact) == [ends.RIGHT, ends.RIGHT]
    inexact = Extreme("f", "strip", SMALL, Full(), exact=True)  # not exact on this mesh
    assert outcomes(inexact) == [ends.WRONG, ends.WRONG]


def test_a_folding_problem_fails_and_is_not_solvable(few_steps):
    rows = STUDY.examine(FOLDING)
    assert [row["outcome"] for row in rows] == [ends.REFUSED, ends.REFUSED]
    assert not any(row["solvable"] or row["agrees"] for row in rows)
    assert all("det F" in row["message"] for row in rows)
    assert all(row["energy_off"] is None for row in rows)


@pytest.mark.parametrize("solver", ["plain", "more steps"])
def test_a_failure_of_some_runs_is_marked_solvable(few_steps, monkeypatch, solver):
    def balks(ply, conditions, steps, method):
        solves = method == solver or (solver == "more steps" and steps == 10)
        method = "newton" if solves else Newton(most=1)
        return LoadStepper(ply, conditions, steps, method=method, max_halvings=0)

    monkeypatch.setattr(study, "LoadStepper", balks)
    rows = STUDY.examine(Extreme("f", "plain", SMALL, OnePoint(10.0)))
    assert [row["outcome"] for row in rows] == [ends.MISSED, ends.MISSED]
    solved_by = "newton in 10" if solver == "more steps" else f"{solver} in 1"
    assert all(row["solvable"] and row["solved_by"] == solved_by for row in rows)
    assert not any(row["reference_sound"] and solver != "more steps" for row in rows)


def test_an_accepted_saddle_point_is_wrong(few_steps, monkeypatch):
    """The study checks stability independently of the load stepper."""
    assert ends.WRONG not in outcomes(ROD)

    def accept_all(ply, conditions, steps, method):
        warn_only = list(CHECKS)
        return LoadStepper(ply, conditions, steps, method="plain", warn_only=warn_only)

    monkeypatch.setattr(study, "LoadStepper", accept_all)
    assert outcomes(ROD) == [ends.WRONG, ends.WRONG]


def test_flat_angles_are_flat():
    (problem,) = [p for p in extremes() if p.name == "strip, 2×2" and "179" in p.family]
    mesh = problem.scene().mesh
    x = mesh.p[:, mesh.t]
    ahead, behind = np.roll(x, -1, axis=1) - x, np.roll(x, 1, axis=1) - x
    cosine = np.sum(ahead * behind, axis=0) / (
        np.linalg.norm(ahead, axis=0) * np.linalg.norm(behind, axis=0)
    )
    assert np.degrees(np.arccos(cosine)).max() == pytest.approx(179.0)


#: A tenth of the problems of the study, drawn by this seed.
DRAWN = np.random.default_rng(2026).choice(extremes(), len(extremes()) // 10, False)


@pytest.mark.slow
@pytest.mark.parametrize("problem", DRAWN, ids=STUDY.name)
def test_no_problem_of_a_tenth_of_the_study_is_wrong(problem):
    """In 1 to 100 steps, against 400; each is solved in all of them or none."""
    assert not {ends.WRONG, ends.MISSED} & set(outcomes(problem))
