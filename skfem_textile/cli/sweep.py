"""The command ``sweep``: a case at all combinations of values, and their figures."""

import argparse
from collections.abc import Mapping
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from ..cases.sweep import (
    REACHED,
    SOLVES,
    CaseSweep,
    axis_of,
    half_width_of,
    legible,
    resolved_case,
    run_variants,
    variants,
)
from ..cases.write import CASE, WRITTEN_FILES, WrittenCase, refuse_foreign_case
from ..mesh.progress import log_to_stderr, shown
from ..mesh.user_input import printable
from .interruption import INTERRUPTED, held
from .output import STOPPED_EARLY, complain, say
from .page import rows, sources, write_page
from .result_folder import ResultFolder
from .run import versions
from .run_options import with_tables
from .samples import executor_of, require_packages

#: Files of a sweep: finished runs, with which an interrupted sweep continues, table,
#: picture and page.
FINISHED, TABLE, PICTURE, PAGE = (
    "sweep.jsonl",
    "sweep.csv",
    "sweep.png",
    "sweep.html",
)


def run(options: argparse.Namespace) -> int:
    """Run a case at all combinations of values; returns the exit code.

    Raises
    ------
    ValueError
        If a case cannot be run.
    OutputError
        If the results cannot be written.
    """
    return with_tables(options, partial(_sweep, options=options))


@np.errstate(over="ignore", invalid="ignore")  # results that are not finite are refused
def _sweep(tables: Mapping[str, Any], base: Path, options: argparse.Namespace) -> int:
    require_packages("a sweep", options.scheduler)
    log_to_stderr(options.verbose)
    with shown("preparing the cases", printed=True):
        found = variants(tables, base)
        written = WrittenCase(resolved_case(found))
    refuse_foreign_case(options.out)
    files = TABLE, PICTURE, PAGE, *WRITTEN_FILES
    out = ResultFolder(options.out, files)
    executor = executor_of(options.workers, options.scheduler, len(found))
    try:
        with shown("running the cases", printed=True), executor as called:
            swept = run_variants(found, called, options.out / FINISHED)
    except KeyboardInterrupt:
        complain("interrupted: finished runs are kept; the same command continues")
        return INTERRUPTED
    with held(), out as folder:
        swept.write(folder / TABLE)
        written.write(folder)
        picture = "" if options.no_render else _drawn(swept, folder)
        _write_page(swept, folder, picture)
    if picture:
        say(f"the picture was not drawn: {picture}")
    _say(swept)
    say(f"results written to {printable(options.out)}: all values in {TABLE}")
    for line in swept.incomplete:
        complain(line)
    return STOPPED_EARLY if swept.incomplete else 0


def _drawn(swept: CaseSweep, folder: Path) -> str:
    """Draw the picture; returns the reason if it is not drawn."""
    try:
        from ..plot.curves import compared_runs

        compared_runs(*swept.drawn, folder / PICTURE)
    except Exception as error:
        return printable(error)
    return ""


def _columns(swept: CaseSweep) -> dict[str, str]:
    """Names and headings of the columns that are printed."""
    keys = {key: axis_of(key) for key in swept.vary}
    halves = {half_width_of(name) for name in swept.compared}
    figures = [x for x in swept.columns if x in halves | {*swept.compared}]
    return keys | {name: name for name in (*figures, SOLVES, REACHED)}


def _say(swept: CaseSweep) -> None:
    """Print the values and the compared figures."""
    columns = _columns(swept)
    cells = [[*columns.values()], *legible(swept.in_words, [*columns])]
    widths = [max(map(len, column)) for column in zip(*cells, strict=True)]
    for row in cells:
        say("  ".join(x.ljust(n) for x, n in zip(row, widths, strict=True)).rstrip())


def _write_page(swept: CaseSweep, folder: Path, no_picture: str) -> None:
    """Write a page with the picture, the tables and the case."""
    every = [*swept.columns]
    columns = _columns(swept)
    content = {
        "title": f"Sweep of {', '.join(map(axis_of, swept.vary))}",
        "incomplete": swept.incomplete,
        "number": len(swept.rows),
        "pictures": sources(folder, {PICTURE: "Figures of the runs over the values"}),
        "no_picture": no_picture,
        "head": [*columns.values()],
        "rows": legible(swept.in_words, [*columns]),
        "columns": every,
        "every": legible(swept.in_words, every),
        "file": sources(folder, {TABLE: TABLE}),
        "case": (folder / CASE).read_text(encoding="utf-8"),
        "versions": rows(versions()),
    }
    write_page(folder, PAGE, PAGE, **content)
