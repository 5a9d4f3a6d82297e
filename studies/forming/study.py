"""Plies formed between tools: a reference hemisphere, and random ones."""

import argparse
from collections.abc import Sequence
from statistics import median

from ..common.tables import markdown_table
from ..study import Part, Row, Study
from .cases import (
    CHOSEN,
    DEEP,
    JUDGED,
    PEAK,
    RANDOM,
    REFERENCE,
    SLACK,
    AnyCase,
    Reference,
    all_cases,
)
from .outlines import OUTLINE, outline_table

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
    """Number of intervals that contain the results of a finer mesh."""
    names = {JUDGED: "judged", CHOSEN: "chosen"}
    heads = ["quantity", "plies", "inside", "half-width over error, median"]
    heads += ["error, median", "error, largest", "half-width, median"]
    lines = []
    for kind, name in names.items():
        of_kind = [row for row in _of(rows, kind) if not row["refused"]]
        if not of_kind:
            continue
        compared = {
            "punch force": [_pair(row, "force", "%") for row in of_kind],
            "largest shear angle": [_pair(row, "angle", "°") for row in of_kind],
            "field": [(row["error"], row["interval"]) for row in of_kind],
        }
        for quantity, pairs in compared.items():
            unit = " %" if quantity == "punch force" else "°"
            errors, halves = zip(*pairs, strict=True)
            inside = sum(error <= half for error, half in pairs)
            over = median(half / error for error, half in pairs)
            numbers = median(errors), max(errors), median(halves)
            line = [f"{quantity}, {name}", f"{len(pairs)}", f"{inside}", f"{over:.1f}"]
            lines.append(line + [f"{x:.2f}{unit}" for x in numbers])
    return markdown_table(heads, lines) if lines else ""


def _pair(row: Row, name: str, unit: str) -> tuple[float, float]:
    """Error and half-width of a quantity, in % of the finer one or in degrees.

    The half-width is 0 where there is no interval.
    """
    scale = 100 / abs(row[f"{name}_on_finer"]) if unit == "%" else 1.0
    off = abs(row[name] - row[f"{name}_on_finer"])
    return scale * off, scale * (row[f"half_width_of_{name}"] or 0.0)


def peaks(rows: Sequence[Row]) -> str:
    """Field, largest angle and force of the reference hemisphere with intervals."""
    heads = ["parts a side", "unknowns", "field, rms error", "largest at centres"]
    heads += ["recovered", "punch force (N)"]
    lines = [
        [
            f"{row['parts']}",
            f"{row['unknowns']}",
            f"{row['field']:.2f}°",
            f"{row['raw']:.2f}°",
            f"{row['angle']:.2f} ± {row['half_width_of_angle']:.2f}°",
            f"{row['force']:.2f} ± {row['half_width_of_force']:.2f}",
        ]
        for row in _of(rows, PEAK)
    ]
    return markdown_table(heads, lines) if lines else ""


class Forming(Study[AnyCase]):
    """Reference hemisphere, and plies drawn at random by a seed."""

    parts = (
        Part("reference.csv", {"reference.md": reference}, cases=(f"{REFERENCE},*",)),
        Part(
            "random.csv",
            {"outcomes.md": outcomes},
            cases=tuple(f"{kind},*" for kind in _KINDS),
        ),
        Part(
            "compared.csv",
            {"intervals.md": intervals},
            cases=(f"{CHOSEN},*", f"{JUDGED},*"),
        ),
        Part("peak.csv", {"peak.md": peaks}, cases=(f"{PEAK},*",)),
        Part("outlines.csv", {"outlines.md": outline_table}, cases=(f"{OUTLINE},*",)),
    )
    shown = "{solves} solves"
    sample = str(Reference(6, 5))

    def add_options(self, parser: argparse.ArgumentParser) -> None:
        """Add the seed."""
        parser.add_argument(
            "--seed", type=int, default=2043, help="seed of the random cases"
        )

    def cases(self, options: argparse.Namespace) -> Sequence[AnyCase]:
        """See `all_cases`."""
        return all_cases(options.seed)


STUDY = Forming()
