"""Trials of damaged sweep files: refused and unchanged, or completed rightly."""

import logging
import os
from concurrent.futures import ThreadPoolExecutor
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.random import Generator

from skfem_textile.solve.sweep import sweep

from ..readers import sweep_file
from ..trial import RIGHT, SILENT, Family, Finding, refused
from .file_damage import CHANGES, replaced
from .sweep_damage import DAMAGES

#: Names of cases; they hold characters that JSON escapes.
CASES = ("0", "a b", "größe", '"', "\\", "two\nlines", "{}", "")


def attempt(seed: int, folder: Path) -> Finding:
    """Damage the file of a sweep, resume the sweep, and read the file."""
    logging.disable()
    rng = np.random.default_rng(seed)
    content = _interrupted_sweep(int(rng.integers(1, len(CASES) + 1)))
    damages = []
    for _ in range(rng.choice([1, 1, 2, 3])):
        name, content = _damaged(rng, content)
        damages.append(name)
    out = folder / "kept" / "out.jsonl"
    out.parent.mkdir()
    out.write_bytes(content)
    if rng.random() < 0.1:
        damages.append(replaced(rng, out))
    return _finding(", ".join(damages), out)


def _damaged(rng: Generator, content: bytes) -> tuple[str, bytes]:
    change = (*CHANGES, *DAMAGES)[rng.integers(len(CHANGES) + len(DAMAGES))]
    return change.__name__, change(rng, content)


def _finding(damage: str, out: Path) -> Finding:
    is_file = out.is_file()
    before = out.read_bytes() if is_file else b""
    content = sweep_file.read(before)
    run_cases: list[str] = []
    try:
        results = _resumed_sweep(out, run_cases)
    except (ValueError, OSError) as error:
        if is_file and out.read_bytes() != before:
            return Finding(SILENT, damage, f"the file has changed after: {error}")
        # A broken link takes the place of the file, for which `exists` is false.
        if content.is_sweep and (is_file or not os.path.lexists(out)):
            return Finding(SILENT, damage, f"a file of a sweep is refused: {error}")
        return refused(damage, str(error).replace(str(out), "FILE"))
    right = {case: content.good.get(case, _result(case)) for case in CASES}
    if not content.is_sweep:
        return Finding(SILENT, damage, "a file that no sweep wrote is taken")
    if results != right:
        return Finding(SILENT, damage, f"results {results}, not {right}")
    if sorted(run_cases) != sorted(set(CASES) - set(content.good)):
        return Finding(SILENT, damage, f"ran {run_cases}, has {sorted(content.good)}")
    if not out.read_bytes().startswith(content.kept):
        return Finding(SILENT, damage, "whole lines are lost")
    return Finding(RIGHT, damage)


def _result(case: str) -> dict[str, Any]:
    """The result of a case."""
    n = CASES.index(case)
    return {"value": n / 7, "text": case, "list": [1e300, -0.0, None, n]}


def _resumed_sweep(out: Path, run_cases: list[str]) -> dict[str, Any]:
    """Results of all cases; those that were run are added to the list."""

    def run(case: str) -> dict[str, Any]:
        run_cases.append(case)
        return _result(case)

    with ThreadPoolExecutor(1) as executor:
        return dict(sweep(run, CASES, executor, out=out, key=str))


@cache
def _interrupted_sweep(number: int) -> bytes:
    """The file of a sweep that was interrupted after a number of cases."""
    return b"".join(sweep_file.line(case, _result(case)) for case in CASES[:number])


FAMILY = Family("sweeps", attempt, trials=1000, short=40)
