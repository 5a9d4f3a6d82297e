"""Force of a punch over its travel in this library, DOLFINx and FElupe.

A quarter of a ply of 300 × 300 mm is formed by a hemispherical punch through a die,
with the same energy on the same squares.  In this library contact with the tools is a
constraint, in the other codes a penalty, which converges towards it.  With friction,
DOLFINx has an unsymmetric tangent, and therefore SNES alone.
"""

import argparse
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from ..common.rivals.codes import FElupe, interpreter
from ..common.rivals.course import Course
from ..common.rivals.forming import Forming, dolfinx
from ..common.rivals.rival import QUAD4
from ..common.tables import grouped, markdown_table, percent
from ..study import Part, Row, Study
from .of_felupe import felupe
from .ours import ours

#: Entries ``code`` of this library and of the others, of which descent is the fastest.
OURS, DESCENT = "this library", "DOLFINx, descent"
SNES, FELUPE = "DOLFINx, SNES", "FElupe"

# Codes with a ratio of times on pages, and their short names there.
_SHORT = {DESCENT: "descent", FELUPE: "felupe"}

# Elements along each side of plies that are formed in few steps, with the fastest code,
# and number of steps.
_PARTS, _FEW = (24, 48), 5

# Penalties in N/mm³.  With the last one, close to a constraint, only the fastest code.
_SOFT, _STIFF = (0.5, 5.0), 50.0

#: Each other code by name: a function of the ply between its tools and of the steps.
CODES: dict[str, Callable[[Forming, int], Course]] = {
    DESCENT: dolfinx,
    SNES: partial(dolfinx, method="snes"),
    FELUPE: felupe,
}


@dataclass(frozen=True)
class Case:
    """A ply formed in equal steps by this library and other codes.

    ``others`` are pairs of a penalty in N/mm³ and the name of a code, which is left out
    if it is not installed.
    """

    forming: Forming
    others: tuple[tuple[float, str], ...]
    steps: int = 10

    def __str__(self) -> str:
        made = self.forming
        rubs = f", μ {made.friction:g}" if made.friction else ""
        size = f"{made.parts}×{made.parts}"
        return f"{size} to {made.depth:g} mm in {self.steps} steps{rubs}"

    def rows(self) -> list[Row]:
        """Forces, draw-in, solves and times of each code, a row for each travel."""
        rows = self._of(OURS, None, ours(self.forming, self.steps))
        gone = missing()
        for penalty, name in self.others:
            if name not in gone:
                case = replace(self.forming, penalty=penalty)
                rows += self._of(name, penalty, CODES[name](case, self.steps))
        return rows

    def _of(self, name: str, penalty: float | None, course: Course) -> list[Row]:
        last = len(course.travels) - 1
        return [
            {
                "case": str(self),
                "parts": self.forming.parts,
                "steps": self.steps,
                "friction": self.forming.friction,
                "penalty": penalty,
                "code": name,
                "travel": round(float(travel), 9),
                "force": float(course.forces[i]),
                "draw_in": float(course.draw_in[i, 0]),
                "draw_in_of_corner": float(course.draw_in[i, 1]),
                "solves": int(course.solves[i]),
                "seconds": float(course.seconds[i]),
                "failure": course.failure if i == last else "",
            }
            for i, travel in enumerate(course.travels)
        ]


def missing() -> set[str]:
    """Names of the codes that are not installed."""
    gone = {name for name in CODES if "DOLFINx" in name and not interpreter()}
    return gone | ({FELUPE} if FElupe(QUAD4).missing() else set())


def differences(rows: Sequence[Row]) -> list[tuple[Row, float]]:
    """Last row of each course, and its largest relative difference of the force.

    From this library with the same case, at the travels that both reach.
    """
    ours_at = {
        (row["case"], row["travel"]): row["force"]
        for row in rows
        if row["code"] == OURS
    }
    found = []
    for course in grouped(rows, "case", "penalty", "code").values():
        pairs = [
            (row["force"], ours_at[row["case"], row["travel"]])
            for row in course
            if (row["case"], row["travel"]) in ours_at
        ]
        off = max((abs(a / b - 1) for a, b in pairs), default=np.nan)
        found.append((course[-1], off))
    return found


