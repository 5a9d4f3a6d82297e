"""Checkpoints that are damaged, forged or locked."""

import json
import os
import shutil
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from skfem_textile import CheckpointError
from skfem_textile.solve import checksummed
from skfem_textile.solve.checksummed import Lock
from tests.helpers.sheared_runs import read_npz, stepper
from tests.helpers.strip_runs import interrupted

# Damaged checkpoints: rejected in one line


@pytest.fixture(scope="module")
def folders(made, tmp_path_factory):
    """Two interrupted runs of the same problem, and one of another."""
    top = tmp_path_factory.mktemp("checkpoints")
    interrupted(0.6, stepper, top / "again")
    interrupted(0.6, stepper, top / "other", pull=0.25)
    return made, top / "again", top / "other"


def refusal(folder):
    with pytest.raises(CheckpointError) as refused:
        stepper(folder).run(resume=True)
    line = str(refused.value)
    assert line.isprintable()
    assert str(folder) in line
    assert len(line) < 500 + len(str(folder))
    return line


def forge(folder, number, edit):
    """Edit text and arrays of a file, and its checksum."""
    file = [folder / "run.npz", *sorted(folder.glob("state_*"))][number]
    of_run, name, text, arrays = read_npz(file)
    edit(text, arrays)
    checksummed.write(file, of_run, name, text, arrays)


NAN = float("nan")


def slightly_more(x):
    return 1.001 * x


def with_value(path, value):
    """An edit that sets a value of the text, or changes it by a function."""

    def edit(text, arrays):
        *outer, key = path
        for step in outer:
            text = text[step]
        text[key] = value(text[key]) if callable(value) else value

    return edit


@pytest.mark.parametrize("file", ["run.npz", "state_000000.npz", "state_000002.npz"])
def test_a_damaged_checkpoint_is_rejected(run, file):
    path, whole = run / file, (run / file).read_bytes()
    middle = len(whole) // 2
    flipped = whole[:middle] + bytes([whole[middle] ^ 255]) + whole[middle + 1 :]
    for damaged in (whole[:middle], flipped, b"hello", b""):
        path.write_bytes(damaged)
        assert "damaged" in refusal(run)


def test_no_changed_byte_changes_what_is_read(made, tmp_path):
    file, copy = made / "state_000002.npz", tmp_path / "state_000002.npz"
    content, whole = checksummed.read(file, ""), file.read_bytes()
    for i in range(0, len(whole), 53):
        copy.write_bytes(whole[:i] + bytes([whole[i] ^ 16]) + whole[i + 1 :])
        try:
            text, arrays, run = checksummed.read(copy, content.run)
        except ValueError:
            continue
        assert (text, run) == (content.text, content.run)
        assert [*arrays] == [*content.arrays]
        for name, array in arrays.items():
            assert array.tobytes() == content.arrays[name].tobytes()


@pytest.mark.parametrize("file", ["run.npz", "state_000001.npz"])
def test_a_missing_file_is_reported(run, file):
    (run / file).unlink()
    assert "missing" in refusal(run)


@pytest.mark.parametrize("other", [1, 2])
def test_a_file_of_a_repeated_or_another_run_is_rejected(folders, tmp_path, other):
    for i, file in enumerate(sorted(folders[0].iterdir())):
        folder = shutil.copytree(folders[0], tmp_path / f"{i}")
        shutil.copy(folders[other] / file.name, folder / file.name)
        assert "belongs to another run" in refusal(folder)


def test_a_renamed_file_is_reported(run):
    shutil.copy(run / "state_000001.npz", run / "state_000002.npz")
    assert "state_000002.npz was renamed from state_000001.npz" in refusal(run)


def test_a_checkpoint_of_an_earlier_version_is_refused(run):
    """Its last lines contain run and name, which the text does not."""
    for file in run.iterdir():
        of_run, name, text, arrays = read_npz(file)
        np.savez(file, text=np.array(json.dumps(text)), **arrays)
        with open(file, "ab") as end:
            end.write(f"\n{of_run} {name} {'0' * 64}".encode())
    assert "run.npz was written by an earlier version" in refusal(run)


@pytest.mark.parametrize(
    ("path", "values"),
    [
        (("load_factor",), [0.0, 0.9, 1.1, NAN, "1"]),
        (("progress", "continuation", "next"), [0.0, -0.1, NAN, np.inf, None]),
        (("progress", "continuation", "cut"), [-1, None]),
        (("progress", "elapsed"), [NAN, None]),
        (("progress", "continuation", "longest"), [0.1, None]),
        (("progress", "continuation", "claims"), [3]),
        (("progress", "continuation", "unresolved"), ["x", ["x"], [NAN]]),
        (("progress", "continuation", "to_compare"), [[1], [[0.7, 1, [NAN], 0, 0]]]),
        (("progress", "clock", "solves"), [0, 1.5, None]),
        (("linear_solves",), [0, 99]),
        (("energies", "tension"), [slightly_more, None, "x"]),
        (("energies",), [{}, []]),
        (("reactions", "pull", 0), [slightly_more, None]),
        (("displacements", "pull", 0), [slightly_more]),
        (("displacements", "clamp"), [0.0, [0.0], [[0.0, 0.0]]]),
        (("verdict", "work"), [slightly_more]),
        (("verdict", "min_det_F"), [slightly_more, "x"]),
        (("verdict", "max_fibre_strain"), [slightly_more]),
        (("verdict",), [None, {}]),
    ],
)
def test_an_inconsistent_last_state_is_rejected(made, tmp_path, path, values):
    """The checksum is valid."""
    for i, value in enumerate(values):
        folder = shutil.copytree(made, tmp_path / f"{i}")
        forge(folder, -1, with_value(path, value))
        assert refusal(folder), value


