"""Progress of long computations on stderr."""

import io
from threading import Event, Thread, active_count
from types import SimpleNamespace

import pytest

from skfem_textile.cli.main import main
from skfem_textile.mesh import progress
from skfem_textile.mesh.progress import SWITCH, shown


class Terminal(io.StringIO):
    def isatty(self):
        return True


class Clock:
    """Clock of a computation of a given duration; waiting advances it."""

    def __init__(self, duration):
        self.now, self.duration = 0.0, duration

    def __call__(self):
        return self.now

    def wait(self, seconds):
        self.now += seconds
        return self.now > self.duration


@pytest.fixture(autouse=True)
def _switched_on(monkeypatch):
    monkeypatch.delenv(SWITCH)


@pytest.fixture
def terminal(monkeypatch):
    monkeypatch.setenv("TERM", "xterm")
    return standard_error(monkeypatch, Terminal())


def standard_error(monkeypatch, stream):
    """Replace stderr for the progress alone: pytest also replaces it for each test."""
    replaced = SimpleNamespace(stderr=stream, modules={})
    monkeypatch.setattr(progress, "sys", replaced)
    return stream


@pytest.fixture
def at_once(monkeypatch):
    for name in ("_DELAY", "_REFRESH", "_PRINTED"):
        monkeypatch.setattr(progress, name, 0.001)


def output(stream, duration, monkeypatch):
    """Output during a computation."""
    clock = Clock(duration)
    monkeypatch.setattr(progress, "perf_counter", clock)
    monkeypatch.setattr(progress, "_running", [lambda: "solving"])
    progress._show(stream, clock.wait)
    return stream.getvalue()


def is_erased(text):
    """True if the last line of a terminal is blank, with the cursor at its start."""
    *_, last, end = text.split("\r")
    return not last.strip() and not end


def test_nothing_is_shown_in_the_first_two_seconds(terminal, monkeypatch):
    assert output(terminal, 1.9, monkeypatch) == ""


def test_a_terminal_shows_one_line_that_is_erased_at_the_end(terminal, monkeypatch):
    text = output(terminal, 3.2, monkeypatch)
    lines = [line.rstrip() for line in text.split("\r") if line.strip()]
    assert lines == ["0:00:02 solving", "0:00:02 solving", "0:00:03 solving"]
    assert "\n" not in text
    assert is_erased(text)


def test_a_file_receives_lines_after_twice_the_time_each(monkeypatch):
    assert output(io.StringIO(), 9.9, monkeypatch) == ""
    lines = "0:00:10 solving\n0:00:20 solving\n0:00:40 solving\n"
    assert output(io.StringIO(), 75, monkeypatch) == lines


@pytest.mark.parametrize("error", [ValueError, KeyboardInterrupt])
def test_an_error_or_interruption_erases_the_line(terminal, at_once, error):
    drawn = Event()

    def work():
        drawn.set()
        return "solving"

    def fail():
        with shown(work):
            assert drawn.wait(60)
            raise error

    with pytest.raises(error):
        fail()
    assert "solving" in terminal.getvalue()
    assert is_erased(terminal.getvalue())
    assert not progress._running


def test_an_inner_computation_replaces_the_outer_one(terminal):
    with shown("outer"):
        with shown("inner"):
            assert progress._running[-1]() == "inner"
        assert progress._running[-1]() == "outer"


def test_other_output_follows_an_erased_line(terminal, monkeypatch):
    monkeypatch.setattr(progress, "_visible", (terminal, 5))
    progress.clear()
    progress.clear()
    assert terminal.getvalue() == "\r     \r"


@pytest.mark.parametrize(
    ("stream", "switch", "added"),
    [
        (Terminal(), "", 1),
        (Terminal(), "0", 0),
        (io.StringIO(), "", 0),
        (io.StringIO(), "1", 1),
        (None, "1", 0),
    ],
)
def test_a_thread_is_started_only_where_something_can_be_shown(
    terminal, monkeypatch, stream, switch, added
):
    monkeypatch.setenv(SWITCH, switch)
    standard_error(monkeypatch, stream)
    before = active_count()
    with shown("solving"):
        assert active_count() - before == added


def test_worker_threads_show_nothing(terminal):
    seen = []

    def work():
        with shown("worker"):
            seen.append(len(progress._running))

    with shown("main"):
        worker = Thread(target=work)
        worker.start()
        worker.join()
    assert seen == [1]


def test_standard_output_of_the_command_line_contains_no_progress(
    tmp_path, capsys, monkeypatch, at_once
):
    command = ["run", "strip", "--size", "2x3", "--steps", "2", "--no-render"]
    command += ["--shear-stiffness", "0.5", "--mesh-as-is", "--out"]

    def printed(switch):
        monkeypatch.setenv(SWITCH, switch)
        assert main([*command, str(tmp_path / "out")]) == 0
        out, err = capsys.readouterr()
        times = "wall_time", "_time_s", "Run time"
        return [x for x in out.splitlines() if not any(t in x for t in times)], err

    quiet, nothing = printed("0")
    assert nothing == ""
    with_progress, lines = printed("1")
    assert with_progress == quiet
    assert " analysing " in lines or " load factor " in lines
