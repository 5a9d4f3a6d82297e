"""Error against run time, of this library and of its rivals.

Every formulation and every rival loads a scene on finer and finer meshes.
The clock runs from mesh and fabric in memory to the end of the load, in a process that
has done the same once before.
"""

import argparse
from dataclasses import replace
from pathlib import Path
from time import perf_counter
from typing import NamedTuple

from skfem_textile.scenes import bias_extension

from ..common import machine_and_versions
from ..common.rivals.all_rivals import RIVALS
from ..common.tables import csv_table, json_text
from ..formulations.cases import (
    AUTO,
    BIAS,
    MACRO,
    MACRO_TRIANGLES,
    MEAN_QUADRATIC,
    METHODS,
    STRIP,
)
from ..study import Row, Study
from . import tables
from .timed_codes import LONG, OtherCode, Refined, ThisLibrary, TimedCode

#: Scenes in one load step: the strip, and the bias extension to 40° at E/G = 2·10⁵.
PROBLEMS = {
    "strip": replace(STRIP, steps=1, last=1),
    "bias_extension": replace(BIAS[1], scene=bias_extension, steps=1, last=1),
}

_BY_NAME = {method.name: method for method in METHODS}

#: This library first, then the rivals.
CODES: tuple[TimedCode, ...] = (
    ThisLibrary("Q4, one point", AUTO),
    ThisLibrary("macro, quads", MACRO),
    ThisLibrary("macro, triangles", MACRO_TRIANGLES),
    ThisLibrary("P2, 3 points", _BY_NAME["quadratic"]),
    ThisLibrary("P2, mean stretch", MEAN_QUADRATIC),
    ThisLibrary("Q4, 2×2", _BY_NAME["2×2 points"]),
    ThisLibrary("Q4, isotropic", _BY_NAME["isotropic, κ = C"]),
    Refined("macro, refined", MACRO_TRIANGLES),
    *map(OtherCode, RIVALS),
)


class Case(NamedTuple):
    """A code, timed on finer and finer meshes of a scene."""

    scene: str
    code: TimedCode


class ErrorTime(Study[Case]):
    """Every code on one scene."""

    files = ("error_time.csv", "summary.json", "error_time.md")
    pictures = ("error_time.png",)
    timed = True

    def add_options(self, parser: argparse.ArgumentParser) -> None:
        scenes = tuple(PROBLEMS)
        parser.add_argument("--scene", choices=scenes, required=True, help="the scene")

    def cases(self, options: argparse.Namespace) -> list[Case]:
        """Every code; without an exact load a tolerance is a share of none."""
        loaded = PROBLEMS[options.scene].exact_load > 0
        codes = (code for code in CODES if loaded or not isinstance(code, Refined))
        return [Case(options.scene, code) for code in codes]

    def name(self, case: Case) -> str:
        return f"{case.scene}, {case.code.code}, {case.code.element}"

    def examine(self, case: Case) -> list[Row]:
        """The results of one code, from coarse to fine meshes.

        The mesh is refined, or the tolerance reduced, until a run takes longer than
        `LONG`.  A code that is not installed has one row that says so.
        """
        code = case.code
        head: Row = {"scene": case.scene, "code": code.code, "element": code.element}
        head |= {"across": 0}
        if missing := code.missing():
            return [head | {"note": f"skipped, not installed: {missing}"}]
        rows = []
        for refinement in code.refinements:
            start = perf_counter()
            row = code.measured(PROBLEMS[case.scene], refinement)
            rows.append(head | row)
            took = perf_counter() - start if row["note"] else row["seconds"]
            if took > LONG:
                break
        return rows

    def line(self, rows: list[Row]) -> str:
        return "\n".join(map(_line, rows))

    def tables(self, rows: list[Row]) -> dict[str, str]:
        machine = machine_and_versions.described()
        sentence = machine_and_versions.sentence(machine)
        return {
            "error_time.csv": csv_table(rows),
            "summary.json": json_text({"machine": machine, **tables.summary(rows)}),
            "error_time.md": f"{sentence}\n\n{tables.tables(rows)}",
        }

    def draw(self, rows: list[Row], folder: Path) -> None:
        from .figure import work_precision

        work_precision(tables.curves(rows), folder / "error_time.png")


STUDY = ErrorTime()


def _line(row: Row) -> str:
    """One result, on one line."""
    name = f"{row['scene']}, {row['code']}, {row['element']}"
    if "seconds" not in row:
        return f"{name}: {row['note']}"
    if row["note"]:
        return f"{name}, {tables.mesh_of(row)}: {row['note']}"
    off = f"{row['angle']:.3g}°, load {row['load']:.4g}, {row['position']:.3g} mm"
    return f"{name}, {tables.mesh_of(row)}: {row['seconds']:.3g} s, {off}"
