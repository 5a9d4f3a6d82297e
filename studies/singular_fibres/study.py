"""Bias extensions and plies with holes on nets along the singular fibres."""

import argparse
from collections.abc import Sequence

import numpy as np

from ..common.tables import Column, grouped, markdown_table, percent, table, thousands
from ..study import Part, Row, Study
from .cases import (
    Case,
    Irregular,
    chosen,
    convergence,
    irregular_triangles,
    shapes,
    specimens,
)


def summary(rows: list[Row]) -> str:
    """A line for each shear law and for all specimens."""
    by_law = grouped(rows, "law")
    lines = [_line(law, of_law) for law, of_law in by_law.items()]
    head = [
        *("shear law", "specimens", "refused", "median error", "largest"),
        *("within 1 %", "within 3 %", "most unknowns", "longest run, s"),
    ]
    return markdown_table(head, [*lines, _line("all", rows)])


def _line(name: str, rows: list[Row]) -> list[object]:
    errors = sorted(abs(r["error"]) for r in rows if r["error"] is not None)
    return [
        *(name, len(rows), len(rows) - len(errors)),
        percent(errors[len(errors) // 2], ".2f"),
        percent(errors[-1], ".2f"),
        sum(e < 0.01 for e in errors),
        sum(e < 0.03 for e in errors),
        max(r["unknowns"] for r in rows),
        f"{max(r['seconds'] for r in rows):.2f}",
    ]


def shape_table(rows: list[Row]) -> str:
    """A line for each ply."""
    columns: dict[str, Column] = {
        "ply": "{case}",
        "law": "{law}",
        "E/G": "{ratio:.0e}",
        "unknowns": "{unknowns}",
        "load, N": "{load:.3f}",
        "error": lambda row: percent(row["error"]),
        "last change of the reference": lambda row: percent(row["last_change"]),
        "seconds": "{seconds:.2f}",
    }
    return table(rows, columns)


def convergence_table(rows: list[Row]) -> str:
    """A line for each specimen, a column for each density."""
    densities = sorted({row["density"] for row in rows})
    lines = []
    for (ratio, degrees), of in grouped(rows, "ratio", "degrees").items():
        errors = {row["density"]: row["error"] for row in of}
        lines.append(
            [
                *(f"{ratio:.0e}", f"{degrees:g}°"),
                *(percent(errors[density], "+.3f") for density in densities),
            ]
        )
    return markdown_table(
        ["E/G", "fibres", *(f"density {d:g}" for d in densities)], lines
    )


def irregular_table(rows: list[Row]) -> str:
    """A line for each formulation and number of elements across."""
    lines = []
    for (formulation, across), of in grouped(rows, "formulation", "across").items():
        errors = np.array([row["error"] for row in of])
        lines.append(
            [
                *(formulation, across, len(of)),
                percent(float(np.sqrt(np.mean(errors**2))), ".2f"),
                percent(float(errors[np.abs(errors).argmax()])),
                max(row["unknowns"] for row in of),
            ]
        )
    head = ["formulation", "elements across", "runs", "rms error", "largest"]
    return markdown_table([*head, "most unknowns"], lines)


class SingularFibres(Study[Case | Irregular]):
    """Specimens, shapes and convergence."""

    parts = (
        Part("specimens.csv", {"specimens.md": summary}, cases=("specimen *",)),
        Part(
            "convergence.csv",
            {"convergence.md": convergence_table},
            cases=("convergence*",),
        ),
        Part("shapes.csv", {"shapes.md": shape_table}, cases=("*°",)),
        Part("chosen.csv", cases=("chosen *",)),
        Part(
            "triangles.csv", {"triangles.md": irregular_table}, cases=("triangles *",)
        ),
    )
    shown = "{error:+.4f}, {unknowns} unknowns, {seconds:.2f} s"
    timed = True
    sample = "hole, 41°"

    def figures(self, rows: list[Row]) -> dict[str, str]:
        drawn = [row for row in rows if row["case"].startswith("specimen")]
        errors = [abs(row["error"]) for row in drawn if row["error"] is not None]
        return {
            "within_one": f"{sum(e < 0.01 for e in errors)} of {len(drawn)}",
            "most_unknowns": thousands(max(row["unknowns"] for row in drawn)),
        }

    def cases(self, options: argparse.Namespace) -> Sequence[Case | Irregular]:
        return [
            *specimens(),
            *shapes(),
            *convergence(),
            *chosen(),
            *irregular_triangles(),
        ]


STUDY = SingularFibres()
