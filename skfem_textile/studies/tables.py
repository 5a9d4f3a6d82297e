"""Tables of the study of formulations: medians over the seeds, in Markdown."""

from collections.abc import Callable, Iterable, Sequence
from typing import Any

import numpy as np

from ..formulations import Macro
from .comparison import (
    ACROSS,
    ANGLES,
    AUTO,
    BIAS,
    BIAS_SIN2,
    DEVIATIONS,
    FOR_LOAD,
    MACRO,
    MACRO_TRIANGLES,
    METHODS,
    PAPER,
    RESOLVED,
    STABILISATIONS,
    STRIP,
    TRELLIS,
    Method,
    Problem,
)

Row = dict[str, Any]

# The load may be off by so much more than that of `auto`, in the comparison of C_s.
_LOAD_MARGIN = 2.0


def methods(rows: list[Row]) -> str:
    """Every method at the middle refinement."""
    lines = []
    for method in METHODS:
        on = {p: _of(rows, "methods", p, method, ACROSS[1]) for p in _SCENES}
        strip, trellis, *bias = on.values()
        lines.append(
            [
                method.name,
                f"{_median(strip, 'unknowns'):.0f}",
                _figure(_median(strip, "load")),
                *(_figure(_median(strip, key)) for key in ("position", "angle")),
                *(_strain(_median(strip, key)) for key in ("strain", "strain_2x2")),
                _figure(_median(trellis, "position")),
                *(_load(_median(some, "load")) for some in bias),
                *(_figure(_median(bias[1], key)) for key in ("position", "angle")),
                f"{_median(bias[1], 'solves'):.0f}",
                str(sum(bool(row["refused"]) for some in on.values() for row in some)),
            ]
        )
    head = [
        "",
        "unknowns",
        "strip: N",
        "mm",
        "°",
        "strain",
        "strain 2×2",
        "trellis: mm",
    ]
    head += [f"bias: load, {problem.E / 0.5:.0e}" for problem in BIAS]
    return _table([*head, "mm", "°", "solves", "refused"], lines)


def load(rows: list[Row]) -> str:
    """The load of the bias extension: worst median and worst case over 10° to 40°."""
    lines = []
    for method in FOR_LOAD:
        for problem in (*BIAS, *BIAS_SIN2):
            line = [method.name, problem.name.removeprefix("bias extension, ")]
            for across in ACROSS[1:]:
                some = _of(rows, "methods", problem, method, across)
                median, worst = _over_angles(some)
                line += [_load(x) for x in (median, worst, _median(some, "load_50"))]
            lines.append(line)
    head = ["", "law, E/G"]
    for across in ACROSS[1:]:
        head += [f"{across} across: median", "worst", "50°"]
    return _table(head, lines) + "\n" + _resolved(rows)


def _resolved(rows: list[Row]) -> str:
    lines = []
    for method in (MACRO, AUTO):
        line = [method.name]
        for problem in BIAS:
            some = _of(rows, "resolved", problem, method, RESOLVED)
            line.append(_load(_median(some, "load")))
        lines.append(line)
    head = [f"load at {RESOLVED} across"]
    return _table(
        [*head, *(p.name.removeprefix("bias extension, ") for p in BIAS)], lines
    )


def constants(rows: list[Row]) -> str:
    """Errors with other constants than those of ``auto``."""
    problems = (STRIP, TRELLIS, *BIAS)
    lines = []
    for method in (*STABILISATIONS, AUTO, MACRO):
        group = "methods" if method in METHODS else "stabilisation"
        line = [method.name]
        for problem in problems:
            some = _of(rows, group, problem, method, ACROSS[1])
            if problem != TRELLIS:
                show = _figure if problem == STRIP else _load
                line.append(show(_median(some, "load")))
            line.append(_figure(_median(some, "position")))
        lines.append(line)
    head = ["", "strip: N", "mm", "trellis: mm"]
    for problem in BIAS:
        head += [f"bias: load, {problem.E / 0.5:.0e}", "mm"]
    return _table(head, lines) + "\n" + _deviations(rows)


def _deviations(rows: list[Row]) -> str:
    lines = []
    of_triangles, of_quads = Macro().deviation
    for mesh, chosen, c in (
        ("quads", MACRO, of_quads),
        ("triangles", MACRO_TRIANGLES, of_triangles),
    ):
        own = [m for m in DEVIATIONS if m.mesh == mesh]
        for method in (*own[:2], chosen, *own[2:]):
            group = "methods" if method is chosen else "deviation"
            line = [f"**{mesh}, {c:g}**" if method is chosen else method.name]
            for across in ACROSS[:2]:
                for problem in (*BIAS[::2], *BIAS_SIN2[::2]):
                    some = _of(rows, group, problem, method, across)
                    line.append(_load(_median(some, "load")))
            lines.append(line)
    shown = [
        p.name.removeprefix("bias extension, ") for p in (*BIAS[::2], *BIAS_SIN2[::2])
    ]
    head = [
        f"{n} across: {name}" if i == 0 else name
        for n in ACROSS[:2]
        for i, name in enumerate(shown)
    ]
    return _table(["deviation", *head], lines)


