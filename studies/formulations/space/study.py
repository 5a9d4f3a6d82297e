"""Errors of a ply in 3D, and outcomes with extreme stiffness ratios."""

import argparse
from collections.abc import Callable, Iterable, Mapping, Sequence
from itertools import product
from typing import Any, NamedTuple

import numpy as np
from scipy.optimize import brentq
from scipy.sparse.linalg import spsolve

from skfem_textile import (
    BodyForce,
    Condition,
    Fabric,
    Full,
    LoadStepper,
    Macro,
    OnePoint,
    Ply,
    Quadratic,
    StepError,
    Traction,
)
from skfem_textile.scenes.elastica import buckled, hanging, peirce
from skfem_textile.scenes.rectangle import rectangle
from skfem_textile.solve.conditions import Constraints
from skfem_textile.solve.linear import solver_named
from skfem_textile.solve.problem import Problem, Tangent

from ...common.figures import File, legend, panels_of, style_of
from ...common.tables import (
    grouped,
    having,
    markdown_table,
    percent,
    table,
)
from ...study import Part, Row, Study

#: Length and width of strips, and side of squares, in mm.
LENGTH, WIDTH = 100.0, 20.0

#: Formulations by name, and parts into which they divide the edges of the user's mesh.
FORMULATIONS: Mapping[str, tuple[Any, int]] = {
    "one point": (OnePoint(), 1),
    "macro": (Macro(), 2),
    "quadratic": (Quadratic(), 1),
}

#: Cantilevers by name: dimensionless end force P L²/D and weight w L³/D.
CANTILEVERS = {"force 1": (1.0, 0.0), "force 10": (10.0, 0.0), "weight 8": (0.0, 8.0)}

# Default fibre stiffness of strips in N/mm, relative shortening of the buckled strip.
_FIBRES, _SHORTENING = 1e4, 0.2

# Span of the hanging sheet over its length, and its weight in N/mm².
_SPAN, _WEIGHT = 0.8, 1e-3

# Bisection steps for a critical tension.
_HALVINGS = 16


def cantilever(load: str, **parameters: Any) -> Row:
    """Tip errors of a cantilever in one load step, relative to its length."""
    (force, weight), D = CANTILEVERS[load], parameters["D"]
    loads: list[Any] = []
    if force:
        loads.append(Traction("right", (0.0, 0.0, -force * D / LENGTH**2)))
    if weight:
        loads.append(BodyForce((0.0, 0.0, -weight * D / LENGTH**3)))
    conditions, ends = {"left": Condition("left")}, {"left": "clamped"}
    row, ply, result = _loaded(loads, conditions, 1, ends, **parameters)
    if result is None:
        return row
    tip = ply.nodes[0] > LENGTH - 1e-6
    x, _, z = ply.nodal(result.u)[:, tip].mean(axis=1)
    exact = hanging(weight, force)
    return row | {
        "off_x": float(1 + x / LENGTH - exact.x[-1]),
        "off_z": float(z / LENGTH - exact.z[-1]),
    }


def shortened(**parameters: Any) -> Row:
    """Relative errors of force and height of a buckled strip."""
    D, moved = parameters["D"], (-_SHORTENING * LENGTH, 0.0, 0.0)
    push = BodyForce((0.0, 0.0, 1e-3 * D / LENGTH**3), factor=1.0)
    conditions = {"left": Condition("left"), "right": Condition("right", moved)}
    row, ply, result = _loaded([push], conditions, 4, {}, **parameters)
    if result is None:
        return row
    exact = buckled(_SHORTENING)
    force = -result.states[-1].reactions["right"][0] / WIDTH
    z = ply.nodal(result.u)[2]
    height = np.abs(z).max()
    return row | {
        "mirrored": bool(z.max() < height),
        "off_x": float(force * LENGTH**2 / D / exact.force - 1),
        "off_z": float(height / LENGTH / exact.height - 1),
    }


def hanging_sheet(**parameters: Any) -> Row:
    """Relative errors of sag and horizontal force of a hanging sheet, D = 0."""
    load = BodyForce((0.0, 0.0, -_WEIGHT), factor=1.0)
    moved = ((_SPAN - 1) * LENGTH, 0.0, 0.0)
    conditions = {"left": Condition("left"), "right": Condition("right", moved)}
    row, ply, result = _loaded([load], conditions, 4, {}, **parameters)
    if result is None:
        return row
    c = brentq(lambda c: 2 * c * np.sinh(_SPAN / 2 / c) - 1, 0.05, 10.0)
    sag = c * (np.cosh(_SPAN / 2 / c) - 1)
    pull = result.states[-1].reactions["right"][0] / (_WEIGHT * WIDTH * LENGTH)
    return row | {
        "off_x": float(pull / c - 1),
        "off_z": float(-ply.nodal(result.u)[2].min() / LENGTH / sag - 1),
    }


