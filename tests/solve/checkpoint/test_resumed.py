"""A run that was interrupted or killed is resumed to the same end."""

import os
import pickle
import signal
import subprocess
import sys
import time
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from skfem_textile import CheckpointError, Newton, StepError
from skfem_textile.cli import main as cli
from tests import helpers
from tests.helpers import extended_runs
from tests.helpers.strip_runs import assert_same, interrupted_at, stepper, whole


@pytest.mark.parametrize("kind", ["energy", "rate"])
@pytest.mark.parametrize("at", [0.1, 0.5, 0.8])
def test_a_resumed_run_gives_the_same_result_to_the_last_bit(tmp_path, kind, at):
    interrupted_at(tmp_path / "c", at, kind=kind)
    resumed = stepper(tmp_path / "c", kind=kind).run(resume=True)
    assert_same(resumed, whole(kind))


# Runs every formulation, afresh and from its checkpoint.
IN_ANOTHER_PROCESS = """
import pickle, sys
from pathlib import Path
from tests.helpers.extended_runs import FORMULATIONS, stepper
folder, found = Path(sys.argv[1]), {}
for name in FORMULATIONS:
    afresh = stepper(name).run()
    resumed = stepper(name, folder / name).run(resume=True)
    found[name] = [(run.states, run.history()) for run in (afresh, resumed)]
(folder / "found").write_bytes(pickle.dumps(found))
"""


@pytest.fixture(scope="module")
def in_another_process(tmp_path_factory):
    """States and histories by name of the formulation."""
    folder = tmp_path_factory.mktemp("another process")
    for name in extended_runs.FORMULATIONS:
        extended_runs.interrupted(name, folder / name)
    environment = os.environ | {"PYTHONPATH": str(Path(helpers.__file__).parents[2])}
    command = [sys.executable, "-c", IN_ANOTHER_PROCESS, str(folder)]
    subprocess.run(command, env=environment, check=True, timeout=300)
    return pickle.loads((folder / "found").read_bytes())


@pytest.mark.parametrize("name", extended_runs.FORMULATIONS)
def test_runs_resumed_or_in_another_process_are_the_same_to_the_last_bit(
    tmp_path, name, in_another_process
):
    """Displacements and parameters of every state, and the history."""
    first = extended_runs.stepper(name).run()
    changed = [s.parameters for s in first.states if s.load_factor in (0.25, 0.5, 1)]
    for before, after in pairwise(changed):
        assert not any(before[term].same_as(after[term]) for term in after)
    extended_runs.interrupted(name, tmp_path)
    resumed = extended_runs.stepper(name, tmp_path).run(resume=True)
    assert_same(resumed, first)
    for states, history in (
        (resumed.states, resumed.history()),
        *in_another_process[name],
    ):
        assert history == first.history()
        for found, state in zip(states, first.states, strict=True):
            np.testing.assert_array_equal(found.u, state.u)
            assert found.parameters.keys() == state.parameters.keys()
            for term, values in found.parameters.items():
                assert values.same_as(state.parameters[term])


def test_a_resumed_run_goes_on_with_the_length_of_its_step(tmp_path):
    """This run cuts its only step, and grows again."""
    options = {"steps": 1, "method": Newton(most=1)}
    whole = stepper(None, **options).run()
    assert whole.steps_cut > 0
    interrupted_at(tmp_path / "c", whole.states[1].load_factor, **options)
    assert_same(stepper(tmp_path / "c", **options).run(resume=True), whole)


def test_a_run_that_stopped_early_is_resumed_to_the_same_end(tmp_path):
    """A run that cannot go on says so again, and keeps what it had."""
    ends = []
    for resume in (False, True):
        run = stepper(tmp_path / "c", steps=4, E=1e8, method="plain", max_halvings=1)
        with pytest.raises(StepError) as error:
            run.run(resume)
        ends.append(error.value.result)
    assert ends[0].states[-1].load_factor == ends[1].states[-1].load_factor


def test_a_finished_run_is_read_and_not_run_again(tmp_path):
    first = stepper(tmp_path / "c").run()
    again = stepper(tmp_path / "c", on_step=pytest.fail).run(resume=True)
    assert_same(again, first)


def test_without_a_state_a_run_starts_from_the_beginning_and_says_so(tmp_path, caplog):
    assert_same(stepper(tmp_path / "c").run(resume=True), whole())
    assert "nothing to resume" in caplog.text


def test_an_unfinished_run_is_not_overwritten_and_a_finished_one_is(half):
    with pytest.raises(CheckpointError, match="holds an unfinished run: resume it"):
        stepper(half).run()
    stepper(half).run(resume=True)
    stepper(half, C_s=10.0).run()


def test_there_must_be_a_checkpoint_to_resume_from(tmp_path):
    with pytest.raises(ValueError, match="no checkpoint to resume from"):
        stepper(None).run(resume=True)


@pytest.mark.parametrize(
    ("steps", "kills"), [(12, 1), pytest.param(40, 20, marks=pytest.mark.long)]
)
def test_a_run_killed_at_any_moment_is_resumed(tmp_path, capsys, steps, kills):
    """Killed without warning, at random between the first state and the last.

    It is resumed in another process, this one.
    """
    rng = np.random.default_rng(0)
    program = sys.executable, "-m", "skfem_textile"
    command = ["run", "strip", "--no-render", "--size", "4x6", "--steps", str(steps)]
    command += [
        "--formulation",
        "one-point",
        "--set",
        "formulation.stabilisation=rate",
        "--set",
        "formulation.cs_N_per_mm=1",
    ]

    def killed(out, kill_at):
        """Exit code; the kill comes a little after so many states."""
        with subprocess.Popen(
            [*program, *command, "-v", "--checkpoint", "--out", str(out)],
            stdout=subprocess.DEVNULL,
            stderr=subprocess.PIPE,
            text=True,
        ) as child:
            states = 0
            for line in child.stderr:
                states += "linear solves" in line
                if states == kill_at:
                    time.sleep(0.02 * rng.random())
                    child.kill()
        return child.returncode

    assert cli.main([*command, "--out", str(tmp_path / "whole")]) == 0
    history = (tmp_path / "whole" / "history.csv").read_text()
    for i in range(kills):
        out = tmp_path / f"out{i}"
        assert killed(out, rng.integers(1, steps - 3)) == -signal.SIGKILL
        assert not (out / "history.csv").exists()
        capsys.readouterr()
        assert cli.main([*command, "-v", "--out", str(out), "--resume"]) == 0
        assert "resumed at load factor" in capsys.readouterr().err
        assert (out / "history.csv").read_text() == history
