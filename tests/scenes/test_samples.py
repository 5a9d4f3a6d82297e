"""Runs of a case with further specimens of its fabric."""

import pickle
from dataclasses import replace

import numpy as np
import pytest

from skfem_textile import Fabric, Linear
from skfem_textile.scenes import Case, picture_frame, run_samples
from skfem_textile.scenes.samples import CONFIDENCE, band_of
from skfem_textile.sweep import ThisThread
from tests.helpers import refused

SCENE = picture_frame("horizontal", size=(2, 2))
CASE = Case(
    scene=SCENE,
    fabric=Fabric(1e4, 0.5, SCENE.warp, SCENE.weft),
    steps=2,
    solver="superlu",
)
CASE_RUN = Case.run
STIFFNESSES = 0.2, 0.3, 0.4, 0.6, 0.7


def fabrics(*stiffnesses):
    return [replace(CASE.fabric, shear=Linear(one)) for one in stiffnesses]


@pytest.fixture(scope="module")
def samples():
    return run_samples(CASE, fabrics(*STIFFNESSES))


def test_each_sample_is_a_run_with_its_law(samples):
    loads = []
    for fabric in fabrics(*STIFFNESSES):
        case = replace(CASE, fabric=fabric)
        loads.append(case.summary(case.run())["load_N"])
    assert samples.figures["load_N"] == pytest.approx(loads, rel=1e-12)
    assert samples.bands["load_N"] == pytest.approx((loads[0], loads[-1]), rel=1e-12)
    assert not samples.warnings.any()


def test_the_band_of_the_force_follows_the_load(samples):
    """The force is proportional to the stiffness at each load factor."""
    low, high = samples.force_band(np.array([0.0, 0.5, 1.0]))
    assert (low[0], high[0]) == (0.0, 0.0)
    ratio = STIFFNESSES[-1] / STIFFNESSES[0]
    assert high[1:] / low[1:] == pytest.approx([ratio, ratio], rel=1e-6)


@pytest.mark.parametrize(
    ("n", "inner"), [(2, 0), (19, 0), (20, 0), (38, 0), (39, 1), (99, 4)]
)
def test_a_band_omits_as_many_extremes_as_its_probability_permits(n, inner):
    values = np.random.default_rng(n).permutation(np.arange(float(n)))
    assert band_of(values) == (inner, n - 1 - inner)
    probability = (n - 1 - 2 * inner) / (n + 1)
    assert probability >= CONFIDENCE - 1e-12 or inner == 0


def test_the_probability_of_a_band_is_the_share_of_further_draws(samples):
    assert samples.probability == pytest.approx(4 / 6)
    rng = np.random.default_rng(1)
    drawn = rng.standard_exponential((4000, 6))
    bands = np.array([band_of(row[:5]) for row in drawn])
    inside = (bands[:, 0] <= drawn[:, 5]) & (drawn[:, 5] <= bands[:, 1])
    assert inside.mean() == pytest.approx(samples.probability, abs=0.03)


def test_completed_samples_are_not_repeated(tmp_path, samples, monkeypatch):
    out = tmp_path / "samples.jsonl"
    run_samples(CASE, fabrics(*STIFFNESSES[:3]), out=out, key="case")
    called = []
    monkeypatch.setattr(Case, "run", lambda case: called.append(case) or CASE_RUN(case))
    again = run_samples(CASE, fabrics(*STIFFNESSES), out=out, key="case")
    assert len(called) == 2
    assert again.bands == samples.bands
    run_samples(CASE, fabrics(*STIFFNESSES[:2]), out=out, key="another case")
    assert len(called) == 4


def test_samples_that_stop_early_have_no_figures(monkeypatch):
    def stops(case):
        if case.fabric.shear_law.stiffness > 1:
            raise ValueError("the run stopped\nin two lines")
        return CASE_RUN(case)

    monkeypatch.setattr(Case, "run", stops)
    found = run_samples(CASE, fabrics(0.2, 3.0, 0.3))
    assert found.completed == (0, 2)
    assert found.figures["load_N"].shape == (2,)
    assert found.stopped == {1: "the run stopped"}
    message = refused(lambda: run_samples(CASE, fabrics(0.2, 2.0)), "1 of 2 samples")
    assert message.endswith("requires at least 2: the run stopped")


def test_other_errors_than_those_of_a_run_are_raised(monkeypatch):
    def broken(case):
        raise MemoryError

    monkeypatch.setattr(Case, "run", broken)
    with pytest.raises(
        RuntimeError, match=r"2 case\(s\) failed: sample 1: MemoryError"
    ):
        run_samples(CASE, fabrics(0.2, 0.3))


def test_a_case_and_its_samples_can_be_sent_to_a_process():
    sent = pickle.loads(pickle.dumps((CASE, fabrics(0.2))))
    assert sent[1][0].shear_law == Linear(0.2)


def test_this_thread_returns_results_and_errors():
    with ThisThread() as executor:
        assert executor.submit(max, 1, 2).result() == 2
        assert isinstance(executor.submit(int, "x").exception(), ValueError)
