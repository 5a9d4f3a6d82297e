"""Figs. 3 to 5 and 9 to 12 of Hamila & Boisse (2013), and the equations of §2.3."""

import argparse
import csv
import json
from collections.abc import Sequence
from pathlib import Path

from ..common.tables import csv_table, json_text, markdown_table
from ..study import Row, Study
from . import printed, strips
from .strips import MEASURED

#: The case of the two elements of §2.3.
TWO_ELEMENTS = "two elements"

_STRIPS, _SYSTEMS = "paper.csv", "systems.json"

# Keys of the row of the two elements.
_REPORTED = "systems", "slips"


class Paper(Study[strips.Strip | str]):
    """The strips of the figures, and the two elements."""

    files = (_STRIPS, "paper.md", _SYSTEMS, "systems.md")
    pictures = ("contact_sheet.png", "load_curves.png")
    sample = "Fig. 4, 5, irregular, 2×2 points"
    volatile = ("drawn",)

    def cases(self, options: argparse.Namespace) -> list[strips.Strip | str]:
        return [*strips.strips(), TWO_ELEMENTS]

    def name(self, case: strips.Strip | str) -> str:
        return case if isinstance(case, str) else case.name

    def examine(self, case: strips.Strip | str) -> list[Row]:
        """A strip is one row; the two elements are one that has their equations."""
        if isinstance(case, str):
            return [printed.report()]
        return [strips.examined(case)]

    def line(self, rows: list[Row]) -> str:
        (row,) = rows
        if "systems" in row:
            return printed.table(row["systems"], row["slips"])
        return (
            f"Fig. {row['figure']}, {row['mesh']}, {row['element']}: {row['outcome']}"
        )

    def tables(self, rows: list[Row]) -> dict[str, str]:
        texts = {}
        if run := _strips(rows):
            shown = [{k: v for k, v in row.items() if k != "case"} for row in run]
            lines = [
                [f"{x:.3g}" if isinstance(x, float) else x for x in row.values()]
                for row in shown
            ]
            texts[_STRIPS] = csv_table(run)
            texts["paper.md"] = markdown_table(list(shown[0]), lines)
        for row in rows:
            if "systems" in row:
                texts[_SYSTEMS] = json_text({key: row[key] for key in _REPORTED})
                texts["systems.md"] = printed.table(row["systems"], row["slips"])
        return texts

    def stored(self, folder: Path) -> list[Row]:
        """The strips of one file, whose other cells are text, and the two elements."""
        rows: list[Row] = []
        if (file := folder / _STRIPS).is_file():
            lines = file.read_text(encoding="utf-8").splitlines()
            rows += [
                {k: float(v) if k in MEASURED else v for k, v in cells.items()}
                for cells in csv.DictReader(lines)
            ]
        if (file := folder / _SYSTEMS).is_file():
            report = json.loads(file.read_text(encoding="utf-8"))
            rows.append({"case": TWO_ELEMENTS, **report})
        if not rows:
            raise FileNotFoundError(f"no results in {folder}")
        return rows

    def figures(self, rows: list[Row]) -> dict[str, str]:
        """The largest difference that rates make at the largest C_s."""
        by_element = {row["element"]: row for row in _strips(rows)}
        energy, rate = (by_element[f"one point, Cs = 10{x}"] for x in ("", ", rate"))
        apart = max(abs(rate[key] / energy[key] - 1) for key in MEASURED)
        return {"rate_apart": f"{100 * apart:.1f} %"}

    def written(self, cases: Sequence[strips.Strip | str]) -> list[str]:
        """Pictures show every strip, and a run of some leaves them as they are."""
        whole = {x.name for x in strips.strips()} <= {self.name(x) for x in cases}
        return [*self.files, *(self.pictures if whole else ())]

    def draw(self, rows: list[Row], folder: Path) -> None:
        from .figures import draw

        drawn = [row["drawn"] for row in rows if "drawn" in row]
        draw(list(zip(strips.strips(), drawn, strict=True)), folder)


STUDY = Paper()


def _strips(rows: list[Row]) -> list[Row]:
    """The rows of strips, without what pictures need."""
    return [
        {key: value for key, value in row.items() if key != "drawn"}
        for row in rows
        if "figure" in row
    ]
