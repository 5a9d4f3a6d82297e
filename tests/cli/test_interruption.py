"""Ctrl-C, SIGTERM, full disks and closed pipes: one line, and nothing is lost."""

import contextlib
import errno
import json
import os
import random
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import pytest
from command_line import DRAWN, QUICK

from skfem_textile import Condition, Fabric, LoadStepper, OnePoint, Ply, StepError
from skfem_textile.cli import main as cli
from skfem_textile.cli.interruption import INTERRUPTED, held, raised
from skfem_textile.cli.output import OutputError
from skfem_textile.cli.results.result_folder import ResultFolder
from skfem_textile.io import write_fields, write_history
from skfem_textile.scenes import strip
from skfem_textile.solve.stepper.run import Run
from skfem_textile.solve.sweep import WorkerProcesses

ROOT = Path(__file__).parents[2]
COMMAND = sys.executable, "-X", "importtime", "-m", "skfem_textile", "run", "strip"

pytestmark = pytest.mark.skipif(os.name != "posix", reason="signals are POSIX's")


def interrupted(out, number, seconds, *options):
    """Exit code and stderr of a run that gets a signal, counted from first imports."""
    child = subprocess.Popen(
        [*COMMAND, *QUICK, *options, "--out", str(out)],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
        env={**os.environ, "PYTHONPATH": str(ROOT)},
    )
    with child:
        lines = iter(child.stderr.readline, "")
        next(line for line in lines if "skfem_textile.cli.interruption" in line)
        late = threading.Timer(seconds, child.send_signal, [number])
        late.start()
        said = [line for line in lines if not line.startswith("import time:")]
    late.cancel()
    return child.returncode, "".join(said)


def is_whole(out):
    """Whether the files of which a summary speaks are there, if it is."""
    if not (out / "summary.json").exists():
        return True
    steps = json.loads((out / "summary.json").read_text())["load_steps"]
    rows = (out / "history.csv").read_text().count("\n") - 1
    files = list((out / "fields").glob("step_*.vtu"))
    return rows == len(files) == steps + 1


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
@pytest.mark.parametrize(
    "seconds",
    [0.0, 0.3, 1.0, *(pytest.param(s, marks=pytest.mark.long) for s in (0.1, 0.6))],
)
def test_a_signal_at_any_moment_gives_one_line_and_130(tmp_path, number, seconds):
    """From the first import on; a run that was over when it came has ended well."""
    seconds *= random.Random(f"{number} {seconds}").uniform(0.8, 1.2)
    code, said = interrupted(tmp_path / "out", number, seconds)
    assert is_whole(tmp_path / "out")
    if code == 0:
        assert said == ""
        assert (tmp_path / "out" / "summary.json").exists()
    else:
        assert code == INTERRUPTED
        assert said.startswith("skfem-textile: interrupted")
        assert said.count("\n") == 1
    assert not list(tmp_path.glob("out/.unfinished-*"))


def test_a_signal_while_modules_are_imported_is_answered():
    code, said = interrupted("unused", signal.SIGTERM, 0.0)
    assert (code, said) == (INTERRUPTED, "skfem-textile: interrupted\n")


def test_who_imports_the_package_keeps_the_answers_to_signals():
    script = (
        "import signal; answers = lambda: "
        "[signal.getsignal(n) for n in (signal.SIGTERM, signal.SIGINT)];"
        "before = answers(); from skfem_textile.cli.main import main;"
        "assert before == answers(); main(['list']); assert before == answers()"
    )
    subprocess.run([sys.executable, "-c", script], check=True, capture_output=True)


def test_sigterm_is_ctrl_c_while_signals_are_raised():
    with pytest.raises(KeyboardInterrupt), raised():
        os.kill(os.getpid(), signal.SIGTERM)
    assert signal.getsignal(signal.SIGTERM) == signal.SIG_DFL


def test_a_signal_while_an_object_is_removed_is_not_lost():
    """Python prints and forgets what is raised there."""

    class Removed:
        def __del__(self):
            os.kill(os.getpid(), signal.SIGTERM)
            done.append(True)

    def remove():
        Removed()
        time.sleep(10)

    done = []
    with pytest.raises(KeyboardInterrupt), raised():
        remove()
    assert done == [True]


def hold(signals, steps):
    """Take a step after each signal, and one after what is held together."""
    with held():
        for number in signals:
            os.kill(os.getpid(), number)
            steps.append("held")
    steps.append("after")


@pytest.mark.parametrize(
    ("signals", "taken"),
    [
        ([], ["after"]),
        ([signal.SIGINT], ["held"]),
        ([signal.SIGINT, signal.SIGINT, signal.SIGINT], ["held"]),
    ],
)
def test_what_is_held_together_ends_before_the_first_signal_is_answered(signals, taken):
    steps = []
    with contextlib.suppress(KeyboardInterrupt):
        hold(signals, steps)
    assert steps == taken


