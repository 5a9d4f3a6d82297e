"""Medians over seeds, Pareto fronts of codes, and time ratios."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from ..common.tables import Row
from .cases import CODE, GIVEN_UP, Load, ThisLibrary, converged

#: Sets of linear solvers, with the solver names in the rows.
SETS = {"required": ("required", "MUMPS"), "fastest": ("fastest", "MUMPS")}

# Relative tolerance for equal errors: codes with the same element differ by the Newton
# tolerance.
_SAME = 1e-3

#: Minimum number of seeds with a result for a mesh to count.
LEAST_SEEDS = 3


@dataclass(frozen=True)
class Criterion:
    """An error measure of a scene, and the levels at which codes are compared.

    With the unit ``%`` errors are relative.
    """

    scene: str
    label: str
    unit: str
    levels: tuple[float, ...]
    error: Callable[[Row, Load | None], float | None]

    @property
    def factor(self) -> float:
        """Conversion factor of the error to its unit."""
        return 100.0 if self.unit == "%" else 1.0

    def text(self, error: float, digits: int = 2) -> str:
        """An error with its unit."""
        return f"{self.number(error, digits)} {self.unit}".replace(" °", "°")

    def number(self, error: float, digits: int = 2) -> str:
        """An error in its unit, with significant digits or as an integer."""
        value = self.factor * error
        return f"{value:.0f}" if value >= 10**digits else f"{value:.{digits}g}"


def _angle(row: Row, reference: Load | None) -> float | None:
    return row.get("angle")


def _force(row: Row, reference: Load | None) -> float | None:
    return row.get("load")


def _load(row: Row, reference: Load | None) -> float | None:
    load = row.get("load")
    if load is None or reference is None:
        return None
    return abs(load / reference.load - 1)


_ANGLE, _LOAD = "strip, rms shear-angle error", "bias extension, load error"

#: The criteria by name.
CRITERIA = {
    "angle": Criterion("strip", _ANGLE, "°", (0.2, 0.1, 0.02), _angle),
    "force": Criterion("strip", "strip, load error", "N", (10.0, 1.0, 0.1), _force),
    "load": Criterion("bias_extension", _LOAD, "%", (0.1, 0.05, 0.03), _load),
}


class Spread(NamedTuple):
    """Median, smallest and largest value over several seeds."""

    median: float
    least: float
    most: float


@dataclass(frozen=True)
class Point:
    """An element of a code on a mesh, over all seeds.

    ``worst`` is the error with the largest median on this mesh and on all finer ones.
    """

    code: str
    element: str
    solver: str
    across: int
    seeds: int
    unknowns: float
    steps: float
    solves: float
    error: Spread
    seconds: Spread
    worst: Spread

    @property
    def within(self) -> float:
        """The largest median error on this mesh and on all finer ones."""
        return self.worst.median

    @property
    def mesh(self) -> str:
        """Description of the mesh."""
        return f"{self.across} across"


Method = tuple[str, str, str]


def methods(rows: Sequence[Row], criterion: Criterion) -> dict[Method, list[Point]]:
    """The points of each code, element and solver, from coarse to fine.

    A mesh counts if `LEAST_SEEDS` seeds have a result.  Failed seeds count as infinite
    values in medians, and a mesh on which most seeds failed as an infinite error.  If
    the search for a number of steps was given up, refinement ends without a failure.
    """
    reference, by = converged(rows), dict[Method, dict[int, list[Row]]]()
    for row in rows:
        if row["scene"] == criterion.scene and row["code"] != CODE and row["across"]:
            method = row["code"], row["element"], row["solver"]
            by.setdefault(method, {}).setdefault(row["across"], []).append(row)
    points = {}
    for method, meshes in by.items():
        worst, series = Spread(0.0, 0.0, 0.0), list[Point]()
        for across, runs in sorted(meshes.items(), reverse=True):
            runs = [run for run in runs if GIVEN_UP not in (run.get("note") or "")]
            errors = [criterion.error(run, reference) for run in runs]
            failed = sum(bool(run.get("note")) for run in runs)
            if 2 * failed > len(runs):
                worst = Spread(np.inf, np.inf, np.inf)
            if sum(error is not None for error in errors) < LEAST_SEEDS:
                continue
            error = _spread(errors)
            worst = max(worst, error)
            point = Point(
                *method,
                across=across,
                seeds=sum(one is not None for one in errors),
                unknowns=_spread([run["unknowns"] for run in runs]).median,
                steps=_spread([run["steps"] for run in runs]).median,
                solves=_spread([run["linear_solves"] for run in runs]).median,
                error=error,
                seconds=_spread([run["seconds"] for run in runs]),
                worst=worst,
            )
            series.insert(0, point)
        points[method] = series
    return points


def _spread(values: Sequence[float | None]) -> Spread:
    """Median and range; failed seeds, None, count as infinite in the median."""
    known = [value for value in values if value is not None]
    padded = known + [np.inf] * (len(values) - len(known))
    return Spread(float(np.median(padded)), min(known), max(known))


Fronts = dict[str, list[Point]]


def fronts(rows: Sequence[Row], criterion: Criterion, solvers: str) -> Fronts:
    """The Pareto front of each code, ordered by decreasing error.

    A point is on the front if no other point of its code is faster with an error as
    small on its mesh and on all finer meshes of its element.
    """
    by_code: Fronts = {}
    series = methods(rows, criterion).items()
    points = [x for method, own in series if method[2] in SETS[solvers] for x in own]
    for code in dict.fromkeys(point.code for point in points):
        front = by_code[code] = list[Point]()
        own = (point for point in points if point.code == code)
        for point in sorted(own, key=lambda p: (p.seconds.median, p.within)):
            if not front or point.within < front[-1].within:
                front.append(point)
    return by_code


def fastest(front: Sequence[Point], error: float) -> Point | None:
    """The fastest point of a front with this error, or None."""
    reached = (point for point in front if point.within <= (1 + _SAME) * error)
    return next(reached, None)


class Comparison(NamedTuple):
    """Points of this library and another code; None if the error is not reached."""

    own: Point | None
    other: Point | None

    @property
    def ratio(self) -> float | None:
        """Ratio of the run times, other code to this library."""
        return self._ratio(lambda point: point.seconds.median)

    @property
    def solves(self) -> float | None:
        """Ratio of the numbers of linear solves, other code to this library."""
        return self._ratio(lambda point: point.solves)

    @property
    def per_solve(self) -> float | None:
        """Ratio of the times per linear solve, other code to this library."""
        return self._ratio(lambda point: point.seconds.median / point.solves)

    def _ratio(self, of: Callable[[Point], float]) -> float | None:
        return of(self.other) / of(self.own) if self.own and self.other else None


def compared(by_code: Fronts, error: float) -> Comparison:
    """Points of this library and of the fastest other code for an error."""
    reached = {code: fastest(front, error) for code, front in by_code.items()}
    this_library = reached.pop(ThisLibrary.code, None)
    others = [point for point in reached.values() if point]
    other = min(others, key=lambda point: point.seconds.median, default=None)
    return Comparison(this_library, other)


def ratios(by_code: Fronts) -> list[tuple[float, float]]:
    """Time ratios by error, from large to small errors.

    A ratio applies from its error up to the previous one.
    """
    levels = {point.within for front in by_code.values() for point in front}
    known, before = list[tuple[float, float]](), np.inf
    for error in sorted(levels, reverse=True):
        ratio = compared(by_code, error).ratio
        if ratio is not None and error < (1 - _SAME) * before:
            known.append((error, ratio))
            before = error
    return known
