"""Commands of pages, run as they are printed, and the results that pages say."""

import argparse
from collections.abc import Sequence

from ..common.tables import csv_table
from ..study import Row, Study
from .documented import DOCUMENTED
from .running import results_of as results_of_command
from .stretched import STRETCHED
from .stretched import results_of as results_of_stretched
from .tables import tables
from .words import figures


class Commands(Study[str]):
    """The commands by the names of their cases; a row for each result."""

    files = (
        "commands.csv",
        *("along_fibres.md", "on_tools.md", "fibre_stretch.md", "hole.md"),
    )
    sample = "strip"

    def cases(self, options: argparse.Namespace) -> Sequence[str]:
        return [*DOCUMENTED, *STRETCHED]

    def examine(self, case: str) -> list[Row]:
        if case in DOCUMENTED:
            results = results_of_command(DOCUMENTED[case])
        else:
            results = results_of_stretched(STRETCHED[case])
        return [
            {"case": case, "quantity": name, "value": value}
            for name, value in results.items()
        ]

    def line(self, rows: list[Row]) -> str:
        values = ", ".join(f"{row['quantity']} {row['value']:.4g}" for row in rows)
        return f"{rows[0]['case']}: {values}"

    def tables(self, rows: list[Row]) -> dict[str, str]:
        return {"commands.csv": csv_table(rows), **tables(rows)}

    def figures(self, rows: list[Row]) -> dict[str, str]:
        return figures(rows)


STUDY = Commands()
