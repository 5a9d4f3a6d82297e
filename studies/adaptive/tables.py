"""Tables of the study of refinement, in Markdown."""

from collections.abc import Sequence

import numpy as np

from skfem_textile.solve.error_estimate import LOAD_OVER_SHARE, SHEAR_ANGLE_OVER_CHANGE

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
    """Ratios of estimate and error, of the cases that calibrate and that judge."""
    lines = []
    for task in ("calibrates", "judges"):
        if found := _of(rows, task):
            costs = [row["cost"] for row in found]
            cost = f"{np.median(costs):.0%}, {np.max(costs):.0%}"
            lines.append([task, *_passed(found), cost])
    head = [
        "cases",
        f"estimate over error from {PASSES[0]:g} to {PASSES[1]:g}",
        f"error at most {SMALL:.1%}, estimate below {_LEAST_LARGE:.0%}",
        "share of the run, median and most",
    ]
    return markdown_table(head, lines)


def _passed(rows: Sequence[Row]) -> tuple[str, str]:
    """How many estimates of large errors and of small errors pass."""
    large = [row for row in rows if abs(row["error"]) > SMALL]
    small = [row for row in rows if abs(row["error"]) <= SMALL]
    ratios = [(row["estimate"] or 0.0) / abs(row["error"]) for row in large]
    passed = sum(PASSES[0] <= ratio <= PASSES[1] for ratio in ratios)
    below = sum((row["estimate"] or np.inf) < _LEAST_LARGE for row in small)
    return f"{passed} of {len(large)}", f"{below} of {len(small)}"


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
    lines = [
        [
            row["case"].removeprefix("tolerance, "),
            row["unknowns"],
            f"{row['error']:.2%}",
            "-" if row["estimate"] is None else f"{row['estimate']:.2%}",
            "yes" if row["met"] else "no",
        ]
        for row in _of(rows, "tolerance")
    ]
    head = ["case", "unknowns", "error", "estimate", "reported as met"]
    return markdown_table(head, lines)


def kinks(rows: Sequence[Row]) -> str:
    """Position errors over those of uniform meshes, interpolated at equal unknowns."""
    lines, found = [], _of(rows, "kinks")
    for row in (row for row in found if row["mesh"] != "uniform"):
        line = [f"{row['degrees']:g}°", MESHES[row["mesh"]], row["unknowns"]]
        for key in _POSITIONS:
            at = _uniform(found, row, key)
            line += [f"{row[key]:.4f}", f"{at:.4f}", f"{row[key] / at:.2f}"]
        lines.append(line)
    over = [
        f"{name}, {what}"
        for what in ("nodes", "area")
        for name in ("error (mm)", "uniform (mm)", "ratio")
    ]
    return markdown_table(["fibres", "mesh", "unknowns", *over], lines)


_POSITIONS = "position_error", "over_area"


def _uniform(rows: Sequence[Row], row: Row, key: str) -> float:
    """The error of uniform meshes with as many unknowns as a row has."""
    uniform = [
        other
        for other in rows
        if (other["degrees"], other["mesh"]) == (row["degrees"], "uniform")
    ]
    sizes = np.log([other["unknowns"] for other in uniform])
    errors = np.log([other[key] for other in uniform])
    return float(np.exp(np.interp(np.log(row["unknowns"]), sizes, errors)))


def in_words(rows: Sequence[Row]) -> dict[str, str]:
    """The results that pages say, by name."""
    large, _ = _passed(_of(rows, "judges"))
    runs = _of(rows, "tolerance")
    within = [row for row in runs if abs(row["error"]) <= TOLERANCE]
    met = [row for row in runs if row["met"]]
    right = [row for row in met if row in within]
    words = {
        "estimates": large,
        "within": f"{len(within)} of {len(runs)}",
        "met": f"{len(met)} of {len(runs)}",
        "right": f"{len(right)} of {len(met)}",
        "met_worst": f"{max(abs(row['error']) for row in met):.2%}".replace("%", " %"),
    }
    found = _of(rows, "kinks")
    for mesh in MESHES:
        ratios = [
            row[key] / _uniform(found, row, key)
            for row in found
            if row["mesh"] == mesh
            for key in _POSITIONS
        ]
        words[mesh] = f"{min(ratios):.2f} to {max(ratios):.2f}"
    return words
