"""Errors of a ply in space, and whether extreme stiffnesses lead to wrong answers."""

import argparse
from collections.abc import Callable, Sequence
from itertools import product
from pathlib import Path
from typing import Any, NamedTuple

from ...common.tables import csv_table
from ...study import Row, Study
from . import problems
from .tables import (
    buckling,
    cantilevers,
    extremes,
    in_words,
    modes,
    peirce_over_elastica,
    plates,
    wrong,
)

_PARTS: dict[str, Callable[..., dict[str, Any]]] = {
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


class Space(Study[Case]):
    """Bending, buckling, zero modes, and extreme stiffnesses."""

    files = (
        *("space.csv", "cantilevers.md", "plates.md", "buckling.md", "modes.md"),
        "extremes.md",
        "peirce.md",
    )
    pictures = ("space.png",)
    sample = (
        "extreme strip: n 32, jitter 0.25, formulation one point, D 1000.0, "
        "E_over_G 100.0"
    )

    def add_options(self, parser: argparse.ArgumentParser) -> None:
        parser.add_argument(
            "--quick", action="store_true", help="without the extreme stiffnesses"
        )

    def cases(self, options: argparse.Namespace) -> Sequence[Case]:
        every: Any = list(problems.FORMULATIONS)
        loads: Any = list(problems.CANTILEVERS)
        plain = [
            *_every(
                "cantilever",
                load=loads,
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
                where=["in plane"],
                n=[8, 16],
                formulation=every,
                D=[0.0, 10.0, 100.0],
            ),
            *_every(
                "buckling",
                where=["in plane"],
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
        if options.quick:
            return plain
        sheets = _EXTREME | {"D": [0.0]}
        return [
            *plain,
            *_every("extreme cantilever", load=["force 10", "weight 8"], **_EXTREME),
            *_every("extreme strip", **_EXTREME),
            *_every("extreme sheet", **sheets),
        ]

    def name(self, case: Case) -> str:
        given = ", ".join(f"{k} {v}" for k, v in case.parameters.items())
        return f"{case.part}: {given}"

    def examine(self, case: Case) -> list[Row]:
        found = _PARTS[case.part](**case.parameters)
        return [{"part": case.part, **case.parameters, **found}]

    def line(self, rows: list[Row]) -> str:
        (row,) = rows
        return ", ".join(
            f"{k} {v:.3g}" if isinstance(v, float) else f"{k} {v}"
            for k, v in row.items()
        )

    def tables(self, rows: list[Row]) -> dict[str, str]:
        return {
            "space.csv": csv_table(rows),
            "cantilevers.md": cantilevers(rows),
            "plates.md": plates(rows),
            "buckling.md": buckling(rows),
            "modes.md": modes(rows),
            "extremes.md": extremes(rows),
            "peirce.md": peirce_over_elastica(),
        }

    def figures(self, rows: list[Row]) -> dict[str, str]:
        return in_words(rows)

    def complaint(self, rows: list[Row]) -> str:
        """Runs that converged to a wrong answer."""
        bad = wrong(rows)
        return f"{len(bad)} wrong, first: {self.line(bad[:1])}" if bad else ""

    def draw(self, rows: list[Row], folder: Path) -> None:
        from .figure import draw_errors

        draw_errors(rows, folder / "space.png")


STUDY = Space()
