"""Trials of signals at any moment of a run: nothing is lost that was kept."""

import os
import signal
from collections.abc import Sequence
from pathlib import Path
from random import Random

from .command_child import (
    EARLIER_STEPS,
    STEPS,
    check_interrupted,
    check_kept,
    check_recovery,
    is_of_earlier_run,
    run,
    undisturbed,
    words,
)
from .mechanics import WrongError
from .trial import RIGHT, SILENT, Family, Finding

_SIGNALS = signal.SIGKILL, signal.SIGTERM, signal.SIGINT

#: A run is killed, and then up to so many that resume it.
_MOST_RESUMED = 2

#: Moments go past the end of an undisturbed run, which is not the slowest.
_LATEST = 1.1


def attempt(seed: int, folder: Path) -> Finding:
    """Kill a run at the moments of a seed, with an earlier result there or none."""
    random, out = Random(seed), folder / "out"
    number, earlier = _SIGNALS[seed % len(_SIGNALS)], random.random() < 0.5
    moments = [
        random.uniform(0.0, _LATEST * undisturbed().seconds)
        for _ in range(1 + random.randint(0, _MOST_RESUMED))
    ]
    shown = ", ".join(f"{moment:.4f}" for moment in moments)
    damage = f"{number.name} after {shown} s" + " over an earlier result" * earlier
    try:
        if earlier and (ended := run(words(out, EARLIER_STEPS))).code:
            raise WrongError(f"the earlier run fails: {ended}")
        _kill(out, number, moments)
        check_recovery(out)
    except WrongError as wrong:
        return Finding(SILENT, damage, str(wrong))
    return Finding(RIGHT, damage)


def _kill(out: Path, number: signal.Signals, moments: Sequence[float]) -> None:
    """Kill a run, and what resumes it; look at what is there after each."""
    command = words(out)
    for moment in moments:
        was_there = (out / "summary.json").exists()
        ended = run(command, moment, lambda child: os.kill(child, number))
        if not is_of_earlier_run(ended):
            check_interrupted(ended, number)
        check_kept(out, was_there)
        command = words(out, STEPS, "--resume")


FAMILY = Family("kills", attempt, trials=100, short=3)
