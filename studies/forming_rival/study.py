"""Force of a punch over its travel in this library, DOLFINx and FElupe.

A quarter of a ply of 300 × 300 mm is formed by a hemispherical punch through a die,
with the same energy and the same penalty tools in every code, on the same squares.
"""

import argparse
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy import ndarray

from ..common.rivals.codes import FElupe, interpreter
from ..common.rivals.course import Course
from ..common.rivals.forming import Forming, dolfinx
from ..common.rivals.rival import QUAD4
from ..common.tables import grouped, markdown_table, percent
from ..study import Part, Row, Study
from .of_felupe import felupe
from .ours import ours

#: Entries ``code`` of this library, and of the fastest code.
OURS, DESCENT = "this library", "DOLFINx, descent"

#: Each code by name: a function of the case and the travels of the punch.
CODES: dict[str, Callable[[Forming, ndarray], Course]] = {
    OURS: ours,
    DESCENT: dolfinx,
    "DOLFINx, SNES": partial(dolfinx, method="snes"),
    "FElupe": felupe,
}


@dataclass(frozen=True)
class Case:
    """A ply with penalty tools, formed in equal steps by the installed codes."""

    forming: Forming
    steps: int = 10
    codes: tuple[str, ...] = tuple(CODES)

    def __str__(self) -> str:
        case = self.forming
        return f"{case.parts}×{case.parts}, {case.penalty:g} N/mm³ to {case.depth:g} mm"

    def rows(self) -> list[Row]:
        """Forces, draw-in, solves and times of each code, a row for each travel."""
        travels = self.forming.travels(self.steps)
        return [
            row
            for name in self.codes
            if name not in missing()
            for row in self._of(name, CODES[name](self.forming, travels))
        ]

    def _of(self, name: str, course: Course) -> list[Row]:
        last = len(course.travels) - 1
        return [
            {
                "case": str(self),
                "parts": self.forming.parts,
                "penalty": self.forming.penalty,
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
    return gone | ({"FElupe"} if FElupe(QUAD4).missing() else set())


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
    for course in grouped(rows, "case", "code").values():
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
        *("elements", "penalty in N/mm³", "code", "travel", "punch force", "draw-in"),
        *("of the corner", "largest difference of the force", "solves", "time"),
    ]
    lines = [
        [
            f"{row['parts']}×{row['parts']}",
            f"{row['penalty']:g}",
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
        return [
            Case(Forming(penalty=0.5)),
            Case(Forming(penalty=5.0)),
            # Close to tools as constraints, and beyond what Newton's method of this
            # library solves with a penalty.
            Case(Forming(penalty=50.0), codes=(DESCENT,)),
            Case(Forming(parts=6, depth=30.0), steps=2),
        ]

    def line(self, rows: list[Row]) -> str:
        """The end of each course."""
        return "\n".join(
            f"{row['case']}, {row['code']}: {row['force']:.3f} N at {row['travel']:g} "
            f"mm, difference {off:.1e}, {row['solves']} solves, {row['seconds']:.2f} s"
            for row, off in differences(rows)
        )

    def figures(self, rows: list[Row]) -> dict[str, str]:
        """Differences of the force, and ends of the courses at the full depth."""
        ends = [(row, off) for row, off in differences(rows) if row["parts"] > 6]
        known = [off for row, off in ends if row["code"] != OURS and np.isfinite(off)]
        ours = {row["penalty"]: row for row, _ in ends if row["code"] == OURS}
        ratios = {
            f"{short}_{1 + [*ours].index(k)}": row["seconds"] / ours[k]["seconds"]
            for short, code in (("descent", DESCENT), ("felupe", "FElupe"))
            for row, _ in ends
            if row["code"] == code and (k := row["penalty"]) in ours
        }
        penalties = {f"penalty_{i}": f"{k:g} N/mm³" for i, k in enumerate(ours, 1)}
        stiffest = max((row for row, _ in ends), key=lambda row: row["penalty"])
        return (
            {
                "difference": percent(max(known), ".2f"),
                "stiff_penalty": f"{stiffest['penalty']:g} N/mm³",
                "stiff_force": f"{stiffest['force']:.2f} N",
            }
            | {name: f"{ratio:.2g}" for name, ratio in ratios.items()}
            | penalties
        )


STUDY = FormingRival()
