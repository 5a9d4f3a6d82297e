"""Plies draped from the kinematic net: shapes with default options, and growth."""

import argparse
from collections.abc import Sequence

from ..common.tables import grouped, markdown_table
from ..study import Part, Row, Study
from .cases import PAIR, SHAPE, Pair, Shape, all_cases


def _of(rows: Sequence[Row], kind: str) -> list[Row]:
    return [row for row in rows if row["kind"] == kind]


def shapes(rows: Sequence[Row]) -> str:
    """Largest shear angle and solves of the plies on shapes, by the mesh."""
    on_shapes = _of(rows, SHAPE)
    cells = list(grouped(on_shapes, "cells"))
    lines = []
    for (shape, fibres), group in grouped(on_shapes, "shape", "fibres").items():
        by_mesh = {x["cells"]: f"{x['shear']:.1f}°, {x['solves']}" for x in group}
        lines.append([shape, f"{fibres:g}°", *(by_mesh.get(n, "-") for n in cells)])
    head = ["largest shear angle, solves", "fibres", *(f"{n}×{n}" for n in cells)]
    return markdown_table(head, lines) if lines else ""


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