def _loaded(
    loads: list[Any],
    conditions: dict[str, Condition],
    steps: int,
    ends: Any,
    *,
    n: int,
    jitter: float,
    formulation: str,
    D: float,
    E_over_G: float,
) -> tuple[Row, Ply, Any]:
    """Outcome of a strip run, its ply and its result; None if the run fails.

    The strip has n element edges along its length after any splitting.
    """
    chosen, halves = FORMULATIONS[formulation]
    size = n // halves, max(n // 16, 2) // halves
    mesh = rectangle(LENGTH, WIDTH, size, "irregular", jitter, 1)
    fabric = Fabric(_FIBRES, _FIBRES / E_over_G, bending=(D, D))
    ply = Ply(mesh, fabric, chosen, loads, dimension=3, fibre_ends=ends)
    try:
        result = LoadStepper(ply, conditions, steps, solver="superlu").run()
    except StepError as error:
        return {"outcome": "refused", "said": str(error)}, ply, None
    row = {
        "outcome": "converged",
        "linear_solves": result.linear_solves,
        "load_steps": len(result.states) - 1,
        "path_resolved": result.path_resolved,
    }
    return row, ply, result


def plate(degrees: float, n: int, jitter: float, formulation: str) -> Row:
    """Largest relative deflection error of a simply supported square.

    The load is p sin(πx/L) sin(πy/L), the solution w = p/(c D (π/L)⁴) sin sin with
    c = 2 for fibres along the sides and 4 at 45°.
    """
    mesh = rectangle(LENGTH, LENGTH, (n, n), "irregular", jitter, 1)
    c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    fabric = Fabric(_FIBRES, 1.0, (c, s), (-s, c), bending=(1.0, 1.0))
    ply = Ply(mesh, fabric, FORMULATIONS[formulation][0], dimension=3)
    (K,) = (term.matrix for term in ply.terms if term.name == "bending")  # type: ignore[attr-defined]
    k = np.pi / LENGTH

    def pressure(x):
        return np.stack([0 * x[0], 0 * x[0], np.sin(k * x[0]) * np.sin(k * x[1])])

    f = BodyForce(pressure).on(ply.basis).vector[2::3]
    X = ply.nodes
    free = np.flatnonzero((X.min(axis=0) > 1e-9) & (X.max(axis=0) < LENGTH - 1e-9))
    w = np.zeros(X.shape[1])
    w[free] = spsolve(K[2::3, 2::3][free][:, free].tocsc(), f[free])
    share = 2 if degrees == 0 else 4
    return {"off_z": float(np.abs(w * share * k**4 - pressure(X)[2]).max())}


def critical(where: str, n: int, formulation: str, D: float) -> Row:
    """Relative error of the critical tension under uniform compression along x.

    ``in plane``: ends and z fixed, T = −(G + D (π/L)²).  ``out of plane``: all edges
    fixed in position, T = −2 D (π/L)².
    """
    E, G, k = 1e5, 0.1, np.pi / LENGTH
    chosen, halves = FORMULATIONS[formulation]
    m = n // halves
    mesh = rectangle(LENGTH, LENGTH, (m, m), "irregular", 0.0, 1)
    ply = Ply(mesh, Fabric(E, G, bending=(D, D)), chosen, dimension=3)
    if where == "in plane":
        conditions = {name: Condition(name) for name in ("left", "right")}
        conditions["plane"] = Condition(lambda X: X[0] > -1, (None, None, 0.0))
        exact = -(G + D * k**2)
    else:
        sides = ("left", "right", "bottom", "top")
        conditions = {name: Condition(name) for name in sides}
        exact = -2 * D * k**2
    constraints = Constraints(ply.basis, conditions)
    problem = Problem(ply, constraints, solver_named("superlu")).at(1.0)
    low, high = 2 * exact, 0.0
    for _ in range(_HALVINGS):
        u, middle = ply.basis.zeros(), (low + high) / 2
        u[::3] = np.expm1(middle / E) * ply.nodes[0]
        stable = Tangent.at(problem, u, ply.parameters_at_rest).definite
        low, high = (low, middle) if stable else (middle, high)
    return {"exact": exact, "off_x": float(high / exact - 1)}


