"""Runs that are resumed, distinguished from others, and written."""

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

from skfem_textile import (
    CheckpointError,
    Condition,
    CrimpInterchange,
    Fabric,
    Linear,
    LoadStepper,
    Newton,
    OnePoint,
    Ply,
    StepError,
)
from skfem_textile.cli import main as cli
from tests import helpers
from tests.helpers import Coupled, distorted, extended_runs, full_disk, refused
from tests.helpers.strip_runs import assert_same, interrupted, stepper, whole_run


def test_a_resumed_run_gives_the_same_result_to_the_last_bit(half):
    assert_same(stepper(half).run(resume=True), whole_run())


# Resumes the run of every formulation from its checkpoint.
IN_ANOTHER_PROCESS = """
import pickle, sys
from pathlib import Path
from tests.helpers.extended_runs import FORMULATIONS, stepper
folder, found = Path(sys.argv[1]), {}
for name in FORMULATIONS:
    run = stepper(name, folder / name).run(resume=True)
    found[name] = run.states, run.history()
(folder / "found").write_bytes(pickle.dumps(found))
"""


@pytest.fixture(scope="module")
def in_another_process(tmp_path_factory):
    """States and histories by name of the formulation."""
    folder = tmp_path_factory.mktemp("another process")
    for name in extended_runs.FORMULATIONS:
        interrupted(0.5, extended_runs.stepper, name, folder / name)
    environment = os.environ | {"PYTHONPATH": str(Path(helpers.__file__).parents[2])}
    command = [sys.executable, "-c", IN_ANOTHER_PROCESS, str(folder)]
    subprocess.run(command, env=environment, check=True, timeout=300)
    return pickle.loads((folder / "found").read_bytes())


@pytest.mark.dear("the other process imports the library")
def test_runs_resumed_in_another_process_are_bitwise_identical(in_another_process):
    """Displacements and parameters of every state, and the history."""
    for name, (stored, history) in in_another_process.items():
        first = extended_runs.stepper(name).run()
        changed = [s.parameters for s in first.states if s.load_factor in (0.5, 1)]
        for before, after in pairwise(changed):
            assert not any(before[term].same_as(after[term]) for term in after)
        assert history == first.history()
        for one, state in zip(stored, first.states, strict=True):
            np.testing.assert_array_equal(one.u, state.u)
            assert one.parameters.keys() == state.parameters.keys()
            for term, values in one.parameters.items():
                assert values.same_as(state.parameters[term])


def test_a_resumed_run_continues_with_its_step_length(tmp_path):
    """This run cuts its only step and increases it again."""
    options = {"steps": 1, "method": Newton(most=1)}
    whole_run = stepper(None, **options).run()
    assert whole_run.steps_cut > 0
    first = whole_run.states[1].load_factor
    interrupted(first, stepper, tmp_path / "c", **options)
    assert_same(stepper(tmp_path / "c", **options).run(resume=True), whole_run)


def test_a_run_that_stopped_early_is_resumed_to_the_same_result(tmp_path):
    """A run that cannot continue reports it again and keeps its states."""
    ends = []
    for resume in (False, True):
        run = stepper(tmp_path / "c", steps=4, E=1e8, method="plain", max_halvings=1)
        with pytest.raises(StepError) as error:
            run.run(resume)
        ends.append(error.value.result)
    assert ends[0].states[-1].load_factor == ends[1].states[-1].load_factor


def test_a_finished_run_is_read_without_computation(done):
    again = stepper(done, on_step=pytest.fail).run(resume=True)
    assert_same(again, whole_run())


def test_a_run_without_a_state_starts_at_rest_with_a_message(tmp_path, caplog):
    assert_same(stepper(tmp_path / "c").run(resume=True), whole_run())
    assert "no state to resume" in caplog.text


def test_an_unfinished_run_is_not_overwritten_and_a_finished_one_is(half):
    with pytest.raises(CheckpointError, match="contains an unfinished run: resume it"):
        stepper(half).run()
    stepper(half).run(resume=True)
    stepper(half, C_s=10.0).run()


