"""Tables of the study of laws, in Markdown."""

from collections import Counter
from collections.abc import Sequence

import numpy as np

from ..common.tables import markdown_table
from ..study import Row
from .cases import (
    AGREEMENT,
    LIMITS,
    LINEAR_TRIANGLES,
    MATERIALS,
    QUADRATIC,
    REFERENCES,
    Material,
    Method,
    judged_methods,
)


def of(rows: Sequence[Row], material: Material, method: Method) -> list[Row]:
    """Rows of the cases with a material and a method."""
    key = material.name, method.name
    return [row for row in rows if (row["material"], row["method"]) == key]


def by_refinement(
    rows: Sequence[Row], material: Material, method: Method
) -> dict[int, float]:
    """Loads of a reference by the number of cells across, those that it reached."""
    own = of(rows, material, method)
    loads = {row["across"]: row["load"] for row in own if np.isfinite(row["load"])}
    return dict(sorted(loads.items()))


def converged(rows: Sequence[Row], material: Material) -> float:
    """The load of the finest quadratic triangles; nan if there is none."""
    return _last(by_refinement(rows, material, QUADRATIC), 1)


def references(rows: Sequence[Row]) -> str:
    """The loads of the references, and by how much they differ."""
    lines = []
    for material in MATERIALS:
        loads = {m: by_refinement(rows, material, m) for m in REFERENCES}
        line = [material.name]
        for method, found in loads.items():
            cells = REFERENCES[method]
            line += [f"{found[n]:.2f}" if n in found else "-" for n in cells]
        end = converged(rows, material)
        apart = _last(loads[LINEAR_TRIANGLES], 1) / end - 1
        line.append(_percent(apart))
        line += [_percent(_last(x, 1) / _last(x, 2) - 1) for x in loads.values()]
        line.append("yes" if abs(apart) <= AGREEMENT else "no")
        lines.append(line)
    head = ["material"]
    for method, cells in REFERENCES.items():
        name = method.name.removesuffix(" triangles")
        head += [f"{name}, {n}: N" for n in cells]
    head += ["apart", *(f"last halving, {m.name.split()[0]}" for m in REFERENCES)]
    return markdown_table([*head, f"within {100 * AGREEMENT:g} %"], lines)


def judged(rows: Sequence[Row]) -> str:
    """By how much loads are off, their medians and the worst seeds."""
    lines = []
    for material in MATERIALS:
        end = converged(rows, material)
        for method in judged_methods(material):
            line = [material.name, method.name]
            own = of(rows, material, method)
            for across, limit in LIMITS.items():
                seeds = [row for row in own if row["across"] == across]
                line += _cells(seeds, end, limit)
            lines.append(line)
    head = ["material", "method"]
    for across, limit in LIMITS.items():
        head += [
            f"{across} across: median",
            "worst",
            f"within {100 * limit:g} %",
            "warned",
        ]
    return markdown_table(head, lines)


def _cells(seeds: Sequence[Row], end: float, limit: float) -> list[str]:
    """Median, worst, whether the median is within the limit, and warnings."""
    off = np.array([row["load"] / end - 1 for row in seeds])
    off = off[np.isfinite(off)]
    if not off.size:
        return ["-"] * 4
    median, met = np.median(off), np.sum(np.abs(off) <= limit)
    refused = len(seeds) - off.size
    return [
        _percent(median) + (f" ({refused} refused)" if refused else ""),
        _percent(off[np.abs(off).argmax()]),
        f"{'yes' if abs(median) <= limit else 'no'}, {met} of {len(seeds)}",
        warned(seeds),
    ]


def warned(rows: Sequence[Row]) -> str:
    """What runs are warned of, each with the number of runs.

    Examples
    --------
    >>> path = "the path was not resolved"
    >>> said = (path, f"load factor 1: deviations carry 12% | {path}", "")
    >>> warned([{"warnings": text} for text in said])
    'deviations 1, path 2'
    """
    told = Counter(
        subject
        for row in rows
        for subject in {_subject(text) for text in row["warnings"].split(" | ") if text}
    )
    return ", ".join(f"{subject} {n}" for subject, n in sorted(told.items())) or "-"


def _subject(warning: str) -> str:
    """The noun with which a warning begins."""
    text = warning.partition(": ")[2] if warning.startswith("load factor") else warning
    return text.removeprefix("the ").split()[0]


def _last(loads: dict[int, float], back: int) -> float:
    """The finest load, or the one before it; nan if there are too few."""
    return list(loads.values())[-back] if len(loads) >= back else np.nan


def _percent(share: float) -> str:
    return f"{100 * share:+.2f} %" if np.isfinite(share) else "-"
