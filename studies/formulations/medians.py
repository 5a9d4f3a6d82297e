"""Medians over the seeds, and loads beside the exact ones."""

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np

from skfem_textile.fabric import Linear

from ..angles import cases as angles
from ..angles import references
from ..study import Row
from .cases import (
    ACROSS,
    BIAS,
    METHODS,
    STRIP,
    TRELLIS,
    G,
    Method,
    Specimen,
)

#: The shear angles in degrees at which there are converged loads; the last is judged.
CONVERGED_ANGLES = angles.ANGLES
JUDGED_ANGLE = CONVERGED_ANGLES[-1]

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


def exact_load(problem: Specimen, angle: int = JUDGED_ANGLE) -> float:
    """The exact load: zero, or in the bias extension the converged one.

    The converged load comes from the study of angles at the same E/G and shear angle in
    degrees, as a share of the load of fibres that do not stretch.
    """
    if not problem.exact_load:
        return 0.0
    law = "linear" if isinstance(problem.law, Linear) else "sin²"
    ply = angles.Specimen(45.0, law, problem.E / G)
    return float(references.stored()[ply, angle]["load"])


def over_exact(rows: Sequence[Row], problem: Specimen) -> list[Row]:
    """Loads of the bias extension at `JUDGED_ANGLE` over the exact one, as ``load``."""
    return [{"load": row["load"] / exact_load(problem)} for row in rows]


def load_error(rows: Sequence[Row], problem: Specimen) -> float:
    """Median error of the load, in N or in the bias extension relative to the load."""
    exact = exact_load(problem)
    return median(
        [{"off": abs(row["load"] - exact) / (exact or 1)} for row in rows], "off"
    )


def over_angles(rows: Sequence[Row], problem: Specimen) -> tuple[float, float]:
    """The median and the single load over the exact one that are furthest from 1.

    Of all shear angles at which there are converged loads.
    """
    exact = {f"load_{angle}": exact_load(problem, angle) for angle in CONVERGED_ANGLES}
    loads = [{key: row[key] / exact[key] for key in exact} for row in rows]
    medians = [median(loads, key) for key in exact]
    return _furthest(medians), _furthest([row[key] for row in loads for key in exact])


def per_stiffness(row: Row) -> float:
    """The load of a strip over its fibre stiffness in mm."""
    return row["load"] / float(row["problem"].rpartition(" ")[2])


def errors(rows: list[Row]) -> dict[str, dict[str, dict[str, Any]]]:
    """Curves for the figure, by kind of error, problem and method."""
    shown = [m for m in METHODS if m.name not in _NOT_DRAWN]
    what = {
        "load": "Load error (N, or relative)",
        "position": "Position error (mm)",
        "angle": "Shear-angle error (°)",
    }
    curves: dict[str, dict[str, dict[str, Any]]] = {}
    for key, label in what.items():
        for problem in (STRIP, TRELLIS, BIAS[2]):
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
