"""Runs that are killed, and disks that are full or read-only, lose no results."""

import gc
import json
import os
import signal
import sys
import tempfile
import traceback
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager, suppress
from functools import cache, partial
from pathlib import Path
from time import perf_counter, sleep
from typing import NamedTuple
from xml.etree import ElementTree

import pytest
from hypothesis import strategies as st

from skfem_textile import (
    CheckpointError,
    Fabric,
    LoadStepper,
    Macro,
    Ply,
    StepError,
)
from skfem_textile.cli import main as cli
from skfem_textile.cli.interruption import INTERRUPTED
from skfem_textile.cli.output import OutputError
from skfem_textile.cli.result_folder import ResultFolder
from skfem_textile.io import (
    DRAPED,
    FIELDS,
    write_draped,
    write_fields,
    write_history,
    write_summary,
)
from skfem_textile.scenes import strip
from skfem_textile.sweep import sweep
from tests.helpers.command_line import QUICK
from tests.helpers.hostile import (
    RIGHT,
    Family,
    end_with_parent,
    expect,
    expect_close,
    expect_equal,
    folder_content,
    is_clear,
)
from tests.helpers.hostile.small_disk import (
    BLOCK,
    fill,
    make_read_only,
    on_small_disk,
)

# Steps of the run, and of a complete run that may precede it.
STEPS, EARLIER_STEPS = 4, 3

# Relative tolerance of results of resumed runs.
TOLERANCE = 1e-9

# Exit code of a child that has raised an error.
RAISED = 70

# Cases of a sweep and of an earlier one; numbers in a result, a block or two.
CASES, EARLIER_CASES, NUMBERS = 20, 5, 1000

# Files of a result.
FIELD_FILES = tuple(f"fields/{name}" for name in FIELDS)
NAMES = ("summary.json", "history.csv", *DRAPED, *FIELD_FILES)

# A small run of the command line in a forked child


class Ended(NamedTuple):
    """Exit code of a child, negative for a signal, and its lines on stderr."""

    code: int
    lines: list[str]

    @property
    def is_of_earlier_run(self):
        """True if the run was rejected because its checkpoint is of the earlier run."""
        reason = f"steps was {EARLIER_STEPS} and is now {STEPS}"
        return self.code == 2 and reason in "".join(self.lines)


def command_of(out, steps=STEPS, *more):
    """The command line of a run with a checkpoint in its folder."""
    words = *QUICK, "--steps", str(steps), "--checkpoint", *more, "--out", str(out)
    return ["run", "strip", *words]


def run(command, after=0.0, disturb=None):
    """Runs a command line, and disturbs it, by process number, after some seconds."""
    with tempfile.TemporaryFile("w+") as stderr:
        parent = os.getpid()
        if not (child := os.fork()):
            exec_command(command, stderr.fileno(), parent)
        if disturb:
            sleep(after)
            disturb(child)
        _, status = os.waitpid(child, 0)
        stderr.seek(0)
        lines = stderr.read().splitlines()
        none = "there is no state to resume"
        lines = [line for line in lines if not line.startswith(none)]
        return Ended(os.waitstatus_to_exitcode(status), lines)


def exec_command(command, stderr, parent):
    """Run the command line in this process, and exit."""
    code = RAISED
    gc.callbacks.clear()  # Hypothesis has one, which may suppress an interruption
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


def run_successfully(command):
    """Run a command line that must succeed."""
    ended = run(command)
    expect(not ended.code, ended)


@cache
def undisturbed():
    """Duration of a run in seconds, and summaries by number of steps."""
    summaries, seconds = {}, 0.0
    with tempfile.TemporaryDirectory(prefix="hostile-") as folder:
        for steps in (EARLIER_STEPS, STEPS):
            out, began = Path(folder, str(steps)), perf_counter()
            run_successfully(command_of(out, steps))
            seconds = perf_counter() - began
            summaries[steps] = read_result(out)
    return seconds, summaries


# Required files


def read_result(out):
    """Read the summary in a folder, and check that it agrees with the other files."""
    summary = json.loads((out / "summary.json").read_text())
    states = summary["load_steps"] + 1
    rows = (out / "history.csv").read_text().count("\n") - 1
    files = sorted((out / "fields").glob("step_*.vtu"))
    series = ElementTree.parse(out / "fields" / "steps.pvd").iter("DataSet")
    listed = sorted(out / "fields" / entry.attrib["file"] for entry in series)
    expect_equal("rows, files", (rows, len(files), listed), (states, states, files))
    for file in files:
        ElementTree.parse(file)
    return summary


def check_kept(out, had_result):
    """Check that an earlier result, or the new one in its place, is complete."""
    if (out / "summary.json").exists():
        read_result(out)
    else:
        unfinished = list(out.glob(".unfinished-*/summary.json"))
        expect(unfinished or not had_result, "the earlier result is lost")


