"""Plies formed between tools: a reference hemisphere, and random ones."""

import argparse
from collections.abc import Sequence
from statistics import median

from ..common.tables import markdown_table
from ..study import Part, Row, Study
from .cases import (
    DEEP,
    RANDOM,
    REFERENCE,
    REFINED,
    SLACK,
    Random,
    Reference,
    Refined,
    all_cases,
)

# Kinds of random hemispheres, and their names in tables.
_KINDS = {
    RANDOM: "with tension and bending",
    SLACK: "slack",
    DEEP: "deep cups, with tension and bending",
}

# Differences in shear angle (degrees) and force (relative) within which two runs found
# the same state.
_CLOSE_DEG, _CLOSE = 0.01, 1e-3

# Outcomes of a run, in the order of the table.
_OUTCOMES = "right", "warned", "unconfirmed", "wrong", "refused"


def _of(rows: Sequence[Row], kind: str) -> list[Row]:
    return [row for row in rows if row["kind"] == kind]


def outcome(row: Row) -> str:
    """Right, warned, unconfirmed, wrong or refused.

    Wrong is a run that converges without a warning, to another state than the run with
    twice as many steps does; unconfirmed is one for which the latter is refused.
    """
    if row["refused"]:
        return "refused"
    if row["refused_of_more_steps"]:
        return "unconfirmed"
    off = abs(row["force"] - row["force_in_more_steps"])
    same = row["off_in_more_steps"] <= _CLOSE_DEG
    if same and off <= _CLOSE * abs(row["force"]):
        return "right"
    return "wrong" if row["path_resolved"] else "warned"


def reference(rows: Sequence[Row]) -> str:
    """Angle, force, draw-in and solves of the reference hemisphere."""
    heads = [
        *("parts a side", "steps", "tools", "largest shear angle", "punch force (N)"),
        *("draw-in, axis (mm)", "diagonal (mm)", "smallest gap (mm)"),
        *("unbalanced force", "solves", "seconds"),
    ]
    lines = [
        [
            f"{row['parts']}",
            f"{row['steps']}",
            "triangles" if row["triangles"] else "exact",
            f"{row['shear']:.3f}°",
            f"{row['force']:.3f}",
            f"{row['draw_in_axis']:.3f}",
            f"{row['draw_in_diagonal']:.3f}",
            f"{row['gap']:.0e}",
            f"{row['unbalanced']:.0e}",
            f"{row['solves']}",
            f"{row['seconds']:.1f}",
        ]
        for row in _of(rows, REFERENCE)
        if not row["refused"]
    ]
    return markdown_table(heads, lines) if lines else ""


def outcomes(rows: Sequence[Row]) -> str:
    """Outcomes of the random hemispheres."""
    heads = ["plies", *_OUTCOMES, "OnePoint() within both"]
    lines = []
    for kind, name in _KINDS.items():
        if of_kind := _of(rows, kind):
            found = [outcome(row) for row in of_kind]
            counts = [found.count(x) for x in _OUTCOMES]
            lines.append([name, *map(str, counts), _within(of_kind)])
    return markdown_table(heads, lines) if lines else ""


def _in_both(rows: Sequence[Row]) -> list[Row]:
    """Rows with a state in both formulations."""
    return [x for x in rows if not (x["refused"] or x["refused_of_one_point"])]


def _within(rows: Sequence[Row]) -> str:
    both = _in_both(rows)
    within = sum(x["rms_of_one_point"] <= x["interval"] for x in both)
    return f"{within} of {len(both)}"


def intervals(rows: Sequence[Row]) -> str:
    """Number of intervals that contain the shear angles of a finer mesh."""
    found = [
        row["error"] / row["interval"]
        for row in _of(rows, REFINED)
        if not (row["refused"] or row["refused_of_finer"])
    ]
    if not found:
        return ""
    heads = ["hemispheres", "error inside the interval", "median of error / interval"]
    inside = sum(share <= 1 for share in found)
    line = [f"{len(found)}", f"{inside}", f"{median(found):.2f}"]
    return markdown_table(heads, [line])


class Forming(Study[Reference | Random | Refined]):
    """Reference hemisphere, and hemispheres drawn at random by a seed."""

    parts = (
        Part("reference.csv", {"reference.md": reference}, cases=(f"{REFERENCE},*",)),
        Part(
            "random.csv",
            {"outcomes.md": outcomes},
            cases=tuple(f"{kind},*" for kind in _KINDS),
        ),
        Part("refined.csv", {"intervals.md": intervals}, cases=(f"{REFINED},*",)),
    )
    shown = "{solves} solves"
    sample = str(Reference(6, 5))

    def add_options(self, parser: argparse.ArgumentParser) -> None:
        """Add the seed."""
        parser.add_argument(
            "--seed", type=int, default=2043, help="seed of the random cases"
        )

    def cases(
        self, options: argparse.Namespace
    ) -> Sequence[Reference | Random | Refined]:
        """See `all_cases`."""
        return all_cases(options.seed)


STUDY = Forming()
