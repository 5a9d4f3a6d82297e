"""Outcomes of exported tools by shape."""

import argparse
from collections import Counter
from collections.abc import Sequence

from ..common.tables import grouped, having, markdown_table
from ..study import Part, Row, Study
from .exports import EACH, SEED, SHAPES, Export

#: Outcomes, in table order: within the tolerances; a line names the true cause; beyond
#: the tolerances without a line; a line that is not true.
OUTCOMES = "right", "warned", "refused", "silent", "wrong line"

# Scatter relative to the mean edge below which no export may be refused.
_FINE = 1.001e-3


def outcomes(rows: list[Row]) -> str:
    """A line for each shape, and one for all."""
    lines = [_line(shape, of) for shape, of in grouped(rows, "shape").items()]
    if len(lines) > 1:
        lines.append(_line("all", rows))
    head = [
        "tool",
        "exports",
        *OUTCOMES,
        "largest error of the shear angle where right",
    ]
    return markdown_table(head, lines)


def _line(shape: str, rows: Sequence[Row]) -> list[object]:
    counts = Counter(row["outcome"] for row in rows)
    right = [row["shear_error_deg"] for row in having(rows, outcome="right")]
    largest = f"{max(right):.2f}°" if right else ""
    return [shape, len(rows), *(counts[one] for one in OUTCOMES), largest]


def _refused_without_cause(rows: Sequence[Row]) -> list[Row]:
    """Refused exports of fine scatter that are not thin shells."""
    refused = having(rows, outcome="refused")
    return [r for r in refused if r["scatter"] <= _FINE and not r["thickness"]]


class Tools(Study[Export]):
    """Exports drawn by recorded seeds; fails if a result or a line is wrong."""

    parts = (Part("exports.csv", {"outcomes.md": outcomes}),)
    shown = "{outcome}"
    sample = f"saddle {SEED + list(SHAPES).index('saddle')}"

    def cases(self, options: argparse.Namespace) -> Sequence[Export]:
        return [
            Export.drawn(shape, SEED + len(SHAPES) * number + i)
            for i, shape in enumerate(SHAPES)
            for number in range(EACH)
        ]

    def name(self, case: Export) -> str:
        return case.name()

    def figures(self, rows: list[Row]) -> dict[str, str]:
        wrong = [row for row in rows if row["outcome"] in OUTCOMES[3:]]
        return {
            "exports": str(len(rows)),
            "right": str(len(having(rows, outcome="right"))),
            "one_line": str(sum(r["outcome"] in OUTCOMES[1:3] for r in rows)),
            "wrong": str(len(wrong)),
        }

    def complaint(self, rows: list[Row]) -> str:
        bad = [row for row in rows if row["outcome"] in OUTCOMES[3:]]
        bad += _refused_without_cause(rows)
        return f"{len(bad)} export(s) with a wrong result or line" if bad else ""


STUDY = Tools()