def check_energy(energy, steps):
    expected = undisturbed()[1][steps]["energy"]
    expect_close("energy", energy, expected, TOLERANCE * abs(expected))


def check_no_remains(folder):
    """Check that no hidden file of an unfinished run is left."""
    expect_equal("remains", list(folder.rglob(".*")), [])


def check_end(out, steps=STEPS):
    """Compare the result in a folder with the result of an undisturbed run."""
    summary, expected = read_result(out), undisturbed()[1][steps]
    for key in ("load_steps", "load_factor"):
        expect_equal(key, summary[key], expected[key])
    for key in ("energy", "reaction_x", "reaction_y"):
        expect_close(key, summary[key], expected[key], TOLERANCE * abs(expected[key]))
    check_no_remains(out)


def check_recovery(out):
    """Resume the run in a folder, run it once more, and check both ends."""
    steps, ended = STEPS, run(command_of(out, STEPS, "--resume"))
    if ended.is_of_earlier_run:
        steps = EARLIER_STEPS
        ended = run(command_of(out, steps, "--resume"))
    expect(not ended.code, f"it cannot be resumed: {ended}")
    check_end(out, steps)
    run_successfully(command_of(out))
    check_end(out)


def check_line(line, path, remains=None):
    """Check for one clear line that names a path, and the remains there, if any."""
    expect(is_clear(line) and str(path) in line, f"{path} is not named: {line}")
    holds = remains and (remains.is_file() or list(remains.glob("state_*.npz")))
    is_stated = "remains" in line or "kept" in line
    expect(not holds or is_stated, f"{remains} remains: {line}")


def visible_files(folder):
    """Bytes of files by name, without hidden ones, which are not yet complete."""
    return {
        name: content
        for name, content in folder_content(folder).items()
        if "/." not in f"/{name}" and (folder / name).is_file()
    }


# Signals at random times


def attempt_kills(hostile):
    """Kill a run, and the runs that resume it; then let it finish."""
    number, is_second, moments = hostile
    out = Path("out").absolute()
    if is_second:
        run_successfully(command_of(out, EARLIER_STEPS))
    command = command_of(out)
    for moment in moments:
        had_result = (out / "summary.json").exists()
        late = moment * undisturbed()[0]
        ended = run(command, late, lambda child: os.kill(child, number))
        if not ended.is_of_earlier_run:
            # Before the library is ready, or after its end, there is no message.
            outside = INTERRUPTED if number == signal.SIGINT else -number
            clear = [x.startswith("skfem-textile: interrupted") for x in ended.lines]
            expect(clear in ([], [True]), ended)
            expect(ended.code in ({INTERRUPTED} if clear else {0, outside}), ended)
        check_kept(out, had_result)
        command = command_of(out, STEPS, "--resume")
    check_recovery(out)
    return RIGHT


# Disks, and writers to them


class Disk(NamedTuple):
    """A disk that becomes full or read-only.

    ``spoilt`` is a context manager that makes it so: from the start, or when the
    function that the context yields is called, due after a fraction of a run.  The disk
    may contain an earlier result.
    """

    path: Path
    spoilt: partial
    after: float
    is_second: bool


def by_command(disk):
    """Run the command line with a checkpoint."""
    out = disk.path / "out"
    if disk.is_second:
        run_successfully(command_of(out, EARLIER_STEPS))
    before = visible_files(out)
    with disk.spoilt() as spoil:
        after = disk.after * undisturbed()[0]
        ended = run(command_of(out), after, lambda child: spoil())
        check_kept(out, disk.is_second)
        if ended.code == 0:
            expect_equal("lines", ended.lines, [])
            read_result(out)
        else:
            expect(ended.code in (1, 2) and len(ended.lines) == 1, ended)
            is_begun = ended.code == 1
            check_line(ended.lines[0], out, out / "checkpoint" if is_begun else None)
            expect(is_begun or visible_files(out) == before, f"changed: {ended}")
    check_recovery(out)


def by_stepper(disk):
    """Run a load stepper with a checkpoint; the caller receives its result."""
    folder = disk.path / "checkpoint"
    if disk.is_second:
        stepper(folder, EARLIER_STEPS).run()
    with disk.spoilt() as spoil:
        due = round(disk.after * STEPS)

        def spoil_in_time(state):
            if len(load_stepper.states) > due:
                spoil()

        load_stepper = stepper(folder, STEPS)
        load_stepper.on_step = spoil_in_time
        try:
            load_stepper.run()
        except (StepError, CheckpointError) as error:
            check_line(str(error), folder, folder)
            if isinstance(error, StepError):
                n = len(error.result.states)
                expect(1 <= n == len(load_stepper.result.states), "another result")
    steps = STEPS
    try:
        result = stepper(folder, steps).run(resume=True)
    except CheckpointError as error:
        if f"steps was {EARLIER_STEPS}" not in str(error):
            raise
        steps = EARLIER_STEPS
        result = stepper(folder, steps).run(resume=True)
    check_energy(sum(result.states[-1].energies.values()), steps)
    check_no_remains(folder)


