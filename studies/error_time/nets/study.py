"""The bias extension on irregular meshes and on nets: times by mesh, element and code.

Errors of the load are relative to the converged load of the study ``error_time``.
"""

import argparse
from collections.abc import Iterable, Sequence
from functools import cache
from pathlib import Path
from typing import NamedTuple

from ...common.tables import markdown_table, thousands
from ...study import Part, Row, Study
from ..cases import ThisLibrary, Timed, converged
from ..fronts import Criterion, Point, fastest, methods
from ..study import STUDY as ERROR_TIME
from ..study import factor_text
from .cases import MESHES, MESHING, Meshing, all_cases

#: Relative errors of the load at which run times are compared.
LEVELS = (0.03, 0.01, 0.005)

#: The element that every code has.
STANDARD = "P2, 3 points"

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


def gain(slow: Timing, fast: Timing, error: float) -> tuple[str, float] | None:
    """Ratio of two times to an error, after ``>`` or ``<`` if it is a bound.

    A timing that does not reach the error takes longer than its longest run.
    """
    both = slow, fast
    ends = [one.to(error) for one in both]
    if not any(ends) or not all(one.points for one in both):
        return None
    longer, shorter = (
        end.seconds.median if end else max(p.seconds.median for p in one.points)
        for end, one in zip(ends, both, strict=True)
    )
    return "" if all(ends) else ">" if ends[1] else "<", longer / shorter


def timings(rows: Sequence[Row]) -> list[Timing]:
    """Every element of every code on both kinds of meshes."""
    return [
        Timing(mesh, element, code, points)
        for mesh, criterion in _CRITERIA.items()
        for (code, element, _), points in methods(rows, criterion).items()
        if code != MESHING
    ]


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
        """Formatted results with `STANDARD` on nets.

        ``net_reached_ERROR`` is the number of codes that reach an error.
        ``codes_ERROR`` is the range of the ratios of times, other codes to this
        library; ``codes_ERROR_solves`` and ``ours_ERROR_solves`` are linear solves.
        """
        on_nets = [x for x in timings(rows) if x[:2] == ("net", STANDARD)]
        ours = next(x for x in on_nets if x.code == ThisLibrary.code)
        others = [x for x in on_nets if x is not ours]
        words: dict[str, str] = {}
        for error in LEVELS:
            level = _number(error)
            reached = {x.code: point for x in on_nets if (point := x.to(error))}
            own = reached.pop(ours.code, None)
            ratios = sorted(
                (found[1], f"{found[0]} {factor_text(found[1])}".strip())
                for x in others
                if (found := gain(x, ours, error))
            )
            solves = sorted(point.solves for point in reached.values())
            words |= {
                f"level_{level}": _text(error),
                f"net_reached_{level}": f"{len(reached) + bool(own)} of {len(on_nets)}",
                f"codes_{level}": _range(text for _, text in ratios),
                f"codes_{level}_solves": _range(f"{n:g}" for n in solves),
                f"ours_{level}_solves": f"{own.solves:g}" if own else "-",
            }
        return words


def _range(sorted_texts: Iterable[str]) -> str:
    """The first and the last text; ``-`` if there is none."""
    texts = [*sorted_texts]
    ends = dict.fromkeys((texts[0], texts[-1]) if texts else "-")
    return " to ".join(ends)


@cache
def _converged() -> float:
    """The converged load in N of the stored results of `ERROR_TIME`."""
    end = converged(ERROR_TIME.stored(_DOCS / ERROR_TIME.folder))
    assert end
    return end.load


STUDY = Nets()
