import csv
import json
from concurrent.futures import ThreadPoolExecutor
from functools import partial

import numpy as np
import pytest
from skfem import MeshQuad

from skfem_textile import Condition, Fabric, Full, LoadStepper, OnePoint, Ply, cli
from skfem_textile.scenes import Scene, picture_frame, strip
from skfem_textile.studies import stability
from skfem_textile.studies.extremes import Extreme, extremes
from skfem_textile.verdict import CHECKS

SMALL = partial(strip, size=(4, 6))
FOLDING = partial(strip, jitter=0.45, seed=9)


@pytest.fixture
def few_steps(monkeypatch):
    monkeypatch.setattr(stability, "STEPS", (1, 5))
    monkeypatch.setattr(stability, "_REFERENCE", 10)
    monkeypatch.setattr(stability, "_AGREEING", (5, 10))
    # Processes would not know.
    monkeypatch.setattr("skfem_textile.sweep.Processes", ThreadPoolExecutor)


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


def outcomes(problem):
    return [row["outcome"] for row in stability.examined(problem)]


def test_a_plain_problem_is_right_and_has_one_answer(few_steps):
    rows = stability.examined(Extreme("f", "plain", SMALL, OnePoint(10.0)))
    assert [row["outcome"] for row in rows] == [stability.RIGHT, stability.RIGHT]
    assert all(row["one answer"] for row in rows)


def test_an_exact_motion_must_be_met(few_steps):
    frame = partial(picture_frame, size=(3, 3))
    exact = Extreme("f", "frame", frame, Full(), G=0.5, exact=True)
    assert outcomes(exact) == [stability.RIGHT, stability.RIGHT]
    off = Extreme("f", "strip", SMALL, Full(), exact=True)  # not exact on this mesh
    assert outcomes(off) == [stability.WRONG, stability.WRONG]


def test_a_folding_problem_is_refused_and_has_no_answer(few_steps):
    rows = stability.examined(Extreme("f", "folds", FOLDING, OnePoint(1.0)))
    assert [row["outcome"] for row in rows] == [stability.REFUSED, stability.REFUSED]
    assert not any(row["one answer"] for row in rows)
    assert all("det F" in row["message"] for row in rows)


def test_a_saddle_point_taken_for_an_answer_is_wrong(few_steps, monkeypatch):
    """The study must not believe the load stepper."""
    assert stability.WRONG not in outcomes(ROD)
    credulous = partial(LoadStepper, strategies=["newton"], warn_only=list(CHECKS))
    monkeypatch.setattr(stability, "LoadStepper", credulous)
    assert outcomes(ROD) == [stability.WRONG, stability.WRONG]


def test_soundness_needs_equilibrium_stability_and_no_folds():
    scene = SMALL()
    ply = Ply(scene.mesh, Fabric(1e4), OnePoint(10.0))
    u = LoadStepper(ply, scene.conditions, 4).run().u
    assert stability.is_sound(ply, scene, u)
    for off in (1e-2, 10.0):
        moved = u.copy()
        moved[ply.basis.nodal_dofs[:, 17]] += off
        assert not stability.is_sound(ply, scene, moved)
    assert not stability.is_sound(ply, scene, 0.9 * u)


def test_the_study_covers_what_it_should():
    problems = extremes()
    assert len(problems) * len(stability.STEPS) >= 300
    assert len({stability.name(p) for p in problems}) == len(problems)
    ratios = {p.E / p.G for p in problems if p.G}
    assert {1e2, 1e4, 1e6, 1e8, 1e10} <= ratios
    assert any(p.G == 0 for p in problems)
    stabilisations = {getattr(p.formulation, "stabilisation", 1) for p in problems}
    assert {1e-3, 1e3} <= stabilisations


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
    monkeypatch.setattr(stability, "extremes", lambda: problems)
    examined, asked, interrupted = stability.examined, [], [True]

    def interrupting(problem):
        asked.append(problem.label)
        if problem.label == "two" and interrupted:
            interrupted.clear()
            raise KeyboardInterrupt
        return examined(problem)

    monkeypatch.setattr(stability, "examined", interrupting)
    out = tmp_path / "out"
    command = ["study", "stability", "--no-render", "--out", str(out)]
    assert cli.main(command) == 130
    assert "--resume" in capsys.readouterr().err
    assert json.loads((out / "summary.json").read_text())["cases"] == 2
    assert cli.main(command) == 2
    assert "--resume" in capsys.readouterr().err
    assert cli.main([*command, "--resume"]) == 0
    assert asked == ["one", "two", "two"]
    assert json.loads((out / "summary.json").read_text())["cases"] == 4
    assert {p.name for p in out.iterdir()} == set(stability.FILES)


def test_a_case_that_fails_is_named_and_the_others_are_reported(
    tmp_path, few_steps, monkeypatch, capsys
):
    problems = [
        Extreme("plain", "fails", partial(strip, mesh="none"), Full()),
        Extreme("plain", "one", SMALL, OnePoint(10.0)),
    ]
    monkeypatch.setattr(stability, "extremes", lambda: problems)
    out = tmp_path / "out"
    command = ["study", "stability", "--no-render", "--out", str(out)]
    assert cli.main(command) == 1
    said = capsys.readouterr().err
    assert "plain, fails, 2×2: " in said
    assert "--resume" in said
    assert json.loads((out / "summary.json").read_text())["cases"] == 2


def test_the_study_writes_its_report(tmp_path, few_steps, monkeypatch, capsys):
    problems = [
        Extreme("plain", "one", SMALL, OnePoint(10.0)),
        Extreme("folding", "two", FOLDING, OnePoint(1.0)),
    ]
    monkeypatch.setattr(stability, "extremes", lambda: problems)
    out = tmp_path / "out"
    assert cli.main(["study", "stability", "--out", str(out)]) == 0
    assert {p.name for p in out.iterdir()} == {*stability.FILES, *stability.PICTURES}
    summary = json.loads((out / "summary.json").read_text())
    assert summary["cases"] == 4
    assert summary["right"] == summary["refused"] == 2
    assert summary["wrong"] == 0
    assert summary["share_right_with_one_answer"] == 1.0
    with open(out / "stability.csv") as file:
        rows = list(csv.DictReader(file))
    assert [row["steps"] for row in rows] == ["1", "5", "1", "5"]
    table = (out / "stability.md").read_text()
    assert "| folding | 2 | 0 | 0 | 2 | 0 |" in table
    assert "| 1 element(s) folded, det F" in table
    assert "plain, one, one point " in capsys.readouterr().out
