"""Tables of the study of the inf-sup constant, in Markdown."""

from collections.abc import Callable, Sequence

import numpy as np

from ..common.tables import markdown_table
from ..study import Row
from .cases import (
    CHECKED_ACROSS,
    IRREGULAR,
    LAYOUTS,
    METHODS,
    REFINED,
    SHEARED,
    SHEARED_ACROSS,
    Layout,
    Method,
)

#: Spacings of which unknowns and constraints are counted.
COUNTED_ACROSS = 16


def of(
    rows: Sequence[Row],
    method: Method,
    layout: Layout,
    shear: int = 0,
    refined: int = REFINED,
) -> dict[int, Row]:
    """The rows of a method on a layout, by the number of spacings."""
    key = method.name, layout.name, shear, refined
    found = {
        row["across"]: row
        for row in rows
        if (row["method"], row["layout"], row["shear"], row["refined"]) == key
    }
    return dict(sorted(found.items()))


def order(found: dict[int, float]) -> float:
    """The power of h with which a value goes, of the two finest meshes.

    Examples
    --------
    >>> round(order({4: 0.8, 8: 0.4, 16: 0.1}), 12)
    2.0
    """
    (n, coarse), (m, fine) = list(found.items())[-2:]
    return float(np.log(coarse / fine) / np.log(m / n))


def constants(rows: Sequence[Row], key: str) -> str:
    """A constant on the coarsest and the finest mesh, on regular ones its order too."""

    def cell(found: dict[int, Row]) -> str:
        values = {across: row[key] for across, row in found.items()}
        first, *_, last = values.values()
        regular = IRREGULAR.name not in {row["layout"] for row in found.values()}
        power = f", h^{round(order(values), 1) + 0.0:.1f}" if regular else ""
        return f"{first:.2g} to {last:.2g}{power}"

    return _by_layout(rows, cell, least=2)


def kernels(rows: Sequence[Row]) -> str:
    """Unknowns, constraints, and dimensions of the kernel."""
    lines = []
    for method in METHODS:
        counted = [of(rows, method, x).get(COUNTED_ACROSS) for x in LAYOUTS]
        first = next((row for row in counted if row), None)
        if first is None:
            continue
        sizes = [str(row["kernel"]) if row else "-" for row in counted]
        lines.append([method.name, first["unknowns"], first["constraints"], *sizes])
    head = ["method", "unknowns", "constraints", *(x.name for x in LAYOUTS)]
    return markdown_table(head, lines)


def ratios(rows: Sequence[Row]) -> str:
    """How much further the kernel is from a motion than the mesh is."""

    def cell(found: dict[int, Row]) -> str:
        row = found[max(found)]
        return ", ".join(
            f"{row[f'{kind}_from_kernel'] / row[f'{kind}_from_mesh']:.2f}"
            for kind in ("smooth", "kinked")
        )

    return _by_layout(rows, cell)


def stiffnesses(rows: Sequence[Row]) -> str:
    """How much stiffer than exact a ply is."""

    def cell(found: dict[int, Row]) -> str:
        row = found[max(found)]
        return ", ".join(f"{row[f'{k}_stiffness']:.4g}" for k in ("smooth", "kinked"))

    return _by_layout(rows, cell)


def sheared(rows: Sequence[Row]) -> str:
    """The inf-sup constant about the flat and about the sheared state."""
    lines, layouts = [], [layout for layout in LAYOUTS if layout.regular]
    for method in METHODS:
        line = [method.name]
        for layout in layouts:
            pair = [
                of(rows, method, layout, shear).get(SHEARED_ACROSS)
                for shear in (0, SHEARED)
            ]
            line.append(
                ", ".join(f"{row['inf_sup']:.3g}" if row else "-" for row in pair)
            )
        lines.append(line)
    return markdown_table(["method", *(layout.name for layout in layouts)], lines)


def norms(rows: Sequence[Row]) -> str:
    """The inf-sup constant with the norm of tensions from finer and finer meshes."""
    lines, layout = [], Layout(30)
    for method in METHODS:
        line = [method.name]
        for refined in (REFINED, REFINED + 1):
            row = of(rows, method, layout, 0, refined).get(CHECKED_ACROSS)
            line.append(f"{row['inf_sup']:.4f}" if row else "-")
        lines.append(line)
    parts = [f"{2**refined} × {2**refined} parts" for refined in (REFINED, REFINED + 1)]
    return markdown_table(["method", *parts], lines)


def _by_layout(
    rows: Sequence[Row], cell: Callable[[dict[int, Row]], str], least: int = 1
) -> str:
    """A line for each method, with a cell for each layout on flat plies.

    ``least`` is the number of meshes that a cell needs.
    """
    lines = []
    for method in METHODS:
        found = [of(rows, method, layout) for layout in LAYOUTS]
        lines.append(
            [method.name, *(cell(x) if len(x) >= least else "-" for x in found)]
        )
    return markdown_table(["method", *(layout.name for layout in LAYOUTS)], lines)
