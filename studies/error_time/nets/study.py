"""The bias extension on irregular meshes and on nets: gains by mesh, element and code.

Errors of the load are relative to the converged load of the study ``error_time``.
"""

import argparse
from collections.abc import Callable, Iterable, Iterator, Sequence
from functools import cache
from itertools import permutations, product
from pathlib import Path
from typing import NamedTuple

import numpy as np

from ...common.tables import grouped, having, markdown_table, median, thousands
from ...study import Part, Row, Study
from ..cases import ThisLibrary, Timed, converged
from ..fronts import Criterion, Point, fastest, methods
from ..study import STUDY as ERROR_TIME
from ..study import factor_text, key_of
from .cases import ACROSS, EDGES, MESHES, MESHING, SEEDS, Meshing, all_cases

#: Relative errors of the load at which run times are compared.
LEVELS = (0.03, 0.01, 0.005)

#: The element that every code has.
STANDARD = "P2, 3 points"

#: Causes of a gain: entries of timings, and whether a ratio goes from one to another.
CAUSES: dict[str, Callable[[str, str], bool]] = {
    "mesh": lambda slow, fast: slow == "irregular",
    "element": lambda slow, fast: slow == STANDARD,
    "code": lambda slow, fast: fast == ThisLibrary.code,
}

_DOCS = Path(__file__).parents[3] / "docs"

# Errors of the load by kind of mesh.
_CRITERIA = {
    mesh: Criterion(mesh, "load error", "%", LEVELS, lambda row, _: row.get("error"))
    for mesh in MESHES
}
_number, _text = _CRITERIA["net"].number, _CRITERIA["net"].text


class Timing(NamedTuple):
    """An element of a code on a kind of mesh, from coarse to fine meshes."""

    mesh: str
    element: str
    code: str
    points: list[Point]

    def to(self, error: float) -> Point | None:
        """The fastest point that reaches an error; None if none does."""
        return fastest(sorted(self.points, key=lambda p: p.seconds.median), error)

    def text(self, error: float) -> str:
        """Time, unknowns and error of this point, or of the finest mesh."""
        if point := self.to(error):
            unknowns = thousands(round(point.unknowns))
            return f"{_seconds(point)}, {unknowns}, {_text(point.error.median)}"
        if not self.points:
            return "no result"
        last = self.points[-1]
        return f"not reached: {_text(last.error.median)} in {_seconds(last)}"


class Gain(NamedTuple):
    """Two timings that differ in one of `CAUSES`."""

    cause: str
    slow: Timing
    fast: Timing

    @property
    def same(self) -> str:
        """The common entries of both timings."""
        return "; ".join(getattr(self.fast, x) for x in CAUSES if x != self.cause)

    @property
    def ends(self) -> tuple[str, str]:
        """The entries that differ."""
        return getattr(self.slow, self.cause), getattr(self.fast, self.cause)

    @property
    def key(self) -> str:
        """Part of the names of its results."""
        return key_of(" ".join((self.cause, *self.ends, self.same)))

    def ratio(self, error: float) -> tuple[str, float] | None:
        """Ratio of the times to an error, after ``>`` or ``<`` if it is a bound.

        A timing that does not reach the error takes longer than its longest run.
        """
        ends = [one.to(error) for one in self[1:]]
        if not any(ends) or not all(one.points for one in self[1:]):
            return None
        slow, fast = (
            end.seconds.median if end else max(p.seconds.median for p in one.points)
            for end, one in zip(ends, self[1:], strict=True)
        )
        return "" if all(ends) else ">" if ends[1] else "<", slow / fast

    def text(self, error: float) -> str:
        """The ratio as text."""
        found = self.ratio(error)
        return f"{found[0]} {factor_text(found[1])}".strip() if found else "-"


def timings(rows: Sequence[Row]) -> list[Timing]:
    """Every element of every code on both kinds of meshes."""
    return [
        Timing(mesh, element, code, points)
        for mesh, criterion in _CRITERIA.items()
        for (code, element, _), points in methods(rows, criterion).items()
        if code != MESHING
    ]


def gains(rows: Sequence[Row]) -> Iterator[Gain]:
    """Pairs that differ in one cause; at least one of both reaches an error."""
    pairs = [*permutations(timings(rows), 2)]
    for cause, (slow, fast) in product(CAUSES, pairs):
        gain = Gain(cause, slow, fast)
        differ = [x for x in CAUSES if getattr(slow, x) != getattr(fast, x)]
        known = any(map(gain.ratio, LEVELS))
        if differ == [cause] and CAUSES[cause](*gain.ends) and known:
            yield gain


def times(rows: Sequence[Row]) -> str:
    """Time, unknowns and error at each level, by mesh, element and code."""
    lines = [
        [one.mesh, one.element, _code(one.code), *map(one.text, LEVELS)]
        for one in timings(rows)
    ]
    return markdown_table(["mesh", "element", "code", *_within()], lines)


