"""Results report if another number of steps leads to the same equilibrium."""

import json
import logging
from dataclasses import asdict, replace

import numpy as np
import pytest

from skfem_textile import (
    Condition,
    Fabric,
    Full,
    Linear,
    LoadStepper,
    Macro,
    OnePoint,
    Ply,
    Pretensioned,
    Quadratic,
    Sin2,
)
from skfem_textile.scenes import bias_extension, strip
from skfem_textile.solve.continuation import Continuation
from skfem_textile.solve.states import State, Verdict
from skfem_textile.solve.verdict import CHECKS
from tests.helpers import Locking


def loaded(scene, formulation, steps, shear=0.0, tension=1e4, **options):
    fabric = Fabric(tension, shear, scene.warp, scene.weft)
    ply = Ply(scene.mesh, fabric, formulation or Macro())
    return LoadStepper(ply, scene.conditions, steps, **options).run()


@pytest.mark.slow
def test_the_strip_has_the_same_final_state_for_any_number_of_steps():
    """Without a path, 2 steps ended at 1.790 N·mm and 20 at 1.265."""
    results = [loaded(strip(), OnePoint(1.0), steps) for steps in (1, 2)]
    for result in results:
        assert result.path_resolved
        assert result.states[-1].verdict.stable
        assert energy_of(result) == pytest.approx(1.2650745, rel=1e-6)
        reaction = result.states[-1].forces["right"][0]
        assert reaction == pytest.approx(3.06595, rel=1e-4)


@pytest.mark.parametrize(
    ("scene", "steps"), [(strip(size=(5, 8)), 6), (bias_extension(size=(4, 8)), 1)]
)
def test_an_easy_path_has_no_extra_cost(scene, steps, monkeypatch):
    result = loaded(scene, Full(), steps, 0.5)
    assert result.path_resolved
    monkeypatch.setattr(Continuation, "most_projected", lambda *_: np.inf)
    monkeypatch.setattr(Continuation, "accepts", lambda *_: True)
    assert loaded(scene, Full(), steps, 0.5).linear_solves == result.linear_solves


@pytest.mark.parametrize(
    ("formulation", "law", "degrees"),
    [
        (OnePoint(), Sin2(0.5), 60.0),
        pytest.param(Macro(), Locking(0.5, 0.6), 30.0, marks=pytest.mark.slow),
        pytest.param(Macro(), Sin2(0.5), 60.0, marks=pytest.mark.slow),
        pytest.param(Macro(), Linear(0.5), 60.0, marks=pytest.mark.slow),
        pytest.param(OnePoint(), Locking(0.5, 0.3), 15.5, marks=pytest.mark.slow),
    ],
)
def test_load_and_energy_are_independent_of_the_step_size(formulation, law, degrees):
    """C_s and E_d follow the state, or a run reports that its path is in doubt."""
    scene = bias_extension(size=(3, 6), shear_angle=np.radians(degrees))
    few, more, many = (loaded(scene, formulation, n, law) for n in (1, 4, 8))
    assert many.path_resolved
    assert more.path_resolved
    for result in (few, more):
        if result.path_resolved:
            assert load_of(result) == pytest.approx(load_of(many), rel=0.005)
            assert energy_of(result) == pytest.approx(energy_of(many), rel=0.005)


def load_of(result):
    return result.states[-1].reactions["top"][1]


def energy_of(result):
    return result.history()[-1]["energy"]


def test_energy_is_independent_of_the_number_of_steps_if_reactions_cancel():
    """One condition fixes both ends: the sum of its forces is zero."""
    scene = bias_extension(size=(2, 4), shear_angle=np.radians(50))
    ends = [scene.mesh.p[1].min(), scene.mesh.p[1].max()]
    held = Condition(
        lambda X: np.isin(X[1], ends),
        lambda X, t: np.where(X[1] == ends[1], scene.displacement(X, t), 0.0),
    )
    scene = replace(scene, conditions={"ends": held})
    one, eight = (loaded(scene, Quadratic(80.0), n, Sin2(0.5)) for n in (1, 8))
    assert one.path_resolved
    assert energy_of(one) == pytest.approx(energy_of(eight), rel=0.005)


