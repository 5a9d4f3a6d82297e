import csv
import json
from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from helpers import drawn_here
from skfem import MeshQuad

from skfem_textile import (
    Condition,
    Fabric,
    Full,
    Linear,
    LoadStepper,
    Macro,
    Mixed,
    OnePoint,
    Quadratic,
)
from skfem_textile.scenes import Scene, picture_frame, strip
from skfem_textile.solve.stepper import DEFAULT_STRATEGIES
from skfem_textile.solve.verdict import CHECKS
from studies.__main__ import main
from studies.stability import outcomes as ends
from studies.stability import study, tables
from studies.stability.laws import SHEARS, TENSIONS
from studies.stability.outcomes import End, outcome
from studies.stability.problems import Extreme, extremes
from studies.stability.study import STUDY

SMALL = partial(strip, size=(4, 6))


@pytest.fixture
def few_steps(monkeypatch):
    monkeypatch.setattr(study, "STEPS", (1, 5))
    monkeypatch.setattr(study, "_REFERENCE", 10)


def rod() -> Scene:
    """A rod pushed together: straight is an equilibrium, but not a stable one."""
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
    """Elements whose nodes are all prescribed, and past two thirds turned over."""
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


def end(energy=2.0, reactions=(5.0, -1.0), **others):
    """The end of a run that is right, unless something else is said of it."""
    given = {"converged": True, "sound": True, "path_resolved": True} | others
    return End(**given, energy=energy, reactions=np.array(reactions), **NOTHING)


NOTHING = {"no_energy": 1e-12, "no_force": 1e-9}
REFUSED = {"converged": False, "sound": False}


def test_a_state_is_right_as_400_steps_or_told_to_be_another():
    told = {"path_resolved": False}
    for near in (end(), end(2.0198), end(2.0, (4.96, -1.04)), end(**told)):
        assert outcome(near, end(), True) == ends.RIGHT
    for far in ({"energy": 2.04}, {"energy": 1.96}, {"reactions": (5.0, -1.06)}):
        assert outcome(end(**far), end(), True) == ends.WRONG
        assert outcome(end(**far, **told), end(), True) == ends.OTHER
    for reference in (end(sound=False), end(**REFUSED)):  # nothing to agree with
        assert outcome(end(), reference, True) == ends.WRONG
        assert outcome(end(**told), reference, True) == ends.OTHER


def test_what_is_not_sound_is_wrong_whatever_it_says_of_its_path():
    for resolved in (True, False):
        unsound = end(sound=False, path_resolved=resolved)
        assert outcome(unsound, end(), True) == ends.WRONG


def test_a_refusal_of_what_can_be_solved_is_told_from_others():
    assert outcome(end(**REFUSED), end(), True) == ends.MISSED
    assert outcome(end(**REFUSED), end(**REFUSED), False) == ends.REFUSED


def test_round_off_is_no_disagreement():
    none = end(1e-13, (1e-10, 0.0))
    assert outcome(none, end(-5e-13, (0.0, -8e-10)), True) == ends.RIGHT
    assert outcome(none, end(5e-12, (0.0, 0.0)), True) == ends.WRONG
    assert outcome(none, end(0.0, (5e-9, 0.0)), True) == ends.WRONG


def test_the_summary_counts():
    def row(outcome, solvable=True, agrees=True, path_resolved=True, **head):
        head = {"family": "f", "problem": "p"} | head
        said = {"agrees": agrees, "path_resolved": path_resolved}
        return head | {"outcome": outcome, "solvable": solvable} | said

    rows = [row(ends.RIGHT)] * 3 + [row(ends.RIGHT, path_resolved=False, problem="q")]
    rows += [row(ends.OTHER, agrees=False, path_resolved=False)] * 2
    rows += [row(ends.MISSED, agrees=False), row(ends.WRONG, agrees=False)]
    rows += [row(ends.REFUSED, solvable=False, agrees=False)] * 4
    assert ends.summary(rows) == {
        "problems": 2,
        "cases": 12,
        "right": 6,
        "right_on_another_equilibrium": 2,
        "refused": 5,
        "refused_though_solvable": 1,
        "wrong": 1,
        "solvable": 8,
        "share_right_of_solvable": 6 / 8,
        "share_right_as_400_steps_of_solvable": 4 / 8,
        "agree_with_400_steps": 4,
        "agree_but_path_not_resolved": 1,
        "share_of_these_not_resolved": 1 / 4,
    }