@pytest.mark.parametrize(
    ("steps", "kills"),
    [
        pytest.param(6, 1, marks=pytest.mark.dear("the killed process is the subject")),
        pytest.param(40, 20, marks=pytest.mark.slow),
    ],
)
def test_a_run_killed_at_any_moment_is_resumed(tmp_path, capsys, steps, kills):
    """It is killed at a random time between the first state and the last.

    It is resumed in another process.
    """
    rng = np.random.default_rng(0)
    program = sys.executable, "-m", "skfem_textile"
    command = ["run", "strip", "--no-render", "--size", "2x3", "--steps", str(steps)]
    command += ["--formulation", "one-point"]
    command += ["--set", "formulation.stabilisation=rate"]
    command += ["--set", "formulation.cs_N_per_mm=1"]

    def killed(out, kill_at):
        """Exit code; the kill comes shortly after this many states."""
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
        assert killed(out, rng.integers(1, steps - 2)) == -signal.SIGKILL
        assert not (out / "history.csv").exists()
        capsys.readouterr()
        assert cli.main([*command, "-v", "--out", str(out), "--resume"]) == 0
        assert "resumed at load factor" in capsys.readouterr().err
        assert (out / "history.csv").read_text() == history


# A checkpoint of another run is rejected for any small difference


@pytest.mark.parametrize(
    ("other", "reason"),
    [
        ({"C_s": 2.0}, r"formulation was OnePoint\(stabilisation=1.0.* is .*=2.0"),
        ({"E": 1e10}, "warp law was Linear.*10000.0.* is .*10000000000.0"),
        ({"E": (1e4, 2e4)}, "weft law was"),
        ({"E": CrimpInterchange(1e4, 0.01, 1.0, 1e-3, 1.0)}, "warp law was Linear"),
        ({"kind": "rate"}, "formulation was .*'energy'.* is .*'rate'"),
        ({"steps": 7}, "steps was"),
        ({"method": "plain"}, "method was"),
        ({"warn_only": []}, "warn_only was"),
    ],
)
def test_a_checkpoint_of_another_run_is_rejected(half, other, reason):
    refused(
        lambda: stepper(half, **other).run(resume=True),
        f"belongs to another run: .*{reason}",
    )


class HiddenCoupling(Coupled):
    """A law whose repr does not contain its values."""

    def __repr__(self):
        return "Hidden()"


class Hidden(Linear):
    """A law whose repr does not contain its values."""

    def __repr__(self):
        return "Hidden()"


def square(
    folder,
    *,
    tension=1e10,
    shear=0.5,
    warp=(1.0, 0.0),
    path=lambda t: t,
    slope=(1.0, 0.2),
    names=("clamp", "pull", "roll"),
):
    """Stiff fibres mask the shear law and the directions."""
    ply = Ply(distorted(1).with_defaults(), Fabric(tension, shear, warp), OnePoint(1.0))
    middle = np.abs(ply.nodes - 0.5).sum(axis=0).argsort()[:1]
    held = (
        Condition("bottom"),
        Condition("top", lambda X, t: 0 * X[0] + 0.01 * path(t), (0, 1)),
        Condition(middle, 0.0, slope),
    )
    conditions = dict(zip(names, held, strict=True))
    return LoadStepper(ply, conditions, 2, checkpoint=folder)


@pytest.mark.parametrize(
    ("one", "other", "reason"),
    [
        ({}, {"shear": 1.0}, "shear law was"),
        (
            {"shear": Hidden(0.5)},
            {"shear": Hidden(0.5 + 1e-6)},
            "values of the shear law differ",
        ),
        (
            {"tension": HiddenCoupling(1e4, 100.0)},
            {"tension": HiddenCoupling(1e4, 101.0)},
            "values of the tensions with the other family stretched differ",
        ),
        ({}, {"warp": (1.0, 1e-6)}, "fibre directions differ"),
        ({}, {"slope": (1.0, 0.3)}, "fixed directions differ"),
        ({}, {"names": ("low", "high", "side")}, "conditions was"),
        ({}, {"path": lambda t: t + 1e-6 * np.sin(np.pi * t)}, "fixed values differ"),
        # Between the load factors of the steps alone:
        ({}, {"path": lambda t: t + np.sin(2 * np.pi * t)}, "fixed values differ"),
    ],
)
def test_a_small_difference_is_distinguished(tmp_path, one, other, reason):
    square(tmp_path / "c", **one).run()
    with pytest.raises(CheckpointError, match=f"belongs to another run: .*{reason}"):
        square(tmp_path / "c", **other).run(resume=True)


