"""Error against run time, of this library and of its rivals.

A scene is loaded with every formulation and every rival on finer and finer meshes.
The clock runs from mesh and fabric in memory to the end of the load, in a process that
has done the same once before.
"""

import csv
import json
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from time import perf_counter

from ..scenes import bias_extension
from . import machine, time_tables
from .comparison import (
    AUTO,
    BIAS,
    MACRO,
    MACRO_TRIANGLES,
    MEAN_QUADRATIC,
    METHODS,
    STRIP,
)
from .contestants import LONG, Contestant, Other, Own, Row
from .rivals.every import RIVALS

#: Written by `write` and by `draw`.
FILES = ("error_time.csv", "summary.json", "error_time.md")
PICTURES = ("error_time.png",)

#: Refinements: edges of elements across, after any division.
ACROSS = (4, 6, 8, 12, 16, 24, 32, 48, 64, 96, 128, 192, 256)

#: Scenes in one load step: the strip, and the bias extension to 40° at E/G = 2·10⁵.
PROBLEMS = {
    "strip": replace(STRIP, steps=1, last=1),
    "bias_extension": replace(BIAS[1], scene=bias_extension, steps=1, last=1),
}

_BY_NAME = {method.name: method for method in METHODS}

#: This library first, then the rivals.
CONTESTANTS: tuple[Contestant, ...] = (
    Own("Q4, one point", AUTO),
    Own("macro, quads", MACRO),
    Own("macro, triangles", MACRO_TRIANGLES),
    Own("P2, 3 points", _BY_NAME["quadratic"]),
    Own("P2, mean strain", MEAN_QUADRATIC),
    Own("Q4, 2×2", _BY_NAME["2×2 points"]),
    Own("Q4, isotropic", _BY_NAME["isotropic, κ = C"]),
    *map(Other, RIVALS),
)


def cases(scene: str) -> Iterator[list[Row]]:
    """The results of one method after the other, from coarse to fine meshes.

    A method is refined until a run takes longer than `LONG`; one that is not
    installed is one row that says so.

    Parameters
    ----------
    scene
        One of `PROBLEMS`.
    """
    problem = PROBLEMS[scene]
    for contestant in CONTESTANTS:
        head: Row = {
            "scene": scene,
            "code": contestant.code,
            "element": contestant.element,
            "across": 0,
        }
        if missing := contestant.missing():
            yield [head | {"note": f"skipped, not installed: {missing}"}]
            continue
        for across in ACROSS:
            start = perf_counter()
            row = head | contestant.measured(problem, across) | {"across": across}
            took = perf_counter() - start if row["note"] else row["seconds"]
            yield [row]
            if took > LONG:
                break


def line(rows: list[Row]) -> str:
    """One result, on one line."""
    (row,) = rows
    name = f"{row['scene']}, {row['code']}, {row['element']}"
    if "seconds" not in row:
        return f"{name}: {row['note']}"
    if row["note"]:
        return f"{name}, {row['across']} across: {row['note']}"
    off = f"{row['angle']:.3g}°, load {row['load']:.4g}, {row['position']:.3g} mm"
    return f"{name}, {row['across']} across: {row['seconds']:.3g} s, {off}"


def write(rows: list[Row], folder: Path) -> None:
    """Write every case as CSV, the bar as JSON, and the tables."""
    columns = list(dict.fromkeys(key for row in rows for key in row))
    with open(folder / "error_time.csv", "w", newline="") as file:
        writer = csv.DictWriter(file, fieldnames=columns)
        writer.writeheader()
        writer.writerows(rows)
    found = {"machine": machine.described(), **time_tables.summary(rows)}
    text = json.dumps(found, indent=2, ensure_ascii=False, allow_nan=False)
    (folder / "summary.json").write_text(text + "\n")
    (folder / "error_time.md").write_text(
        machine.sentence(found["machine"]) + "\n\n" + time_tables.tables(rows)
    )


def draw(rows: list[Row], folder: Path) -> None:
    """Draw `PICTURES`: errors against seconds."""
    from ..plot.work_precision import work_precision

    work_precision(time_tables.curves(rows), folder / "error_time.png")
