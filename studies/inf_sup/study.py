"""Inf-sup constants, kernels, and approximation of inextensional modes."""

import argparse
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np
from numpy import ndarray
from skfem import Mesh

from skfem_textile.fabric import Fabric
from skfem_textile.mesh.splitting import cut
from skfem_textile.ply.formulations import Full, Macro, OnePoint, Quadratic
from skfem_textile.ply.terms import Formulation
from skfem_textile.scenes.rectangle import rectangle

from ..common.figures import (
    File,
    colour_of,
    legend,
    panels_of,
    plain_numbers,
    style_of,
    ticks_of_decades,
)
from ..common.tables import having, markdown_table, percent, span
from ..study import Part, Row, Study
from .constraints import Constraints, spectrum
from .motions import KINKED, SMOOTH, distances, stiffness

#: Fibre and shear stiffness in N/mm; the ratio is high but realistic.
E, G = 1e6, 1.0

#: Numbers of node spacings along a side of the unit square.
ACROSS = (4, 8, 16, 24)

#: Shear angle in degrees of the sheared state, and its finest mesh.
SHEARED, SHEARED_ACROSS = 40, 16

#: Number of refinements for the tension norm, and the mesh on which one more refinement
#: checks its influence.
REFINED, CHECKED_ACROSS = 2, 8


@dataclass(frozen=True)
class Method:
    """A formulation on quadrilaterals or triangles.

    ``parts`` is the number of node spacings along an edge of the user's element.
    """

    name: str
    formulation: Formulation
    triangles: bool = False
    parts: int = 2


TWO_BY_TWO = Method("2×2 points, quads", Full(), parts=1)
ONE_POINT = Method("one point, quads", OnePoint(), parts=1)
ONE_POINT_TRIANGLES = Method("one point, split triangles", OnePoint(), triangles=True)
QUADRATIC = Method("quadratic triangles", Quadratic(), triangles=True)
QUADRATIC_MEAN = Method("quadratic, mean", Quadratic(80.0), triangles=True)
MACRO = Method("macro-elements, quads", Macro())
MACRO_TRIANGLES = Method("macro-elements, triangles", Macro(), triangles=True)
METHODS = (
    TWO_BY_TWO,
    ONE_POINT,
    ONE_POINT_TRIANGLES,
    QUADRATIC,
    QUADRATIC_MEAN,
    MACRO,
    MACRO_TRIANGLES,
)


@dataclass(frozen=True)
class Layout:
    """Fibres at an angle in degrees to a regular or an irregular mesh."""

    angle: int
    regular: bool = True

    def __str__(self) -> str:
        return f"{self.angle}°" if self.regular else f"{self.angle}°, irregular"


IRREGULAR = Layout(0, regular=False)
LAYOUTS = (*(Layout(angle) for angle in (0, 15, 30, 45)), IRREGULAR)


@dataclass(frozen=True)
class Case:
    """A method on the unit square, about an undeformed or sheared state."""

    method: Method
    layout: Layout
    across: int
    shear: int = 0
    refined: int = REFINED

    def __str__(self) -> str:
        state = f", sheared {self.shear}°" if self.shear else ""
        mesh = f"{self.across} across, refined {self.refined}"
        return f"{self.method.name}, {self.layout}{state}, {mesh}"

    def mesh(self) -> Mesh:
        """The user's mesh; regular triangles are halved squares."""
        n = self.across // self.method.parts
        triangles, regular = self.method.triangles, self.layout.regular
        if not regular:
            return rectangle(1, 1, (n, n), "delaunay" if triangles else "irregular")
        squares: Any = rectangle(1, 1, (n, n), "aligned")
        return cut(squares) if triangles else squares

    def directions(self) -> ndarray:
        """Unit reference directions of warp and weft, as columns."""
        angle = np.radians(self.layout.angle)
        c, s = np.cos(angle), np.sin(angle)
        return np.array([[c, -s], [s, c]])

    def constraints(self) -> Constraints:
        """Constraints of the formulation; each family turns by half the shear angle."""
        A, half = self.directions(), np.radians(self.shear) / 2
        closer = np.array([[np.cos(half), np.sin(half)], [np.sin(half), np.cos(half)]])
        mesh = self.method.formulation.working_mesh(self.mesh())
        fabric = Fabric(E, G, *A.T)
        return Constraints(mesh, fabric, self.method.formulation, A @ closer @ A.T)

    def rows(self) -> list[Row]:
        """Singular values, kernel and distances; also the stiffness of flat plies."""
        constraints = self.constraints()
        result = spectrum(constraints, self.refined)
        row: Row = {
            "method": self.method.name,
            "layout": str(self.layout),
            "shear": self.shear,
            "refined": self.refined,
            "across": self.across,
            "unknowns": constraints.basis.N,
            "constraints": constraints.matrix.shape[0],
            "rank": len(result.values),
            "kernel": result.kernel.shape[1],
            "inf_sup": result.inf_sup,
            "inf_sup_in_l2": result.in_l2,
            "largest": float(result.values[-1]),
            "largest_zero": result.largest_zero,
        }
        for kind, profiles in (("smooth", SMOOTH), ("kinked", KINKED)):
            from_mesh, from_kernel = distances(constraints, result.kernel, profiles)
            row[f"{kind}_from_mesh"] = from_mesh
            row[f"{kind}_from_kernel"] = from_kernel
            if not self.shear:
                row[f"{kind}_stiffness"] = stiffness(constraints, profiles)
        return [row]


