"""Figs. 3 to 5 and 9 to 12 of Hamila & Boisse (2013), and the equations of §2.3."""

import argparse
from collections.abc import Sequence
from pathlib import Path

from ..common.tables import csv_table, json_text, markdown_table
from ..study import Row, Study
from . import printed, strips

#: The case of the two elements of §2.3.
TWO_ELEMENTS = "two elements"


class Paper(Study[strips.Strip | str]):
    """The strips of the figures, and the two elements."""

    files = ("paper.csv", "paper.md", "systems.json", "systems.md")
    pictures = ("contact_sheet.png", "load_curves.png")

    def cases(self, options: argparse.Namespace) -> list[strips.Strip | str]:
        return [*strips.strips(), TWO_ELEMENTS]

    def name(self, case: strips.Strip | str) -> str:
        return case if isinstance(case, str) else case.name

    def examine(self, case: strips.Strip | str) -> list[Row]:
        """A strip is one row; the two elements are one that holds their equations."""
        if isinstance(case, str):
            return [{"case": case, **printed.report()}]
        return [strips.examined(case)]

    def line(self, rows: list[Row]) -> str:
        (row,) = rows
        if "systems" in row:
            return printed.table()
        return f"{row['case']:50} {row['figures']['outcome']}"

    def tables(self, rows: list[Row]) -> dict[str, str]:
        texts = {}
        if figures := [row["figures"] for row in rows if "figures" in row]:
            lines = [
                [f"{x:.3g}" if isinstance(x, float) else x for x in row.values()]
                for row in figures
            ]
            texts["paper.csv"] = csv_table(figures)
            texts["paper.md"] = markdown_table(list(figures[0]), lines)
        for row in rows:
            if "systems" in row:
                texts["systems.md"] = printed.table()
                content = {key: row[key] for key in ("systems", "slips")}
                texts["systems.json"] = json_text(content)
        return texts

    def written(self, cases: Sequence[strips.Strip | str]) -> list[str]:
        systems = [name for name in self.files if name.startswith("systems")]
        if TWO_ELEMENTS not in cases:
            return [name for name in super().written(cases) if name not in systems]
        return systems if len(cases) == 1 else [*super().written(cases)]

    def draw(self, rows: list[Row], folder: Path) -> None:
        from .figures import draw

        by_name = {row["case"]: row for row in rows}
        run = [s for s in strips.strips() if s.name in by_name]
        if run:
            draw([(strip, by_name[strip.name]) for strip in run], folder)


STUDY = Paper()
