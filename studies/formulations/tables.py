"""Tables of the study of formulations: medians over the seeds, in Markdown.

If not every seed reached a figure, the table says how many did.
"""

from collections.abc import Callable, Sequence

import numpy as np

from skfem_textile.ply.formulations import Macro

from ..common.tables import markdown_table
from ..study import Row
from .cases import (
    ACROSS,
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
    SHEARED,
    STABILISATIONS,
    STRIP,
    TRELLIS,
    Specimen,
)
from .medians import (
    load_error,
    median,
    of,
    over_angles,
    over_exact,
    per_stiffness,
)

_STRAINS = ("strain", "mesh_fibre_strain")

#: Heads of load, position and shear angle where the exact load is zero.
_ERRORS = ["load (N)", "position off by (mm)", "shear angle off by (°)"]


def methods(rows: list[Row]) -> str:
    """Every method at the middle refinement: strip and trellis, then bias extension."""
    smooth, kinked = [], []
    for method in METHODS:
        strip, trellis, *bias = (
            of(rows, "methods", p, method, ACROSS[1]) for p in (STRIP, TRELLIS, *BIAS)
        )
        smooth.append(
            [
                *(method.name, _cell(strip, "unknowns", _count)),
                *(_cell(strip, key) for key in ("load", "position", "angle")),
                *(_cell(strip, key, _strain) for key in _STRAINS),
                *(_cell(trellis, key) for key in ("load", "position", "angle")),
                _cell(trellis, "linear_solves", _count),
            ]
        )
        kinked.append(
            [
                *(method.name, _cell(bias[-1], "unknowns", _count)),
                *map(_over_exact, bias, BIAS),
                *(_cell(bias[-1], key) for key in ("position", "angle")),
                *(_cell(bias[-1], key, _strain) for key in _STRAINS),
                _cell(bias[-1], "linear_solves", _count),
            ]
        )
    strains = ["strain", "mesh strain"]
    head = ["method", "unknowns", *_on("strip", _ERRORS), *strains]
    head += [*_on("trellis", _ERRORS), "trellis: linear solves"]
    text = markdown_table(head, smooth)
    loads = [f"load over exact, E/G = {_ratio(problem)}" for problem in BIAS]
    head = ["method", "unknowns", *loads, *_ERRORS[1:], *strains, "linear solves"]
    kinks = markdown_table(head, kinked)
    return text + "\n" + kinks + "\n" + _sheared(rows)


def _sheared(rows: list[Row]) -> str:
    """A smooth motion of a fabric with shear stiffness."""
    lines = []
    for method in (*FOR_LOAD, PAPER):
        line = [method.name]
        for across in ACROSS[:2]:
            seeds = of(rows, "methods", SHEARED, method, across)
            line += [_cell(seeds, key) for key in ("load", "position", "angle")]
            line.append(_cell(seeds, "linear_solves", _count))
        lines.append(line)
    head = ["method"]
    for across in ACROSS[:2]:
        head += _on(f"{across} across", [*_ERRORS, "linear solves"])
    return markdown_table(head, lines)


def load(rows: list[Row]) -> str:
    """The load of the bias extension: worst median and worst case over shear angles."""
    lines = []
    for method in FOR_LOAD:
        for problem in (*BIAS, *BIAS_SIN2):
            line = [method.name, problem.name.removeprefix("bias extension, ")]
            for across in ACROSS[1:]:
                seeds = of(rows, "methods", problem, method, across)
                line += [_load(x) for x in over_angles(seeds, problem)]
            lines.append(line)
    head = ["method", "law, E/G"]
    for across in ACROSS[1:]:
        head += _on(f"{across} across", ["median", "worst"])
    resolved = []
    for method in (MACRO, AUTO):
        line = [method.name]
        for problem in BIAS:
            seeds = of(rows, "resolved", problem, method, RESOLVED)
            line.append(_over_exact(seeds, problem))
        resolved.append(line)
    fine = [f"{RESOLVED} across, linear", *map(_ratio, BIAS)]
    return markdown_table(head, lines) + "\n" + markdown_table(fine, resolved)


