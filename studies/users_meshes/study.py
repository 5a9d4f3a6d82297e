"""Load error on meshes of users, as they are and fitted to the singular fibres."""

import argparse
from collections.abc import Sequence
from typing import Any

import numpy as np

from skfem_textile.ply.formulations import DEFAULT, ON_FIBRES
from skfem_textile.solve.quantities import ROUNDED

from ..common.tables import grouped, having, markdown_table, median
from ..study import Part, Row, Study
from .cases import JUDGING, OnUsersMesh, on_users_meshes
from .plates import OnFile, on_files


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
        share(median(errors)),
        share(np.quantile(errors, 0.95)),
        share(errors.max()),
        f"{sum(map(is_inside, known))} of {len(known)}",
        share(median([row["half_width"] for row in known])),
        round(median([row["unknowns"] for row in ran])),
        f"{median([row['seconds'] for row in ran]):.2f}",
    ]


def of_files(rows: list[Row]) -> str:
    """A line for each kind of plate."""
    lines = []
    for shape, of in grouped(
        [{**row, "shape": row["case"].split()[1]} for row in rows], "shape"
    ).items():
        left = sum("left as it is" in row["note"] for row in of)
        ran = [row for row in of if not row["refused"]]
        errors = np.abs([row["error"] for row in ran])
        known = [row for row in ran if row["half_width"] is not None]
        lines.append(
            [
                *(shape, len(of), left),
                share(median(errors)),
                share(errors.max()),
                f"{sum(map(is_inside, known))} of {len(known)}",
                share(median([row["half_width"] for row in known])),
            ]
        )
    head = ["plate", "runs", "left as they are", "median error", "largest", "inside"]
    return markdown_table([*head, "half-width"], lines)


def is_inside(row: Row, least: float = ROUNDED) -> bool:
    """True if the converged load is in the interval; by default as it is printed."""
    relative = abs(row["error"]) / (1 + row["error"])
    return bool(relative <= max(row["half_width"], least))


def share(x: Any) -> str:
    """A share in percent."""
    return f"{100 * x:.2f} %"


class UsersMeshes(Study[OnUsersMesh | OnFile]):
    """Specimens on irregular meshes, and plates on unstructured ones."""

    parts = (
        Part("judged.csv", {"judged.md": summary}, cases=("judged: *",)),
        Part("files.csv", {"files.md": of_files}, cases=("file: *",)),
    )
    timed = True
    sample = "judged: specimen 1, irregular, 16 across, 1"

    def figures(self, rows: list[Row]) -> dict[str, str]:
        own = [row for row in rows if row["case"].startswith("judged: ")]
        runs = [row for row in having(own, mesh="fitted") if not row["refused"]]
        runs = having(runs, formulation=ON_FIBRES.title)
        known = [row for row in runs if row["half_width"] is not None]
        errors = np.abs([row["error"] for row in runs])
        before = having(own, mesh="as it is", formulation=DEFAULT.title)
        seconds = {row["case"]: row["seconds"] for row in before}
        ratios = [row["seconds"] / seconds[row["case"]] for row in runs]
        plates = [row for row in rows if row["case"].startswith("file: ")]
        on_files = [row for row in plates if not row["refused"]]
        some = [row for row in on_files if row["half_width"] is not None]
        middle, most, largest = median(errors), np.quantile(errors, 0.95), errors.max()
        left = sum("left as it is" in row["note"] for row in plates)
        exactly = sum(is_inside(row, 0.0) for row in known)
        return {
            "errors": ", ".join(map(share, (middle, most, largest))),
            "inside": f"{sum(map(is_inside, known))} of {len(known)}",
            "inside_exactly": f"{exactly} of {len(known)}",
            "half_width": share(median([row["half_width"] for row in known])),
            "time": f"{median(ratios):.2f}",
            "largest_on_files": share(max(abs(row["error"]) for row in on_files)),
            "inside_on_files": f"{sum(map(is_inside, some))} of {len(some)}",
            "left": f"{left} of {len(plates)}",
        }

    def cases(self, options: argparse.Namespace) -> Sequence[OnUsersMesh | OnFile]:
        return [
            *on_users_meshes(JUDGING, "judged: "),
            *on_files(JUDGING, "file: "),
        ]


STUDY = UsersMeshes()
