"""Nets on triangulated tools."""

import argparse
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from ..common.tables import cell
from ..study import Part, Row, Study
from .blade import BLADE, REFERENCE, STEERED, Blade, blade_table, draw_blade, totals
from .shapes import (
    ANGLES_ON_BOX,
    BOX,
    CELLS_OF_BOX,
    SHAPE,
    SHAPES,
    Box,
    Shape,
    box_table,
    shape_table,
    shapes_in_words,
)
from .starts import START, TOOLS, BestOfRandom, start_table, starts_in_words


class NetsOnTools(Study[Any]):
    """Nets on a published mould, and on shapes of the tests."""

    parts = (
        Part(
            "blade.csv",
            {"blade.md": blade_table},
            {"blade.png": draw_blade},
            cases=(f"{BLADE},*",),
        ),
        Part("shapes.csv", {"shapes.md": shape_table}, cases=(f"{SHAPE},*",)),
        Part("darts.csv", {"darts.md": box_table}, cases=(f"{BOX},*",)),
        Part("starts.csv", {"starts.md": start_table}, cases=(f"{START},*",)),
    )
    timed = True
    sample = str(Shape("saddle", 0.0))

    def add_options(self, parser: argparse.ArgumentParser) -> None:
        parser.add_argument(
            "--reference",
            type=Path,
            default=REFERENCE,
            metavar="DIR",
            help="folder with blade_mold (default: %(default)s)",
        )

    def cases(self, options: argparse.Namespace) -> Sequence[Any]:
        blades = [Blade(name, options.reference) for name in STEERED]
        shapes = [Shape(name, angle) for name in SHAPES for angle in (0.0, 30.0, 45.0)]
        boxes = [Box(cell, angle) for cell in CELLS_OF_BOX for angle in ANGLES_ON_BOX]
        return [*blades, *shapes, *boxes, *(BestOfRandom(name) for name in TOOLS)]

    def line(self, rows: list[Row]) -> str:
        row = rows[0]
        if row["case"].startswith(BLADE):
            text = "{away_largest:.2f} mm, {off_99:.2f}°, {seconds:.1f} s"
        elif row["case"].startswith(START):
            text = "{best:.2f}°, of random ones {random:.2f}°, {seconds:.0f} s"
        else:
            text = "area {area_error:+.2%}, {seconds:.1f} s"
        return f"{row['case']}: {cell(row, text)}"

    def figures(self, rows: list[Row]) -> dict[str, str]:
        words: dict[str, str] = {}
        if row := totals(rows).get("GeoCourse"):
            words["GeoCourse_position"] = f"{row['away_largest']:.2f} mm"
            words["GeoCourse_angle"] = f"{row['off_largest']:.2f}°"
        return words | shapes_in_words(rows) | starts_in_words(rows)


STUDY = NetsOnTools()