def test_in_another_thread_signals_are_left_alone():
    def run():
        with raised(), held():
            done.append(True)

    done = []
    thread = threading.Thread(target=run)
    thread.start()
    thread.join()
    assert done == [True]


def test_a_signal_while_results_are_written_lets_them_be_written(
    tmp_path, capsys, monkeypatch
):
    move = ResultFolder._move

    def interrupted_move(folder):
        os.kill(os.getpid(), signal.SIGTERM)
        move(folder)

    monkeypatch.setattr(ResultFolder, "_move", interrupted_move)
    out = tmp_path / "out"
    assert cli.main(["run", "strip", *QUICK, "--out", str(out)]) == INTERRUPTED
    said = capsys.readouterr().err
    assert said == "skfem-textile: interrupted; the results are written\n"
    assert (out / "summary.json").exists()
    assert is_whole(out)


@pytest.mark.parametrize("options", [(), ("--tolerance", "0.5")])
def test_a_signal_while_the_error_is_estimated_loses_no_result(
    tmp_path, capsys, monkeypatch, options
):
    def interrupted_estimate(ply):
        os.kill(os.getpid(), signal.SIGTERM)
        time.sleep(10)

    monkeypatch.setattr(Ply, "finer", interrupted_estimate)
    out = tmp_path / "out"
    command = ["run", "strip", *QUICK, *options, "--out", str(out)]
    assert cli.main(command) == INTERRUPTED
    assert capsys.readouterr().err.startswith("skfem-textile: interrupted; the ")
    summary = json.loads((out / "summary.json").read_text())
    assert summary["error_estimate"] == "none: interrupted"
    assert summary["converged"]
    assert is_whole(out)


def test_an_interrupted_run_takes_no_time_for_an_estimate(tmp_path, monkeypatch):
    def interrupted_step(run, t):
        if t > 0.5:
            raise KeyboardInterrupt
        return advance(run, t)

    advance = Run._advance
    monkeypatch.setattr(Run, "_advance", interrupted_step)
    monkeypatch.setattr(Ply, "finer", lambda *_: pytest.fail("estimated"))
    out = tmp_path / "out"
    assert cli.main(["run", "strip", *QUICK, "--out", str(out)]) == INTERRUPTED
    summary = json.loads((out / "summary.json").read_text())
    assert summary["error_estimate"] == "none: interrupted"


def test_a_signal_while_a_picture_is_drawn_lets_that_one_end(
    tmp_path, capsys, monkeypatch
):
    """VTK may crash where it is interrupted."""
    plot = pytest.importorskip("skfem_textile.plot")
    drawn = []

    def draw(*_, **__):
        os.kill(os.getpid(), signal.SIGINT)
        drawn.append(True)

    for name in ("fibre_strain", "shear_angle", "fibre_directions", "animation"):
        monkeypatch.setattr(plot, name, draw)
    out = tmp_path / "out"
    assert cli.main(["run", "strip", *DRAWN, "--out", str(out)]) == INTERRUPTED
    assert drawn == [True]
    said = "skfem-textile: interrupted; the numbers are written, pictures are not\n"
    assert capsys.readouterr().err == said
    assert is_whole(out)


def test_worker_processes_never_hear_ctrl_c():
    """A worker that did would print a traceback of its imports."""
    with WorkerProcesses(1) as executor:
        blocked = executor.submit(signal.pthread_sigmask, signal.SIG_BLOCK, []).result()
    assert signal.SIGINT in blocked
    assert signal.SIGINT not in signal.pthread_sigmask(signal.SIG_BLOCK, [])


@pytest.mark.parametrize("change", ["unlink", "replace", "mkdir"])
def test_a_summary_never_speaks_of_files_that_are_not_there(
    tmp_path, monkeypatch, change
):
    """Looked at before every change of the folder, a shorter run after a longer one."""
    out = tmp_path / "out"
    plain, seen = getattr(Path, change), []

    def watched(path, *arguments, **options):
        if out in path.parents:
            seen.append(is_whole(out))
        return plain(path, *arguments, **options)

    options = ("run", "strip", *QUICK, "--out", str(out))
    assert cli.main(options) == 0
    monkeypatch.setattr(Path, change, watched)
    assert cli.main([*options, "--steps", "2"]) == 0
    assert seen
    assert all(seen)
    assert is_whole(out)


def full(*_, **__):
    raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))


