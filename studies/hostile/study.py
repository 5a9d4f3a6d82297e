"""Trials of hostile inputs by family, counted by outcome."""

import argparse
import json
import os
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

from tests.calibration import test_hostile_recordings as recordings
from tests.cli import test_disturbed_runs as disturbed_runs
from tests.cli import test_hostile_runs as runs
from tests.contact import test_hostile_free_plies as free_plies
from tests.contact import test_hostile_holders as holders
from tests.fabric import test_hostile_tables as tables
from tests.helpers.hostile import Family
from tests.io import test_hostile_decks as decks
from tests.io import test_hostile_mesh_files as mesh_files
from tests.mesh import test_hostile_meshes as meshes
from tests.outlines.drawings import test_hostile_drawings as drawings
from tests.solve import test_hostile_arguments as arguments
from tests.solve import test_hostile_intervals as intervals
from tests.solve.checkpoint import test_hostile_checkpoints as checkpoints
from tests.sweep import test_hostile_files as sweeps

from ..common.tables import json_text, markdown_table
from ..study import Row, Study
from .workers import GOOD, OUTCOMES, findings

_COUNTS, _TABLE = "hostile.json", "hostile.md"

#: The families of hostile inputs, defined in the tests.
FAMILIES: tuple[Family, ...] = (
    *mesh_files.FAMILIES,
    *decks.FAMILIES,
    tables.FAMILY,
    recordings.FAMILY,
    *runs.FAMILIES,
    meshes.FAMILY,
    arguments.FAMILY,
    intervals.FAMILY,
    checkpoints.FAMILY,
    sweeps.FAMILY,
    *disturbed_runs.FAMILIES,
    drawings.FAMILY,
    free_plies.FAMILY,
    holders.FAMILY,
)


class Trials(NamedTuple):
    """Trials of a family by number, and the number of worker processes."""

    family: str
    numbers: range
    workers: int


class Hostile(Study[Trials]):
    """Trials of hostile inputs; the study fails if a trial has a bad outcome."""

    files = (_COUNTS, _TABLE)
    timed = True  # trials have time limits and start workers themselves
    sample = "mesh defects 0-1059"

    def add_options(self, parser: argparse.ArgumentParser) -> None:
        """Add the options that select trials."""
        add = parser.add_argument
        add("--short", action="store_true", help="short version for CI")
        add("--workers", type=int, default=os.cpu_count(), help="processes")
        add("--first", type=int, default=0, help="number and seed of the first trial")

    def cases(self, options: argparse.Namespace) -> Sequence[Trials]:
        """All families, with the numbers of their trials."""
        first = options.first
        return [
            Trials(family.name, range(first, first + number), options.workers)
            for family in FAMILIES
            for number in [family.short if options.short else family.trials]
        ]

    def name(self, case: Trials) -> str:
        """Family, first and last number."""
        return f"{case.family} {case.numbers[0]}-{case.numbers[-1]}"

    def examine(self, case: Trials) -> list[Row]:
        """Count the trials by outcome, and list bad outcomes."""
        (family,) = (family for family in FAMILIES if family.name == case.family)
        all_findings = list(findings(family, case.numbers, case.workers))
        counts = Counter(finding.outcome for finding in all_findings)
        bad = [finding for finding in all_findings if finding.outcome not in GOOD]
        return [
            {
                "family": case.family,
                "counts": {outcome: counts[outcome] for outcome in OUTCOMES},
                "bad": "\n".join(f"{case.family}: {finding}" for finding in bad),
            }
        ]

    def line(self, rows: list[Row]) -> str:
        """Counts of a family, and a line for each bad outcome."""
        (row,) = rows
        counts = ", ".join(f"{n} {outcome}" for outcome, n in row["counts"].items())
        return f"{row['family']:16}{counts}\n{row['bad']}".rstrip()

    def tables(self, rows: list[Row]) -> dict[str, str]:
        """Counts by family and outcome."""
        counts = {row["family"]: row["counts"] for row in rows}
        lines = [[name, sum(by.values()), *by.values()] for name, by in counts.items()]
        table = markdown_table(["family", "trials", *OUTCOMES], lines)
        return {_COUNTS: json_text(counts), _TABLE: table}

    def stored(self, folder: Path) -> list[Row]:
        """The counts of each family, with trials numbered from zero."""
        text = (folder / _COUNTS).read_text(encoding="utf-8")
        return [
            {
                "case": f"{family} 0-{sum(counts.values()) - 1}",
                "family": family,
                "counts": counts,
            }
            for family, counts in json.loads(text).items()
        ]

    def figures(self, rows: list[Row]) -> dict[str, str]:
        """Numbers of trials and of bad outcomes."""
        return {"trials": str(_trials(rows, OUTCOMES)), "bad": str(_bad(rows))}

    def complaint(self, rows: list[Row]) -> str:
        """Report the number of bad outcomes."""
        bad = _bad(rows)
        return f"{bad} trial(s) with bad outcomes" if bad else ""


def _trials(rows: Sequence[Row], outcomes: Sequence[str]) -> int:
    """Number of trials with one of these outcomes."""
    return sum(row["counts"][outcome] for row in rows for outcome in outcomes)


def _bad(rows: Sequence[Row]) -> int:
    return _trials(rows, OUTCOMES) - _trials(rows, GOOD)


STUDY = Hostile()
