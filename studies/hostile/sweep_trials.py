"""Damaged files of sweeps: refused and left alone, or completed to the same results."""

import logging
import os
from concurrent.futures import ThreadPoolExecutor
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.random import Generator

from skfem_textile.sweep import sweep

from . import plain_sweep
from .file_damage import CHANGES, replaced
from .sweep_damage import DAMAGES
from .trial import RIGHT, SILENT, Family, Finding, refused

#: Cases of a sweep: their names hold what JSON must write with care.
CASES = ("0", "a b", "größe", '"', "\\", "two\nlines", "{}", "")


def attempt(seed: int, folder: Path) -> Finding:
    """Damage the file of a sweep, resume it, and read what is there then."""
    logging.disable()
    rng = np.random.default_rng(seed)
    content = _whole(int(rng.integers(1, len(CASES) + 1)))
    damages = []
    for _ in range(rng.choice([1, 1, 2, 3])):
        name, content = _damaged(rng, content)
        damages.append(name)
    out = folder / "kept" / "out.jsonl"
    out.parent.mkdir()
    out.write_bytes(content)
    if rng.random() < 0.1:
        damages.append(replaced(rng, out))
    return _judged(", ".join(damages), out)


def _damaged(rng: Generator, content: bytes) -> tuple[str, bytes]:
    change = (*CHANGES, *DAMAGES)[rng.integers(len(CHANGES) + len(DAMAGES))]
    return change.__name__, change(rng, content)


def _judged(damage: str, out: Path) -> Finding:
    is_file = out.is_file()
    before = out.read_bytes() if is_file else b""
    there = plain_sweep.read(before)
    asked: list[str] = []
    try:
        found = _swept(out, asked)
    except (ValueError, OSError) as error:
        if is_file and out.read_bytes() != before:
            return Finding(SILENT, damage, f"the file has changed after: {error}")
        if there.is_sweep and (is_file or not _is_taken(out)):
            return Finding(SILENT, damage, f"a file of a sweep is refused: {error}")
        return refused(damage, str(error).replace(str(out), "FILE"))
    return _compared(damage, out, there, found, asked)


def _is_taken(out: Path) -> bool:
    """Whether there is something in the place of the file, a broken link included."""
    return os.path.lexists(out)


def _compared(
    damage: str,
    out: Path,
    there: plain_sweep.Read,
    found: dict[str, Any],
    asked: list[str],
) -> Finding:
    after = out.read_bytes()
    right = {case: there.good.get(case, result(case)) for case in CASES}
    if not there.is_sweep:
        return Finding(SILENT, damage, "a file that no sweep wrote is taken")
    if found != right:
        return Finding(SILENT, damage, f"found {found}, not {right}")
    if sorted(asked) != sorted(case for case in CASES if case not in there.good):
        return Finding(SILENT, damage, f"ran {asked}, has {sorted(there.good)}")
    if not after.startswith(there.kept):
        return Finding(SILENT, damage, "what no sweep had torn is gone")
    return Finding(RIGHT, damage)


def result(case: str) -> dict[str, Any]:
    """The result of a case."""
    n = CASES.index(case)
    return {"value": n / 7, "text": case, "list": [1e300, -0.0, None, n]}


def _swept(out: Path, asked: list[str]) -> dict[str, Any]:
    """Every result of the whole sweep; the cases that were run are added to a list."""

    def ask(case: str) -> dict[str, Any]:
        asked.append(case)
        return result(case)

    with ThreadPoolExecutor(1) as executor:
        return dict(sweep(ask, CASES, executor, out=out, key=str))


@cache
def _whole(number: int) -> bytes:
    """The file of a sweep that was interrupted after so many cases."""
    return b"".join(plain_sweep.line(case, result(case)) for case in CASES[:number])


FAMILY = Family("sweeps", attempt, trials=1000, short=40)