def courses(rows: Sequence[Row]) -> str:
    """End of each course, and its difference from this library."""
    heads = [
        *(
            "elements",
            "steps",
            "friction",
            "penalty in N/mm³",
            "code",
            "travel",
            "punch force",
            "draw-in",
        ),
        *("of the corner", "largest difference of the force", "solves", "time"),
    ]
    lines = [
        [
            f"{row['parts']}×{row['parts']}",
            f"{row['steps']}",
            f"{row.get('friction') or 0:g}",
            "–" if row["penalty"] is None else f"{row['penalty']:g}",
            row["code"],
            f"{row['travel']:g} mm",
            f"{row['force']:.2f} N",
            f"{row['draw_in']:.2f} mm",
            f"{row['draw_in_of_corner']:.2f} mm",
            "–" if row["code"] == OURS else percent(off, ".3f"),
            f"{row['solves']}",
            f"{row['seconds']:.1f} s",
        ]
        for row, off in differences(rows)
    ]
    return markdown_table(heads, lines)


class FormingRival(Study[Case]):
    """A ply formed by a punch in this library, DOLFINx and FElupe."""

    parts = (Part("courses.csv", {"courses.md": courses}),)
    timed = True

    def cases(self, options: argparse.Namespace) -> Sequence[Case]:
        soft = [(penalty, name) for penalty in _SOFT for name in CODES]
        rubbing = tuple((penalty, SNES) for penalty in _SOFT)
        quick = tuple((_SOFT[0], name) for name in CODES)
        fastest = tuple((penalty, DESCENT) for penalty in (*_SOFT, _STIFF))
        few = [Case(Forming(parts=parts), fastest, steps=_FEW) for parts in _PARTS]
        return [
            *few,
            Case(Forming(), (*soft, (_STIFF, DESCENT))),
            Case(Forming(parts=6, depth=30.0), quick, steps=2),
            Case(Forming(parts=12, friction=0.2), rubbing),
        ]

    def line(self, rows: list[Row]) -> str:
        """The end of each course."""
        return "\n".join(
            f"{row['case']}, {row['code']}{_at(row)}: {row['force']:.3f} N at "
            f"{row['travel']:g} mm, difference {off:.1e}, {row['solves']} solves, "
            f"{row['seconds']:.2f} s"
            for row, off in differences(rows)
        )

    def figures(self, rows: list[Row]) -> dict[str, str]:
        """Differences of the force and ratios of the times at the full depth."""
        smooth = [x for x in differences(rows) if not x[0].get("friction")]
        (ours, _), *others = [
            (row, off)
            for row, off in smooth
            if row["parts"] > 6 and row["steps"] > _FEW
        ]
        found = _with_friction(rows) | _in_few_steps(smooth)
        for i, penalty in enumerate((*_SOFT, _STIFF), 1):
            of_penalty = [
                (row, off) for row, off in others if row["penalty"] == penalty
            ]
            largest = max(off for _, off in of_penalty)
            found[f"penalty_{i}"] = f"{penalty:g} N/mm³"
            found[f"difference_{i}"] = percent(largest, ".2g")
            for row, _ in of_penalty:
                ratio = row["seconds"] / ours["seconds"]
                if name := _SHORT.get(row["code"]):
                    found[f"{name}_{i}"] = f"{ratio:.2g}"
        return found


def _in_few_steps(ends: Sequence[tuple[Row, float]]) -> dict[str, str]:
    """Ratios of the times in few steps, by elements and penalty."""
    found = {}
    few = [row for row, _ in ends if row["steps"] == _FEW]
    for parts in _PARTS:
        ours, *others = [row for row in few if row["parts"] == parts]
        for i, row in enumerate(others, 1):
            ratio = row["seconds"] / ours["seconds"]
            found[f"descent_of_{parts}_{i}"] = f"{ratio:.2g}"
    return found


def _with_friction(rows: Sequence[Row]) -> dict[str, str]:
    """Differences of the force and ratios of the times with friction."""
    of = [(row, off) for row, off in differences(rows) if row.get("friction")]
    ours = next((row for row, _ in of if row["code"] == OURS), None)
    found = {}
    for row, off in of:
        if ours and row["penalty"] in _SOFT:
            i = _SOFT.index(row["penalty"]) + 1
            found[f"rubbing_difference_{i}"] = percent(off, ".3f")
            times = row["seconds"], ours["seconds"]
            found[f"rubbing_times_{i}"] = f"{times[0]:.1f} s and {times[1]:.1f} s"
            found[f"rubbing_time_{i}"] = f"{times[0] / times[1]:.2g}"
            found[f"rubbing_solves_{i}"] = f"{row['solves']} and {ours['solves']}"
    return found


def _at(row: Row) -> str:
    """The penalty of a course, empty for this library."""
    return "" if row["penalty"] is None else f" at {row['penalty']:g} N/mm³"


STUDY = FormingRival()
