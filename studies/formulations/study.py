"""Errors of strain, load, position and shear angle for all formulations and scenes.

The reference is the exact solution for inextensible fibres.  Tables and the figure show
medians over the seeds; if some runs failed, the number of successful runs is given.
"""

import argparse
from collections.abc import Callable, Iterable, Sequence
from typing import Any

import numpy as np

from skfem_textile.fabric import Linear

from ..angles import cases as angles
from ..common.figures import (
    File,
    legend,
    panels_of,
    plain_numbers,
    style_of,
    ticks_of_decades,
)
from ..common.tables import (
    furthest,
    having,
    markdown_table,
    median,
    minus,
    on,
    percent,
    span,
)
from ..study import Part, Row, Study
from .cases import (
    ACROSS,
    BIAS,
    BIAS_SIN2,
    FOR_LOAD,
    LOCKING,
    MACRO,
    MACRO_TRIANGLES,
    MEAN_QUADRATIC,
    METHODS,
    PAPER,
    QUADRATIC,
    SHEARED,
    SPLIT_ONE_POINT,
    STRIP,
    TRELLIS,
    Case,
    G,
    Method,
    Specimen,
    all_cases,
)

#: Shear angles in degrees with converged loads; the last one is evaluated.
CONVERGED_ANGLES = angles.ANGLES
JUDGED_ANGLE = CONVERGED_ANGLES[-1]

#: Headings of load, position and shear-angle errors for zero exact load.
_ERRORS = ["load (N)", "position error (mm)", "shear-angle error (°)"]


def of(
    rows: Iterable[Row], group: str, problem: Specimen, method: Method, across: int
) -> list[Row]:
    """Rows of the cases that differ only in the seed."""
    names = {"group": group, "problem": problem.name, "method": method.name}
    return having(rows, **names, across=across)


def _median(rows: Sequence[Row], key: str) -> float:
    return median(row[key] for row in rows)


def exact_load(problem: Specimen, angle: int = JUDGED_ANGLE) -> float:
    """The exact load: zero, or the converged load of the bias extension.

    The converged load comes from the study of angles at the same E/G and shear angle in
    degrees, relative to the load of inextensible fibres.
    """
    if not problem.exact_load:
        return 0.0
    law = "linear" if isinstance(problem.law, Linear) else "sin²"
    ply = angles.Specimen(45.0, law, problem.E / G)
    return float(angles.stored()[ply, angle]["load"])


def over_exact(rows: Sequence[Row], problem: Specimen) -> list[Row]:
    """Ratios of bias-extension load to exact load at `JUDGED_ANGLE`, as ``load``."""
    return [{"load": row["load"] / exact_load(problem)} for row in rows]


def load_error(rows: Sequence[Row], problem: Specimen) -> float:
    """Median load error, in N, or relative for the bias extension."""
    exact = exact_load(problem)
    return median(abs(row["load"] - exact) / (exact or 1) for row in rows)


def over_angles(rows: Sequence[Row], problem: Specimen) -> tuple[float, float]:
    """Median and single load ratios to the exact load that differ most from 1.

    All shear angles with converged loads are included.
    """
    exact = {f"load_{angle}": exact_load(problem, angle) for angle in CONVERGED_ANGLES}
    loads = [[row[key] / load for row in rows] for key, load in exact.items()]
    single = furthest((x for of_angle in loads for x in of_angle), 1.0)
    return furthest(map(median, loads), 1.0), single


