"""Draping on a sphere, a cylinder and a cone, against exact solutions."""

import argparse
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import fields
from typing import Any

import numpy as np

from ...common.figures import File, legend, panels_of, style_of
from ...common.tables import (
    Column,
    cell,
    grouped,
    having,
    markdown_table,
    percent,
    scientific,
    table,
)
from ...study import Part, Row, Study
from .cases import (
    EXPONENTIAL,
    FLAT,
    FROM_NET,
    GROWTH,
    NET,
    PUBLISHED,
    ROLLED,
    SPHERE,
    TIME,
    Case,
    all_cases,
)
from .extremes import EXTREME, REFUSED, RIGHT, TOLD, WRONG, Extreme, all_extremes
from .rolled import BIAS, CYLINDER, FAN, SQUARES

_DEFAULTS = {
    field.name: field.default
    for field in fields(Case)
    if field.name not in ("kind", "parts", "formulation")
}

# Names of the outcomes in tables.
_WORDS = {
    RIGHT: "right",
    TOLD: "inaccurate, reported",
    REFUSED: "refused",
    WRONG: "wrong",
}

Columns = Mapping[str, Column]

_MESH: Columns = {"formulation": "{formulation}", "parts per side": "{parts}"}
_LARGEST: Columns = {"largest error of Γ in °": "{largest:.4f}"}
_ERRORS: Columns = {**_LARGEST, "root mean square in °": "{rms:.4f}"}
_SOLVES: Columns = {"solves": "{solves}"}
_SECONDS: Columns = {"CPU time in s": "{seconds:.2f}"}
_PRESSURE: Columns = {
    "largest error of pressure": lambda r: _share(r["pressure_error"])
}


def _share(x: float | None) -> str:
    return "–" if x is None else f"{x:.2%}"


def of_runs(rows: Iterable[Row], settings: Columns, results: Columns) -> str:
    """A table with a line for each row, without results for failed runs."""
    refused = ["refused", *(len(results) - 1) * ["–"]]
    lines = [
        [
            *(cell(row, column) for column in settings.values()),
            *(refused if row["refused"] else (cell(row, c) for c in results.values())),
        ]
        for row in rows
    ]
    return markdown_table([*settings, *results], lines)


def _of(rows: Sequence[Row], kind: str, *different: str) -> list[Row]:
    """Rows of a kind with non-default values of exactly these settings."""
    return [r for r in having(rows, kind=kind) if _options(r) == [*different]]


def _options(row: Row) -> list[str]:
    """Names of the non-default settings of a row."""
    return [name for name, ordinary in _DEFAULTS.items() if row[name] != ordinary]


def refinement(rows: Sequence[Row]) -> str:
    """Error, solves and time of the Chebyshev net on regular meshes."""
    selected = [r for r in _of(rows, SPHERE) if r["formulation"] != FLAT]
    results = {"unknowns": "{unknowns}", **_ERRORS, **_SOLVES, **_SECONDS, **_PRESSURE}
    return of_runs(selected, _MESH, results)


def distorted(rows: Sequence[Row]) -> str:
    """Errors on meshes with nodes moved by 20 %."""
    formulation, parts = _MESH.items()
    settings = dict([formulation, ("nodes moved by 20 %", _moved), parts])
    tension = "{least_tension:.1f} to {largest_tension:.1f}"
    runs = _of(rows, SPHERE, "distortion") + _of(rows, SPHERE, "distortion", "halvings")
    results = {**_ERRORS, "fibre tension in N/mm": tension, **_PRESSURE}
    return of_runs(runs, settings, results)


def _moved(row: Row) -> str:
    halvings = row["halvings"]
    if not halvings:
        return "in each mesh independently"
    return f"with {row['parts'] // 2**halvings} parts, then halved"


def nets(rows: Sequence[Row]) -> str:
    """Error of kinematic nets."""
    forms = "{parts}", "{largest:.5f}", "{rms:.5f}"
    columns = dict(zip(("cells per side", *_ERRORS), forms, strict=True))
    return table(_of(rows, NET), {**columns, **_SECONDS})


