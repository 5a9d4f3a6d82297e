"""Medians over the seeds, and numbers that the page on formulations states."""

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np

from ..study import Row
from .cases import (
    ACROSS,
    ANGLES,
    AUTO,
    BIAS,
    MACRO,
    METHODS,
    STABILISATIONS,
    STRIP,
    TRELLIS,
    Method,
    Specimen,
)

# Factor by which the load may be further off than with `auto`, where C_s is compared.
_LOAD_MARGIN = 2.0

_NOT_DRAWN = ("rates, C_s = 1", "isotropic, κ = C/8", "one point, triangles")


def of(
    rows: Iterable[Row], group: str, problem: Specimen, method: Method, across: int
) -> list[Row]:
    """Rows of the cases that differ only in their seed."""
    key = (group, problem.name, method.name, across)
    names = ("group", "problem", "method", "across")
    return [row for row in rows if tuple(row[name] for name in names) == key]


def median(rows: Sequence[Row], key: str) -> float:
    """Median of the known values; nan if there is none."""
    values = [row[key] for row in rows if not np.isnan(row[key])]
    return float(np.median(values)) if values else np.nan


def load_error(rows: Sequence[Row], problem: Specimen) -> float:
    """Median distance of the load from the exact one."""
    off = [{"off": abs(row["load"] - problem.exact_load)} for row in rows]
    return median(off, "off")


def over_angles(rows: Sequence[Row]) -> tuple[float, float]:
    """The median and the single load from 10° to 40° that are furthest from exact."""
    keys = [f"load_{angle}" for angle in ANGLES if angle <= 40]
    medians = [median(rows, key) for key in keys]
    return _furthest(medians), _furthest([row[key] for row in rows for key in keys])


def per_stiffness(row: Row) -> float:
    """The load of a strip over its fibre stiffness in mm."""
    return row["load"] / float(row["problem"].rpartition(" ")[2])


def summary(rows: list[Row]) -> dict[str, Any]:
    """Numbers that the page states in words; None if a case is missing."""
    strips = [row for row in rows if row["group"] == "triangulations"]
    shares = {
        chosen.name: {
            problem.name: _known(best_position(rows, problem, chosen))
            for problem in (STRIP, TRELLIS, *BIAS)
        }
        for chosen in (AUTO, MACRO)
    }
    return {
        "cases": len(rows),
        "refused": sum(bool(row["refused"]) for row in rows),
        "not_stable": sum(row["negative_pivots"] > 0 for row in rows),
        "triangulations": {
            "largest_load_over_E": _largest(map(per_stiffness, strips)),
            "largest_strain": _largest(row["strain"] for row in strips),
            "negative_pivots": _largest(row["negative_pivots"] for row in strips),
        },
        "position_error_of_the_best_fixed_stabilisation_over_that_of": shares,
    }


def best_position(rows: list[Row], problem: Specimen, chosen: Method) -> float:
    """Smallest position error of a fixed C_s as a share of that of ``chosen``.

    Only a C_s whose load is off by at most twice as much counts; nan if there is none.
    """
    own = of(rows, "methods", problem, chosen, ACROSS[1])
    allowed = _LOAD_MARGIN * load_error(own, problem)
    rivals = [
        median(seeds, "position")
        for method in STABILISATIONS
        if (seeds := of(rows, "stabilisation", problem, method, ACROSS[1]))
        and load_error(seeds, problem) <= allowed
    ]
    return min(rivals, default=np.nan) / median(own, "position")


def errors(rows: list[Row]) -> dict[str, dict[str, dict[str, Any]]]:
    """Curves for the figure, by kind of error, problem and method."""
    shown = [m for m in METHODS if m.name not in _NOT_DRAWN]
    what = {
        "load": "Load error (N, or share)",
        "position": "Position error (mm)",
        "angle": "Shear-angle error (°)",
    }
    curves: dict[str, dict[str, dict[str, Any]]] = {}
    for key, label in what.items():
        for problem in (STRIP, TRELLIS, BIAS[0], BIAS[2]):
            title = problem.name.replace(", ", "\n", 1)
            panel = curves.setdefault(label, {}).setdefault(title, {})
            for method in shown:
                meshes = [of(rows, "methods", problem, method, n) for n in ACROSS]
                panel[method.name] = (
                    [median(seeds, "unknowns") for seeds in meshes],
                    [
                        load_error(seeds, problem)
                        if key == "load"
                        else median(seeds, key)
                        for seeds in meshes
                    ],
                )
    return curves


def _furthest(loads: Iterable[float]) -> float:
    known = [x for x in loads if not np.isnan(x)]
    return max(known, key=lambda x: abs(x - 1), default=np.nan)


def _largest(values: Iterable[float]) -> float | None:
    """The largest; None if one is missing, or all are."""
    return _known(float(np.max([*values] or [np.nan])))


def _known(x: float) -> float | None:
    return None if np.isnan(x) else x
