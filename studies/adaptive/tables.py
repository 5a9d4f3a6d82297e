"""Tables of the study of refinement, in Markdown."""

from collections.abc import Sequence

import numpy as np

from skfem_textile.solve.stepping.error_estimate import (
    LOAD_OVER_SHARE,
    SHEAR_ANGLE_OVER_CHANGE,
)

from ..common.tables import markdown_table
from ..study import Row
from .cases import TOLERANCE

#: Errors below this are small: an estimate is to stay below `_LEAST_LARGE` there.
SMALL, _LEAST_LARGE = 0.005, 0.02

#: Least and largest estimate over error that pass.
PASSES = 0.5, 3.0

#: What meshes of the comparison at equal unknowns are called.
MESHES = {
    "refined": "refined at kinks",
    "known": "refined at the exact kinks",
    "along": "along fibres, quadratic",
}


def _of(rows: Sequence[Row], task: str) -> list[Row]:
    return [row for row in rows if row["task"] == task]


def estimates(rows: Sequence[Row]) -> str:
    """How the estimate of the load does, of the cases that calibrate and that judge."""
    lines = []
    for task in ("calibrates", "judges"):
        found = _of(rows, task)
        large = [row for row in found if abs(row["error"]) > SMALL]
        small = [row for row in found if abs(row["error"]) <= SMALL]
        ratios = [(row["estimate"] or 0.0) / abs(row["error"]) for row in large]
        passed = sum(PASSES[0] <= ratio <= PASSES[1] for ratio in ratios)
        below = sum((row["estimate"] or np.inf) < _LEAST_LARGE for row in small)
        costs = [row["cost"] for row in found]
        if not found:
            continue
        lines.append(
            [
                task,
                f"{passed} of {len(large)}",
                f"{below} of {len(small)}",
                f"{np.median(costs):.0%}, {np.max(costs):.0%}",
            ]
        )
    head = [
        "cases",
        f"estimate over error from {PASSES[0]:g} to {PASSES[1]:g}",
        f"error at most {SMALL:.1%}, estimate below {_LEAST_LARGE:.0%}",
        "share of the run, median and most",
    ]
    return markdown_table(head, lines)


def factor(rows: Sequence[Row]) -> str:
    """Error over what tells of it in the cases that calibrate, and what is taken."""
    found = [row for row in _of(rows, "calibrates") if row["estimate"]]
    large = [row for row in found if abs(row["error"]) > SMALL]
    taken = SHEAR_ANGLE_OVER_CHANGE
    columns = (
        (
            "load over the share of the energy",
            [abs(r["error"]) / r["carried"] for r in large],
            LOAD_OVER_SHARE,
        ),
        (
            "shear angle over its change",
            [taken * r["angle_error"] / r["angle_estimate"] for r in found],
            taken,
        ),
    )
    lines = [
        [name, f"{np.median(x):.2f}", f"{min(x):.2f} to {max(x):.2f}", f"{now:g}"]
        for name, x, now in columns
        if x
    ]
    return markdown_table(["error", "median", "range", "taken"], lines)


def tolerances(rows: Sequence[Row]) -> str:
    """Runs to a tolerance against the reference."""
    found = _of(rows, "tolerance")
    met = [row for row in found if row["met"]]
    true = [row for row in met if abs(row["error"]) <= TOLERANCE]
    lines = [
        [
            row["case"].removeprefix("tolerance, "),
            row["unknowns"],
            f"{row['error']:.2%}",
            "-" if row["estimate"] is None else f"{row['estimate']:.2%}",
            "yes" if row["met"] else "no",
        ]
        for row in found
    ]
    head = ["case", "unknowns", "error", "estimate", "said to be met"]
    count = (
        f"Of {len(found)} runs to {TOLERANCE:.0%}, {len(met)} say that they met it, "
        f"and {len(true)} of these did.\n\n"
    )
    return count + markdown_table(head, lines)


def kinks(rows: Sequence[Row]) -> str:
    """Position errors over those of uniform meshes, interpolated at equal unknowns."""
    lines, found = [], _of(rows, "kinks")
    for row in (row for row in found if row["mesh"] != "uniform"):
        uniform = [
            other
            for other in found
            if (other["degrees"], other["mesh"]) == (row["degrees"], "uniform")
        ]
        sizes = np.log([other["unknowns"] for other in uniform])
        line = [f"{row['degrees']:g}°", MESHES[row["mesh"]], row["unknowns"]]
        for key in ("position_error", "over_area"):
            errors = np.log([other[key] for other in uniform])
            at = np.exp(np.interp(np.log(row["unknowns"]), sizes, errors))
            line += [f"{row[key]:.4f}", f"{at:.4f}", f"{row[key] / at:.2f}"]
        lines.append(line)
    over = [
        f"{name}, {what}"
        for what in ("nodes", "area")
        for name in ("error (mm)", "uniform (mm)", "ratio")
    ]
    return markdown_table(["fibres", "mesh", "unknowns", *over], lines)