@pytest.mark.parametrize(
    ("options", "told"),
    [
        ((), "nothing is kept, as --checkpoint was not given"),
        (("--checkpoint",), "/checkpoint remains, and --resume goes on from there"),
    ],
)
def test_a_full_disk_is_named_and_what_is_left(
    tmp_path, capsys, monkeypatch, options, told
):
    out = tmp_path / "out"
    command = ["run", "strip", *QUICK, "--out", str(out)]
    assert cli.main(command) == 0
    before = (out / "summary.json").read_text()
    capsys.readouterr()
    with monkeypatch.context() as patch:
        patch.setattr("meshio.Mesh.write", full)
        assert cli.main([*command, *options]) == 1
    printed, said = capsys.readouterr()
    assert printed == ""
    assert said.startswith(
        f"skfem-textile: error: cannot write results to {out}: No space left on device;"
    )
    assert said.endswith(told + "\n")
    assert said.count("\n") == 1
    assert (out / "summary.json").read_text() == before
    assert is_whole(out)
    assert not list(out.glob(".unfinished-*"))
    if options:
        assert cli.main([*command, "--resume"]) == 0


@pytest.mark.parametrize("write", [write_fields, write_history])
def test_who_writes_one_thing_to_a_full_disk_is_told_where(
    tmp_path, monkeypatch, write
):
    scene = strip(size=(3, 4))
    ply = Ply(scene.mesh, Fabric(), OnePoint(10.0))
    result = LoadStepper(ply, scene.conditions, 1).run()
    monkeypatch.setattr("meshio.Mesh.write", full)
    monkeypatch.setattr("csv.DictWriter.writeheader", full)
    with pytest.raises(OSError, match=r"No space left on device: '.*/out'"):
        write(result, tmp_path / "out")


def test_a_disk_that_fills_while_files_are_moved_in_is_named(tmp_path, monkeypatch):
    monkeypatch.setattr(Path, "replace", full)
    message = r"cannot write results to .*/out: No space left on device"
    with (
        pytest.raises(OutputError, match=message),
        ResultFolder(tmp_path / "out", ["a"]) as folder,
    ):
        (folder / "a").write_text("a")
    assert not (tmp_path / "out").exists()


def test_a_full_disk_leaves_the_result_of_a_run_to_its_caller(tmp_path, monkeypatch):
    scene = strip(size=(3, 4))
    ply = Ply(scene.mesh, Fabric(), OnePoint(10.0))
    conditions: dict[str, Condition] = scene.conditions
    stepper = LoadStepper(ply, conditions, 3, checkpoint=tmp_path / "c")
    stepper.on_step = lambda state: monkeypatch.setattr("os.fsync", full)
    with pytest.raises(StepError, match=r"cannot write checkpoint .*/c: No space left"):
        stepper.run()
    assert [s.load_factor for s in stepper.result.states] == pytest.approx([0, 1 / 3])
    monkeypatch.undo()
    again = LoadStepper(ply, conditions, 3, checkpoint=tmp_path / "c")
    assert again.run(resume=True).converged


def test_the_next_run_removes_what_a_killed_one_left_unfinished(tmp_path):
    left, own = tmp_path / ".unfinished-left", tmp_path / "own"
    for path in (left / "fields", own):
        path.mkdir(parents=True)
        (path / "file").write_text("half a fi")
    with ResultFolder(tmp_path, ["a"]) as folder:
        (folder / "a").write_text("a")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a", "own"]


def test_what_a_living_run_has_not_finished_is_left_to_it(tmp_path):
    with ResultFolder(tmp_path, ["a"]) as folder:
        (folder / "a").write_text("a")
        with pytest.raises(BlockingIOError, match="another run is writing to"):
            ResultFolder(tmp_path, ["a"])
    assert (tmp_path / "a").read_text() == "a"


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="no /dev/full here")
@pytest.mark.parametrize(
    "arguments",
    [pytest.param(("list",), marks=pytest.mark.long), ("--help",), ("run", "strip")],
)
def test_what_cannot_be_printed_is_told_in_one_line(tmp_path, arguments):
    if arguments[0] == "run":
        arguments += (*QUICK, "--out", str(tmp_path / "out"))
    with open("/dev/full", "w") as stdout:
        child = subprocess.run(
            [sys.executable, "-m", "skfem_textile", *arguments],
            stdout=stdout,
            stderr=subprocess.PIPE,
            text=True,
            check=False,
            env={**os.environ, "PYTHONPATH": str(ROOT)},
        )
    assert child.returncode == 1
    message = "skfem-textile: error: cannot print: No space left on device\n"
    assert child.stderr == message
    if arguments[0] == "run":
        assert (tmp_path / "out" / "summary.json").exists()


def test_a_message_is_one_line_without_control_characters(tmp_path, capsys):
    command = ["run", "strip", "--mesh", "a\nb\x1b[31m", "--out", str(tmp_path / "o")]
    assert cli.main(command) == 2
    said = capsys.readouterr().err
    assert r"--mesh a\nb\x1b[31m: neither a file nor" in said
    assert said.count("\n") == 1