def test_a_reaction_along_stiff_fibres_is_independent_of_the_number_of_steps():
    """If the energy changes by a thousandth, the reaction changes by a tenth."""
    scene, tension = strip(size=(3, 4)), Pretensioned(Linear(1e5), 1.0)
    few, many = (loaded(scene, None, n, 0.5, tension) for n in (2, 5))
    reactions = [np.array([*r.states[-1].forces.values()]) for r in (few, many)]
    assert few.path_resolved
    assert np.abs(reactions[0] - reactions[1]).max() < 0.005 * np.abs(reactions).max()


def test_energy_is_independent_of_the_load_history():
    """Up to 60 degrees and back to 6, and straight to 6."""
    scene = bias_extension(size=(2, 4), seed=0, shear_angle=np.radians(60))

    def pulled(path, steps):
        top = Condition("top", lambda X, t: scene.displacement(X, path(t)))
        conditions = scene.conditions | {"top": top}
        return loaded(replace(scene, conditions=conditions), Macro(), steps, 0.5)

    back = pulled(lambda t: min(2 * t, 1.9 - 1.8 * t), 6)
    straight = pulled(lambda t: 0.1 * t, 2)
    assert back.path_resolved
    assert energy_of(back) == pytest.approx(energy_of(straight), rel=0.005)
    assert load_of(back) == pytest.approx(load_of(straight), rel=0.005)


def test_a_released_ply_has_no_energy_and_no_warning(caplog):
    scene = bias_extension(size=(4, 8))
    top = Condition("top", lambda X, t: scene.displacement(X, 1 - abs(2 * t - 1)))
    scene = replace(scene, conditions=scene.conditions | {"top": top})
    with caplog.at_level(logging.WARNING, logger="skfem_textile"):
        result = loaded(scene, Macro(), 4, 0.5)
    assert result.path_resolved
    assert abs(energy_of(result)) < 1e-9 * result.history()[2]["energy"]
    assert not caplog.records


def test_the_papers_rates_depend_on_the_number_of_steps():
    assert not loaded(strip(size=(3, 4)), OnePoint(10.0, "rate"), 4).path_resolved


def state(t, energy, force):
    """A state with an energy and a force at a load factor."""
    verdict, energies = Verdict(0, 1.0, 0.0, 0.0, 0.0), {"tension": energy}
    arguments = t, np.zeros(4), {}, {}, energies, 1, (), 0.0, verdict
    return State(*arguments, forces={"top": np.array([0.0, force])})


@pytest.mark.parametrize(
    ("energy", "force", "projected", "resolved"),
    [
        (1.009, 2.0, 2, True),
        (1.02, 2.0, 2, False),
        (1.0, 2.03, 2, False),
        (1.0, 2.0, 3, False),
    ],
)
def test_a_hard_step_must_agree_with_its_halves_within_1_per_cent(
    energy, force, projected, resolved
):
    path, step = Continuation(1.0, 8, True, next=1.0), 2.0**-6
    assert not path.accepts(step, state(step, 1.0, 2.0), projected=3, settled=True)
    assert path.end(0.0, 1.0) == path.next == step / 2
    assert path.accepts(step / 2, state(step / 2, 0.5, 1.0), projected, settled=True)
    path.next = 1.0
    assert path.end(step / 2, 1.0) == step
    assert path.accepts(step / 2, state(step, energy, force), projected=0, settled=True)
    assert (not path.unresolved) == resolved
    assert path.end(step, 1.0) == 1.0


def test_a_path_is_saved_and_resumed():
    path = Continuation(1.0, 8, True, next=1.0, unresolved=[0.5])
    path.accepts(2.0**-6, state(2.0**-6, 1.0, 2.0), projected=3, settled=True)
    assert path.to_compare
    assert Continuation.of(json.loads(json.dumps(asdict(path)))) == path


def test_a_method_without_difficulty_measure_leaves_the_path_unresolved():
    scene = strip(size=(2, 3), seed=0)
    options = {"method": "plain", "warn_only": list(CHECKS)}
    assert not loaded(scene, OnePoint(1.0), 1, **options).path_resolved