def all_cases() -> Iterator[Case]:
    """All cases: flat, sheared, and with the tension norm from a finer mesh."""
    for method, layout in product(METHODS, LAYOUTS):
        for across in ACROSS:
            yield Case(method, layout, across)
        if layout.regular:
            for across in (n for n in ACROSS if n <= SHEARED_ACROSS):
                yield Case(method, layout, across, SHEARED)
    for method in METHODS:
        yield Case(method, Layout(30), CHECKED_ACROSS, refined=REFINED + 1)


#: Upper bound of zero singular values relative to the smallest non-zero one.
CLEAR = 0.01

#: Spacings of the table of unknowns and constraints.
COUNTED_ACROSS = 16

_KINDS = "smooth", "kinked"


def of(
    rows: Sequence[Row],
    method: Method,
    layout: Layout,
    shear: int = 0,
    refined: int = REFINED,
) -> dict[int, Row]:
    """The rows of a method and a layout, by number of spacings."""
    keys = {"method": method.name, "layout": str(layout), "shear": shear}
    chosen = having(rows, **keys, refined=refined)
    return {row["across"]: row for row in sorted(chosen, key=lambda row: row["across"])}


def order(by_n: dict[int, float]) -> float:
    """Convergence order in h from the two finest meshes.

    Examples
    --------
    >>> round(order({4: 0.8, 8: 0.4, 16: 0.1}), 12)
    2.0
    """
    (n, coarse), (m, fine) = list(by_n.items())[-2:]
    return float(np.log(coarse / fine) / np.log(m / n))


def constants(rows: Sequence[Row], key: str) -> str:
    """A constant on the coarsest and finest mesh; its order if meshes are regular."""

    def cell(by_n: dict[int, Row]) -> str:
        values = {across: row[key] for across, row in by_n.items()}
        first, *_, last = values.values()
        regular = str(IRREGULAR) not in {row["layout"] for row in by_n.values()}
        power = f", h^{round(order(values), 1) + 0.0:.1f}" if regular else ""
        return f"{first:.2g} to {last:.2g}{power}"

    return _by_layout(rows, cell, least=2)


def ratios(rows: Sequence[Row]) -> str:
    """Distances of modes from the kernel relative to the distances from the mesh."""
    return _by_layout(rows, lambda by_n: _of_kinds(by_n, _from_kernel, ".2f"))


def stiffnesses(rows: Sequence[Row]) -> str:
    """Ratios of the stiffness of a ply to the exact stiffness."""

    def stiffness(row: Row, kind: str) -> float:
        return float(row[f"{kind}_stiffness"])

    return _by_layout(rows, lambda by_n: _of_kinds(by_n, stiffness, ".4g"))


def _of_kinds(by_n: dict[int, Row], value: Callable, form: str) -> str:
    """A value for both kinds of modes on the finest mesh."""
    return ", ".join(f"{value(by_n[max(by_n)], kind):{form}}" for kind in _KINDS)


def _from_kernel(row: Row, kind: str) -> float:
    """Distance of a mode from the kernel over its distance from the mesh space."""
    return float(row[f"{kind}_from_kernel"] / row[f"{kind}_from_mesh"])


def _by_layout(
    rows: Sequence[Row], cell: Callable[[dict[int, Row]], str], least: int = 1
) -> str:
    """A line for each method, with a cell for each layout of flat plies.

    ``least`` is the number of meshes required for a cell.
    """
    lines = []
    for method in METHODS:
        by_layout = [of(rows, method, layout) for layout in LAYOUTS]
        cells = (cell(x) if len(x) >= least else "-" for x in by_layout)
        lines.append([method.name, *cells])
    return markdown_table(["method", *LAYOUTS], lines)


def kernels(rows: Sequence[Row]) -> str:
    """Unknowns, constraints, and dimensions of the kernel."""
    lines = []
    for method in METHODS:
        counted = [of(rows, method, x).get(COUNTED_ACROSS) for x in LAYOUTS]
        if first := next(filter(None, counted), None):
            sizes = [str(row["kernel"]) if row else "-" for row in counted]
            lines.append([method.name, first["unknowns"], first["constraints"], *sizes])
    return markdown_table(["method", "unknowns", "constraints", *LAYOUTS], lines)


