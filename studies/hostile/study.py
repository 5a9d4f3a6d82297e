"""The study of hostile inputs: every family of trials, counted by outcome."""

import argparse
import json
import os
from collections import Counter
from collections.abc import Sequence
from typing import NamedTuple

from ..common.tables import json_text, markdown_table
from ..study import Row, Study
from .families import FAMILIES
from .trial import GOOD, OUTCOMES
from .workers import try_seeds

#: Trials of one case.  An interrupted study starts with the case that it left.
_TRIALS_PER_CASE = 500

_COUNTS, _TABLE = "hostile.json", "hostile.md"


class Block(NamedTuple):
    """Consecutive seeds of a family, and the number of processes that try them."""

    family: str
    seeds: range
    workers: int


class Hostile(Study[Block]):
    """Trials of hostile inputs; it fails if one ends badly."""

    files = (_COUNTS, _TABLE)
    timed = True  # trials have time limits, and workers of their own

    def __init__(self) -> None:
        self._kept: dict[str, dict[str, int]] = {}

    def add_options(self, parser: argparse.ArgumentParser) -> None:
        """Add the options that choose trials."""
        add = parser.add_argument
        add("--short", action="store_true", help="the short form, for CI")
        add("--workers", type=int, default=os.cpu_count(), help="processes")
        add("--first", type=int, default=0, help="first seed")
        add(
            "--family",
            nargs="+",
            choices=[family.name for family in FAMILIES],
            help="these families only; the counts of others are kept",
        )

    def cases(self, options: argparse.Namespace) -> Sequence[Block]:
        """Blocks of seeds of the chosen families."""
        counts = options.out / _COUNTS
        if options.family and counts.is_file():
            self._kept = json.loads(counts.read_text(encoding="utf-8"))
        blocks = []
        for family in FAMILIES:
            if family.name in (options.family or [family.name]):
                number = family.short if options.short else family.trials
                seeds = range(options.first, options.first + number)
                starts = range(0, number, _TRIALS_PER_CASE)
                parts = [seeds[i : i + _TRIALS_PER_CASE] for i in starts]
                blocks += [Block(family.name, part, options.workers) for part in parts]
        return blocks

    def name(self, case: Block) -> str:
        """Family, first and last seed."""
        return f"{case.family} {case.seeds[0]}-{case.seeds[-1]}"

    def examine(self, case: Block) -> list[Row]:
        """Count the trials by outcome, and list those that end badly."""
        (family,) = (family for family in FAMILIES if family.name == case.family)
        tried = list(try_seeds(family, case.seeds, case.workers))
        counts = Counter(trial.finding.outcome for trial in tried)
        bad = [t for t in tried if t.finding.outcome not in GOOD]
        bad.sort(key=lambda trial: trial.seed)
        return [
            {
                "name": self.name(case),
                "family": case.family,
                "counts": {outcome: counts[outcome] for outcome in OUTCOMES},
                "bad": [f"{case.family} {t.seed}: {t.finding}" for t in bad],
            }
        ]

    def line(self, rows: list[Row]) -> str:
        """Counts of a block, and a line for each trial that ends badly."""
        (row,) = rows
        counts = ", ".join(f"{n} {outcome}" for outcome, n in row["counts"].items())
        return "\n".join([f"{row['name']:24}{counts}", *row["bad"]])

    def tables(self, rows: list[Row]) -> dict[str, str]:
        """Counts by family and outcome."""
        counts = {row["family"]: dict.fromkeys(OUTCOMES, 0) for row in rows}
        for row in rows:
            for outcome, number in row["counts"].items():
                counts[row["family"]][outcome] += number
        counts = self._kept | counts
        lines = [[name, sum(by.values()), *by.values()] for name, by in counts.items()]
        table = markdown_table(["family", "trials", *OUTCOMES], lines)
        return {_COUNTS: json_text(counts), _TABLE: table}

    def complaint(self, rows: list[Row]) -> str:
        """How many trials end badly."""
        bad = sum(len(row["bad"]) for row in rows)
        return f"{bad} trials end badly" if bad else ""


STUDY = Hostile()
