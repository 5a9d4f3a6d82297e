"""Errors of a ply in space, and whether extreme stiffnesses lead to wrong answers."""

import argparse
from collections.abc import Callable, Iterable, Sequence
from itertools import product
from typing import Any, NamedTuple

import numpy as np

from skfem_textile.scenes.common.elastica import hanging, peirce

from ...common.figures import File, legend, panels_of, style_of
from ...common.tables import (
    Column,
    grouped,
    having,
    markdown_table,
    percent,
    table,
)
from ...study import Part, Row, Study
from . import problems

# Weights w L³/D of hanging strips; 8 is that of the usual angle of the chord.
_WEIGHTS, _USUAL = (1, 2, 4, 8, 20, 80), 8

#: An answer that is off by more than this share is wrong.
WRONG = 0.02

_PROBLEMS: dict[str, Callable[..., dict[str, Any]]] = {
    "cantilever": problems.cantilever,
    "plate": problems.plate,
    "buckling": problems.critical,
    "modes": problems.zero_modes,
    "extreme cantilever": problems.cantilever,
    "extreme strip": problems.shortened,
    "extreme sheet": problems.hanging_sheet,
}


class Case(NamedTuple):
    """A problem by its part, and its parameters."""

    part: str
    parameters: dict[str, Any]

    def __str__(self) -> str:
        given = ", ".join(f"{k} {v}" for k, v in self.parameters.items())
        return f"{self.part}: {given}"

    def rows(self) -> list[Row]:
        """What the problem gives."""
        found = _PROBLEMS[self.part](**self.parameters)
        return [{"part": self.part, **self.parameters, **found}]


def _every(part: str, **choices: Any) -> list[Case]:
    sets = product(*choices.values())
    return [Case(part, dict(zip(choices, one, strict=True))) for one in sets]


#: Stiffnesses and meshes of the extreme cases; 32 element edges along a strip.
_EXTREME: dict[str, Sequence[Any]] = {
    "n": [32],
    "jitter": [0.0, 0.25],
    "formulation": ["one point", "macro"],
    "D": [1e-3, 1e-2, 0.1, 1.0, 10.0, 100.0, 1000.0],
    "E_over_G": [1e2, 1e4, 1e6, 1e8],
}


def plain_cases() -> list[Case]:
    """The cases without extreme stiffnesses."""
    every: Any = list(problems.FORMULATIONS)
    in_plane: Any = {"where": ["in plane"]}
    return [
        *_every(
            "cantilever",
            load=list(problems.CANTILEVERS),
            n=[8, 16, 32],
            jitter=[0.0],
            formulation=every,
            D=[10.0],
            E_over_G=[1e5],
        ),
        *_every(
            "plate",
            degrees=[0, 45],
            n=[8, 16, 32],
            jitter=[0.0, 0.2],
            formulation=["one point", "quadratic"],
        ),
        *_every(
            "buckling",
            **in_plane,
            n=[8, 16],
            formulation=every,
            D=[0.0, 10.0, 100.0],
        ),
        *_every(
            "buckling",
            **in_plane,
            n=[32, 64, 128, 256],
            formulation=["macro"],
            D=[0.0],
        ),
        *_every(
            "buckling",
            where=["out of plane"],
            n=[8, 16, 32],
            formulation=every,
            D=[0.1, 10.0, 1000.0],
        ),
        *_every(
            "modes",
            formulation=[*every, "one point, C_s = 0", "full"],
            D=[0.0, 1.0],
        ),
    ]


def _of_extremes(rows: Iterable[Row]) -> list[Row]:
    return [row for row in rows if row["part"].startswith("extreme")]


def _share(key: str) -> Column:
    return f"{{{key}:+.1e}}"


def cantilevers(rows: Sequence[Row]) -> str:
    """Errors of the tip over the length."""
    return table(
        having(rows, part="cantilever"),
        {
            "formulation": "{formulation}",
            "load": "{load}",
            "edges": "{n}",
            "x, of L": _share("off_x"),
            "z, of L": _share("off_z"),
            "steps": "{load_steps}",
            "solves": "{linear_solves}",
        },
    )


def plates(rows: Sequence[Row]) -> str:
    """Largest error of the deflection over the largest deflection."""
    found = having(rows, part="plate")
    edges = list(grouped(found, "n"))
    lines = []
    for key, own in grouped(found, "formulation", "degrees", "jitter").items():
        formulation, degrees, jitter = key
        mesh = "moved by 20 %" if jitter else "regular"
        errors = {row["n"]: f"{row['off_z']:.1e}" for row in own}
        line = [formulation, f"{degrees}°", mesh]
        lines.append([*line, *(errors.get(n, "-") for n in edges)])
    head = ["elements", "fibres at", "nodes", *(f"{n} edges" for n in edges)]
    return markdown_table(head, lines)


def buckling(rows: Sequence[Row]) -> str:
    """Errors of critical tensions."""
    found = having(rows, part="buckling")
    edges = sorted(grouped(found, "n"))
    lines = []
    for key, own in grouped(found, "where", "formulation", "D").items():
        where, formulation, D = key
        errors = {row["n"]: f"{row['off_x']:+.1e}" for row in own}
        line = [where, formulation, f"{D:g}", f"{own[0]['exact']:.4g}"]
        lines.append([*line, *(errors.get(n, "-") for n in edges)])
    head = ["buckles", "formulation", "D, N·mm", "exact, N/mm"]
    return markdown_table([*head, *(f"{n} edges" for n in edges)], lines)