def zero_modes(formulation: str, D: float) -> Row:
    """Number of zero-energy modes of a free flat patch of 4×4 elements."""
    chosen = {"one point, C_s = 0": OnePoint(0.0), "full": Full()}
    made: Any = chosen.get(formulation) or FORMULATIONS[formulation][0]
    m = 2 if formulation == "macro" else 4
    mesh = rectangle(10.0, 10.0, (m, m), "irregular", 0.0, 1)
    ply = Ply(mesh, Fabric(1e3, 1.0, bending=(D, D)), made, dimension=3)
    values = np.linalg.eigvalsh(ply.tangent(ply.basis.zeros()).toarray())
    zero = np.abs(values) < 1e-9 * values[-1]
    return {"unknowns": ply.basis.N, "modes": int(zero.sum())}


# Weights w L³/D of hanging strips; 8 corresponds to the usual chord angle.
_WEIGHTS, _USUAL = (1, 2, 4, 8, 20, 80), 8

#: Relative error above which a result is wrong.
WRONG = 0.02

_PROBLEMS: dict[str, Callable[..., dict[str, Any]]] = {
    "cantilever": cantilever,
    "plate": plate,
    "buckling": critical,
    "modes": zero_modes,
    "extreme cantilever": cantilever,
    "extreme strip": shortened,
    "extreme sheet": hanging_sheet,
}


class Case(NamedTuple):
    """A problem by name, and its parameters."""

    part: str
    parameters: dict[str, Any]

    def __str__(self) -> str:
        parameters = ", ".join(f"{k} {v}" for k, v in self.parameters.items())
        return f"{self.part}: {parameters}"

    def rows(self) -> list[Row]:
        """Run the problem; returns one row."""
        results = _PROBLEMS[self.part](**self.parameters)
        return [{"part": self.part, **self.parameters, **results}]


def _cases_of(part: str, **choices: Any) -> list[Case]:
    sets = product(*choices.values())
    return [Case(part, dict(zip(choices, one, strict=True))) for one in sets]


#: Stiffnesses and meshes of the extreme cases, with 32 element edges along a strip.
_EXTREME: dict[str, Sequence[Any]] = {
    "n": [32],
    "jitter": [0.0, 0.25],
    "formulation": ["one point", "macro"],
    "D": [1e-3, 1e-2, 0.1, 1.0, 10.0, 100.0, 1000.0],
    "E_over_G": [1e2, 1e4, 1e6, 1e8],
}


def plain_cases() -> list[Case]:
    """The cases without extreme stiffness ratios."""
    every: Any = list(FORMULATIONS)
    in_plane: Any = {"where": ["in plane"]}
    return [
        *_cases_of(
            "cantilever",
            load=list(CANTILEVERS),
            n=[8, 16, 32],
            jitter=[0.0],
            formulation=every,
            D=[10.0],
            E_over_G=[1e5],
        ),
        *_cases_of(
            "plate",
            degrees=[0, 45],
            n=[8, 16, 32],
            jitter=[0.0, 0.2],
            formulation=["one point", "quadratic"],
        ),
        *_cases_of(
            "buckling",
            **in_plane,
            n=[8, 16],
            formulation=every,
            D=[0.0, 10.0, 100.0],
        ),
        *_cases_of(
            "buckling",
            **in_plane,
            n=[32, 64, 128, 256],
            formulation=["macro"],
            D=[0.0],
        ),
        *_cases_of(
            "buckling",
            where=["out of plane"],
            n=[8, 16, 32],
            formulation=every,
            D=[0.1, 10.0, 1000.0],
        ),
        *_cases_of(
            "modes",
            formulation=[*every, "one point, C_s = 0", "full"],
            D=[0.0, 1.0],
        ),
    ]


def _of_extremes(rows: Iterable[Row]) -> list[Row]:
    return [row for row in rows if row["part"].startswith("extreme")]


def cantilevers(rows: Sequence[Row]) -> str:
    """Error of the height of the tip relative to the length."""
    bent = having(rows, part="cantilever")
    edges = sorted(grouped(bent, "n"))
    lines = []
    for (formulation, load), group in grouped(bent, "formulation", "load").items():
        errors = {row["n"]: f"{row['off_z']:+.1e}" for row in group}
        lines.append([formulation, load, *(errors.get(n, "-") for n in edges)])
    head = ["z error / L", "load", *(f"{n} edges" for n in edges)]
    return markdown_table(head, lines)