def published_nets(rows: Sequence[Row]) -> str:
    """Differences between nets and a published method."""
    return table(
        _of(rows, PUBLISHED, "surface"),
        {
            "draping": "{surface}",
            "cells": "{cells}",
            "largest shear angle in °": "{largest_shear:.1f}",
            "largest difference in °": "{largest:.3f}",
            "mean difference in °": "{mean:.4f}",
        },
    )


def rolled(rows: Sequence[Row]) -> str:
    """Spurious shear on developable surfaces, on successively finer meshes."""
    all_rows = having(rows, kind=ROLLED)
    parts = sorted({row["parts"] for row in all_rows})
    lines = []
    for key, group in grouped(all_rows, "surface", "tension", "formulation").items():
        surface, tension, formulation = key
        shear = {
            row["parts"]: "refused" if row["refused"] else f"{row['largest']:.1e}"
            for row in group
        }
        shears = (shear.get(n, "–") for n in parts)
        lines.append([surface, f"{tension:g}", formulation, *shears])
    head = [f"shear angle in °, {n} parts" for n in parts]
    return markdown_table(["surface", "q in N/mm", "formulation", *head], lines)


def outcomes(rows: Sequence[Row]) -> str:
    """Outcomes of extreme drapes by group."""
    compared = "off_net", "off_finer"
    lines = []
    for group, selected in (grouped(rows, "group") | {"all": [*rows]}).items():
        count = Counter(row["outcome"] for row in selected)
        alone = sum(
            row["outcome"] == RIGHT and all(row.get(x) is None for x in compared)
            for row in selected
        )
        known = ([r[x] for r in selected if r.get(x) is not None] for x in compared)
        angles = [f"{max(off):.1f}" if off else "–" for off in known]
        counts = len(selected), *(count[outcome] for outcome in _WORDS), alone
        lines.append([group, *counts, *angles])
    head = ["group", "drapes", *_WORDS.values(), "right, not compared"]
    head += ["largest difference to the net in °", "to the finer mesh in °"]
    return markdown_table(head, lines)


def in_words(rows: Sequence[Row]) -> dict[str, str]:
    """Errors, orders and pressures for prose."""
    regular = _by_mesh(_of(rows, SPHERE))
    moved = _by_mesh(_of(rows, SPHERE, "distortion"))
    rolled = [r for r in having(rows, kind=ROLLED) if not r["refused"]]
    cylinders = [r for r in rolled if r["surface"] in (CYLINDER, BIAS)]
    along = [r["largest"] for r in rolled if r["surface"] != SQUARES]
    net = _of(rows, PUBLISHED, "surface")
    return {
        "largest_32": f"{regular['macro', 32]['largest']:.3f}°",
        "solves_32": str(regular["macro", 32]["solves"]),
        "orders": _orders(regular),
        "pressure": _largest(r for (_, n), r in regular.items() if n >= 16),
        "pressure_moved": _largest([moved["macro", 128]]),
        "pressure_cylinder": _largest(cylinders),
        "pressure_cone": _largest(having(rolled, surface=FAN)),
        "rolled": f"{scientific(max(along), 1)}°",
        "nets": f"{max(r['largest'] for r in net):.2f}°",
    } | extremes_in_words(having(rows, kind=EXTREME))


def extremes_in_words(rows: Sequence[Row]) -> dict[str, str]:
    """Numbers of extreme drapes and of each outcome.

    Examples
    --------
    >>> words = extremes_in_words([{"outcome": "right"}, {"outcome": "refused"}])
    >>> words["extremes"], words["extremes_right"]
    ('2', '1')
    """
    count = Counter(row["outcome"] for row in rows)
    names = {RIGHT: "right", TOLD: "reported", REFUSED: "refused", WRONG: "wrong"}
    return {
        "extremes": str(len(rows)),
        **{f"extremes_{name}": str(count[kind]) for kind, name in names.items()},
    }


