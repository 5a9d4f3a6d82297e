"""Ctrl-C and SIGTERM end a run with one line and lose no results."""

import contextlib
import os
import random
import signal
import subprocess
import sys
import threading
import time

import pytest

from skfem_textile.cli import main as cli
from skfem_textile.cli.interruption import INTERRUPTED, held, raised
from skfem_textile.cli.result_folder import ResultFolder
from skfem_textile.solve import interval
from skfem_textile.solve.stepper import Run
from tests.helpers.command_line import DRAWN, OF_CHILD, QUICK, is_whole, summary_in

COMMAND = sys.executable, "-X", "importtime", "-m", "skfem_textile", "run", "strip"

pytestmark = pytest.mark.skipif(os.name != "posix", reason="signals are POSIX's")


@pytest.fixture(autouse=True)
def _receives_ctrl_c():
    """A background process of a shell ignores it, and so would its children."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


def interrupt_run(out, number, seconds, *options):
    """Exit code and stderr of a run with a signal, timed from the first imports."""
    child = subprocess.Popen(
        [*COMMAND, *QUICK, *options, "--out", str(out)],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
        env=OF_CHILD,
    )
    with child:
        lines = iter(child.stderr.readline, "")
        next(line for line in lines if "skfem_textile.cli.interruption" in line)
        late = threading.Timer(seconds, child.send_signal, [number])
        late.start()
        messages = [line for line in lines if not line.startswith("import time:")]
    late.cancel()
    return child.returncode, "".join(messages)


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
@pytest.mark.parametrize(
    "seconds",
    [0.0, *(pytest.param(s, marks=pytest.mark.slow) for s in (0.1, 0.3, 0.6, 1.0))],
)
def test_a_signal_at_any_moment_gives_one_line_and_130(tmp_path, number, seconds):
    """From the first import on; a run that had already finished ends normally."""
    seconds *= random.Random(f"{number} {seconds}").uniform(0.8, 1.2)
    code, lines = interrupt_run(tmp_path / "out", number, seconds)
    assert is_whole(tmp_path / "out")
    if code == 0:
        assert lines == ""
        assert (tmp_path / "out" / "summary.json").exists()
    else:
        assert code == INTERRUPTED
        assert lines.startswith("skfem-textile: interrupted")
        assert lines.count("\n") == 1
    assert not list(tmp_path.glob("out/.unfinished-*"))
    if not seconds and number == signal.SIGTERM:  # while modules are imported
        assert (code, lines) == (INTERRUPTED, "skfem-textile: interrupted\n")


def test_importing_the_package_changes_no_signal_handler():
    script = (
        "import signal; answers = lambda: "
        "[signal.getsignal(n) for n in (signal.SIGTERM, signal.SIGINT)];"
        "before = answers(); from skfem_textile.cli.main import main;"
        "assert before == answers(); main(['list']); assert before == answers()"
    )
    subprocess.run([sys.executable, "-c", script], check=True, capture_output=True)


def test_sigterm_acts_as_ctrl_c_while_signals_are_raised():
    with pytest.raises(KeyboardInterrupt), raised():
        os.kill(os.getpid(), signal.SIGTERM)
    assert signal.getsignal(signal.SIGTERM) == signal.SIG_DFL


def test_a_signal_during_finalisation_is_not_lost():
    """Python prints and ignores exceptions in finalisers."""

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


def test_a_signal_in_python_code_called_by_rslab_is_raised_after_it():
    """An exception there would end the process."""
    done = []

    def called_by_rslab():
        os.kill(os.getpid(), signal.SIGTERM)
        done.append(True)

    caller = {"__name__": "skfem_textile.solve.linear.rslab"}
    exec("def analyse(call):\n    call()", caller)

    def run():
        caller["analyse"](called_by_rslab)
        time.sleep(10)

    with pytest.raises(KeyboardInterrupt), raised():
        run()
    assert done == [True]


def run_held(signals, steps):
    """Take a step after each signal, and one after the protected block."""
    with held():
        for number in signals:
            os.kill(os.getpid(), number)
            steps.append("held")
    steps.append("after")


def test_a_signal_in_a_string_that_is_run_ends_the_command_as_any_other(tmp_path):
    (tmp_path / "interrupted.py").write_text(
        "from skfem_textile.cli import main\n"
        "main._dispatch = lambda _: exec('raise KeyboardInterrupt')\n"
        "raise SystemExit(main.main([]))\n"
    )
    options = {"capture_output": True, "text": True, "cwd": tmp_path, "env": OF_CHILD}
    child = subprocess.run([sys.executable, "-m", "interrupted"], **options)
    assert child.returncode == INTERRUPTED
    assert child.stderr == "skfem-textile: interrupted\n"


@pytest.mark.parametrize(
    ("signals", "order"),
    [
        ([], ["after"]),
        ([signal.SIGINT], ["held"]),
        ([signal.SIGINT, signal.SIGINT, signal.SIGINT], ["held"]),
    ],
)
def test_a_protected_block_ends_before_the_first_signal_is_handled(signals, order):
    steps = []
    with contextlib.suppress(KeyboardInterrupt):
        run_held(signals, steps)
    assert steps == order


def test_another_thread_changes_no_signal_handler():
    def run():
        with raised(), held():
            done.append(True)

    done = []
    thread = threading.Thread(target=run)
    thread.start()
    thread.join()
    assert done == [True]


def interrupted_run(out, *options):
    """Summary of a run that a signal interrupts, and whose results are whole."""
    assert cli.main(["run", "strip", *options, "--out", str(out)]) == INTERRUPTED
    assert is_whole(out)
    return summary_in(out)


def test_results_are_written_whole_despite_a_signal(tmp_path, capsys, monkeypatch):
    move = ResultFolder._move

    def interrupted_move(folder):
        os.kill(os.getpid(), signal.SIGTERM)
        move(folder)

    monkeypatch.setattr(ResultFolder, "_move", interrupted_move)
    assert interrupted_run(tmp_path / "out", *QUICK)
    message = "interrupted: the results computed so far are written"
    assert capsys.readouterr().err == f"skfem-textile: {message}\n"


@pytest.mark.parametrize(
    ("options", "written"),
    [
        ((), "the results computed so far are written"),
        (
            ("--tolerance", "0.5"),
            "the last converged state, at load factor 1, is written",
        ),
    ],
)
def test_a_signal_during_the_error_interval_loses_no_result(
    tmp_path, capsys, monkeypatch, options, written
):
    def interrupted(*_):
        os.kill(os.getpid(), signal.SIGTERM)
        time.sleep(10)

    monkeypatch.setattr(interval, "_interval", interrupted)
    summary = interrupted_run(tmp_path / "out", *QUICK, *options)
    stderr = capsys.readouterr().err
    assert stderr.startswith("skfem-textile: interrupted")
    assert stderr.endswith(f": {written}\n")
    assert summary["error_interval"] == "none: interrupted"
    assert summary["converged"]


def test_an_interrupted_run_skips_the_error_interval(tmp_path, monkeypatch):
    def interrupted_step(run, t):
        if t > 0.5:
            raise KeyboardInterrupt
        return advance(run, t)

    advance = Run._step
    monkeypatch.setattr(Run, "_step", interrupted_step)
    monkeypatch.setattr(interval, "_interval", lambda *_: pytest.fail("computed"))
    summary = interrupted_run(tmp_path / "out", *QUICK)
    assert summary["error_interval"] == "none: interrupted"


def test_a_picture_is_finished_despite_a_signal(tmp_path, capsys, monkeypatch):
    """VTK may crash if it is interrupted."""
    plot = pytest.importorskip("skfem_textile.plot")
    drawn = []

    def draw(*_, **__):
        os.kill(os.getpid(), signal.SIGINT)
        drawn.append(True)

    monkeypatch.setattr(plot, "fibre_strain", draw)
    assert interrupted_run(tmp_path / "out", *DRAWN)
    assert drawn == [True]
    message = "interrupted: the numerical results are written, the pictures are not"
    assert capsys.readouterr().err == f"skfem-textile: {message}\n"
