"""Error against run time, of this library and of its rivals.

Every formulation and every rival loads two scenes on finer and finer meshes.
The clock runs from mesh and fabric in memory to the end of the load, in a process that
has done the same once before.
"""

import argparse
from dataclasses import replace
from itertools import product
from pathlib import Path
from time import perf_counter
from typing import NamedTuple

from skfem_textile.scenes import bias_extension

from ..common.rivals.all_rivals import RIVALS
from ..formulations.cases import (
    AUTO,
    BIAS,
    MACRO,
    MACRO_TRIANGLES,
    MEAN_QUADRATIC,
    METHODS,
    SEEDS,
    STRIP,
)
from ..study import Row, Study
from . import tables
from .fronts import CRITERIA
from .reference import CELLS, FORMULATIONS, Reference
from .timed_codes import LONG, SOLVERS, OtherCode, Refined, ThisLibrary, TimedCode

#: Scenes in one load step: the strip, and the bias extension to 40° at E/G = 2·10⁵.
PROBLEMS = {
    "strip": replace(STRIP, steps=1, last=1),
    "bias_extension": replace(BIAS[1], scene=bias_extension, steps=1, last=1),
}

_BY_NAME = {method.name: method for method in METHODS}

#: Formulations of this library by the name of their element.
OWN = {
    "Q4, one point": AUTO,
    "macro, quads": MACRO,
    "macro, triangles": MACRO_TRIANGLES,
    "P2, 3 points": _BY_NAME["quadratic"],
    "P2, mean stretch": MEAN_QUADRATIC,
    "Q4, 2×2": _BY_NAME["2×2 points"],
}

#: This library with each set of solvers, then the rivals.
CODES: tuple[TimedCode, ...] = (
    *(ThisLibrary(*own, solver) for solver in SOLVERS for own in OWN.items()),
    Refined("macro, refined", MACRO_TRIANGLES, "SciPy"),
    *map(OtherCode, RIVALS),
)


class Timed(NamedTuple):
    """A code, timed on finer and finer meshes of a scene."""

    seed: int
    scene: str
    code: TimedCode

    @property
    def name(self) -> str:
        """What to call it."""
        code = self.code
        words = self.scene, code.code, code.element, code.solver, f"seed {self.seed}"
        return ", ".join(words)


class ErrorTime(Study[Timed | Reference]):
    """Every code on both scenes, and the converged load of one."""

    files = (
        *("error_time.csv", "meshes.csv", "codes.csv", "ratios.md", "elements.md"),
        *("same_mesh.md", "reference.md", "failed.md"),
    )
    pictures = (
        *("fronts.png", "fronts.svg", "ratios.png", "ratios.svg"),
        *("strip.png", "bias_extension.png"),
    )
    folder = "error-time"
    timed = True
    sample = "reference, Quadratic(), 8 cells"

    def cases(self, options: argparse.Namespace) -> list[Timed | Reference]:
        """The reference, then every code; the codes take turns, seed by seed.

        A tolerance of the load is a share of it, and the strip has none.
        """
        timed = (Timed(*given) for given in product(SEEDS, PROBLEMS, CODES))
        return [
            *(Reference(*given) for given in product(FORMULATIONS, CELLS)),
            *(
                case
                for case in timed
                if PROBLEMS[case.scene].exact_load or not isinstance(case.code, Refined)
            ),
        ]

    def name(self, case: Timed | Reference) -> str:
        return case.name

    def examine(self, case: Timed | Reference) -> list[Row]:
        """The results of one code on one seed, from coarse to fine meshes.

        The mesh is refined, or the tolerance reduced, until a run takes longer than
        `LONG`.  A code that is not installed has one row that says so.
        """
        if isinstance(case, Reference):
            return [case.computed()]
        code = case.code
        head: Row = {"scene": case.scene, "code": code.code, "element": code.element}
        head |= {"solver": code.solver, "seed": case.seed, "across": 0}
        if missing := code.missing():
            return [head | {"note": f"skipped, not installed: {missing}"}]
        rows = []
        for refinement in code.refinements:
            start = perf_counter()
            row = code.measured(PROBLEMS[case.scene], refinement, case.seed)
            rows.append(head | row)
            took = perf_counter() - start if row["note"] else row["seconds"]
            if took > LONG:
                break
        return rows

    def line(self, rows: list[Row]) -> str:
        return "\n".join(map(_line, rows))

    def tables(self, rows: list[Row]) -> dict[str, str]:
        return tables.tables(rows)

    def figures(self, rows: list[Row]) -> dict[str, str]:
        """Results in words.

        ``CRITERION_ERROR_SOLVERS_WHAT`` is of this library and the fastest other code
        at an error: ``ratio``, ``solves`` and ``per_solve``, ``other_code``, and
        ``ours`` or ``other`` for the element, with ``_mesh``, ``_error``, ``_seconds``
        and ``_solves`` of it.  ``CRITERION_ELEMENT`` is of an element of this library
        at the middle error.
        """
        return tables.in_words(rows)

    def draw(self, rows: list[Row], folder: Path) -> None:
        from .figure import drawn_elements, drawn_fronts, drawn_ratios

        for suffix in (".png", ".svg"):
            drawn_fronts(rows, folder / f"fronts{suffix}")
            drawn_ratios(rows, folder / f"ratios{suffix}")
        for name in ("angle", "load"):
            drawn_elements(rows, name, folder / f"{CRITERIA[name].scene}.png")


STUDY = ErrorTime()


def _line(row: Row) -> str:
    """One result, on one line."""
    words = (row.get(key) for key in ("scene", "code", "element", "solver", "seed"))
    name = ", ".join(str(word) for word in words if word is not None)
    text = f"{name}, {row['across']} across: "
    if row.get("note"):
        return text + row["note"]
    angle = "" if row.get("angle") is None else f", {row['angle']:.3g}°"
    seconds = "" if row.get("seconds") is None else f"{row['seconds']:.3g} s, "
    return f"{text}{seconds}load {row['load']:.5g} N{angle}"
