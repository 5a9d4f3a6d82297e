"""Who writes to a disk that is spoilt: the command line, the stepper, and others."""

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from contextlib import AbstractContextManager
from pathlib import Path
from typing import NamedTuple

from skfem_textile import (
    CheckpointError,
    Fabric,
    LoadStepper,
    OnePoint,
    Ply,
    Result,
    State,
    StepError,
)
from skfem_textile.cli.output import OutputError
from skfem_textile.cli.result_folder import ResultFolder
from skfem_textile.io import FIELDS, write_fields, write_history
from skfem_textile.io import write_summary as write
from skfem_textile.scenes import strip
from skfem_textile.sweep import sweep

from .command_child import (
    EARLIER_STEPS,
    LOG,
    SAME,
    STEPS,
    check_kept,
    check_recovery,
    run,
    undisturbed,
    whole,
    words,
)
from .mechanics import WrongError
from .trial import is_clear

#: Cases of a sweep, of which each takes a block or two, and those of an earlier one.
_CASES, _EARLIER_CASES, _NUMBERS = 20, 5, 1000

_NAMES = "summary.json", "history.csv", *(f"fields/{name}" for name in FIELDS)


class Disk(NamedTuple):
    """A disk, and how it is spoilt.

    Parameters
    ----------
    path
        Where it is.
    spoilt
        Spoils it for some time, at the latest when what it gives is called.
    after
        When that is called, as a fraction of a run.
    earlier
        Whether something was written there before.
    """

    path: Path
    spoilt: Callable[[], AbstractContextManager[Callable[[], None]]]
    after: float
    earlier: bool


def command(disk: Disk) -> None:
    """Run the command line with a checkpoint."""
    out = disk.path / "out"
    if disk.earlier and (ended := run(words(out, EARLIER_STEPS))).code:
        raise WrongError(f"the earlier run fails: {ended}")
    before = _content(out)
    with disk.spoilt() as spoil:
        after = disk.after * undisturbed().seconds
        ended = run(words(out), after, lambda child: spoil())
        check_kept(out, disk.earlier)
        lines = [text for text in ended.said.splitlines() if not text.startswith(LOG)]
        if ended.code == 0 and not lines:
            whole(out)
        elif ended.code == 1 and len(lines) == 1:
            _check_line(lines[0], out, out / "checkpoint")
        elif ended.code == 2 and len(lines) == 1:  # refused before it has begun
            _check_line(lines[0], out, None)
            if _content(out) != before:
                raise WrongError(f"refused, but something has changed: {ended}")
        else:
            raise WrongError(f"{ended}")
    check_recovery(out)


def stepper(disk: Disk) -> None:
    """Run a load stepper with a checkpoint: its result stays with the caller."""
    folder = disk.path / "checkpoint"
    if disk.earlier:
        _stepper(folder, EARLIER_STEPS).run()
    with disk.spoilt() as spoil:
        due = round(disk.after * STEPS)

        def reached(state: State) -> None:
            if len(one.states) > due:
                spoil()

        one = _stepper(folder, STEPS)
        one.on_step = reached
        try:
            one.run()
        except StepError as error:
            _check_line(str(error), folder, folder)
            if not (1 <= len(error.result.states) == len(one.result.states)):
                raise WrongError("the result is not the caller's") from None
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
    expected = undisturbed().summaries[steps]["energy"]
    energy = sum(result.states[-1].energies.values())
    if abs(energy - expected) > SAME * abs(expected):
        raise WrongError(f"the energy is {energy}, not {expected}")
    if left := list(folder.glob(".*")):
        raise WrongError(f"debris stays: {left}")


def results(disk: Disk) -> None:
    """Write results to a folder, all at once, and one by one."""
    out, result = disk.path / "out", _stepper(None, STEPS).run()
    if disk.earlier:
        _write(result, out)
        before = _content(out)
    with disk.spoilt() as spoil:
        try:
            _write(result, out, spoil)
        except OSError as error:
            _check_line(str(error), out, None)
            if disk.earlier and _content(out) != before:
                raise WrongError("the earlier result has changed") from None
        else:
            whole(out)
        try:
            write_fields(result, disk.path / "alone")
            write_history(result, disk.path / "alone.csv")
        except OSError as error:
            _check_line(str(error), disk.path / "alone", None)
    _write(result, out)
    whole(out)
    if left := list(out.glob(".*")):
        raise WrongError(f"debris stays: {left}")


def _write(result: Result, out: Path, spoil: Callable[[], None] = lambda: None) -> None:
    with ResultFolder(out, _NAMES) as folder:
        spoil()
        write(result.summary(), folder / "summary.json")
        write_history(result, folder / "history.csv")
        write_fields(result, folder / "fields")


def sweep_file(disk: Disk) -> None:
    """Write the results of a sweep, which a later one goes on with."""
    out, told, called = disk.path / "sweep.jsonl", set[int](), list[int]()

    def function(case: int) -> list[int]:
        called.append(case)
        return [case] * _NUMBERS

    def go(cases: int, spoil: Callable[[], None] = lambda: None) -> None:
        due = round(disk.after * cases)
        with ThreadPoolExecutor(1) as executor:
            for case, found in sweep(function, range(cases), executor, out=out):
                if found != [case] * _NUMBERS:
                    raise WrongError(f"case {case} is told {found[:3]}")
                told.add(case)
                if len(told) > due:
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
    before, called[:] = set(told), []
    go(_CASES)
    if len(told) < _CASES or before & set(called):
        raise WrongError(f"told {before}, run again {called}")


def _check_line(line: str, path: Path, kept: Path | None) -> None:
    """A message is one line that names a path, and says that what it holds remains."""
    if not is_clear(line) or str(path) not in line:
        raise WrongError(f"{path} is not named in one clear line: {line}")
    holds = kept and (kept.is_file() or list(kept.glob("state_*.npz")))
    if holds and "remains" not in line:
        raise WrongError(f"that {kept} remains is not said: {line}")


def _stepper(folder: Path | None, steps: int) -> LoadStepper:
    scene = strip(size=(3, 4))
    ply = Ply(scene.mesh, Fabric(1e4), OnePoint(10.0))
    return LoadStepper(ply, scene.conditions, steps, checkpoint=folder)


def _content(folder: Path) -> dict[Path, bytes]:
    """What the files hold that are not half done, as hidden ones are."""
    files = [path for path in folder.rglob("*") if path.is_file()]
    shown = [p for p in files if "/." not in f"/{p.relative_to(folder)}"]
    return {path: path.read_bytes() for path in shown}


#: Who may write to the disk.
USERS = {
    "command": command,
    "stepper": stepper,
    "results": results,
    "sweep file": sweep_file,
}
