"""Tables of the study of angles, in Markdown."""

from collections.abc import Iterable, Sequence
from itertools import product

import numpy as np

from ..common.tables import markdown_table
from ..study import Row
from .cases import ACROSS, ANGLES, INCLINATIONS, MESHES, SPECIMENS, Specimen, limit
from .references import AGREEMENT, agree


def errors(
    rows: Sequence[Row], specimen: Specimen, angle: int, elements: str, across: int
) -> list[float]:
    """By how much the loads of the seeds are off, as shares of the reference."""
    key = specimen, angle, elements, across
    return [
        row["load_over_reference"] - 1
        for row in rows
        if (Specimen.of(row), row["shear_angle"], row["elements"], row["across"]) == key
    ]


def agreements(rows: Sequence[Row]) -> str:
    """The references, and by how much meshes and formulations differ."""
    lines = []
    for specimen in SPECIMENS:
        own = [row for row in rows if Specimen.of(row) == specimen]
        if not own:
            continue
        last = own[-1]
        lines.append(
            [
                *specimen.names,
                *(f"{row['load']:.4f}" for row in own),
                *(_percent(_furthest(row[key] for row in own), 3) for key in _CHECKS),
                "yes" if all(map(agree, own)) else "no",
                *(_percent(-x) for x in (1 - last["load"], last["lost"])),
            ]
        )
    head = [*_NAMES, *(f"{angle}°" for angle in ANGLES), "apart", "last halving"]
    head += [f"within {100 * AGREEMENT:g} %", f"stretch at {ANGLES[-1]}°", "estimate"]
    return markdown_table(head, lines)


def loads(rows: Sequence[Row]) -> str:
    """Median and worst error of the load of each ply at each shear angle."""
    lines = []
    for specimen, angle in product(SPECIMENS, ANGLES):
        found = [errors(rows, specimen, angle, *mesh) for mesh in _MESHES]
        if any(found):
            cells = [cell for off in found for cell in _cells(off)]
            lines.append([*specimen.names, f"{angle}°", *cells])
    head = [*_NAMES, "γ"]
    for elements, across in _MESHES:
        head += [f"{elements}, {across} across: median", "worst"]
    return markdown_table(head, lines)


def summary(rows: Sequence[Row]) -> str:
    """The largest median by inclination, and how many medians are within the limit."""
    lines = []
    for inclination in INCLINATIONS:
        own = [ply for ply in SPECIMENS if ply.inclination == inclination]
        line = [f"{inclination:g}°"]
        for mesh in _MESHES:
            seeds = [errors(rows, *case, *mesh) for case in product(own, ANGLES)]
            medians = [_median(off) for off in seeds if off]
            line += [
                _percent(_furthest(medians)),
                _within(medians, inclination, mesh[1]),
            ]
        lines.append(line)
    head = ["fibres"]
    for elements, across in _MESHES:
        head += [f"{elements}, {across} across: furthest median", "met by"]
    return markdown_table(head, lines)


_NAMES, _CHECKS = ("fibres", "law", "E/G"), ("apart", "halving")
_MESHES = tuple(product(MESHES, ACROSS))


def _within(medians: Sequence[float], inclination: float, across: int) -> str:
    """How many medians are within the limit."""
    most = limit(inclination, across)
    within = sum(abs(median) <= most for median in medians)
    return f"{within} of {len(medians)} within {100 * most:g} %"


def _cells(off: Sequence[float]) -> list[str]:
    """Median and worst, and how many runs are refused if any is."""
    refused = int(np.sum(~np.isfinite(off)))
    told = f" ({refused} refused)" if refused else ""
    return [_percent(_median(off)) + told, _percent(_furthest(off))]


def _median(off: Sequence[float]) -> float:
    """The median of those that are known; nan if none is."""
    known = [x for x in off if np.isfinite(x)]
    return float(np.median(known)) if known else np.nan


def _furthest(off: Iterable[float]) -> float:
    """The one furthest from zero of those that are known; nan if none is."""
    return max((x for x in off if np.isfinite(x)), key=abs, default=np.nan)


def _percent(share: float, digits: int = 2) -> str:
    return f"{100 * share:+.{digits}f} %" if np.isfinite(share) else "-"
