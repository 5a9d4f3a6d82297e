"""What is written, and what is left of it where that fails or is cut short."""

from pathlib import Path

import numpy as np
import pytest

from skfem_textile import (
    CheckpointError,
    Fabric,
    LoadStepper,
    OnePoint,
    Ply,
    Sin2,
    StepError,
)
from skfem_textile.scenes import bias_extension
from tests.helpers import full_disk, place_of
from tests.helpers.strip_runs import assert_same, interrupted_at, stepper, whole


def test_a_folder_that_cannot_be_written_is_refused_before_any_work(tmp_path):
    (tmp_path / "file").write_text("in the way")
    with pytest.raises(CheckpointError, match="cannot write checkpoint"):
        stepper(tmp_path / "file" / "c", on_iteration=pytest.fail).run()


def test_a_full_disk_stops_the_run_and_keeps_its_states(tmp_path, monkeypatch):
    monkeypatch.setattr(np, "savez", full_after(3, np.savez))
    with pytest.raises(StepError, match=r"cannot write checkpoint .*: No space") as e:
        stepper(tmp_path / "c").run()
    assert e.value.result.states[-1].load_factor > 0
    monkeypatch.undo()
    assert_same(stepper(tmp_path / "c").run(resume=True), whole())


def test_a_state_that_is_not_written_leaves_no_trace(tmp_path, monkeypatch):
    scene = bias_extension(size=(4, 8))
    fabric = Fabric(1e4, Sin2(0.5), scene.warp, scene.weft)
    ply = Ply(scene.mesh, fabric, OnePoint())
    monkeypatch.setattr(np, "savez", full_after(3, np.savez))
    with pytest.raises(StepError, match="cannot write checkpoint") as e:
        LoadStepper(ply, scene.conditions, 4, checkpoint=tmp_path / "c").run()
    last = e.value.result.states[-1]
    assert ply.energies(*place_of(last)) == last.energies


def full_after(number, savez):
    calls = []

    def full(*arguments, **arrays):
        calls.append(arguments)
        if len(calls) > number:
            raise OSError(28, "No space left on device")
        savez(*arguments, **arrays)

    return full


def test_a_finished_run_stays_until_the_next_has_a_state_on_disk(tmp_path, monkeypatch):
    first = stepper(tmp_path / "c").run()
    for number in (0, 1):
        monkeypatch.setattr(np, "savez", full_after(number, np.savez))
        with pytest.raises(CheckpointError, match="No space left"):
            stepper(tmp_path / "c", C_s=2.0).run()
        monkeypatch.undo()
        assert_same(stepper(tmp_path / "c").run(resume=True), first)


@pytest.mark.parametrize("at", range(10))
def test_a_new_run_that_is_killed_as_it_takes_the_place_of_the_old(
    tmp_path, monkeypatch, at
):
    """Either run is resumed to its own end, or it is told that it cannot be."""
    stepper(tmp_path / "c").run()
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
        stepper(tmp_path / "c", C_s=2.0).run()
    monkeypatch.undo()
    if sorted((tmp_path / "c").glob("state*")):
        C_s = 1.0 if at < 7 else 2.0
        with pytest.raises(CheckpointError, match="is of another run: formulation was"):
            stepper(tmp_path / "c", C_s=3.0 - C_s).run(resume=True)
        resumed = stepper(tmp_path / "c", C_s=C_s).run(resume=True)
        assert_same(resumed, whole(C_s=C_s))
    else:
        stepper(tmp_path / "c", C_s=2.0).run(resume=True)


@pytest.mark.parametrize("resume", [False, True])
def test_the_next_run_removes_what_a_killed_one_left_half_done(tmp_path, resume):
    folder = tmp_path / "c"
    if resume:
        interrupted_at(folder, 0.5)
    folder.mkdir(exist_ok=True)
    for name in (".run.npz", ".state_000009.npz", "own.npz"):
        (folder / name).write_bytes(b"half a fi")
    assert stepper(folder).run(resume=resume).converged
    assert not list(folder.glob(".*"))
    assert (folder / "own.npz").exists()


def test_a_full_disk_is_left_no_half_of_a_file(tmp_path, monkeypatch):
    def fill(state):
        monkeypatch.setattr("os.fsync", full_disk)

    told = (
        "cannot write checkpoint .*/c: No space left on device; what it holds remains"
    )
    with pytest.raises(StepError, match=told):
        stepper(tmp_path / "c", on_step=fill).run()
    assert not list((tmp_path / "c").glob(".*"))


def test_two_runs_do_not_write_to_one_checkpoint(tmp_path):
    def another(state):
        with pytest.raises(CheckpointError, match="another run is writing to"):
            stepper(tmp_path / "c").run(resume=True)
        told.append(state)

    told = []
    stepper(tmp_path / "c", on_step=another).run()
    assert told
    stepper(tmp_path / "c").run()