ARRAYS = [
    *(
        (-1, name, change)
        for name in ("u", "stabilisation C_s")
        for change in (lambda x: x[:-1], lambda x: x + np.nan, lambda x: x + 1)
    ),
    (1, "stabilisation C_s", lambda x: x.astype(complex)),
]


def test_arrays_of_another_ply_or_kind_are_rejected(made, tmp_path):
    for i, (number, name, change) in enumerate(ARRAYS):
        folder = shutil.copytree(made, tmp_path / f"{i}")
        forge(folder, number, lambda _, a, n=name, f=change: a.update({n: f(a[n])}))
        assert refusal(folder), i


def test_rewriting_a_file_has_no_effect(run):
    forge(run, 1, lambda text, arrays: None)
    assert stepper(run).run(resume=True).converged


@pytest.mark.parametrize(
    ("number", "value"), [(1, lambda x: x + 1), (3, lambda x: (1 + 3e-8) * x)]
)
def test_a_state_inconsistent_with_its_displacement_is_rejected(run, number, value):
    forge(run, number, with_value(("reactions", "pull", 0), value))
    line = refusal(run)
    assert f"state_{number - 1:06d}.npz" in line
    assert "its reactions do not match its displacement" in line


def test_files_of_another_format_are_rejected_in_one_line(run):
    """In format 7 forces of shared nodes count for each of their conditions."""
    forge(run, 1, with_value(("work",), {"stabilisation": 0.0}))
    forge(run, 0, with_value(("format",), 7))
    assert refusal(run) == (
        f"checkpoint {run} belongs to another run: format was 7 and is now 11; use the "
        "arguments of that run, or another folder"
    )


@pytest.mark.parametrize("message", ["two\nlines \x1b[31m", "long " * 2000, 10**400])
def test_quoted_content_of_a_file_is_one_short_line(run, message):
    forge(run, 0, with_value(("method",), message))
    assert "method was" in refusal(run)


@pytest.mark.parametrize("name", ["run.npz", "state_000001.npz"])
@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="no pipes on this system")
def test_a_path_that_is_not_a_file_is_rejected_without_waiting(run, name):
    (run / name).unlink()
    os.mkfifo(run / name)
    assert f"{name} is not a file" in refusal(run)
    (run / name).unlink()
    (run / name).symlink_to("/dev/zero")
    assert f"{name} is not a file" in refusal(run)


def test_times_of_other_parts_are_rejected(run):
    forge(run, -1, lambda text, _: text["progress"]["clock"]["seconds"].pop("solve"))
    assert "its times are incomplete" in refusal(run)


ROOT = Path(__file__).parents[2]
HOLDS = """
import sys, time
from pathlib import Path
from skfem_textile.solve.checksummed import Lock
locks = [Lock(Path(name)) for name in sys.argv[1:]]
print("held", flush=True)
time.sleep(60)
"""
FORKS = """
import os, sys, time
from pathlib import Path
from skfem_textile.solve.checksummed import Lock
lock, (came, goes) = Lock(Path(sys.argv[1])), os.pipe()
child = os.fork()
if not child:
    os.write(goes, b".")
    time.sleep(60)
os.read(came, 1)
lock.release()
Lock(Path(sys.argv[1]))
os.kill(child, 9)
"""


def started(script, *paths):
    environment = os.environ | {"PYTHONPATH": str(ROOT)}
    command = [sys.executable, "-c", script, *map(str, paths)]
    return subprocess.Popen(
        command, env=environment, stdout=subprocess.PIPE, stderr=subprocess.PIPE
    )


def test_a_killed_process_leaves_no_lock(tmp_path):
    file = tmp_path / "file"
    file.touch()
    with started(HOLDS, tmp_path, file) as process:
        assert process.stdout.readline() == b"held\n"
        for path in (tmp_path, file):
            with pytest.raises(BlockingIOError, match="another run is writing to"):
                Lock(path)
        process.send_signal(signal.SIGKILL)
    for path in (tmp_path, file):
        Lock(path).release()


def test_a_forked_process_does_not_keep_the_lock_of_its_parent(tmp_path):
    with started(FORKS, tmp_path) as process:
        _, stderr = process.communicate(timeout=60)
    assert (process.returncode, stderr) == (0, b"")


def test_a_lock_interrupted_during_its_creation_is_released():
    Lock.__new__(Lock).release()
