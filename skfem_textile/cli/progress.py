"""Execution of a run: progress bar, log and exit code."""

import logging
from contextlib import AbstractContextManager
from typing import TYPE_CHECKING, TypeAlias

from ..solve.result import StepError
from ..solve.states import Iteration, State
from .interruption import INTERRUPTED

if TYPE_CHECKING:
    from rich.progress import Progress

    from ..solve.adaptive import AdaptiveStepper
    from ..solve.stepper import LoadStepper

    Stepper: TypeAlias = LoadStepper | AdaptiveStepper

#: Exit code of a run that stops early.
STOPPED_EARLY = 1


def load(
    stepper: "Stepper", resume: bool, verbose: int
) -> tuple[int, str, StepError | None]:
    """Run with a progress bar on a terminal.

    Parameters
    ----------
    stepper
        The load stepper.
    resume
        As for `LoadStepper.run`.
    verbose
        1 to log every step, 2 to log every iteration.

    Returns
    -------
    tuple
        Exit code, final message, and the error that stopped the run.
    """
    with _bar() as bar:
        _log(verbose)
        task = bar.add_task("load factor 0", total=1.0)

        def log_state(at: Iteration) -> None:
            bar.update(
                task,
                description=(
                    f"load factor {at.load_factor:.4g}, step length {at.step:.2g}, "
                    f"{at.method} iteration {at.number}"
                ),
            )

        def reached(state: State) -> None:
            bar.update(task, completed=state.load_factor)

        stepper.on_iteration, stepper.on_step = log_state, reached
        try:
            stepper.run(resume=resume)
        except StepError as error:
            return STOPPED_EARLY, str(error), error
        except KeyboardInterrupt:
            if not stepper.states:
                raise
            return INTERRUPTED, _interrupted(stepper), None
    return 0, "", None


def shown(what: str) -> AbstractContextManager[object]:
    """Show the current activity on a terminal, without a measure of progress."""
    bar = _bar()
    bar.add_task(what, total=None)
    return bar


def _bar() -> "Progress":
    """Progress bar on a terminal, removed at its end; none elsewhere."""
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn

    console = Console(stderr=True)
    columns = (BarColumn(), TextColumn("{task.description}"))
    off = not console.is_terminal
    return Progress(*columns, console=console, transient=True, disable=off)


def _interrupted(stepper: "Stepper") -> str:
    at = stepper.states[-1].load_factor
    if hasattr(stepper, "tolerance"):
        return (
            "interrupted during the refinement of the mesh: the last converged state, "
            f"at load factor {at:.6g}, is written"
        )
    kept, lost = (
        "--resume continues the run from there",
        "only a run with --checkpoint can be resumed",
    )
    advice = kept if stepper.checkpoint else lost
    return (
        f"interrupted: the last converged state, at load factor {at:.6g}, is written; "
        f"{advice}"
    )


def _log(verbose: int) -> None:
    """Send the log to stderr without disturbing the progress bar."""
    handler = logging.StreamHandler()
    handler.setFormatter(logging.Formatter("%(message)s"))
    log = logging.getLogger("skfem_textile")
    log.handlers[:] = [handler]
    log.setLevel([logging.WARNING, logging.INFO, logging.DEBUG][min(verbose, 2)])
