"""Draping on a sphere, a cylinder and a cone, against exact answers."""

import argparse
from collections.abc import Callable, Sequence
from pathlib import Path

from ...common.tables import csv_table, rows_of_csv
from ...study import Row, Study
from . import tables
from .cases import NET, PUBLISHED, ROLLED, SPHERE, TIME, Case, all_cases
from .error_time import timed
from .extremes.cases import EXTREME, Extreme, all_extremes
from .extremes.judging import WRONG, judged
from .extremes.tables import in_words, outcomes, told_or_refused
from .runs import row_of

#: The tables of each part of the study, by the kinds of its cases.
_TABLES: dict[tuple[str, ...], dict[str, Callable[[Sequence[Row]], str]]] = {
    (SPHERE, NET, ROLLED): {
        "drape.csv": csv_table,
        "refinement.md": tables.refinement,
        "orders.md": tables.orders,
        "distorted.md": tables.distorted,
        "other.md": tables.other_drapes,
        "free_edges.md": tables.free_edges,
        "nets.md": tables.nets,
        "rolled.md": tables.rolled,
    },
    (PUBLISHED,): {
        "published.csv": csv_table,
        "published.md": tables.published_nets,
    },
    (TIME,): {"error_time.csv": csv_table},
    (EXTREME,): {
        "extremes.csv": csv_table,
        "extremes.md": outcomes,
        "extremes_off.md": told_or_refused,
    },
}


class Drape(Study[Case | Extreme]):
    """Every case once, on one thread; ``--case 'time*'`` and the like run one part."""

    files = tuple(name for written in _TABLES.values() for name in written)
    pictures = ("error_time.png",)
    timed = True
    sample = str(Case(SPHERE, 32, "macro", distortion=0.2))

    def cases(self, options: argparse.Namespace) -> list[Case | Extreme]:
        return [*all_cases(), *all_extremes()]

    def line(self, rows: list[Row]) -> str:
        (row,) = rows
        if row["refused"]:
            return f"{row['case']}: refused, {row['refused']}"
        if row["kind"] == EXTREME:
            return f"{row['case']}: {row['outcome']}"
        return f"{row['case']}: error {row['largest']:.2e}°, {row['seconds']:.2f} s"

    def examine(self, case: Case | Extreme) -> list[Row]:
        """Run one case."""
        settings = {name: getattr(case, name) for name in case.__dataclass_fields__}
        if isinstance(case, Extreme):
            found = judged(case)
        else:
            found = timed(case) if case.kind == TIME else row_of(case)
        return [{"case": str(case), "refused": "", **settings, **found}]

    def tables(self, rows: list[Row]) -> dict[str, str]:
        found: dict[str, str] = {}
        for kinds, written in _TABLES.items():
            if own := [row for row in rows if row["kind"] in kinds]:
                found |= {name: table(own) for name, table in written.items()}
        return found

    def stored(self, folder: Path) -> list[Row]:
        """The rows of every part; each has all columns of its part."""
        files = [folder / name for name in self.files if name.endswith(".csv")]
        texts = [file.read_text(encoding="utf-8") for file in files if file.is_file()]
        if not texts:
            raise FileNotFoundError(f"{folder} has no results")
        return [row for text in texts for row in rows_of_csv(text)]

    def figures(self, rows: list[Row]) -> dict[str, str]:
        extremes = [row for row in rows if row["kind"] == EXTREME]
        return tables.in_words(rows) | in_words(extremes)

    def draw(self, rows: list[Row], folder: Path) -> None:
        from .figure import error_against_time

        own = [row for row in rows if row["kind"] == TIME]
        error_against_time(own, folder / "error_time.png")

    def written(self, cases: Sequence[Case | Extreme]) -> Sequence[str]:
        present = {case.kind for case in cases}
        files = [
            name
            for kinds, written in _TABLES.items()
            if present & {*kinds}
            for name in written
        ]
        return *files, *(self.pictures if TIME in present else ())

    def complaint(self, rows: list[Row]) -> str:
        wrong = [row["case"] for row in rows if row.get("outcome") == WRONG]
        return f"{len(wrong)} wrong: {'; '.join(wrong)}" if wrong else ""


STUDY = Drape()