def modes(rows: Sequence[Row]) -> str:
    """Zero modes of a free flat patch."""
    return table(
        having(rows, part="modes"),
        {
            "formulation": "{formulation}",
            "D, N·mm": "{D:g}",
            "unknowns": "{unknowns}",
            "motions without stiffness": "{modes}",
        },
    )


def wrong(rows: Sequence[Row]) -> list[Row]:
    """Runs of extreme stiffnesses that converged to an answer that is off.

    A strip that has buckled against its push is in an equilibrium to which the path
    does not lead.  It is right if the run says that its path is not resolved.
    """
    return [
        row
        for row in having(_of_extremes(rows), outcome="converged")
        if _off(row) > WRONG or (row.get("mirrored") and row["path_resolved"])
    ]


def _off(row: Row) -> float:
    return max(abs(row["off_x"]), abs(row["off_z"]))


def extremes(rows: Sequence[Row]) -> str:
    """Runs that are right, refused and wrong, by problem and E/G."""
    lines = []
    for key, own in grouped(_of_extremes(rows), "part", "E_over_G").items():
        part, stiff = key
        good, bad = having(own, outcome="converged"), len(wrong(own))
        largest = percent(max(map(_off, good), default=0.0), ".2f")
        counts = len(own), len(good) - bad, len(own) - len(good), bad
        lines.append([part.removeprefix("extreme "), f"{stiff:.0e}", *counts, largest])
    head = ["problem", "E/G", "runs", "right", "refused", "wrong", "largest error"]
    return markdown_table(head, lines)


def peirce_over_elastica(rows: Sequence[Row]) -> str:
    """Bending stiffness by Peirce's formula over that of the elastica."""
    lines = []
    for weight in _WEIGHTS:
        angle, ratio = _peirce(weight)
        lines.append([weight, f"{angle:.1f}", f"{ratio:.3f}"])
    head = ["w L³/D", "angle of the chord in °", "Peirce over elastica"]
    return markdown_table(head, lines)


def _peirce(weight: float) -> tuple[float, float]:
    """The angle of the chord in degrees, and Peirce's formula over the elastica."""
    angle = hanging(weight).chord_angle
    return float(np.degrees(angle)), peirce(1.0, weight, angle)


def in_words(rows: Sequence[Row]) -> dict[str, str]:
    """Largest errors of quadrilaterals, outcomes of extremes, and Peirce's formula."""
    quadrilaterals = [r for r in rows if r["formulation"] in ("one point", "macro")]
    tips = having(quadrilaterals, part="cantilever", n=32)
    bent = [r for r in having(quadrilaterals, part="buckling") if r["D"]]
    soft = having(rows, part="buckling", formulation="macro", D=0.0)
    found = _of_extremes(rows)
    refused = sum(row["outcome"] != "converged" for row in found)
    bad = len(wrong(found))
    words = {
        "tip": percent(max(map(_off, tips)), ".2g"),
        "buckling": percent(max(abs(r["off_x"]) for r in bent), ".2g"),
        "buckling_soft": percent(-min(r["off_x"] for r in soft), ".2g"),
        "extremes": str(len(found)),
        "right": str(len(found) - refused - bad),
        "refused": str(refused),
        "wrong": str(bad),
    }
    for name, weight in (("small", _USUAL / 2), ("usual", _USUAL)):
        angle, ratio = _peirce(weight)
        words |= {f"{name}_chord": f"{angle:.1f}°", name: percent(ratio - 1, ".2g")}
    return words


def draw_errors(rows: Sequence[Row], file: File = None) -> Any:
    """Errors of cantilevers and of plates over the number of element edges."""
    panels: dict[str, dict[str, Any]] = {
        **{f"Cantilever,\n{x}": {"load": x} for x in problems.CANTILEVERS},
        **{f"Plate,\nfibres at {x}°": {"degrees": x} for x in (0, 45)},
    }
    # Markers of a formulation grow, so that lines on each other are all seen.
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
                own = having(known, formulation=name, **kind)
                line = [row for row in own if bool(row["jitter"]) == moved]
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
    """Bending, buckling, zero modes, and extreme stiffnesses."""

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
            "--quick", action="store_true", help="without the extreme stiffnesses"
        )

    def cases(self, options: argparse.Namespace) -> Sequence[Case]:
        if options.quick:
            return plain_cases()
        sheets = _EXTREME | {"D": [0.0]}
        return [
            *plain_cases(),
            *_every("extreme cantilever", load=["force 10", "weight 8"], **_EXTREME),
            *_every("extreme strip", **_EXTREME),
            *_every("extreme sheet", **sheets),
        ]

    def figures(self, rows: list[Row]) -> dict[str, str]:
        return in_words(rows)

    def complaint(self, rows: list[Row]) -> str:
        """Runs that converged to a wrong answer."""
        bad = wrong(rows)
        return f"{len(bad)} wrong, first: {self.line(bad[:1])}" if bad else ""


STUDY = Space()