def methods(rows: list[Row]) -> str:
    """All methods at the middle refinement: strip and trellis, then bias extension."""
    smooth, kinked = [], []
    for method in METHODS:
        strip, trellis, *bias = (
            of(rows, "methods", p, method, ACROSS[1]) for p in (STRIP, TRELLIS, *BIAS)
        )
        smooth.append(
            [
                *(method.name, _cell(strip, "unknowns", _count)),
                *(_cell(strip, key) for key in ("load", "position", "angle")),
                *(_cell(trellis, key) for key in ("position", "angle")),
            ]
        )
        kinked.append(
            [
                method.name,
                *map(_over_exact, bias, BIAS),
                *(_cell(bias[-1], key) for key in ("position", "angle")),
                _cell(bias[-1], "strain", _strain),
                _cell(bias[-1], "linear_solves", _count),
            ]
        )
    head = ["method", "unknowns", *on("strip", _ERRORS), *on("trellis", _ERRORS[1:])]
    text = markdown_table(head, smooth)
    loads = [f"load / exact, E/G = {_ratio(problem)}" for problem in BIAS]
    head = ["method", *loads, *_ERRORS[1:], "strain", "linear solves"]
    kinks = markdown_table(head, kinked)
    return text + "\n" + kinks + "\n" + _sheared(rows)


def _sheared(rows: list[Row]) -> str:
    """A smooth deformation of a fabric with shear stiffness."""
    lines = []
    for method in (*FOR_LOAD, PAPER):
        seeds = of(rows, "methods", SHEARED, method, ACROSS[1])
        errors = (_cell(seeds, key) for key in ("load", "position", "angle"))
        lines.append([method.name, *errors, _cell(seeds, "linear_solves", _count)])
    return markdown_table(["method", *_ERRORS, "linear solves"], lines)


def equal(rows: list[Row]) -> str:
    """The recommended and the paper's element at equal unknowns."""
    lines = []
    for problem in (STRIP, *BIAS[1:]):
        for across in ACROSS:
            macro, paper = (
                of(rows, "methods", problem, m, across) for m in (MACRO, PAPER)
            )
            line = [problem.name, _cell(macro, "unknowns", _count)]
            line += [_figure(load_error(seeds, problem)) for seeds in (macro, paper)]
            for key in ("position", "angle"):
                line += [_cell(seeds, key) for seeds in (macro, paper)]
            lines.append(line)
    head = ["scene", "unknowns"]
    for what in ("load error", *_ERRORS[1:]):
        head += [f"macro: {what}", f"C_s = 1 N/mm: {what}"]
    return markdown_table(head, lines)


def _ratio(problem: Specimen) -> str:
    return problem.name.rpartition("E/G = ")[2]


def _figure(x: float) -> str:
    return f"{x:.2g}"


def _load(x: float) -> str:
    return f"{x:.3f}" if x < 2 else f"{x:.3g}"


def _strain(x: float) -> str:
    return f"{x:.1e}"


def _count(x: float) -> str:
    return f"{x:.0f}"


def _over_exact(rows: Sequence[Row], problem: Specimen) -> str:
    """Ratio of the bias-extension load to the exact load."""
    return _cell(over_exact(rows, problem), "load", _load)


def _cell(rows: Sequence[Row], key: str, show: Callable[[float], str] = _figure) -> str:
    """The median, with the number of known values if some are missing."""
    known = sum(not np.isnan(row[key]) for row in rows)
    if not known:
        return "-"
    few = "" if known == len(rows) else f" ({known} of {len(rows)})"
    return show(_median(rows, key)) + few


def in_words(rows: list[Row]) -> dict[str, str]:
    """The results by name; needs the rows of all cases."""
    middle, stiffest = ACROSS[1], BIAS[-1]

    def seeds(problem: Specimen, method: Method) -> list[Row]:
        return of(rows, "methods", problem, method, middle)

    def over(problem: Specimen, method: Method) -> float:
        return _median(over_exact(seeds(problem, method), problem), "load")

    def position(problem: Specimen, method: Method) -> float:
        return _median(seeds(problem, method), "position")

    smooth = [
        position(p, MACRO) / position(p, MEAN_QUADRATIC) for p in (STRIP, TRELLIS)
    ]

    def loads(method: Method) -> list[tuple[float, float]]:
        """Median and single load ratios of largest error of the bias extensions."""
        problems = *BIAS, *BIAS_SIN2
        return [over_angles(seeds(problem, method), problem) for problem in problems]

    single = max(abs(load - 1) for _, load in loads(MEAN_QUADRATIC))
    return {
        "closer_where_smooth": f"{_range(smooth)} times",
        "locked": f"{_range(over(p, m) for p in BIAS for m in LOCKING)} times",
        "quadratic": f"{over(stiffest, QUADRATIC):.2g} times",
        "split_one_point": f"{over(stiffest, SPLIT_ONE_POINT):.2f} times",
        "quads_16": _per_cent(load for load, _ in loads(MACRO)),
        "triangles_16": _per_cent(load for load, _ in loads(MACRO_TRIANGLES)),
        "quadratic_mean_16_worst": percent(single, ".1f"),
    }


