"""Load error on meshes of users, as they are and fitted to the singular fibres."""

import argparse
from collections.abc import Sequence

import numpy as np

from ..common.tables import grouped, having, markdown_table, median
from ..study import Part, Row, Study
from .cases import CHOOSING, JUDGING, OnUsersMesh, on_users_meshes


def summary(rows: list[Row]) -> str:
    """A line for each kind and size of mesh, and formulation."""
    return markdown_table(
        [
            *("mesh", "across", "", "formulation", "runs", "median error"),
            *("95 %", "largest", "inside", "half-width", "unknowns", "s"),
        ],
        [
            [kind, across, mesh, formulation, *_line(of)]
            for (kind, across, mesh, formulation), of in grouped(
                rows, "kind", "across", "mesh", "formulation"
            ).items()
        ],
    )


def _line(rows: Sequence[Row]) -> list[object]:
    ran = [row for row in rows if not row["refused"]]
    errors = np.abs([row["error"] for row in ran])
    known = [row for row in ran if row["half_width"] is not None]
    runs = f"{len(ran)} of {len(rows)}" if len(ran) < len(rows) else len(rows)
    return [
        runs,
        f"{median(errors):.2%}",
        f"{np.quantile(errors, 0.95):.2%}",
        f"{errors.max():.2%}",
        f"{sum(map(is_inside, known))} of {len(known)}",
        f"{median([row['half_width'] for row in known]):.2%}",
        round(median([row["unknowns"] for row in ran])),
        f"{median([row['seconds'] for row in ran]):.2f}",
    ]


def is_inside(row: Row) -> bool:
    """True if the converged load is in the interval."""
    relative = abs(row["error"]) / (1 + row["error"])
    return bool(relative <= row["half_width"])


class UsersMeshes(Study[OnUsersMesh]):
    """Specimens on irregular quadrilaterals and triangles."""

    parts = (
        Part("judged.csv", {"judged.md": summary}, cases=("judged: *",)),
        Part("chosen.csv", cases=("chosen: *",)),
    )
    timed = True
    sample = "judged: specimen 1, irregular, 16 across, 1"

    def figures(self, rows: list[Row]) -> dict[str, str]:
        own = [row for row in rows if row["case"].startswith("judged: ")]
        fitted = having(own, mesh="fitted")
        default = having(fitted, formulation=fitted[0]["formulation"])
        known = [row for row in default if row.get("half_width") is not None]
        errors = np.abs([row["error"] for row in default if not row["refused"]])
        return {
            "median": f"{median(errors):.2%}",
            "inside": f"{sum(map(is_inside, known))} of {len(known)}",
        }

    def cases(self, options: argparse.Namespace) -> Sequence[OnUsersMesh]:
        return [
            *on_users_meshes(JUDGING, "judged: "),
            *on_users_meshes(CHOOSING, "chosen: "),
        ]


STUDY = UsersMeshes()
