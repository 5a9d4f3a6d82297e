"""Report of a run: one HTML page."""

import csv
import tempfile
import tomllib
from argparse import Namespace
from collections.abc import Iterator, Mapping, Sequence
from math import isnan
from pathlib import Path
from typing import Any

from ..cases.build import case_from_file
from ..cases.finished import content_of, read_summary
from ..cases.sweep import axis_of
from ..cases.write import CASE
from ..mesh.progress import unlogged
from ..mesh.user_input import printable
from ..solve.quantities import (
    IN_SPACE,
    LOST,
    OF_PLY,
    Quantity,
    band_rows,
    first_rows,
)
from .curve import CURVE, Curve, completed, read_test_curve
from .output import say
from .page import Row, formatted, rows, sources, write_page
from .result_folder import ResultFolder
from .results import CURVES, captions, draw_curves

#: File of the report.
REPORT = "report.html"

#: File of the figures of each sample of the fabric.
SAMPLES = "samples.csv"

#: File of the figures at the ends of phases.
PHASES = "phases.csv"

# Decimals of figures of phases in N, mm, ° and %: less is round-off.
_DECIMALS = 6

# Acceptance checks of the last state: name, text if passed, text if failed.
_CHECKS = {
    "converged": ("Full load", "applied", "not applied: the run stopped early"),
    "stable": ("Equilibrium", "stable", "not stable"),
    "path_resolved": (
        "Load path",
        "resolved",
        "not resolved: a different number of steps may lead to a different equilibrium",
    ),
}


def run(options: Namespace) -> int:
    """Write ``report.html`` into the folder of a run; returns the exit code.

    The page contains all pictures and the numbers of ``curve.csv``, and has no external
    references. Curves are redrawn, with a test curve if one is given or named in the
    case. Damaged results are refused.
    """
    folder = options.folder
    summary = read_summary(folder)
    text = content_of(folder / CASE) if (folder / CASE).is_file() else None
    named, loops = _of_case(folder, text)
    test = options.test_curve or named
    curve: Curve = {}
    curves: dict[str, str] = {}
    no_curves = "No curve is drawn, because no load step was completed."
    if summary.get("load_steps") != 0:
        no_curves = f"The folder contains no {CURVE}."
        if (folder / CURVE).is_file():
            curve = read_test_curve(folder / CURVE)
            curves, no_curves = _drawn_curves(curve, folder, test, loops)
    scene = printable(summary.get("scene", "run")).replace("_", " ").capitalize()
    apart = "inputs", "versions", "first"
    values = {k: v for k, v in summary.items() if k not in apart}
    content = {
        "title": f"{scene}, {printable(summary.get('formulation', 'unknown'))}",
        "converged": summary.get("converged") is True,
        "load_factor": summary.get("load_factor"),
        "first": _first(folder, summary),
        "bands": band_rows(summary),
        "phases": _phases(folder),
        "samples": summary.get("samples_text"),
        "checks": list(_checks(summary)),
        "curves": curves,
        "columns": list(curve),
        "points": _points(curve),
        "file": sources(folder, {CURVE: CURVE}) if curve else {},
        "no_curves": no_curves,
        "pictures": sources(
            folder, {**captions(folder), "pattern.svg": "Flat pattern"}
        ),
        "case": text,
        "every_value": rows(values),
        "versions": rows(summary.get("versions")),
    }
    with ResultFolder(folder, (REPORT,)) as scratch:
        write_page(scratch, REPORT, REPORT, **content)
    say(f"report written to {printable(folder / REPORT)}")
    return 0


def _first(folder: Path, summary: Mapping[str, Any]) -> Sequence[Row]:
    """Rows that the run has printed."""
    try:
        return first_rows(summary)
    except (TypeError, ValueError):
        damaged = f"{printable(folder / 'summary.json')} is damaged: repeat the run"
        raise ValueError(damaged) from None


