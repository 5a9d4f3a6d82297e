"""A small run of the command line in a forked child, and checks of what it leaves."""

import json
import os
import signal
import sys
import tempfile
import traceback
from collections.abc import Callable, Sequence
from functools import cache
from pathlib import Path
from time import perf_counter, sleep
from typing import Any, NamedTuple
from xml.etree import ElementTree

from skfem_textile.cli import main as cli
from skfem_textile.cli.interruption import INTERRUPTED

from ..trial import WrongAnswerError
from ..workers import end_with_parent

#: Steps of the run, and of a complete run that may precede it.
STEPS, EARLIER_STEPS = 4, 3

#: By how much results of resumed runs may differ, as a share.
_TOLERANCE = 1e-9

#: Start of a log message: there is no checkpoint.
_LOG = "nothing to resume"

# Exit code of a child that has raised an error.
_RAISED = 70

# Entries of the summary that are compared.
_COMPARED = "energy", "reaction_x", "reaction_y"


class Ended(NamedTuple):
    """Exit code of a child, negative for a signal, and what it wrote to stderr."""

    code: int
    stderr: str

    def lines(self) -> list[str]:
        """Lines of stderr, without a message that there is no checkpoint."""
        lines = self.stderr.splitlines()
        return [line for line in lines if not line.startswith(_LOG)]


def words(out: Path, steps: int = STEPS, *more: str) -> list[str]:
    """The command line of a run with a checkpoint in its folder."""
    size = "--size", "3x4", "--steps", str(steps), "--no-render"
    stiffness = "--cs", "10", "--shear-stiffness", "1"
    return ["run", "strip", *size, *stiffness, "--checkpoint", *more, "--out", str(out)]


def run(
    command: Sequence[str],
    after: float = 0.0,
    disturb: Callable[[int], None] | None = None,
) -> Ended:
    """Run a command line; disturb it, by its process number, after some seconds."""
    with tempfile.TemporaryFile("w+") as stderr:
        parent = os.getpid()
        if not (child := os.fork()):
            _become(command, stderr.fileno(), parent)
        if disturb:
            sleep(after)
            disturb(child)
        _, status = os.waitpid(child, 0)
        stderr.seek(0)
        return Ended(os.waitstatus_to_exitcode(status), stderr.read())


def run_earlier(out: Path) -> None:
    """Run with fewer steps, which leaves a complete earlier result."""
    if (ended := run(words(out, EARLIER_STEPS))).code:
        raise WrongAnswerError(f"the earlier run fails: {ended}")


def _become(command: Sequence[str], stderr: int, parent: int) -> None:
    """Run the command line in this process, and exit."""
    code = _RAISED
    try:
        end_with_parent(parent)
        os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
        os.dup2(stderr, 2)
        sys.stdout, sys.stderr = open(1, "w"), open(2, "w")  # noqa: SIM115
        code = cli.main(command)
    except KeyboardInterrupt:  # before it begins, or after its end
        code = INTERRUPTED
    except BaseException:
        print(traceback.format_exc(), file=sys.stderr, flush=True)
    finally:
        os._exit(code)


class Undisturbed(NamedTuple):
    """Duration of a run in seconds, and summaries by the number of steps."""

    seconds: float
    summaries: dict[int, dict[str, Any]]


@cache
def undisturbed() -> Undisturbed:
    """Make undisturbed runs, once in a process."""
    summaries, seconds = {}, 0.0
    with tempfile.TemporaryDirectory(prefix="hostile-") as folder:
        for steps in (EARLIER_STEPS, STEPS):
            out, began = Path(folder, str(steps)), perf_counter()
            ended = run(words(out, steps))
            seconds = perf_counter() - began
            if ended.code:
                raise WrongAnswerError(f"an undisturbed run: {ended}")
            summaries[steps] = read_result(out)
    return Undisturbed(seconds, summaries)


def read_result(out: Path) -> dict[str, Any]:
    """Read the summary in a folder, and check that it agrees with the other files."""
    summary = json.loads((out / "summary.json").read_text())
    states = summary["load_steps"] + 1
    rows = (out / "history.csv").read_text().count("\n") - 1
    files = sorted((out / "fields").glob("step_*.vtu"))
    series = ElementTree.parse(out / "fields" / "steps.pvd").iter("DataSet")
    listed = sorted(out / "fields" / entry.attrib["file"] for entry in series)
    if not rows == len(files) == states or listed != files:
        raise WrongAnswerError(
            f"{states} states, {rows} rows, {len(files)} files of fields"
        )
    for file in files:
        ElementTree.parse(file)
    return summary


def check_kept(out: Path, had_result: bool) -> None:
    """Check that an earlier result, or the new one in its place, is complete."""
    if (out / "summary.json").exists():
        read_result(out)
    elif had_result and not list(out.glob(".unfinished-*/summary.json")):
        raise WrongAnswerError("the earlier result is lost, and there is no new one")


def is_of_earlier_run(ended: Ended) -> bool:
    """Whether a run was refused because the checkpoint is of the earlier run."""
    return ended.code == 2 and f"steps was {EARLIER_STEPS}, is {STEPS}" in ended.stderr


def check_end(out: Path, steps: int = STEPS) -> None:
    """Compare the result in a folder with the result of an undisturbed run."""
    summary, expected = read_result(out), undisturbed().summaries[steps]
    for key in ("load_steps", "load_factor"):
        if summary[key] != expected[key]:
            raise WrongAnswerError(f"{key} is {summary[key]}, not {expected[key]}")
    for key in _COMPARED:
        check_near(key, summary[key], expected[key])
    check_no_remains(out)


def check_near(what: str, value: float, expected: float) -> None:
    """Compare a number of a resumed run with the number of an undisturbed run."""
    if abs(value - expected) > _TOLERANCE * abs(expected):
        raise WrongAnswerError(f"{what} is {value!r}, not {expected!r}")


def check_no_remains(folder: Path) -> None:
    """Check that no hidden file of an unfinished run is left."""
    if remains := [str(path) for path in folder.rglob(".*")]:
        raise WrongAnswerError(f"these remain: {remains}")


def check_recovery(out: Path) -> None:
    """Resume the run in a folder, run it once more, and check both ends."""
    steps, ended = STEPS, run(words(out, STEPS, "--resume"))
    if is_of_earlier_run(ended):
        steps = EARLIER_STEPS
        ended = run(words(out, steps, "--resume"))
    if ended.code:
        raise WrongAnswerError(f"it cannot be resumed: {ended}")
    check_end(out, steps)
    ended = run(words(out))
    if ended.code:
        raise WrongAnswerError(f"a later run fails: {ended}")
    check_end(out)


def check_interrupted(ended: Ended, number: signal.Signals) -> None:
    """Check exit code and messages of a run that got a signal, or ended before it."""
    lines = ended.lines()
    clear = len(lines) == 1 and lines[0].startswith("skfem-textile: interrupted")
    outside = {0, INTERRUPTED} if number == signal.SIGINT else {0, -number}
    if ended.code not in ({INTERRUPTED} if lines else outside) or clear != bool(lines):
        raise WrongAnswerError(f"after {number.name}: {ended}")
