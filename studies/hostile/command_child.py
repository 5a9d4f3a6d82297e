"""A small run of the command line in a forked child, disturbed at some moment."""

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

from skfem_textile import io as _loaded_before_the_fork  # noqa: F401
from skfem_textile.cli import main as cli
from skfem_textile.cli.interruption import INTERRUPTED

from .mechanics import WrongError
from .workers import end_with_parent

#: Steps of the run, and of a complete one that may have been there before it.
STEPS, EARLIER_STEPS = 4, 3

#: By how much results of runs that went on may differ, relative to their size.
SAME = 1e-9

#: What the log says of a run that has no checkpoint to go on from.
LOG = "nothing to resume"

# Exit code of a child that has raised an error.
_DIED = 70

_COMPARED = "energy", "reaction_x", "reaction_y"


class Ended(NamedTuple):
    """Exit code of a child, negative for a signal, and what it wrote to stderr."""

    code: int
    said: str


def words(out: Path, steps: int = STEPS, *more: str) -> list[str]:
    """The command line of a run with a checkpoint in its folder."""
    size = "--size", "3x4", "--steps", str(steps), "--cs", "10", "--no-render"
    return ["run", "strip", *size, "--checkpoint", *more, "--out", str(out)]


def run(
    command: Sequence[str],
    after: float = 0.0,
    disturb: Callable[[int], None] | None = None,
) -> Ended:
    """Run a command line; so many seconds later disturb it, given its process."""
    with tempfile.TemporaryFile("w+") as said:
        parent = os.getpid()
        if not (child := os.fork()):
            _become(command, said.fileno(), parent)
        if disturb:
            sleep(after)
            disturb(child)
        _, status = os.waitpid(child, 0)
        said.seek(0)
        return Ended(os.waitstatus_to_exitcode(status), said.read())


def _become(command: Sequence[str], said: int, parent: int) -> None:
    """Be the command line."""
    code = _DIED
    try:
        end_with_parent(parent)
        os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
        os.dup2(said, 2)
        sys.stdout, sys.stderr = open(1, "w"), open(2, "w")  # noqa: SIM115
        code = cli.main(command)
    except KeyboardInterrupt:  # before it begins, or after its end
        code = INTERRUPTED
    except BaseException:
        print(traceback.format_exc(), file=sys.stderr, flush=True)
    finally:
        os._exit(code)


class Undisturbed(NamedTuple):
    """What a run takes, in seconds, and its summary by the number of steps."""

    seconds: float
    summaries: dict[int, dict[str, Any]]


@cache
def undisturbed() -> Undisturbed:
    """Runs that nobody disturbs; once in a process."""
    summaries, seconds = {}, 0.0
    with tempfile.TemporaryDirectory(prefix="hostile-") as folder:
        for steps in (EARLIER_STEPS, STEPS):
            out, began = Path(folder, str(steps)), perf_counter()
            ended = run(words(out, steps))
            seconds = perf_counter() - began
            if ended.code:
                raise WrongError(f"an undisturbed run: {ended}")
            summaries[steps] = whole(out)
    return Undisturbed(seconds, summaries)


def whole(out: Path) -> dict[str, Any]:
    """The summary in a folder, whose files must be those of which it speaks."""
    summary = json.loads((out / "summary.json").read_text())
    states = summary["load_steps"] + 1
    rows = (out / "history.csv").read_text().count("\n") - 1
    files = sorted((out / "fields").glob("step_*.vtu"))
    series = ElementTree.parse(out / "fields" / "steps.pvd").iter("DataSet")
    listed = sorted(out / "fields" / one.attrib["file"] for one in series)
    if not rows == len(files) == states or listed != files:
        raise WrongError(f"{states} states, {rows} rows, {len(files)} files of fields")
    for file in files:
        ElementTree.parse(file)
    return summary


def check_kept(out: Path, was_there: bool) -> None:
    """A result that was there is whole, or the new one that was to take its place."""
    if (out / "summary.json").exists():
        whole(out)
    elif was_there and not list(out.glob(".unfinished-*/summary.json")):
        raise WrongError("the earlier result is lost, and no new one is there")


def is_of_earlier_run(ended: Ended) -> bool:
    """Whether a run was refused as the checkpoint is that of the earlier run."""
    return ended.code == 2 and f"steps was {EARLIER_STEPS}, is {STEPS}" in ended.said


def check_end(out: Path, steps: int = STEPS) -> None:
    """Compare the result in a folder with that of an undisturbed run."""
    found, expected = whole(out), undisturbed().summaries[steps]
    for key in ("load_steps", "load_factor"):
        if found[key] != expected[key]:
            raise WrongError(f"{key} is {found[key]}, not {expected[key]}")
    for key in _COMPARED:
        if abs(found[key] - expected[key]) > SAME * abs(expected[key]):
            raise WrongError(f"{key} is {found[key]!r}, not {expected[key]!r}")
    if left := [str(path) for path in out.rglob(".*")]:
        raise WrongError(f"debris stays: {left}")


def check_recovery(out: Path) -> None:
    """Resume the run in a folder, run it once more, and check both ends."""
    steps, ended = STEPS, run(words(out, STEPS, "--resume"))
    if is_of_earlier_run(ended):
        steps = EARLIER_STEPS
        ended = run(words(out, steps, "--resume"))
    if ended.code:
        raise WrongError(f"it cannot be resumed: {ended}")
    check_end(out, steps)
    ended = run(words(out))
    if ended.code:
        raise WrongError(f"a later run fails: {ended}")
    check_end(out)


def check_interrupted(ended: Ended, number: signal.Signals) -> None:
    """What a run says that got a signal, or was over before it."""
    lines = [line for line in ended.said.splitlines() if not line.startswith(LOG)]
    told = len(lines) == 1 and lines[0].startswith("skfem-textile: interrupted")
    outside = {0, INTERRUPTED} if number == signal.SIGINT else {0, -number}
    if ended.code not in ({INTERRUPTED} if lines else outside) or told != bool(lines):
        raise WrongError(f"after {number.name}: {ended}")