def _within() -> list[str]:
    return [f"within {_text(level)}" for level in LEVELS]


def _code(text: str) -> str:
    return text.replace(ThisLibrary.code, "this library")


def _seconds(point: Point) -> str:
    return f"{point.seconds.median:.2g} s"


class Nets(Study[Timed | Meshing]):
    """All codes on irregular meshes and on nets."""

    parts = (Part("nets.csv", {"nets.md": times}),)
    shown = "{across} across: {seconds:.3g} s"
    folder = ERROR_TIME.folder
    timed = True
    sample = "net, skfem_textile, P2, 3 points, fastest, seed 1"

    def cases(self, options: argparse.Namespace) -> list[Timed | Meshing]:
        return [*all_cases()]

    def examine(self, case: Timed | Meshing) -> list[Row]:
        """The rows of a case with the error of the load."""
        return [
            row | {"error": abs(load / _converged() - 1)}
            if (load := row.get("load"))
            else row
            for row in case.rows()
        ]

    def figures(self, rows: list[Row]) -> dict[str, str]:
        """Formatted results.

        ``MESH_CODE_ELEMENT_ERROR`` is a time to an error, with ``_unknowns`` and
        ``_solves``.  ``MESH_ours_ERROR`` and ``MESH_others_ERROR`` are the shortest
        times of this library and of other codes, with ``_element``.
        ``CAUSE_..._ERROR`` is the ratio of a `Gain`, and ``codes_ERROR`` the range of
        ratios of codes with `STANDARD` on nets, with ``_solves`` of the other codes.
        ``MESH_reached_ERROR`` is the number of codes that reach an error with it.
        ``making_MESH_ACROSS`` is the time to make a mesh.
        """
        words = {"seeds": str(len(SEEDS)), "meshes": _of(ACROSS["irregular"])}
        words["densities"] = _of(n / (2 * EDGES) for n in ACROSS["net"])
        made = grouped(having(rows, code=MESHING), "scene", "across")
        for (mesh, across), of in made.items():
            seconds = median(row["seconds"] for row in of)
            words[f"making_{mesh}_{across}"] = f"{seconds:.2g} s"
        known, pairs = timings(rows), [*gains(rows)]
        codes = [x for x in pairs if x.cause == "code" and x.same == f"net; {STANDARD}"]
        for error in LEVELS:
            level = _number(error)
            words[f"level_{level}"] = _text(error)
            for one in known:
                key = f"{key_of(f'{one.mesh} {one.code} {one.element}')}_{level}"
                point = one.to(error)
                words[key] = _seconds(point) if point else "not reached"
                if point:
                    words[f"{key}_unknowns"] = thousands(round(point.unknowns))
                    words[f"{key}_solves"] = f"{point.solves:g}"
            for mesh in MESHES:
                same = [x for x in known if x[:2] == (mesh, STANDARD)]
                reached = sum(x.to(error) is not None for x in same)
                words[f"{mesh}_reached_{level}"] = f"{reached} of {len(same)}"
            words |= _shortest(known, error)
            words |= {f"{gain.key}_{level}": gain.text(error) for gain in pairs}
            ratios = sorted(
                (found[1], x.text(error)) for x in codes if (found := x.ratio(error))
            )
            solves = [p.solves for x in codes if (p := x.slow.to(error))]
            words[f"codes_{level}"] = _range(text for _, text in ratios)
            words[f"codes_{level}_solves"] = _range(f"{n:g}" for n in sorted(solves))
        return words


def _range(sorted_texts: Iterable[str]) -> str:
    """The first and the last text; ``-`` if there is none."""
    texts = [*sorted_texts]
    ends = dict.fromkeys((texts[0], texts[-1]) if texts else "-")
    return " to ".join(ends)


def _of(numbers: Iterable[float]) -> str:
    """An enumeration."""
    *most, last = (f"{n:g}" for n in numbers)
    return f"{', '.join(most)} and {last}"


def _shortest(known: Sequence[Timing], error: float) -> dict[str, str]:
    """The shortest times of this library and of other codes on each kind of mesh."""
    words = {}
    for mesh, who in product(MESHES, ("ours", "others")):
        reached = [
            (point.seconds.median, _code(f"{one.element}, {one.code}"))
            for one in known
            if one.mesh == mesh
            and (one.code == ThisLibrary.code) == (who == "ours")
            and (point := one.to(error))
        ]
        key = f"{mesh}_{who}_{_number(error)}"
        seconds, element = min(reached, default=(np.nan, "none"))
        words[key] = f"{seconds:.2g} s" if reached else "not reached"
        words[f"{key}_element"] = element
    return words


@cache
def _converged() -> float:
    """The converged load in N of the stored results of `ERROR_TIME`."""
    end = converged(ERROR_TIME.stored(_DOCS / ERROR_TIME.folder))
    assert end
    return end.load


STUDY = Nets()
