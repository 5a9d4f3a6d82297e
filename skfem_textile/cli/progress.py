"""Execution of a run: progress, log and exit code."""

import logging
from functools import partial
from typing import TYPE_CHECKING, TypeAlias

from ..mesh import progress
from ..solve.result import StepError
from .interruption import INTERRUPTED
from .output import STOPPED_EARLY

if TYPE_CHECKING:
    from ..solve.stepper import LoadStepper
    from ..solve.tolerance import ToleranceStepper

    Stepper: TypeAlias = LoadStepper | ToleranceStepper

#: Shows a computation, also if stderr is a file or a pipe.
shown = partial(progress.shown, printed=True)


def load(stepper: "Stepper", resume: bool) -> tuple[int, str, StepError | None]:
    """Run a load stepper.

    Parameters
    ----------
    stepper
        The load stepper.
    resume
        As for `LoadStepper.run`.

    Returns
    -------
    tuple
        Exit code, final message, and the error that stopped the run.
    """
    try:
        stepper.run(resume=resume)
    except StepError as error:
        return STOPPED_EARLY, str(error), error
    except KeyboardInterrupt:
        if not stepper.states:
            raise
        return INTERRUPTED, _interrupted(stepper), None
    return 0, "", None


def _interrupted(stepper: "Stepper") -> str:
    at = stepper.states[-1].load_factor
    if hasattr(stepper, "tolerance"):
        return (
            "interrupted before the tolerance was met: the last converged state, "
            f"at load factor {at:.6g}, is written"
        )
    kept, lost = (
        "--resume continues the run from there",
        "only a run with --checkpoint can be resumed",
    )
    advice = kept if stepper.checkpoint else lost
    written = f"the last converged state, at load factor {at:.6g}, is written"
    return f"interrupted: {stepper.result.not_on_tool or written}; {advice}"


def log_to_stderr(verbose: int) -> None:
    """Send the log to stderr, with every step for 1, every iteration for 2."""
    handler = logging.StreamHandler()
    handler.setFormatter(_Formatter("%(message)s"))
    log = logging.getLogger("skfem_textile")
    log.handlers[:] = [handler]
    log.setLevel([logging.WARNING, logging.INFO, logging.DEBUG][min(verbose, 2)])


class _Formatter(logging.Formatter):
    """Formatter that erases the visible line of progress before each message."""

    def format(self, record: logging.LogRecord) -> str:
        progress.clear()
        return super().format(record)