def plates(rows: Sequence[Row]) -> str:
    """Largest deflection error relative to the largest deflection."""
    plate_rows = having(rows, part="plate")
    edges = list(grouped(plate_rows, "n"))
    lines = []
    for key, group in grouped(plate_rows, "formulation", "degrees", "jitter").items():
        formulation, degrees, jitter = key
        mesh = "moved by 20 %" if jitter else "regular"
        errors = {row["n"]: f"{row['off_z']:.1e}" for row in group}
        line = [formulation, f"{degrees}°", mesh]
        lines.append([*line, *(errors.get(n, "-") for n in edges)])
    head = ["elements", "fibres at", "nodes", *(f"{n} edges" for n in edges)]
    return markdown_table(head, lines)


def buckling(rows: Sequence[Row]) -> str:
    """Relative errors of critical tensions."""
    buckling_rows = having(rows, part="buckling")
    lines = []
    for key, group in grouped(buckling_rows, "where", "formulation", "D").items():
        where, formulation, D = key
        coarse, fine = (f(group, key=lambda row: row["n"]) for f in (min, max))
        errors = (f"{row['off_x']:+.1e} ({row['n']})" for row in (coarse, fine))
        lines.append(
            [where, formulation, f"{D:g}", f"{group[0]['exact']:.4g}", *errors]
        )
    head = ["buckling", "formulation", "D, N·mm", "exact, N/mm"]
    return markdown_table([*head, "error (edges)", "finest mesh"], lines)


def modes(rows: Sequence[Row]) -> str:
    """Zero-energy modes of a free flat patch."""
    return table(
        having(rows, part="modes"),
        {
            "formulation": "{formulation}",
            "D, N·mm": "{D:g}",
            "unknowns": "{unknowns}",
            "zero-energy modes": "{modes}",
        },
    )


def wrong(rows: Sequence[Row]) -> list[Row]:
    """Runs with extreme stiffness ratios that converged to a wrong result.

    A strip that buckled to the side opposite the imperfection is on another
    equilibrium path.  It counts as right if the run reports an unresolved path.
    """
    return [
        row
        for row in having(_of_extremes(rows), outcome="converged")
        if _error(row) > WRONG or (row.get("mirrored") and row["path_resolved"])
    ]


def _error(row: Row) -> float:
    return max(abs(row["off_x"]), abs(row["off_z"]))


def extremes(rows: Sequence[Row]) -> str:
    """Numbers of right, refused and wrong runs by problem and E/G."""
    lines = []
    for key, group in grouped(_of_extremes(rows), "part", "E_over_G").items():
        part, stiff = key
        good, bad = having(group, outcome="converged"), len(wrong(group))
        largest = percent(max(map(_error, good), default=0.0), ".2f")
        counts = len(group), len(good) - bad, len(group) - len(good), bad
        lines.append([part.removeprefix("extreme "), f"{stiff:.0e}", *counts, largest])
    head = ["problem", "E/G", "runs", "right", "refused", "wrong", "largest error"]
    return markdown_table(head, lines)


def peirce_over_elastica(rows: Sequence[Row]) -> str:
    """Ratio of bending stiffness by Peirce's formula to the elastica solution."""
    lines = []
    for weight in _WEIGHTS:
        angle, ratio = _peirce(weight)
        lines.append([weight, f"{angle:.1f}", f"{ratio:.3f}"])
    head = ["w L³/D", "chord angle in °", "Peirce / elastica"]
    return markdown_table(head, lines)


def _peirce(weight: float) -> tuple[float, float]:
    """Chord angle in degrees, and ratio of Peirce's formula to the elastica."""
    angle = hanging(weight).chord_angle
    return float(np.degrees(angle)), peirce(1.0, weight, angle)


