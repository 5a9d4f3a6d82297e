"""The result says whether another number of steps leads to the same equilibrium."""

import json
import logging
from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from helpers import Locking

from skfem_textile import (
    Condition,
    Fabric,
    Full,
    LoadStepper,
    Macro,
    OnePoint,
    Ply,
    Sin2,
)
from skfem_textile.cli import main as cli
from skfem_textile.scenes import bias_extension, strip, trellis
from skfem_textile.solve.states import State, Verdict
from skfem_textile.solve.stepping.load_path import LoadPath
from skfem_textile.solve.verdict import CHECKS
from skfem_textile.splitting import split


def loaded(scene, formulation, steps, shear=0.0, **options):
    fabric = Fabric(1e4, shear, scene.warp, scene.weft)
    ply = Ply(scene.mesh, fabric, formulation)
    return LoadStepper(ply, scene.conditions, steps, **options).run()


def test_the_strip_ends_alike_however_many_steps_it_takes():
    """Without a path, 2 steps ended at 1.790 N·mm and 20 at 1.265."""
    results = [loaded(strip(), OnePoint(1.0), steps) for steps in (1, 2, 5, 20)]
    for result in results:
        assert result.path_resolved
        assert result.summary()["energy"] == pytest.approx(1.2650745, rel=1e-6)
        reaction = result.states[-1].reactions["right"][0]
        assert reaction == pytest.approx(3.06595, rel=1e-4)


@pytest.mark.parametrize("steps", [1, 5, 20])
@pytest.mark.parametrize("scene", [strip, partial(bias_extension, size=(6, 12))])
def test_an_easy_path_costs_nothing_more(scene, steps, monkeypatch):
    result = loaded(scene(), Full(), steps, 0.5)
    assert result.path_resolved
    monkeypatch.setattr(LoadPath, "most_altered", lambda *_: np.inf)
    monkeypatch.setattr(LoadPath, "must_repeat", lambda *_: False)
    assert loaded(scene(), Full(), steps, 0.5).linear_solves == result.linear_solves


@pytest.mark.parametrize(
    ("formulation", "law", "degrees", "enough"),
    [
        (OnePoint(), Sin2(0.5), 60.0, 40),
        (Macro(), Locking(0.5, 0.6), 30.0, 40),
        pytest.param(Macro(), Sin2(0.5), 60.0, 40, marks=pytest.mark.long),
        pytest.param(
            *(OnePoint(), Locking(0.5, 0.3), 15.5, 100), marks=pytest.mark.long
        ),
        pytest.param(OnePoint(), Sin2(0.5), 60.0, 100, marks=pytest.mark.long),
        pytest.param(Macro(), Sin2(0.5), 60.0, 100, marks=pytest.mark.long),
        pytest.param(Macro(), Locking(0.5, 0.6), 30.0, 100, marks=pytest.mark.long),
    ],
)
def test_stabilisation_that_changes_in_a_long_step_is_told(
    formulation, law, degrees, enough
):
    """C_s is held during a step: a load that is off by 1 % is not resolved."""
    scene = bias_extension(size=(6, 12), shear_angle=np.radians(degrees))
    if isinstance(formulation, Macro):
        scene = bias_extension(split(scene.mesh), shear_angle=np.radians(degrees))
    results = {n: loaded(scene, formulation, n, law) for n in (1, 4, 10, enough)}
    *few, many = (r.states[-1].reactions["top"][1] for r in results.values())
    assert results[enough].path_resolved
    assert not results[1].path_resolved
    for result, load in zip(results.values(), few, strict=False):
        assert not result.path_resolved or load == pytest.approx(many, rel=0.01)


def test_reactions_that_are_small_are_judged_by_what_the_next_step_would_change():
    """The energy of this one step is right to 0.2 %, a reaction is off by 1.5 %."""
    edges = {"right": "free", "top": "free"}
    scene = trellis(size=(6, 6), seed=0, edges=edges)
    assert not loaded(scene, OnePoint(), 1, Sin2(0.5)).path_resolved
    assert loaded(scene, OnePoint(), 20, Sin2(0.5)).path_resolved