def by_results(disk):
    """Write results to a folder, all at once, and one by one."""
    out, result = disk.path / "out", stepper(None, STEPS).run()

    def write(spoil=lambda: None):
        with ResultFolder(out, NAMES) as folder:
            spoil()
            write_summary(result.summary(), folder / "summary.json")
            write_history(result, folder / "history.csv")
            write_fields(result, folder / "fields")
            write_draped(result, folder)

    if disk.is_second:
        write()
    before = visible_files(out)
    with disk.spoilt() as spoil:
        try:
            write(spoil)
        except OSError as error:
            check_line(str(error), out)
            expect(not disk.is_second or visible_files(out) == before, "it has changed")
        else:
            read_result(out)
        try:
            write_fields(result, disk.path / "alone")
            write_history(result, disk.path / "alone.csv")
        except OSError as error:
            check_line(str(error), disk.path / "alone")
    write()
    read_result(out)
    check_no_remains(out)


def by_sweep(disk):
    """Write the results of a sweep, and resume it."""
    out, returned, called = disk.path / "sweep.jsonl", set(), []

    def function(case):
        called.append(case)
        return [case] * NUMBERS

    def go(cases, spoil=lambda: None):
        due = round(disk.after * cases)
        with ThreadPoolExecutor(1) as executor:
            for case, result in sweep(function, range(cases), executor, out=out):
                expect_equal(f"case {case}", result, [case] * NUMBERS)
                returned.add(case)
                if len(returned) > due:
                    spoil()

    if disk.is_second:
        go(EARLIER_CASES)
    with disk.spoilt() as spoil:
        try:
            go(CASES, spoil)
        except OSError as error:
            check_line(str(error), out, out if isinstance(error, OutputError) else None)
    before, called[:] = set(returned), []
    go(CASES)
    expect_equal("cases", returned, set(range(CASES)))
    expect_equal("cases that ran again", before & set(called), set())


def stepper(folder, steps):
    """The ply of `QUICK`."""
    scene = strip(size=(2, 3))
    ply = Ply(scene.mesh, Fabric(1e4, 1.0), Macro(10.0))
    return LoadStepper(ply, scene.conditions, steps, checkpoint=folder)


@contextmanager
def full(disk, blocks):
    """A number of blocks is free; a run needs a few more."""
    ballast = fill(disk, BLOCK * blocks)
    yield lambda: None
    ballast.unlink()


@contextmanager
def read_only(disk, after):
    """Read-only from the start, or as soon as no file is open when it is due."""

    def make_soon():
        while True:
            with suppress(OSError):
                return make_read_only(disk)
            sleep(1e-4)

    if not after:
        make_read_only(disk)
    yield make_soon
    make_read_only(disk, read_only=False)


def attempt_disk(hostile):
    spoils, write, is_second, how = hostile
    undisturbed()  # measured here once, and not by every child
    after = how if spoils is read_only else 0.0

    def act(path):
        write(Disk(path, partial(spoils, path, how), after, is_second))

    return on_small_disk(act)


def disks(spoils, how):
    """Every writer, without and over an earlier result."""
    return {
        f"{write.__name__} {is_second}": st.tuples(
            *(st.just(spoils), st.just(write), st.just(is_second), how)
        )
        for is_second in (False, True)
        for write in (by_command, by_stepper, by_results, by_sweep)
    }


# Moments in durations of a run; Hypothesis prefers extreme floats.
MOMENT = st.integers(0, 1100).map(lambda n: n / 1000)
MOMENTS = st.lists(MOMENT, min_size=1, max_size=3)

FAMILIES = (
    Family(
        "kills",
        {
            number.name: st.tuples(st.just(number), st.booleans(), MOMENTS)
            for number in (signal.SIGKILL, signal.SIGTERM, signal.SIGINT)
        },
        attempt_kills,
        trials=100,
        short=3,
    ),
    Family("full disk", disks(full, st.integers(0, 30)), attempt_disk, 30, short=2),
    Family(
        "read-only",
        disks(read_only, st.just(0.0) | MOMENT.map(lambda x: min(x, 1.0))),
        attempt_disk,
        trials=30,
        short=2,
    ),
)


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="it forks, and mounts disks")
@pytest.mark.parametrize("family", FAMILIES, ids=lambda family: family.name)
def test_no_saved_result_is_lost(family):
    family.check(3)
