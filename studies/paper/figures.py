"""Load curves and deformed strips, after Figs. 5 and 12."""

from collections.abc import Sequence
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np

from skfem_textile import plot
from skfem_textile.plot.curves import curves
from skfem_textile.ply.formulations import Full, OnePoint

from ..study import Row
from .strips import Strip


def draw(rows: Sequence[tuple[Strip, Row]], folder: Path) -> None:
    """Draw the strips whose stabilisation has an energy, each with what it draws."""
    drawn = [(case, row) for case, row in rows if not case.is_of_rates]
    panels = {
        "Fig. 5": [
            (case, row)
            for case, row in drawn
            if isinstance(case.formulation, Full)
            and case.mesh in ("aligned", "irregular")
        ],
        "Fig. 12": [pair for pair in drawn if pair[0].mesh == "irregular"],
        "Fig. 12, one point only": [
            pair for pair in drawn if isinstance(pair[0].formulation, OnePoint)
        ],
    }
    curves(
        {
            title: {
                f"{case.formulation.title}, {case.mesh}": tuple(row["curve"])
                for case, row in pairs
            }
            for title, pairs in panels.items()
        },
        "Displacement (mm)",
        "Force (N)",
        folder / "load_curves.png",
    )
    plot.contact_sheet(
        *(_last_state(case, row) for case, row in drawn),
        titles=[_caption(case, row) for case, row in drawn],
        filename=folder / "contact_sheet.png",
    )


def _last_state(case: Strip, row: Row) -> Any:
    """The part of the result that pictures need."""
    u = np.array(row["u"])
    state = SimpleNamespace(u=u, load_factor=row["load_factor"])
    return SimpleNamespace(
        ply=case.ply(), u=u, states=[state], tool=lambda load_factor: None
    )


def _caption(case: Strip, row: Row) -> str:
    """The figure's number, and how far the case came if it stopped early."""
    caption = f"Fig. {case.figure.partition(',')[0]}"
    if row["load_factor"] < 1:
        return f"{caption}, t = {row['load_factor']:.2f}"
    if isinstance(case.formulation, OnePoint):
        caption += f", Cs = {case.formulation.stabilisation:g}"
    return caption