def in_words(rows: Sequence[Row]) -> dict[str, str]:
    """Largest errors of quadrilaterals, outcomes of extreme cases, Peirce's formula."""
    quadrilaterals = [r for r in rows if r["formulation"] in ("one point", "macro")]
    tips = having(quadrilaterals, part="cantilever", n=32)
    bent = [r for r in having(quadrilaterals, part="buckling") if r["D"]]
    soft = having(rows, part="buckling", formulation="macro", D=0.0)
    extreme_rows = _of_extremes(rows)
    refused = sum(row["outcome"] != "converged" for row in extreme_rows)
    bad = len(wrong(extreme_rows))
    words = {
        "tip": percent(max(map(_error, tips)), ".2g"),
        "buckling": percent(max(abs(r["off_x"]) for r in bent), ".2g"),
        "buckling_soft": percent(-min(r["off_x"] for r in soft), ".2g"),
        "extremes": str(len(extreme_rows)),
        "right": str(len(extreme_rows) - refused - bad),
        "refused": str(refused),
        "wrong": str(bad),
    }
    for name, weight in (("small", _USUAL / 2), ("usual", _USUAL)):
        angle, ratio = _peirce(weight)
        words |= {f"{name}_chord": f"{angle:.1f}°", name: percent(ratio - 1, ".2g")}
    return words


def draw_errors(rows: Sequence[Row], file: File = None) -> Any:
    """Draw errors of cantilevers and plates against the number of element edges."""
    panels: dict[str, dict[str, Any]] = {
        **{f"Cantilever,\n{x}": {"load": x} for x in CANTILEVERS},
        **{f"Plate,\nfibres at {x}°": {"degrees": x} for x in (0, 45)},
    }
    # Marker sizes differ, so that coinciding lines remain visible.
    sizes = {"quadratic": 5, "one point": 5, "macro": 10}
    styles = {
        name: style_of(i, markersize=size, markerfacecolor="none", ls="-")
        for i, (name, size) in enumerate(sizes.items())
    }
    known = [
        row
        for row in rows
        if row["part"] in ("cantilever", "plate") and row.get("off_z") is not None
    ]
    form: dict[str, Any] = {
        "titles": [*panels],
        "ylabels": ["Error"],
        "xlabel": "Edges",
    }
    with panels_of((8.8, 3.2), file, 10, **form, sharey=True) as (figure, grid):
        for axes, (title, kind) in zip(grid[0], panels.items(), strict=True):
            for name, moved in product(styles, (False, True)):
                selected = having(known, formulation=name, **kind)
                line = [row for row in selected if bool(row["jitter"]) == moved]
                errors = [abs(row["off_z"]) for row in line]
                style = styles[name] | {"ls": "--" if moved else "-"}
                axes.plot([row["n"] for row in line], errors, **style)
            axes.plot([8, 32], [4e-3, 4e-3 / 16], color="0.6", ls=":")
            axes.set_title(title, fontsize=10)
            axes.set(xscale="log", yscale="log")
            axes.set_xlim(7, 37)
            axes.set_xticks([8, 16, 32], ["8", "16", "32"])
            axes.minorticks_off()
            axes.grid(alpha=0.3)
        styles["nodes moved by 20 %"] = {"color": "black", "lw": 1, "ls": "--"}
        styles["second order"] = {"color": "0.6", "ls": ":"}
        legend(figure, styles, len(styles))
    return figure


class Space(Study[Case]):
    """Bending, buckling, zero-energy modes, and extreme stiffness ratios."""

    parts = (
        Part(
            "space.csv",
            {
                "cantilevers.md": cantilevers,
                "plates.md": plates,
                "buckling.md": buckling,
                "modes.md": modes,
                "extremes.md": extremes,
                "peirce.md": peirce_over_elastica,
            },
            {"space.png": draw_errors},
        ),
    )
    sample = (
        "extreme strip: n 32, jitter 0.25, formulation one point, D 1000.0, "
        "E_over_G 100.0"
    )

    def add_options(self, parser: argparse.ArgumentParser) -> None:
        parser.add_argument(
            "--quick", action="store_true", help="omit extreme stiffness ratios"
        )

    def cases(self, options: argparse.Namespace) -> Sequence[Case]:
        if options.quick:
            return plain_cases()
        sheets = _EXTREME | {"D": [0.0]}
        return [
            *plain_cases(),
            *_cases_of("extreme cantilever", load=["force 10", "weight 8"], **_EXTREME),
            *_cases_of("extreme strip", **_EXTREME),
            *_cases_of("extreme sheet", **sheets),
        ]

    def figures(self, rows: list[Row]) -> dict[str, str]:
        return in_words(rows)

    def complaint(self, rows: list[Row]) -> str:
        """Report runs that converged to a wrong result."""
        bad = wrong(rows)
        return f"{len(bad)} wrong, first: {self.line(bad[:1])}" if bad else ""


STUDY = Space()
