"""Trials of signals at random moments of a run: nothing that was kept is lost."""

import os
import signal
from collections.abc import Sequence
from pathlib import Path
from random import Random

from ..trial import Family, Finding, checked
from .command_run import (
    STEPS,
    check_interrupted,
    check_kept,
    check_recovery,
    is_of_earlier_run,
    run,
    run_earlier,
    undisturbed,
    words,
)

_SIGNALS = signal.SIGKILL, signal.SIGTERM, signal.SIGINT

#: Resumed runs that are killed too, at most.
_MOST_RESUMED = 2

#: Latest moment, as a multiple of the duration of an undisturbed run.
_LATEST = 1.1


def attempt(seed: int, folder: Path) -> Finding:
    """Kill a run and those that resume it, then let it end."""
    random, out = Random(seed), folder / "out"
    number, earlier = _SIGNALS[seed % len(_SIGNALS)], random.random() < 0.5
    moments = [
        random.uniform(0.0, _LATEST * undisturbed().seconds)
        for _ in range(1 + random.randint(0, _MOST_RESUMED))
    ]
    shown = ", ".join(f"{moment:.4f}" for moment in moments)
    damage = f"{number.name} after {shown} s" + " over an earlier result" * earlier
    return checked(damage, _kill, out, number, moments, earlier)


def _kill(
    out: Path, number: signal.Signals, moments: Sequence[float], earlier: bool
) -> None:
    """Kill a run, and those that resume it; check what each leaves."""
    if earlier:
        run_earlier(out)
    command = words(out)
    for moment in moments:
        had_result = (out / "summary.json").exists()
        ended = run(command, moment, lambda child: os.kill(child, number))
        if not is_of_earlier_run(ended):
            check_interrupted(ended, number)
        check_kept(out, had_result)
        command = words(out, STEPS, "--resume")
    check_recovery(out)


FAMILY = Family("kills", attempt, trials=100, short=3)