def test_a_plain_problem_is_right_and_agrees(few_steps):
    rows = STUDY.examine(Extreme("f", "plain", SMALL, OnePoint(10.0)))
    assert [row["outcome"] for row in rows] == [ends.RIGHT, ends.RIGHT]
    assert all(row["agrees"] and row["path_resolved"] for row in rows)
    assert all(0 <= row["energy_off"] < 1e-6 for row in rows)
    assert all(0 <= row["reactions_off"] < 1e-6 for row in rows)


def test_every_run_is_compared_with_the_one_of_the_most_steps(few_steps, monkeypatch):
    """One whose energy, or one of whose reactions, is off by 2 %."""
    run = study._run

    def off_by(energy, reaction):
        def off(problem, steps, *strategies):
            end, figures = run(problem, steps, *strategies)
            if steps == 5:
                reactions = end.reactions.copy()
                reactions[0] += reaction * np.abs(reactions).max()
                end = replace(end, energy=energy * end.energy, reactions=reactions)
            return end, figures

        return off

    plain = Extreme("f", "plain", SMALL, OnePoint(10.0))
    for energy, reaction in ((1.02, 0.0), (1.0, 0.02)):
        monkeypatch.setattr(study, "_run", off_by(energy, reaction))
        one, five = STUDY.examine(plain)
        assert (one["outcome"], one["agrees"]) == (ends.RIGHT, True)
        assert (five["outcome"], five["agrees"]) == (ends.WRONG, False)
        assert five["energy_off"] == pytest.approx(1 - 1 / energy, abs=1e-6)
        assert five["reactions_off"] == pytest.approx(reaction, rel=0.03, abs=1e-6)


def test_an_exact_motion_must_be_met(few_steps):
    frame = partial(picture_frame, size=(3, 3))
    exact = Extreme("f", "frame", frame, Full(), G=0.5, exact=True)
    assert outcomes(exact) == [ends.RIGHT, ends.RIGHT]
    off = Extreme("f", "strip", SMALL, Full(), exact=True)  # not exact on this mesh
    assert outcomes(off) == [ends.WRONG, ends.WRONG]


def test_what_must_fold_is_refused_and_not_solvable(few_steps):
    rows = STUDY.examine(FOLDING)
    assert [row["outcome"] for row in rows] == [ends.REFUSED, ends.REFUSED]
    assert not any(row["solvable"] or row["agrees"] for row in rows)
    assert all("det F" in row["message"] for row in rows)
    assert all(row["energy_off"] is None for row in rows)


@pytest.mark.parametrize("way", ["descent", "newton", "more steps"])
def test_what_another_run_solves_is_refused_though_solvable(
    few_steps, monkeypatch, way
):
    def balks(ply, conditions, steps, strategies):
        if (way == "more steps" and steps == 10) or strategies == (way,):
            strategies = DEFAULT_STRATEGIES
        else:
            strategies = [Mixed(most=1)]
        return LoadStepper(
            ply, conditions, steps, strategies=strategies, max_halvings=0
        )

    monkeypatch.setattr(study, "LoadStepper", balks)
    rows = STUDY.examine(Extreme("f", "plain", SMALL, OnePoint(10.0)))
    assert [row["outcome"] for row in rows] == [ends.MISSED, ends.MISSED]
    solved_by = "mixed, descent in 10" if way == "more steps" else f"{way} in 1"
    assert all(row["solvable"] and row["solved_by"] == solved_by for row in rows)
    assert not any(row["reference_sound"] and way != "more steps" for row in rows)


def test_a_saddle_point_taken_for_an_answer_is_wrong(few_steps, monkeypatch):
    """The study must not believe the load stepper."""
    assert ends.WRONG not in outcomes(ROD)

    def credulous(ply, conditions, steps, strategies):
        warn_only = list(CHECKS)
        return LoadStepper(
            ply, conditions, steps, strategies=["newton"], warn_only=warn_only
        )

    monkeypatch.setattr(study, "LoadStepper", credulous)
    assert outcomes(ROD) == [ends.WRONG, ends.WRONG]