def _range(values: Iterable[float]) -> str:
    """The smallest and the largest value with two digits.

    Examples
    --------
    >>> _range([1066.2, 2.27])
    '2.3 to 1100'
    """
    return span((float(f"{value:.2g}") for value in values), "g")


def _per_cent(loads: Iterable[float]) -> str:
    """Signed deviations of load ratios from 1.

    Examples
    --------
    >>> _per_cent([1.0441, 1.03]), _per_cent([0.977, 0.986])
    ('+3.0 to +4.4 %', '−2.3 to −1.4 %')
    """
    return minus(span((100 * (load - 1) for load in loads), "+.1f")) + " %"


def draw_convergence(rows: Sequence[Row], file: File = None) -> Any:
    """Draw errors against unknowns: one row per error, one column per scene.

    A method has the same colour in all panels.
    """
    from matplotlib.ticker import LogLocator

    problems = STRIP, TRELLIS, BIAS[2]
    errors: dict[str, Callable[[list[Row], Specimen], float]] = {
        "Load error (N, or relative)": load_error,
        "Position error (mm)": lambda seeds, _: _median(seeds, "position"),
        "Shear-angle error (°)": lambda seeds, _: _median(seeds, "angle"),
    }
    methods = [m for m in METHODS if m.name not in _NOT_DRAWN]
    styles = {
        method.name: style_of(i, linestyle="-" if i < 7 else "--", linewidth=1.2)
        for i, method in enumerate(methods)
    }
    titles = [problem.name.replace(", ", "\n", 1) for problem in problems]
    form: dict[str, Any] = {"sharex": "col", "xlabel": "Unknowns", "titles": titles}
    with panels_of((6.9, 6.5), file, 8, ylabels=[*errors], **form) as (figure, grid):
        for row_of_panels, error in zip(grid, errors.values(), strict=True):
            for axes, problem in zip(row_of_panels, problems, strict=True):
                for method in methods:
                    meshes = [of(rows, "methods", problem, method, n) for n in ACROSS]
                    unknowns = [_median(seeds, "unknowns") for seeds in meshes]
                    off = [error(seeds, problem) for seeds in meshes]
                    axes.loglog(unknowns, off, markersize=4, **styles[method.name])
                ticks_of_decades(axes)
                axes.xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
                plain_numbers(axes)
                axes.grid(alpha=0.3)
        legend(figure, styles, 3)
    return figure


_NOT_DRAWN = "rates, C_s = 1 N/mm", "isotropic, κ = C/8", "one point, triangles"


class Formulations(Study[Case]):
    """All methods on all problems, on successively finer meshes."""

    parts = (
        Part(
            "formulations.csv",
            {
                "methods.md": methods,
                "equal.md": equal,
            },
            {"formulations.png": draw_convergence},
        ),
    )
    shown = "load {load:.4g}, {position:.3g} mm, {angle:.3g}°"
    sample = "methods: bias extension, linear, E/G = 2e5, macro, quads, 8 across, 1"

    def cases(self, options: argparse.Namespace) -> list[Case]:
        return list(all_cases())

    def figures(self, rows: list[Row]) -> dict[str, str]:
        return in_words(rows)


STUDY = Formulations()
