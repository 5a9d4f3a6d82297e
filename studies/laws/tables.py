"""Tables and results in words of the study of laws."""

from collections import Counter
from collections.abc import Iterator, Sequence

import numpy as np

from ..angles.cases import ACROSS, LIMITS
from ..angles.references import AGREEMENT
from ..common.tables import markdown_table
from ..study import Row
from .cases import (
    IN_MORE_STEPS,
    MATERIALS,
    QUADS,
    REFERENCES,
    STEEP_SHEAR,
    TRIANGLES,
    Material,
    Method,
    judged_methods,
)


def of(rows: Sequence[Row], material: Material, method: Method) -> list[Row]:
    """Rows of the cases with a material and a method."""
    key = material.name, method.name
    return [row for row in rows if (row["material"], row["method"]) == key]


def converged(rows: Sequence[Row], material: Material) -> float:
    """The load in N of the finest reference; nan if there is none."""
    return _loads(rows, material)[REFERENCES[-1]]


def errors(
    rows: Sequence[Row], material: Material, method: Method, across: int
) -> np.ndarray:
    """Errors of the loads of the seeds, as shares; nan if a run is refused."""
    own = [row for row in of(rows, material, method) if row["across"] == across]
    end = converged(rows, material)
    return np.array([row["load"] / end - 1 for row in own])


def references(rows: Sequence[Row]) -> str:
    """The loads of the references, and how much they differ."""
    lines = []
    for material in MATERIALS:
        loads = _loads(rows, material)
        apart, halving = _differences(loads)
        lines.append(
            [
                material.name,
                *(f"{x:.2f}" if np.isfinite(x) else "-" for x in loads.values()),
                _percent(apart),
                _percent(halving),
                "yes" if max(abs(apart), abs(halving)) <= AGREEMENT else "no",
            ]
        )
    head = [f"{method.name}, {cells} cells: N" for method, cells in REFERENCES]
    head += ["apart", "last halving", f"within {100 * AGREEMENT:g} %"]
    return markdown_table(["material", *head], lines)


def judged(rows: Sequence[Row]) -> str:
    """Errors of loads: their medians and the worst seeds."""
    lines = []
    for material in MATERIALS:
        for method in judged_methods(material):
            line = [material.name, method.name]
            own = of(rows, material, method)
            for across in ACROSS:
                off = errors(rows, material, method, across)
                seeds = [row for row in own if row["across"] == across]
                line += _cells(off, LIMITS[across], seeds)
            lines.append(line)
    head = ["material", "method"]
    for across in ACROSS:
        limit = f"within {100 * LIMITS[across]:g} %"
        head += [f"{across} across: median", "worst", limit, "warned"]
    return markdown_table(head, lines)


def in_words(rows: Sequence[Row]) -> dict[str, str]:
    """The results that pages say, by name."""
    words = {f"limit_{n}": f"{100 * LIMITS[n]:g} %" for n in ACROSS}
    medians = dict(_medians(rows))
    met = {
        share: sum(abs(x) <= share * LIMITS[key[2]] for key, x in medians.items())
        for share in (1.0, 0.5)
    }
    words["met"] = f"{met[1.0]} of {len(medians)}"
    words["met_half"] = f"{met[0.5]} of {len(medians)}"
    for name, method in (("quads", QUADS), ("triangles", TRIANGLES)):
        for across in ACROSS:
            key = [method, across]
            own = {m: abs(x) for (m, *other), x in medians.items() if other == key}
            words[f"{name}_{across}"] = _size(max(own.values()))
            words[f"{name}_{across}_steep"] = _size(own.pop(STEEP_SHEAR))
            words[f"{name}_{across}_others"] = _size(max(own.values()))
    differences = [_differences(_loads(rows, m)) for m in MATERIALS]
    words["references"] = f"{100 * np.max(np.abs(differences)):.2f} %"
    words["in_more_steps"] = _size(_change_in_more_steps(rows))
    return words


def _medians(
    rows: Sequence[Row],
) -> Iterator[tuple[tuple[Material, Method, int], float]]:
    """The median errors of the default formulation."""
    for material in MATERIALS:
        for method in (QUADS, TRIANGLES):
            for across in ACROSS:
                off = errors(rows, material, method, across)
                yield (material, method, across), float(np.nanmedian(off))


def _change_in_more_steps(rows: Sequence[Row]) -> float:
    """The largest change of a median with steep shear in more steps, as a share."""
    changes = [
        np.nanmedian(errors(rows, STEEP_SHEAR, more, across))
        - np.nanmedian(errors(rows, STEEP_SHEAR, method, across))
        for method, more in zip((QUADS, TRIANGLES), IN_MORE_STEPS, strict=True)
        for across in ACROSS
    ]
    return float(np.abs(changes).max())


def _loads(rows: Sequence[Row], material: Material) -> dict[tuple[Method, int], float]:
    """Loads of the references in N; nan where there is none."""
    return {
        (method, cells): next(
            (r["load"] for r in of(rows, material, method) if r["across"] == cells),
            np.nan,
        )
        for method, cells in REFERENCES
    }


def _differences(loads: dict[tuple[Method, int], float]) -> tuple[float, float]:
    """Other formulation and last halving against the finest, as shares of the load."""
    other, coarse, finest = loads.values()
    return other / finest - 1, finest / coarse - 1


def _cells(off: np.ndarray, limit: float, seeds: Sequence[Row]) -> list[str]:
    """Median, worst, whether the median is within the limit, and warnings."""
    known = off[np.isfinite(off)]
    if not known.size:
        return ["-"] * 4
    median, met = np.median(known), np.sum(np.abs(known) <= limit)
    refused = off.size - known.size
    return [
        _percent(median) + (f" ({refused} refused)" if refused else ""),
        _percent(known[np.abs(known).argmax()]),
        f"{'yes' if abs(median) <= limit else 'no'}, {met} of {off.size}",
        warned(seeds),
    ]


def warned(rows: Sequence[Row]) -> str:
    """Subjects of the warnings of runs, each with the number of runs.

    Examples
    --------
    >>> path = "the path was not resolved"
    >>> texts = (path, f"load factor 1: deviations carry 12% | {path}", None)
    >>> warned([{"warnings": text} for text in texts])
    'deviations 1, path 2'
    """
    told = Counter(
        subject
        for row in rows
        for subject in {_subject(x) for x in (row["warnings"] or "").split(" | ") if x}
    )
    return ", ".join(f"{subject} {n}" for subject, n in sorted(told.items())) or "-"


def _subject(warning: str) -> str:
    """The noun with which a warning begins."""
    text = warning.partition(": ")[2] if warning.startswith("load factor") else warning
    return text.removeprefix("the ").split()[0]


def _size(share: float) -> str:
    """The size of a share in words."""
    return f"{100 * abs(share):.1f} %"


def _percent(share: float) -> str:
    return f"{100 * share:+.2f} %" if np.isfinite(share) else "-"