# Figures at the ends of phases by key, with names as in the results.
_NAMES = {one.key: one for one in (IN_SPACE, LOST, *OF_PLY)} | {
    "max_draw_in_mm": Quantity("Largest draw-in", "", "mm"),
    "share": Quantity("Share of the phase", "", "%"),
}


def _phases(folder: Path) -> list[list[float | str]]:
    """Table of a run with a column for each phase; empty if there are none."""
    if not (folder / PHASES).is_file():
        return []
    rows = [*csv.reader(content_of(folder / PHASES).splitlines())]
    if not rows or any(len(row) != len(rows[0]) for row in rows):
        raise ValueError(f"{printable(folder / PHASES)} is damaged: repeat the run")
    return [_row_of_phases(*column) for column in zip(*rows, strict=True)]


def _row_of_phases(key: str, *cells: str) -> list[float | str]:
    """Row of a table of phases: name with unit, and values."""
    if (one := _NAMES.get(key)) is None:
        return [axis_of(key), *(_short(cell, 1.0) for cell in cells)]
    scale = 100.0 if one.unit == "%" else 1.0
    return [f"{one.name} ({one.unit})", *(_short(cell, scale) for cell in cells)]


def _short(cell: str, scale: float) -> float | str:
    """Number of four digits, of which round-off is 0; any other text unchanged."""
    try:
        return float(f"{round(scale * float(cell), _DECIMALS):.4g}") + 0.0
    except ValueError:
        return cell


def _checks(summary: Mapping[str, Any]) -> Iterator[Row]:
    """Rows for the acceptance checks of the last state."""
    for key, (name, good, bad) in _CHECKS.items():
        holds = summary.get(key)
        if holds is None:
            yield name, "", "unknown"
        else:
            yield (name, "good", good) if holds is True else (name, "bad", bad)
    folding = summary.get("min_det_F")
    if isinstance(folding, int | float):
        smallest = f"smallest det F {formatted(folding)}"
        if folding > 0:
            yield "Elements", "good", f"none folded, {smallest}"
        else:
            yield "Elements", "bad", smallest
    if "exact_answer" in summary:
        yield "Exact solution", "", summary["exact_answer"]


def _of_case(folder: Path, text: str | None) -> tuple[Path | None, bool]:
    """Test curve named in a case, and whether its motions may reverse."""
    try:
        tables = tomllib.loads(text or "")
        output, stepping = (tables.get(name, {}) for name in ("output", "stepping"))
        named = output.get("test_curve")
        loops = bool(stepping.get("programme") or stepping.get("release"))
    except (ValueError, AttributeError, RecursionError):
        damaged = f"{printable(folder / CASE)} is damaged: it is not a valid case file"
        raise ValueError(damaged) from None
    return folder / named if isinstance(named, str) else None, loops


def _points(curve: Curve) -> list[list[float | None]]:
    """Rows of a curve; None for empty cells."""
    rows_of_curve = zip(*(column.tolist() for column in curve.values()), strict=True)
    return [[None if isnan(x) else x for x in row] for row in rows_of_curve]


def _drawn_curves(
    run: Curve, folder: Path, test: Path | None, loops: bool
) -> tuple[dict[str, str], str]:
    """Curves as data URLs by title, or the reason why there are none."""
    measured = None
    if test:
        case = folder / CASE
        with unlogged():
            of = case_from_file(case).scene.shear_test if case.is_file() else None
        measured = completed(read_test_curve(test), of)
    elif (folder / "tool_force.png").is_file() and not (folder / "load.png").is_file():
        return {}, "The pictures contain the force of the tools."
    with tempfile.TemporaryDirectory() as scratch:
        try:
            draw_curves(run, measured, Path(scratch), loops)
        except ImportError as error:
            return {}, f"No curve is drawn: {error}."
        titles = {name: title for name, (title, *_) in CURVES.items()}
        return sources(
            Path(scratch), titles
        ), "No curve is drawn, because the reported force is zero."