def test_energy_that_unloading_leaves_in_the_stabilisation_is_told():
    """It is 14 % too much in 40 steps."""
    scene = bias_extension(size=(4, 8), seed=0, shear_angle=np.radians(60))
    there_and_back = Condition(
        "top", lambda X, t: scene.displacement(X, min(2 * t, 1.9 - 1.8 * t))
    )
    scene = replace(scene, conditions=scene.conditions | {"top": there_and_back})
    assert not loaded(scene, OnePoint(), 40, Sin2(0.5)).path_resolved


def test_the_papers_rates_depend_on_the_number_of_steps():
    assert not loaded(strip(size=(3, 4)), OnePoint(10.0, "rate"), 4).path_resolved


def state(t, energy, force):
    verdict = Verdict(0, 1.0, 0.0, 0.0, 0.0)
    return State(
        load_factor=t,
        u=np.zeros(4),
        reactions={"top": np.array([0.0, force])},
        displacements={},
        energies={"tension": energy},
        linear_solves=1,
        residuals=(),
        tolerance=0.0,
        verdict=verdict,
    )


@pytest.mark.parametrize(
    ("energy", "force", "resolved"),
    [(1.009, 2.0, True), (1.02, 2.0, False), (1.0, 2.03, False)],
)
def test_a_hard_step_and_its_halves_must_agree_to_1_per_cent(energy, force, resolved):
    path = LoadPath(longest=1.0, halvings=8)
    step = 2.0**-6
    assert path.must_repeat(step, state(step, 1.0, 2.0), altered=3, followed_path=True)
    assert path.until(1.0) == step
    half = state(step / 2, 0.5, 1.0)
    assert not path.must_repeat(step / 2, half, altered=3, followed_path=True)
    path.reached(half)
    path.reached(state(step, energy, force))
    assert (not path.unresolved) == resolved
    assert path.until(1.0) == 1.0


def test_a_path_is_saved_and_taken_up_again():
    path = LoadPath(longest=1.0, halvings=8, unresolved=[0.5])
    path.must_repeat(2.0**-6, state(2.0**-6, 1.0, 2.0), altered=3, followed_path=True)
    kept = json.loads(json.dumps(path.saved()))
    assert LoadPath.of(kept) == path


def test_a_drift_without_end_of_what_holds_nothing_is_no_error():
    path = LoadPath(1.0, 8)
    path.drifted(state(0.5, 1.0, 1.0), rise=0.0, drift=np.inf, held=0.0)
    assert path.energy_error == 0.0
    assert path.unresolved == []
    path.drifted(state(1.0, 1.0, 1.0), rise=1e-9, drift=np.inf, held=1.0)
    assert path.energy_error == np.inf
    assert path.unresolved == [1.0]


def test_a_drift_that_is_no_number_is_not_resolved():
    path = LoadPath(1.0, 8)
    path.drifted(state(1.0, 1.0, 1.0), rise=1e-9, drift=np.nan, held=1.0)
    assert path.unresolved == [1.0]


def test_the_summary_and_one_line_tell_of_a_path_that_forks(tmp_path, caplog):
    one_point = "--formulation one-point --cs 0.1"
    options = f"run strip --size 6x9 {one_point} --seed 0 --steps 1 --no-render --out"
    with caplog.at_level(logging.WARNING, logger="skfem_textile"):
        assert cli.main([*options.split(), str(tmp_path)]) == 0
    summary = json.loads((tmp_path / "summary.json").read_text())
    assert summary["path_resolved"] is False
    told = [r.getMessage() for r in caplog.records if "path" in r.getMessage()]
    assert len(told) == 1
    assert "another number of steps" in told[0]


@pytest.mark.parametrize(("strategies", "steps"), [(["newton"], 2), (["descent"], 20)])
def test_a_strategy_that_does_not_tell_leaves_the_path_unresolved(strategies, steps):
    """With the default strategies this ply ends at 5.107 N·mm, here at 2.770."""
    scene = strip(size=(6, 9), seed=0)
    options = {"strategies": strategies, "warn_only": list(CHECKS)}
    assert not loaded(scene, OnePoint(1.0), steps, **options).path_resolved
    assert loaded(scene, OnePoint(1.0), steps).path_resolved
