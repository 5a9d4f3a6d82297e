"""What writes to a full or read-only disk: command line, stepper, results, sweeps."""

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from contextlib import AbstractContextManager
from pathlib import Path
from typing import NamedTuple

from skfem_textile import (
    CheckpointError,
    Fabric,
    LoadStepper,
    Macro,
    Ply,
    Result,
    State,
    StepError,
)
from skfem_textile.cli.output import OutputError
from skfem_textile.cli.result_folder import ResultFolder
from skfem_textile.io import DRAPED, FIELDS, write_draped, write_fields, write_history
from skfem_textile.io import write_summary as write
from skfem_textile.scenes import strip
from skfem_textile.solve.sweep import sweep

from ..folders import visible_files
from ..trial import WrongAnswerError, is_clear
from .command_run import (
    EARLIER_STEPS,
    STEPS,
    check_kept,
    check_near,
    check_no_remains,
    check_recovery,
    read_result,
    run,
    run_earlier,
    undisturbed,
    words,
)

#: Cases of a sweep and of an earlier one; numbers in a result, a block or two.
_CASES, _EARLIER_CASES, _NUMBERS = 20, 5, 1000

#: Files of a result.
_FIELDS = tuple(f"fields/{name}" for name in FIELDS)
_NAMES = "summary.json", "history.csv", *DRAPED, *_FIELDS


class Disk(NamedTuple):
    """A disk that becomes full or read-only.

    Parameters
    ----------
    path
        Where it is mounted.
    spoilt
        A context in which it is full or read-only: from the start, or from when the
        function that the context gives is called.
    after
        When to call that function, as a share of a run.
    earlier
        Whether an earlier result is on the disk.
    """

    path: Path
    spoilt: Callable[[], AbstractContextManager[Callable[[], None]]]
    after: float
    earlier: bool


def command(disk: Disk) -> None:
    """Run the command line with a checkpoint."""
    out = disk.path / "out"
    if disk.earlier:
        run_earlier(out)
    before = visible_files(out)
    with disk.spoilt() as spoil:
        after = disk.after * undisturbed().seconds
        ended = run(words(out), after, lambda child: spoil())
        check_kept(out, disk.earlier)
        lines = ended.lines()
        if ended.code == 0 and not lines:
            read_result(out)
        elif ended.code == 1 and len(lines) == 1:
            _check_line(lines[0], out, out / "checkpoint")
        elif ended.code == 2 and len(lines) == 1:  # refused before it has begun
            _check_line(lines[0], out, None)
            if visible_files(out) != before:
                raise WrongAnswerError(f"refused, but something has changed: {ended}")
        else:
            raise WrongAnswerError(f"{ended}")
    check_recovery(out)


def stepper(disk: Disk) -> None:
    """Run a load stepper with a checkpoint; the caller keeps its result."""
    folder = disk.path / "checkpoint"
    if disk.earlier:
        _stepper(folder, EARLIER_STEPS).run()
    with disk.spoilt() as spoil:
        due = round(disk.after * STEPS)

        def spoil_in_time(state: State) -> None:
            if len(load_stepper.states) > due:
                spoil()

        load_stepper = _stepper(folder, STEPS)
        load_stepper.on_step = spoil_in_time
        try:
            load_stepper.run()
        except StepError as error:
            _check_line(str(error), folder, folder)
            if not (1 <= len(error.result.states) == len(load_stepper.result.states)):
                raise WrongAnswerError("the result is not the caller's") from None
        except CheckpointError as error:
            _check_line(str(error), folder, folder)
    _check_resumed(folder)


def _check_resumed(folder: Path) -> None:
    steps = STEPS
    try:
        result = _stepper(folder, steps).run(resume=True)
    except CheckpointError as error:
        if f"steps was {EARLIER_STEPS}" not in str(error):
            raise
        steps = EARLIER_STEPS
        result = _stepper(folder, steps).run(resume=True)
    energy = sum(result.states[-1].energies.values())
    check_near("energy", energy, undisturbed().summaries[steps]["energy"])
    check_no_remains(folder)


def results(disk: Disk) -> None:
    """Write results to a folder, all at once, and one by one."""
    out, result = disk.path / "out", _stepper(None, STEPS).run()
    if disk.earlier:
        _write(result, out)
        before = visible_files(out)
    with disk.spoilt() as spoil:
        try:
            _write(result, out, spoil)
        except OSError as error:
            _check_line(str(error), out, None)
            if disk.earlier and visible_files(out) != before:
                raise WrongAnswerError("the earlier result has changed") from None
        else:
            read_result(out)
        try:
            write_fields(result, disk.path / "alone")
            write_history(result, disk.path / "alone.csv")
        except OSError as error:
            _check_line(str(error), disk.path / "alone", None)
    _write(result, out)
    read_result(out)
    check_no_remains(out)


def _write(result: Result, out: Path, spoil: Callable[[], None] = lambda: None) -> None:
    with ResultFolder(out, _NAMES) as folder:
        spoil()
        write(result.summary(), folder / "summary.json")
        write_history(result, folder / "history.csv")
        write_fields(result, folder / "fields")
        write_draped(result, folder)


def sweep_file(disk: Disk) -> None:
    """Write the results of a sweep, and resume it."""
    out, returned, called = disk.path / "sweep.jsonl", set[int](), list[int]()

    def function(case: int) -> list[int]:
        called.append(case)
        return [case] * _NUMBERS

    def go(cases: int, spoil: Callable[[], None] = lambda: None) -> None:
        due = round(disk.after * cases)
        with ThreadPoolExecutor(1) as executor:
            for case, result in sweep(function, range(cases), executor, out=out):
                if result != [case] * _NUMBERS:
                    raise WrongAnswerError(f"result of case {case}: {result[:3]}")
                returned.add(case)
                if len(returned) > due:
                    spoil()

    if disk.earlier:
        go(_EARLIER_CASES)
    with disk.spoilt() as spoil:
        try:
            go(_CASES, spoil)
        except OutputError as error:
            _check_line(str(error), out, out)
        except OSError as error:
            _check_line(str(error), out, None)
    before, called[:] = set(returned), []
    go(_CASES)
    if len(returned) < _CASES or before & set(called):
        raise WrongAnswerError(f"returned {before}, run again {called}")


def _check_line(line: str, path: Path, kept: Path | None) -> None:
    """Check that one clear line names a path, and what remains there if any does."""
    if not is_clear(line) or str(path) not in line:
        raise WrongAnswerError(f"{path} is not named in one clear line: {line}")
    holds = kept and (kept.is_file() or list(kept.glob("state_*.npz")))
    if holds and "remains" not in line:
        raise WrongAnswerError(f"it does not say that {kept} remains: {line}")


def _stepper(folder: Path | None, steps: int) -> LoadStepper:
    scene = strip(size=(3, 4))
    ply = Ply(scene.mesh, Fabric(1e4, 1.0), Macro(10.0))
    return LoadStepper(ply, scene.conditions, steps, checkpoint=folder)


#: What may write to the disk, by name.
WRITERS = {
    "command": command,
    "stepper": stepper,
    "results": results,
    "sweep file": sweep_file,
}