def triangulations(rows: list[Row]) -> str:
    """Ten Delaunay triangulations of the strip, with two fibre stiffnesses."""
    some = [row for row in rows if row["group"] == "triangulations"]
    lines = []
    for across in dict.fromkeys(row["across"] for row in some):
        own = [row for row in some if row["across"] == across]
        lines.append(
            [
                str(own[0]["elements"] // 3),
                ", ".join(f"{_per_stiffness(row):.1e}" for row in own),
                ", ".join(_strain(row["strain"]) for row in own),
                ", ".join(f"{row['position']:.2e}" for row in own),
                ", ".join(f"{row['negative_pivots']:.0f}" for row in own),
            ]
        )
    return _table(
        ["triangles", "load / E", "own strain", "mm", "negative pivots"], lines
    )


def _per_stiffness(row: Row) -> float:
    return row["load"] / float(row["problem"].rpartition(" ")[2])


def equal(rows: list[Row]) -> str:
    """The recommended element and the paper's, at equal unknowns."""
    lines = []
    for problem in (STRIP, *BIAS):
        for across in ACROSS:
            line = [problem.name, ""]
            for key in ("load", "position", "angle"):
                for method in (MACRO, PAPER):
                    some = _of(rows, "methods", problem, method, across)
                    line[1] = f"{_median(some, 'unknowns'):.0f}"
                    error = _load_error(some, problem) if key == "load" else None
                    line.append(_figure(_median(some, key) if error is None else error))
            lines.append(line)
    head = ["", "unknowns"]
    for what in ("load off by", "mm", "°"):
        head += [f"{what}: macro", "C_s = 1"]
    return _table(head, lines)


#: The tables by name.
TABLES: dict[str, Callable[[list[Row]], str]] = {
    "methods": methods,
    "load": load,
    "constants": constants,
    "triangulations": triangulations,
    "equal": equal,
}

_SCENES = (STRIP, TRELLIS, *BIAS)


def findings(rows: list[Row]) -> dict[str, Any]:
    """What the report states in words, as numbers."""
    strips = [row for row in rows if row["group"] == "triangulations"]
    better: dict[str, Any] = {}
    for problem in (STRIP, TRELLIS, *BIAS):
        for chosen in (AUTO, MACRO):
            share = _best_position(rows, problem, chosen)
            better.setdefault(chosen.name, {})[problem.name] = share
    return {
        "triangulations": {
            "largest_load_over_E": max(map(_per_stiffness, strips), default=np.nan),
            "largest_strain": max((row["strain"] for row in strips), default=np.nan),
            "negative_pivots": sum(row["negative_pivots"] for row in strips),
        },
        "position_error_of_the_best_fixed_stabilisation_over_that_of": better,
    }


def errors(rows: list[Row]) -> dict[str, dict[str, dict[str, Any]]]:
    """Curves for the figure: by what is off, by problem, by method."""
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
                some = [_of(rows, "methods", problem, method, n) for n in ACROSS]
                panel[method.name] = (
                    [_median(s, "unknowns") for s in some],
                    [
                        _load_error(s, problem) if key == "load" else _median(s, key)
                        for s in some
                    ],
                )
    return curves


_NOT_DRAWN = ("rates, C_s = 1", "isotropic, κ = C/8", "one point, triangles")


def _best_position(rows: list[Row], problem: Problem, chosen: Method) -> float:
    """Smallest position error of a fixed C_s, of those whose load is not far worse."""
    own = _of(rows, "methods", problem, chosen, ACROSS[1])
    allowed = _LOAD_MARGIN * _load_error(own, problem)
    rivals = [
        _median(some, "position")
        for method in STABILISATIONS
        if (some := _of(rows, "stabilisation", problem, method, ACROSS[1]))
        and _load_error(some, problem) <= allowed
    ]
    return min(rivals, default=np.nan) / _median(own, "position")


def _of(
    rows: Iterable[Row], group: str, problem: Problem, method: Method, across: int
) -> list[Row]:
    key = (group, problem.name, method.name, across)
    names = ("group", "problem", "method", "across")
    return [row for row in rows if tuple(row[name] for name in names) == key]


def _median(rows: Sequence[Row], key: str) -> float:
    values = [row[key] for row in rows if not np.isnan(row[key])]
    return float(np.median(values)) if values else np.nan


def _load_error(rows: Sequence[Row], problem: Problem) -> float:
    """Median distance of the load from the exact one, which is none on the strip."""
    exact = 1.0 if problem in BIAS else 0.0
    values = [abs(row["load"] - exact) for row in rows if not np.isnan(row["load"])]
    return float(np.median(values)) if values else np.nan


def _over_angles(rows: Sequence[Row]) -> tuple[float, float]:
    """Of 10° to 40° the median and the single load that are furthest from the exact."""
    keys = [f"load_{angle}" for angle in ANGLES if angle <= 40]
    medians = [_median(rows, key) for key in keys]
    return _furthest(medians), _furthest([row[key] for row in rows for key in keys])


def _furthest(loads: Iterable[float]) -> float:
    known = [x for x in loads if not np.isnan(x)]
    return max(known, key=lambda x: abs(x - 1), default=np.nan)


def _load(x: float) -> str:
    return "-" if np.isnan(x) else f"{x:.3f}" if x < 2 else f"{x:.3g}"


def _figure(x: float) -> str:
    return "-" if np.isnan(x) else f"{x:.2g}"


def _strain(x: float) -> str:
    return "-" if np.isnan(x) else f"{x:.1e}"


def _table(head: Sequence[str], lines: Iterable[Sequence[str]]) -> str:
    text = [f"| {' | '.join(head)} |", "|" + "---|" * len(head)]
    return "\n".join(text + [f"| {' | '.join(line)} |" for line in lines]) + "\n"
