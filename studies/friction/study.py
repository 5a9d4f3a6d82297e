"""Forces and work of friction on belts, strips and wedges, and formed hemispheres."""

import argparse
from collections.abc import Sequence
from itertools import chain
from typing import Any

from ..common.tables import grouped, markdown_table, on, percent, table
from ..study import Part, Row, Study
from . import extremes
from .problems import Hemisphere, problems

# Further results that are exact.
_FURTHER = "work", "area", "distance"

# Elastic slip in mm and coefficient of the hemispheres whose energies are balanced.
_SLIP, _RUBS = 0.02, 0.2

# Areas on which the holder of a hemisphere presses.
_AREAS: dict[str, dict[str, bool]] = {
    "whole": {"whole_areas": True},
    "same_total": {"whole_areas": True, "same_total": True},
    "parts": {},
}


def exact(rows: list[Row]) -> str:
    """Forces against exact ones."""
    return markdown_table(
        [
            *("problem", "force", "exact", "difference"),
            *("of the work", "of the area", "of the distance", "solves"),
        ],
        [
            [
                row["case"],
                f"{row['force']:.5f}",
                f"{row['exact']:.5f}",
                f"{row['off']:.1e}",
                *(_difference(row.get(f"off_{name}")) for name in _FURTHER),
                row["solves"],
            ]
            for row in rows
            if not row.get("refused")
        ],
    )


def _difference(x: float | None) -> str:
    return "" if x is None else f"{x:.1e}"


def belts(rows: list[Row]) -> str:
    """Differences of the tensions of belts from the ones of polygons."""
    belts = grouped(rows, "wrap", "elements")
    coefficients = [f"μ {row['mu']:g}" for row in next(iter(belts.values()), [])]
    heads = (on(mu, ("exact", "by its kinks")) for mu in coefficients)
    return markdown_table(
        ["angle", "elements", *chain(*heads)],
        [
            [
                f"{wrap}°",
                elements,
                *chain(*((f"{x['off']:.1e}", f"{x['off_product']:.2e}") for x in of)),
            ]
            for (wrap, elements), of in belts.items()
        ],
    )


def balances(rows: list[Row]) -> str:
    """Balances of the energy of hemispheres with friction, and without."""
    pairs: dict[tuple[int, int], dict[float, float]] = {}
    for row in rows:
        if row["slip"] == _SLIP and not row["at_nodes"]:
            pair = pairs.setdefault((row["parts"], row["steps"]), {})
            pair[row["mu"]] = row["balance"]
    return markdown_table(
        ["parts", "steps", "with friction", "without", "more with friction"],
        [
            [*at, f"{100 * rubbed:.2f} %", f"{100 * free:.2f} %", f"{more:.2f} %"]
            for at, (rubbed, free) in (
                (at, (pair[_RUBS], pair[0.0])) for at, pair in pairs.items()
            )
            for more in [100 * (abs(rubbed) - abs(free))]
        ],
    )


def turning(rows: list[Row]) -> str:
    """Work of a plate that turns by 2 rad, by the number of steps."""
    columns = {"steps": "{steps}", "work of sliding in N·mm": "{work:.3f}"}
    columns |= {"exact": "{exact:.3f}", "difference": "{off:.1%}"}
    known = [{**row, "shown": "yes" if row["warned"] else "no"} for row in rows]
    return table(known, {**columns, "warning": "{shown}"})


def works(rows: list[Row]) -> str:
    """Work of sliding of hemispheres by the number of steps, and estimated errors."""
    return markdown_table(
        [
            *("holder", "steps", "work of sliding in N·mm"),
            *("difference from the most steps", "estimated error", "warning"),
        ],
        [
            [
                f"with a {holder}",
                row["steps"],
                f"{row['work']:.1f}",
                percent(row["work"] / of[-1]["work"] - 1, "+.1f"),
                percent(row["error"] / row["work"], ".1f"),
                "yes" if row["warned"] else "no",
            ]
            for holder, of in grouped(rows, "holder").items()
            for row in of
        ],
    )


def hemispheres(rows: list[Row]) -> str:
    """Hemispheres with and without friction."""
    return markdown_table(
        [
            *("hemisphere", "punch force in N", "largest angle", "draw-in in mm"),
            *("at the corner", "beyond the flange in mm", "work of sliding in N·mm"),
            *("work of the holder", "energy balance", "of it the stabilisation"),
            "solves",
        ],
        [
            [
                row["case"].removeprefix("hemisphere, "),
                f"{row['force']:.3f}",
                f"{row['angle']:.2f}°",
                f"{row['draw_in']:.2f}",
                f"{row['corner']:.2f}",
                f"{row['beyond']:.1f}",
                f"{row['work']:.1f}",
                f"{row['holder_work']:.2f}",
                f"{100 * row['balance']:.2f} %",
                f"{100 * row['of_stabilisation']:.2f} %",
                row["solves"],
            ]
            for row in rows
        ],
    )


class Friction(Study[Any]):
    """Friction with tools: exact forces, a hemisphere, and problems drawn at random."""

    parts = (
        Part(
            "exact.csv",
            {"exact.md": exact},
            cases=("strip, *", "rigid holder, *", "wedge, *"),
        ),
        Part("belts.csv", {"belts.md": belts}, cases=("belt, *",)),
        Part("turning.csv", {"turning.md": turning}, cases=("turning plate, *",)),
        Part("steps.csv", {"works.md": works}, cases=("steps, *",)),
        Part(
            "hemispheres.csv",
            {"hemispheres.md": hemispheres, "balances.md": balances},
            cases=("hemisphere*",),
        ),
        Part(
            "random.csv",
            {
                "outcomes.md": extremes.outcomes,
                "causes.md": extremes.causes,
                "deviations.md": extremes.deviations,
                "more_steps.md": extremes.more_steps,
            },
            cases=("judged, *",),
        ),
    )
    sample = "belt, μ 0.3, 90°, 60 elements"

    def cases(self, options: argparse.Namespace) -> Sequence[Any]:
        return [*problems(), *extremes.extremes()]

    def figures(self, rows: list[Row]) -> dict[str, str]:
        """Forces of hemispheres with contact at the nodes, by areas of the holder."""
        forces = {row["case"]: f"{row.get('force', 0):.3f} N" for row in rows}
        return {
            f"{name}_{rubs}": forces[case]
            for name, options in _AREAS.items()
            for rubs, mu in (("rubbing", _RUBS), ("free", 0.0))
            if (case := str(Hemisphere(24, 20, mu, at_nodes=True, **options))) in forces
        }

    def line(self, rows: list[Row]) -> str:
        """Outcome and cause of a problem drawn at random; all entries of others."""
        (row,) = rows
        if "outcome" not in row:
            return super().line(rows)
        return f"{row['case']}: {row['outcome']} {row['cause']}".rstrip()

    def complaint(self, rows: list[Row]) -> str:
        """Report wrong states."""
        wrong = sum(row.get("outcome") == extremes.WRONG for row in rows)
        return f"{wrong} wrong result(s)" if wrong else ""


STUDY = Friction()