def test_the_study_covers_what_it_should():
    problems = extremes()
    assert len(problems) * len(study.STEPS) >= 300
    assert len({STUDY.name(p) for p in problems}) == len(problems)
    ratios = {p.E / p.G for p in problems if p.G}
    assert {1e2, 1e4, 1e6, 1e8, 1e10} <= ratios
    assert any(p.G == 0 for p in problems)
    stabilisations = {getattr(p.formulation, "stabilisation", 1) for p in problems}
    assert {1e-3, 1e3} <= stabilisations


def test_every_law_is_on_every_scene_with_every_formulation_and_stiffness():
    found = [p for p in extremes() if p.family.startswith("laws: ")]
    assert {p.family.removeprefix("laws: ") for p in found} == {
        "strip",
        "trellis",
        "picture frame",
        "bias extension",
    }
    for law in (*TENSIONS, *SHEARS):
        own = [p for p in found if p.label.rpartition(", ")[0] == law]
        assert len({p.family for p in own}) == 4
        formulations = {p.formulation for p in own}
        assert formulations == {Macro(), OnePoint(), Quadratic(80.0)}
        assert {p.E for p in own} == {1e3, 1e5, 1e8}
        for problem in own:
            fabric = problem.ply(problem.scene()).fabric
            if law in SHEARS:
                assert fabric.shear_law is SHEARS[law]
                assert fabric.families[0].tension == Linear(problem.E)
            else:
                assert fabric.shear_law == Linear(0.5)
                given = Fabric(TENSIONS[law](problem.E)).tensions
                assert repr(fabric.tensions) == repr(given)


@pytest.mark.parametrize("law", TENSIONS)
def test_laws_of_tension_have_about_the_slope_E_at_one_percent_of_strain(law):
    law = Fabric(TENSIONS[law](1e5)).tensions.of_family(0)
    assert 0.6 < law.tangent(np.array([0.01]))[0] / 1e5 < 1.01


def test_the_shear_table_rises_a_hundredfold():
    at_30, at_55 = SHEARS["shear table"].value(np.radians([30, 55]))
    assert at_55 == pytest.approx(100 * at_30)


def test_folding_plies_are_on_meshes_in_a_row():
    """No mesh is chosen by how it ends."""
    seeds, first = {}, {}
    for problem in extremes():
        if problem.family == "folding":
            seeds.setdefault(problem.kind, []).append(problem.seed)
            mesh = problem.scene().mesh.p
            assert not np.array_equal(mesh, first.setdefault(problem.kind, 0 * mesh))
            first[problem.kind] = mesh
    assert {kind: (found[0], len(found)) for kind, found in seeds.items()} == {
        "strip 6×9, C_s = 1, one point": (0, 24),
        "strip 6×9, C_s = 0.1, one point": (0, 6),
        "strip 6×9, C_s = 0.01, one point": (0, 6),
        "strip 10×15, C_s = 1, one point": (2, 7),
        "strip 10×15, C_s = 0.1, one point": (2, 7),
        "bias 60°, Delaunay, G = 0.1, macro": (0, 24),
        "bias 60°, Delaunay, G = 0, macro": (0, 8),
        "bias 40°, G = 0, one point": (0, 4),
        "trellis, G = 0, one point": (0, 4),
    }
    assert all(
        found == list(range(found[0], found[-1] + 1)) for found in seeds.values()
    )


def test_flat_angles_are_flat():
    (problem,) = [p for p in extremes() if p.name == "strip, 2×2" and "179" in p.family]
    mesh = problem.scene().mesh
    x = mesh.p[:, mesh.t]
    ahead, behind = np.roll(x, -1, axis=1) - x, np.roll(x, 1, axis=1) - x
    cosine = np.sum(ahead * behind, axis=0) / (
        np.linalg.norm(ahead, axis=0) * np.linalg.norm(behind, axis=0)
    )
    assert np.degrees(np.arccos(cosine)).max() == pytest.approx(179.0)


