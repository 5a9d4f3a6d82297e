"""Errors and intervals of loads in simple shear, and of their components."""

import argparse
from collections.abc import Sequence

import numpy as np

from skfem_textile.solve.quantities import ROUNDED

from ..common.tables import grouped, having, markdown_table, median
from ..study import Part, Row, Study
from .cases import Sheared, sheared


def intervals(rows: list[Row]) -> str:
    """A line for each motion, fabric and inclination of the fibres."""
    return markdown_table(
        [
            *("across", "fabric", "fibres", "runs", "with interval", "load inside"),
            *("largest error", "half-width", "largest", "F_x inside", "F_y inside"),
            *("largest half-width of F_x, F_y", "solves"),
        ],
        [
            [across, fabric, f"{fibres}°", *_line(of)]
            for (across, fabric, fibres), of in grouped(
                rows, "across", "fabric", "fibres"
            ).items()
        ],
    )


def _line(rows: Sequence[Row]) -> list[object]:
    ran = [row for row in rows if not row["refused"]]
    known = _known(rows)
    solves = f"{median([r['solves'] for r in ran]):.0f}" if ran else ""
    runs = f"{len(ran)} of {len(rows)}" if len(ran) < len(rows) else len(rows)
    if not known:
        return [runs, 0, *[""] * 7, solves]
    widths = [row["half_width"] for row in known]
    largest = [max(_share(row, axis) for row in known) for axis in "xy"]
    return [
        runs,
        len(known),
        _count(known, is_inside),
        _percent(max(abs(row["error"]) for row in known)),
        _percent(median(widths)),
        _percent(max(widths)),
        _count(known, x_inside),
        _count(known, y_inside),
        ", ".join(map(_percent, largest)),
        solves,
    ]


def _known(rows: Sequence[Row]) -> list[Row]:
    """Rows of runs with an interval."""
    return [r for r in rows if not r["refused"] and r["half_width"] is not None]


def is_inside(row: Row) -> bool:
    """True if the converged load is in the interval, as it is printed."""
    relative = abs(row["error"]) / (1 + row["error"])
    return bool(relative <= max(row["half_width"], ROUNDED))


def x_inside(row: Row) -> bool:
    """True if the converged component along the clamps is in its interval."""
    return _component_inside(row, "x")


def y_inside(row: Row) -> bool:
    """True if the converged component across the clamps is in its interval."""
    return _component_inside(row, "y")


def _component_inside(row: Row, axis: str) -> bool:
    rounding = ROUNDED * np.hypot(row["x"], row["y"])
    off = abs(row[f"F_{axis}"] - row[axis])
    return bool(off <= max(row[f"half_{axis}"], rounding))


def _share(row: Row, axis: str) -> float:
    """Half-width of a component over the size of the force."""
    return float(row[f"half_{axis}"] / np.hypot(row["x"], row["y"]))


def _count(rows: Sequence[Row], inside: object) -> str:
    assert callable(inside)
    return f"{sum(map(inside, rows))} of {len(rows)}"


def _percent(x: float) -> str:
    return f"{100 * x:.1f} %" if x < 10 else f"{100 * x:.0f} %"


class SimpleShear(Study[Sheared]):
    """Rectangles and trapezia of three fabrics on irregular meshes."""

    parts = (Part("intervals.csv", {"intervals.md": intervals}),)
    shown = "error {error:.2%}, half-width {half_width:.2%}"
    sample = "tension, rectangle, 0°, linear, 6 across"

    def line(self, rows: list[Row]) -> str:
        """The error, or the reason why there is no interval."""
        (row,) = rows
        if not row["refused"] and row["half_width"] is None:
            return f"{row['case']}: {row['reason']}"
        return super().line(rows)

    def figures(self, rows: list[Row]) -> dict[str, str]:
        known = _known(rows)
        free = having(known, across="tension")
        widths = [row["half_width"] for row in known]
        bent = having(having(known, across="circle"), fabric="bending", fibres=0)
        return {
            "runs": str(len(rows)),
            "with_interval": str(len(known)),
            "inside": _count(known, is_inside),
            "half_width": _percent(median(widths)),
            "largest": _percent(max(widths)),
            "free_error": _percent(max(abs(row["error"]) for row in free)),
            "free_largest": _percent(max(row["half_width"] for row in free)),
            "free_solves": str(max(row["solves"] for row in free)),
            "components": _count(known, x_inside) + " and " + _count(known, y_inside),
            "bent_components": ", ".join(
                _percent(max(_share(row, axis) for row in bent)) for axis in "xy"
            ),
        }

    def cases(self, options: argparse.Namespace) -> Sequence[Sheared]:
        return [*sheared()]


STUDY = SimpleShear()