def constants(rows: list[Row]) -> str:
    """Errors with other constants than ``auto`` takes."""
    lines = []
    for method in (*STABILISATIONS, AUTO, MACRO):
        group = "methods" if method in METHODS else "stabilisation"
        line = [f"**{method.name}**" if method in METHODS else method.name]
        for problem in (STRIP, TRELLIS, *BIAS):
            seeds = of(rows, group, problem, method, ACROSS[1])
            if problem == STRIP:
                line.append(_cell(seeds, "load"))
            if problem in BIAS:
                line.append(_over_exact(seeds, problem))
            if problem != BIAS[0]:  # where stretch moves nodes by more than errors do
                line.append(_cell(seeds, "position"))
        lines.append(line)
    load, position, _ = _ERRORS
    head = ["C_s", *_on("strip", [load, position]), *_on("trellis", [position])]
    for problem in BIAS:
        heads = ["load over exact", position][: 1 if problem == BIAS[0] else 2]
        head += _on(f"E/G = {_ratio(problem)}", heads)
    return markdown_table(head, lines) + "\n" + _deviations(rows)


def _deviations(rows: list[Row]) -> str:
    """Loads with other stiffnesses against deviations."""
    problems = (*BIAS[::2], *BIAS_SIN2[::2])
    lines = []
    for chosen, c in zip((MACRO_TRIANGLES, MACRO), Macro().deviation, strict=True):
        own = [m for m in DEVIATIONS if m.mesh == chosen.mesh]
        for method in (*own[:2], chosen, *own[2:]):
            group = "methods" if method is chosen else "deviation"
            line = [f"**{chosen.mesh}, {c:g}**" if method is chosen else method.name]
            for across in ACROSS[:2]:
                for problem in problems:
                    seeds = of(rows, group, problem, method, across)
                    line.append(_over_exact(seeds, problem))
            lines.append(line)
    shown = [p.name.removeprefix("bias extension, ") for p in problems]
    head = [f"{n} across: {name}" for n in ACROSS[:2] for name in shown]
    return markdown_table(["deviation", *head], lines)


def triangulations(rows: list[Row]) -> str:
    """Ten Delaunay triangulations of the strip, with two fibre stiffnesses."""
    strips = [row for row in rows if row["group"] == "triangulations"]
    lines = []
    for across in dict.fromkeys(row["across"] for row in strips):
        own = [row for row in strips if row["across"] == across]
        lines.append(
            [
                str(own[0]["elements"] // 3),
                ", ".join(f"{per_stiffness(row):.1e}" for row in own),
                ", ".join(_strain(row["strain"]) for row in own),
                ", ".join(f"{row['position']:.2e}" for row in own),
                ", ".join(f"{row['negative_pivots']:.0f}" for row in own),
            ]
        )
    return markdown_table(
        ["triangles", "load / E (mm)", "strain", _ERRORS[1], "negative pivots"], lines
    )


def equal(rows: list[Row]) -> str:
    """The recommended element and the paper's, at equal unknowns."""
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
    for what in ("load off by", *_ERRORS[1:]):
        head += [f"macro: {what}", f"C_s = 1: {what}"]
    return markdown_table(head, lines)


#: The tables by name.
TABLES: dict[str, Callable[[list[Row]], str]] = {
    "methods": methods,
    "load": load,
    "constants": constants,
    "triangulations": triangulations,
    "equal": equal,
}


def _on(what: str, heads: Sequence[str]) -> list[str]:
    return [f"{what}: {head}" for head in heads]


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
    """The load of the bias extension over the exact one."""
    return _cell(over_exact(rows, problem), "load", _load)


def _cell(rows: Sequence[Row], key: str, show: Callable[[float], str] = _figure) -> str:
    """The median, and the number of rows that have a value if not all have."""
    known = sum(not np.isnan(row[key]) for row in rows)
    if not known:
        return "-"
    few = "" if known == len(rows) else f" ({known} of {len(rows)})"
    return show(median(rows, key)) + few