def test_an_interrupted_study_reports_on_what_it_has_and_goes_on(
    tmp_path, few_steps, monkeypatch, capsys
):
    problems = [Extreme("plain", n, SMALL, OnePoint(10.0)) for n in ("one", "two")]
    monkeypatch.setattr(study, "extremes", lambda: problems)
    examine, asked, interrupted = STUDY.examine, [], [True]

    def interrupting(problem):
        asked.append(problem.label)
        if problem.label == "two" and interrupted:
            interrupted.clear()
            raise KeyboardInterrupt
        return examine(problem)

    monkeypatch.setattr(STUDY, "examine", interrupting)
    out = tmp_path / "out"
    command = ["stability", "--no-render", "--out", str(out)]
    assert main(command) == 130
    assert "--resume" in capsys.readouterr().err
    assert json.loads((out / "summary.json").read_text())["cases"] == 2
    assert main(command) == 2
    assert "--resume" in capsys.readouterr().err
    assert main([*command, "--resume"]) == 0
    assert asked == ["one", "two", "two"]
    assert json.loads((out / "summary.json").read_text())["cases"] == 4
    assert {p.name for p in out.iterdir()} == set(STUDY.files)


def test_a_case_that_fails_is_named_and_the_others_are_reported(
    tmp_path, few_steps, monkeypatch, capsys
):
    problems = [
        Extreme("plain", "fails", partial(strip, mesh="none"), Full()),
        Extreme("plain", "one", SMALL, OnePoint(10.0)),
    ]
    monkeypatch.setattr(study, "extremes", lambda: problems)
    out = tmp_path / "out"
    command = ["stability", "--no-render", "--out", str(out)]
    assert main(command) == 1
    said = capsys.readouterr().err
    assert "plain, fails, 2×2: " in said
    assert "--resume" in said
    assert json.loads((out / "summary.json").read_text())["cases"] == 2


def test_the_study_writes_its_report(tmp_path, few_steps, monkeypatch, capsys):
    problems = [
        Extreme("plain", "one", SMALL, OnePoint(10.0)),
        replace(FOLDING, seed=0),
        replace(FOLDING, seed=1, scene=SMALL, E=1e4),
    ]
    monkeypatch.setattr(study, "extremes", lambda: problems)
    out = tmp_path / "out"
    assert main(["stability", "--out", str(out)]) == 0
    assert {p.name for p in out.iterdir()} == {*STUDY.files, *drawn_here(STUDY)}
    summary = json.loads((out / "summary.json").read_text())
    assert summary["cases"] == 6
    assert summary["right"] == summary["solvable"] == 4
    assert summary["refused"] == 2
    assert summary["wrong"] == summary["refused_though_solvable"] == 0
    assert summary["share_right_of_solvable"] == 1.0
    with open(out / "stability.csv") as file:
        rows = list(csv.DictReader(file))
    assert [row["steps"] for row in rows] == ["1", "5"] * 3
    assert {row["path_resolved"] for row in rows[:2]} == {"True"}
    table = (out / "stability.md").read_text()
    assert "| plain | 2 | 2 | 0 | 0 | 0 | 0 | 2 | 0 |" in table
    assert "| folding: turned over, 2×2 | 4 | 2 | 0 | 2 | 0 | 0 | 2 | 0 |" in table
    assert "| folding, turned over, 2×2, seeds 0 | refused | 1, 5 | 0.66" in table
    assert "2 element(s) folded, det F" in table
    assert "plain, one, one point " in capsys.readouterr().out


def test_meshes_that_differ_in_their_seed_share_a_line_of_the_picture():
    def row(outcome, solves=3):
        message = "" if outcome == ends.RIGHT else "stopped"
        return {"outcome": outcome, "linear_solves": solves, "message": message}

    right, refused = row(ends.RIGHT), row(ends.REFUSED)
    assert tables._cell([right]) == ({ends.RIGHT: 1}, "3")
    assert tables._cell([refused]) == ({ends.REFUSED: 1}, "")
    shared = {ends.RIGHT: 2, ends.REFUSED: 1}
    assert tables._cell([refused, right, right]) == (shared, "2/3")
