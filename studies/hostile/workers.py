"""Forked workers that try the inputs of a family, with time and memory limits."""

import contextlib
import contextvars
import os
import resource
import signal
import traceback
from collections import deque
from collections.abc import Iterator
from multiprocessing import get_context
from multiprocessing.connection import wait
from typing import Any, NamedTuple

import hypothesis
from hypothesis.internal.conjecture import providers

from tests.helpers.hostile import (
    REFUSED,
    RIGHT,
    Family,
    UnclearError,
    WrongAnswerError,
    end_with_parent,
)

#: Refused without a clear one-line message; accepted with a wrong result.
UNCLEAR, SILENT = "unclear", "silent"
#: Other errors, trials over their time limit, and processes that ended.
TRACEBACK, HANG, DIED = "traceback", "hang", "died"
#: All outcomes of a trial, in table order.
OUTCOMES = (RIGHT, REFUSED, UNCLEAR, SILENT, TRACEBACK, HANG, DIED)
GOOD = (RIGHT, REFUSED)

#: Memory limit of a worker in bytes: corrupted counts can request any size.
MEMORY = 6 * 2**30

# Trials per process; a new process then starts, which frees memory.
_TRIALS_PER_PROCESS = 300

_FORK = get_context("fork")


class Finding(NamedTuple):
    """Result of a trial: one of `OUTCOMES`, the input and a message."""

    outcome: str
    hostile: str = ""
    message: str = ""


class _Trials(NamedTuple):
    """A number of trials of one kind of input, and the Hypothesis seed."""

    kind: str
    number: int
    seed: int


def findings(family: Family, numbers: range, workers: int) -> Iterator[Finding]:
    """Try equal numbers of inputs of each kind; yields results in arbitrary order.

    Parameters
    ----------
    family
        The family of the inputs.
    numbers
        Numbers of the trials; the first seeds the inputs.
    workers
        Number of concurrent processes.
    """
    waiting = deque(_shared(family, numbers))
    busy: dict[Any, tuple[Any, _Trials]] = {}
    try:
        while waiting or busy:
            while waiting and len(busy) < workers:
                pipe, process = _started(family, waiting[0])
                busy[pipe] = process, waiting.popleft()
            ready: list[Any] = [*wait(list(busy))]
            for pipe in ready:
                process, trials = busy[pipe]
                left = trials._replace(number=trials.number - 1)
                try:
                    finding = pipe.recv()
                except EOFError:
                    process.join()
                    _end(process)
                    del busy[pipe]
                    if (code := process.exitcode) and trials.number:
                        hung, trials = code == -signal.SIGALRM, left
                        yield Finding(HANG if hung else DIED, "", f"exit code {code}")
                    if trials.number:
                        waiting.append(trials._replace(seed=trials.seed + len(numbers)))
                else:
                    busy[pipe] = process, left
                    yield finding
    finally:
        for process, _ in busy.values():
            _end(process)


def _shared(family: Family, numbers: range) -> Iterator[_Trials]:
    """The trials of each process."""
    for i, kind in enumerate(family.inputs):
        of_kind = numbers[i :: len(family.inputs)]
        for begin in range(0, len(of_kind), _TRIALS_PER_PROCESS):
            part = of_kind[begin : begin + _TRIALS_PER_PROCESS]
            yield _Trials(kind, len(part), part[0])


def _started(family: Family, trials: _Trials) -> tuple[Any, Any]:
    """A process that sends its findings, and the receiving pipe."""
    pipe, of_process = _FORK.Pipe(duplex=False)
    arguments = family, trials, of_process, os.getpid()
    process = _FORK.Process(target=_serve, args=arguments, daemon=True)
    process.start()
    of_process.close()
    return pipe, process


def _end(process: Any) -> None:
    """End a process and its child processes."""
    with contextlib.suppress(ProcessLookupError):
        os.killpg(process.pid, signal.SIGKILL)
    process.kill()
    process.join()


def _serve(family: Family, trials: _Trials, pipe: Any, parent: int) -> None:
    """Try inputs; the kernel ends this process on a timeout."""
    os.setpgid(0, 0)
    end_with_parent(parent)
    signal.signal(signal.SIGINT, signal.default_int_handler)
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    signal.signal(signal.SIGALRM, signal.SIG_DFL)
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
    # Inputs would change with the numbers in the code of all loaded modules.
    providers._get_local_constants = providers.Constants

    @hypothesis.seed(trials.seed)
    @hypothesis.settings(
        max_examples=trials.number,
        database=None,
        deadline=None,
        phases=[hypothesis.Phase.generate],
        suppress_health_check=list(hypothesis.HealthCheck),
    )
    @hypothesis.given(family.inputs[trials.kind])
    def serve(hostile: Any) -> None:
        signal.setitimer(signal.ITIMER_REAL, family.seconds)
        finding = _finding(family, hostile)
        signal.setitimer(signal.ITIMER_REAL, 0)
        pipe.send(finding)

    # Without the name of the study's case, which would begin each message.
    contextvars.Context().run(serve)


def _finding(family: Family, hostile: Any) -> Finding:
    try:
        return Finding(family.outcome(hostile))
    except UnclearError as error:
        outcome, message = UNCLEAR, str(error)
    except WrongAnswerError as error:
        outcome, message = SILENT, str(error)
    except BaseException as error:  # any uncaught error counts
        outcome, message = TRACEBACK, "".join(traceback.format_exception(error))
    return Finding(outcome, repr(hostile)[:1000], message)
