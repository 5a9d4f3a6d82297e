"""Tables and results in words of the study of angles."""

from collections.abc import Iterable, Mapping, Sequence
from itertools import product
from typing import TypeAlias

import numpy as np

from ..common.tables import markdown_table
from ..study import Row
from .cases import (
    ACROSS,
    ANGLES,
    INCLINATIONS,
    LIMITS,
    MESHES,
    RATIOS,
    SPECIMENS,
    STEEP,
    Specimen,
    limit,
)
from .references import AGREEMENT, agree

#: A ply, shear angle, kind of elements, and number of edges across.
Key: TypeAlias = tuple[Specimen, int, str, int]


def are_references(rows: Sequence[Row]) -> bool:
    """Whether the rows are those of references."""
    return "halving" in rows[0]


def split(rows: Sequence[Row]) -> tuple[list[Row], list[Row]]:
    """The rows of references, and those of the cases that are judged."""
    converged = [row for row in rows if are_references([row])]
    return converged, [row for row in rows if not are_references([row])]


def errors(rows: Sequence[Row]) -> dict[Key, list[float]]:
    """Errors of the loads of the seeds, as shares of the reference."""
    found: dict[Key, list[float]] = {}
    for row in rows:
        mesh = row["elements"], row["across"]
        key = Specimen.of(row), row["shear_angle"], *mesh
        found.setdefault(key, []).append(row["load_over_reference"] - 1)
    return found


def agreements(rows: Sequence[Row]) -> str:
    """The references, and how much meshes and formulations differ."""
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


def summary(rows: Sequence[Row]) -> str:
    """The furthest median by inclination, and how many medians are within the limit."""
    lines, found = [], _medians(errors(rows))
    for inclination in INCLINATIONS:
        line = [f"{inclination:g}°"]
        for elements, across in _MESHES:
            own = {
                key: median
                for key, median in found.items()
                if (key[0].inclination, *key[2:]) == (inclination, elements, across)
            }
            most = 100 * limit(inclination, across)
            met = f"{_within(own)} of {len(own)} within {most:g} %"
            line += [_percent(_furthest(own.values())), met]
        lines.append(line)
    head = ["fibres"]
    for elements, across in _MESHES:
        head += [f"{elements}, {across} across: furthest median", "met by"]
    return markdown_table(head, lines)


def in_words(rows: Sequence[Row]) -> dict[str, str]:
    """The results that pages say, by name."""
    converged, compared = split(rows)
    found = errors(compared)
    medians = _medians(found)
    gentle = [
        1 - row["load"]
        for row in converged
        if row["ratio"] == max(RATIOS) and row["inclination"] <= STEEP
    ]
    lost = [(1 - row["load"]) / row["lost"] for row in converged]
    apart = _furthest(row[key] for row in converged for key in _CHECKS)
    single = _furthest(error for off in found.values() for error in off)
    words = {f"limit_{n}": f"{100 * LIMITS[n]:g} %" for n in ACROSS}
    words |= {f"limit_steep_{n}": f"{200 * LIMITS[n]:g} %" for n in ACROSS}
    return (
        words
        | {
            "met": f"{_within(medians)} of {len(medians)}",
            "single": f"{100 * abs(single):.1f} %",
            "references": f"{100 * abs(apart):.2f} %",
            "lost_stiff": f"{100 * max(gentle):.1f} %",
            "lost_most": f"{100 * max(1 - row['load'] for row in converged):.0f} %",
            "lost_over_estimate": f"{min(lost):.2f} to {max(lost):.2f}",
        }
        | {
            f"{elements}_{across}": f"{100 * abs(_furthest(own)):.1f} %"
            for elements, across in _MESHES
            if (
                own := [
                    x for key, x in medians.items() if key[2:] == (elements, across)
                ]
            )
        }
    )


_NAMES, _CHECKS = ("fibres", "law", "E/G"), ("apart", "halving")
_MESHES = tuple(product(MESHES, ACROSS))


def _medians(found: Mapping[Key, Sequence[float]]) -> dict[Key, float]:
    """Medians of the errors that are known; nan if none is."""
    known = {key: [x for x in off if np.isfinite(x)] for key, off in found.items()}
    return {key: float(np.median(x)) if x else np.nan for key, x in known.items()}


def _within(medians: Mapping[Key, float]) -> int:
    """How many medians are within their limits."""
    return sum(
        abs(median) <= limit(key[0].inclination, key[3])
        for key, median in medians.items()
    )


def _furthest(off: Iterable[float]) -> float:
    """The one furthest from zero of those that are known; nan if none is."""
    return max((x for x in off if np.isfinite(x)), key=abs, default=np.nan)


def _percent(share: float, digits: int = 2) -> str:
    return f"{100 * share:+.{digits}f} %" if np.isfinite(share) else "-"