def in_words(rows: Sequence[Row]) -> dict[str, str]:
    """The results by name; needs the rows of all cases."""
    means = QUADRATIC_MEAN, MACRO, MACRO_TRIANGLES
    meshes = [[*of(rows, m, layout).values()] for m in means for layout in LAYOUTS]
    finest = [mesh[-1] for mesh in meshes]
    regular = [mesh for mesh in meshes if mesh[0]["layout"] != str(IRREGULAR)]
    falls = [1 - mesh[-1]["inf_sup"] / mesh[-2]["inf_sup"] for mesh in regular]
    furthest = max(_from_kernel(row, kind) for row in finest for kind in _KINDS)
    return {
        "means": _range(row["inf_sup"] for row in finest),
        "means_fall": percent(max(falls), ".1f"),
        "means_distance": percent(furthest - 1, ".0f"),
    }


def _range(values: Iterable[float]) -> str:
    """The smallest and the largest value, or one value if both agree.

    Examples
    --------
    >>> _range([0.873, 0.791]), _range([0.936, 0.938])
    ('0.79 to 0.87', '0.94')
    """
    return " to ".join(dict.fromkeys(span(values, ".2f").split(" to ")))


def draw_constants(rows: Sequence[Row], file: File = None) -> Any:
    """Draw a column of panels for each fibre layout and a row for each result."""
    from matplotlib.ticker import FixedLocator, NullLocator

    layouts = Layout(0), Layout(30), Layout(45), IRREGULAR
    results = {
        "inf_sup": "Inf-sup constant",
        "smooth_from_kernel": "Distance, smooth motion",
        "kinked_from_kernel": "Distance, kinked motion",
    }
    styles = {
        method.name: style_of(
            i,
            linestyle="--" if method.triangles else "-",
            linewidth=1.2,
            markersize=4.5,
            markerfacecolor="white" if method.triangles else colour_of(i),
        )
        for i, method in enumerate(METHODS)
    }
    size = 1.7 * len(layouts), 1.8 * len(results) + 0.5
    form: dict[str, Any] = {
        "sharex": True,
        "sharey": "row",
        "xlabel": "Spacings a side, 1/h",
    }
    form |= {"titles": [f"Fibres at {layout}" for layout in layouts]}
    form |= {"ylabels": [*results.values()]}
    with panels_of(size, file, 8, **form) as (figure, grid):
        for i, key in enumerate(results):
            for axes, layout in zip(grid[i], layouts, strict=True):
                for method in METHODS:
                    by_n = of(rows, method, layout)
                    values = [row[key] for row in by_n.values()]
                    axes.loglog(list(by_n), values, **styles[method.name])
                axes.grid(alpha=0.3)
            first = grid[i, 0]
            first.xaxis.set_major_locator(FixedLocator(ACROSS))
            first.xaxis.set_minor_locator(NullLocator())
            ticks_of_decades(first)
            plain_numbers(first)
        for power, start in ((1, 0.075), (2, 0.012)):
            _draw_slope(grid[0, 0], power, start)
        legend(figure, styles, 3)
    return figure


def _draw_slope(axes: Any, power: int, start: float) -> None:
    """Draw a short line with the slope of a power of h."""
    first, last = 4.0, 7.0
    end = start * (first / last) ** power
    axes.plot([first, last], [start, end], color="grey", linewidth=0.8)
    name = "h" if power == 1 else "h²"
    axes.annotate(name, (last, end), (3, -3), textcoords="offset points", color="grey")


class InfSup(Study[Case]):
    """All methods on all fibre layouts, flat and sheared."""

    parts = (
        Part(
            "inf_sup.csv",
            {
                "constants.md": lambda rows: constants(rows, "inf_sup"),
                "kernels.md": kernels,
                "distances.md": ratios,
                "stiffness.md": stiffnesses,
            },
            {"inf_sup.png": draw_constants},
        ),
    )
    shown = "inf-sup {inf_sup:.4f}, kernel {kernel}"
    sample = "macro-elements, triangles, 0°, irregular, 8 across, refined 2"
    volatile = ("largest_zero",)  # round-off

    def cases(self, options: argparse.Namespace) -> Sequence[Case]:
        return list(all_cases())

    def figures(self, rows: list[Row]) -> dict[str, str]:
        return in_words(rows)

    def complaint(self, rows: list[Row]) -> str:
        """Report rows without a clear gap between zero and non-zero singular values."""
        doubtful = [r for r in rows if r["largest_zero"] > CLEAR * r["inf_sup"]]
        if not doubtful:
            return ""
        first = self.line(doubtful[:1])
        return f"{len(doubtful)} case(s) without a clear smallest value, first: {first}"


STUDY = InfSup()
