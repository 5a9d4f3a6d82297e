"""Draping on a sphere, a cylinder and a cone, against exact answers."""

import argparse

from ...common.tables import csv_table
from ...study import Row, Study
from .cases import Case, all_cases
from .runs import row_of
from .tables import nets, other_drapes, published_nets, refinement, rolled


class Drape(Study[Case]):
    """Every case once, on one thread."""

    files = (
        "drape.csv",
        "refinement.md",
        "other.md",
        "nets.md",
        "published.md",
        "rolled.md",
    )
    timed = True

    def cases(self, options: argparse.Namespace) -> list[Case]:
        return list(all_cases())

    def line(self, rows: list[Row]) -> str:
        (row,) = rows
        if row["refused"]:
            return f"{row['case']}: refused, {row['refused']}"
        return f"{row['case']}: error {row['largest']:.2e}°, {row['seconds']:.2f} s"

    def examine(self, case: Case) -> list[Row]:
        """Run one case."""
        settings = {name: getattr(case, name) for name in case.__dataclass_fields__}
        return [{"case": str(case), "refused": "", **settings, **row_of(case)}]

    def tables(self, rows: list[Row]) -> dict[str, str]:
        return {
            "drape.csv": csv_table(rows),
            "refinement.md": refinement(rows),
            "other.md": other_drapes(rows),
            "nets.md": nets(rows),
            "published.md": published_nets(rows),
            "rolled.md": rolled(rows),
        }


STUDY = Drape()