def _by_mesh(rows: Iterable[Row]) -> dict[tuple[str, int], Row]:
    """Rows by formulation and parts per side."""
    return {(row["formulation"], row["parts"]): row for row in rows}


def _orders(rows: dict[tuple[str, int], Row]) -> str:
    """Orders of the largest error of macro-elements, 32 to 64 and 64 to 128 parts.

    Examples
    --------
    >>> _orders({("macro", n): {"largest": n**-2} for n in (32, 64, 128)})
    '2.0 and 2.0'
    """
    coarse, middle, fine = (rows["macro", n]["largest"] for n in (32, 64, 128))
    return f"{np.log2(coarse / middle):.1f} and {np.log2(middle / fine):.1f}"


def _largest(rows: Iterable[Row]) -> str:
    """The largest contact-pressure error in per cent, with two digits."""
    errors = (row["pressure_error"] for row in rows)
    return percent(max(e for e in errors if e is not None), ".2g")


def draw_error_time(rows: Sequence[Row], file: File = None) -> Any:
    """Draw rms error against CPU time, a panel for each initial guess."""
    from matplotlib.ticker import NullFormatter

    starts = EXPONENTIAL, FROM_NET, GROWTH
    styles = {name: style_of(i) for i, name in enumerate(grouped(rows, "formulation"))}
    form: dict[str, Any] = {
        "titles": [f"start: {start}" for start in starts],
        "xlabel": "seconds",
    }
    form |= {"ylabels": ["error of Γ in °, root mean square"]}
    form |= {"sharex": True, "sharey": True}
    with panels_of((8.8, 3.4), file, 10, **form) as (figure, grid):
        for axes, start in zip(grid[0], starts, strict=True):
            axes.set(xscale="log", yscale="log")
            axes.xaxis.set_minor_formatter(NullFormatter())
            axes.grid(alpha=0.3)
            for name, style in styles.items():
                known = having(rows, formulation=name, start=start)
                known = [row for row in known if not row["refused"]]
                seconds = [row["seconds"] for row in known]
                axes.plot(seconds, [row["rms"] for row in known], **style)
        legend(figure, styles, len(styles))
    return figure


class Drape(Study[Case | Extreme]):
    """All cases, on one thread; for example, ``--case 'time*'`` runs one part."""

    parts = (
        Part(
            "drape.csv",
            {
                "refinement.md": refinement,
                "distorted.md": distorted,
                "nets.md": nets,
                "rolled.md": rolled,
            },
            cases=(f"{SPHERE},*", f"{NET},*", f"{ROLLED},*"),
        ),
        Part(
            "published.csv", {"published.md": published_nets}, {}, (f"{PUBLISHED},*",)
        ),
        Part(
            "error_time.csv",
            pictures={"error_time.png": draw_error_time},
            cases=(f"{TIME},*",),
        ),
        Part(
            "extremes.csv",
            {"extremes.md": outcomes},
            cases=(f"{EXTREME},*",),
        ),
    )
    timed = True
    sample = str(Case(SPHERE, 32, "macro", distortion=0.2))

    def cases(self, options: argparse.Namespace) -> list[Case | Extreme]:
        return [*all_cases(), *all_extremes()]

    def line(self, rows: list[Row]) -> str:
        (row,) = rows
        result = (
            "{outcome}" if row["kind"] == EXTREME else "{largest:.2e}°, {seconds:.2f} s"
        )
        return f"{row['case']}: {row['refused'] or cell(row, result)}"

    def figures(self, rows: list[Row]) -> dict[str, str]:
        return in_words(rows)

    def complaint(self, rows: list[Row]) -> str:
        wrong = [row["case"] for row in having(rows, outcome=WRONG)]
        return f"{len(wrong)} wrong: {'; '.join(wrong)}" if wrong else ""


STUDY = Drape()