# Written files, and their remains after failures and interruptions


def test_a_folder_that_cannot_be_written_is_rejected_before_any_work(tmp_path):
    (tmp_path / "file").write_text("in the way")
    with pytest.raises(CheckpointError, match="cannot write to checkpoint"):
        stepper(tmp_path / "file" / "c", on_iteration=pytest.fail).run()


def test_a_full_disk_stops_the_run_and_keeps_its_states(tmp_path, monkeypatch):
    monkeypatch.setattr(np, "savez", full_after(3, np.savez))
    with pytest.raises(StepError, match=r"to checkpoint .*: No space") as e:
        stepper(tmp_path / "c").run()
    assert e.value.result.states[-1].load_factor > 0
    monkeypatch.undo()
    assert_same(stepper(tmp_path / "c").run(resume=True), whole_run())


def full_after(number, savez):
    calls = []

    def full(*arguments, **arrays):
        calls.append(arguments)
        if len(calls) > number:
            raise OSError(28, "No space left on device")
        savez(*arguments, **arrays)

    return full


def test_a_finished_run_stays_until_the_next_has_a_state_on_disk(done, monkeypatch):
    for number in (0, 1):
        monkeypatch.setattr(np, "savez", full_after(number, np.savez))
        with pytest.raises(CheckpointError, match="No space left"):
            stepper(done, C_s=2.0).run()
        monkeypatch.undo()
        assert_same(stepper(done).run(resume=True), whole_run())


@pytest.mark.parametrize("at", range(7))
def test_a_run_killed_while_it_replaces_another_is_resumable(done, monkeypatch, at):
    """One of the two runs is resumed to its end, or resumption is rejected."""
    calls = []

    def killed(act):
        def call(*arguments):
            calls.append(arguments)
            if len(calls) > at:
                raise KeyboardInterrupt
            return act(*arguments)

        return call

    for name in ("unlink", "replace"):
        monkeypatch.setattr(Path, name, killed(getattr(Path, name)))
    with pytest.raises(KeyboardInterrupt):
        stepper(done, C_s=2.0).run()
    monkeypatch.undo()
    if sorted(done.glob("state*")):
        C_s = 1.0 if at < 4 else 2.0
        with pytest.raises(CheckpointError, match="another run: formulation was"):
            stepper(done, C_s=3.0 - C_s).run(resume=True)
        assert_same(stepper(done, C_s=C_s).run(resume=True), whole_run(C_s=C_s))
    else:
        stepper(done, C_s=2.0).run(resume=True)


@pytest.mark.parametrize("resume", [False, True])
def test_the_next_run_removes_unfinished_files_of_a_killed_one(tmp_path, resume):
    folder = tmp_path / "c"
    if resume:
        interrupted(0.5, stepper, folder)
    folder.mkdir(exist_ok=True)
    for name in (".run.npz", ".state_000009.npz", "own.npz"):
        (folder / name).write_bytes(b"half a fi")
    assert stepper(folder).run(resume=resume).converged
    assert not list(folder.glob(".*"))
    assert (folder / "own.npz").exists()


def test_no_partial_file_is_left_on_a_full_disk(tmp_path, monkeypatch):
    def fill(state):
        monkeypatch.setattr("os.fsync", full_disk)

    message = r"cannot write to checkpoint .*/c: No space left on device; the states"
    with pytest.raises(StepError, match=message):
        stepper(tmp_path / "c", on_step=fill).run()
    assert not list((tmp_path / "c").glob(".*"))


def test_two_runs_do_not_write_to_one_checkpoint(tmp_path):
    def another(state):
        with pytest.raises(CheckpointError, match="another run is writing to"):
            stepper(tmp_path / "c").run(resume=True)
        messages.append(state)

    messages = []
    stepper(tmp_path / "c", on_step=another).run()
    assert messages
    stepper(tmp_path / "c").run()
