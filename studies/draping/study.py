"""Plies draped from the kinematic net: shapes with default options, and growth."""

import argparse
from collections.abc import Sequence

from ..common.tables import markdown_table
from ..study import Part, Row, Study
from .cases import PAIR, SHAPE, Pair, Shape, all_cases


def _of(rows: Sequence[Row], kind: str) -> list[Row]:
    return [row for row in rows if row["kind"] == kind]


def _share(x: float | None) -> str:
    return "–" if x is None else f"{x:.0e}"


def shapes(rows: Sequence[Row]) -> str:
    """Load factor, solves and reactions of the plies on shapes."""
    heads = "shape", "elements", "fibres", "load factor", "solves", "largest shear"
    lines = [
        [
            row["shape"],
            f"{row['cells']}×{row['cells']}",
            f"{row['fibres']:g}°",
            f"{row['load_factor']:g}",
            f"{row['solves']}",
            f"{row['shear']:.1f}°",
            _share(row["held"]),
        ]
        for row in _of(rows, SHAPE)
    ]
    return markdown_table([*heads, "reaction/loads"], lines) if lines else ""


class Draping(Study[Shape | Pair]):
    """Plies on shapes with default options; drapes from the net and by growth."""

    parts = (
        Part("shapes.csv", {"shapes.md": shapes}, cases=(f"{SHAPE},*",)),
        Part("pairs.csv", cases=(f"{PAIR},*",)),
    )
    shown = "{solves} solves"
    sample = str(Shape("hat", 12, 0.0))

    def figures(self, rows: list[Row]) -> dict[str, str]:
        on_shapes = _of(rows, SHAPE)
        known = [row for row in _of(rows, PAIR) if not row["refused"]]
        full = sum(row["load_factor"] == 1 for row in on_shapes)
        off = max(max(row["off_1_steps"], row["off_4_steps"]) for row in known)
        return {
            "full": f"{full} of {len(on_shapes)}",
            "solves": f"{min(row['solves'] for row in on_shapes)} to "
            f"{max(row['solves'] for row in on_shapes)}",
            "difference": f"{off:.2f}°",
        }

    def cases(self, options: argparse.Namespace) -> Sequence[Shape | Pair]:
        return all_cases()


STUDY = Draping()
