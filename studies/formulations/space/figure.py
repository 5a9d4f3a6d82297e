"""The figure of the study of a ply in space."""

import os
from collections.abc import Sequence
from typing import Any

from matplotlib.lines import Line2D

from ...common.figures import colour_of, figure_of, legend, marker_of
from ...study import Row
from .problems import CANTILEVERS

# Markers of a formulation grow, so that lines on each other are all seen.
_FORMULATIONS = "quadratic", "one point", "macro"
_SIZES = 5, 5, 10


def draw_errors(rows: Sequence[Row], filename: str | os.PathLike[str]) -> None:
    """Errors of cantilevers and of plates over the number of element edges."""
    panels: list[tuple[str, dict[str, Any]]] = [
        *((f"Cantilever,\n{load}", {"load": load}) for load in CANTILEVERS),
        *((f"Plate,\nfibres at {angle}°", {"degrees": angle}) for angle in (0, 45)),
    ]
    with figure_of((8.8, 3.2), filename) as figure:
        for axes, (title, kind) in zip(
            figure.subplots(1, len(panels), sharey=True), panels, strict=True
        ):
            own = [
                row
                for row in rows
                if row["part"] in ("cantilever", "plate")
                and kind.items() <= row.items()
                and row.get("off_z") is not None
            ]
            for formulation in _FORMULATIONS:
                for moved in (False, True):
                    _draw(axes, own, formulation, moved)
            _second_order(axes)
            axes.set_title(title, fontsize=10)
            axes.set(xlabel="Edges", xscale="log", yscale="log")
            axes.set_xlim(7, 37)
            axes.set_xticks([8, 16, 32], ["8", "16", "32"])
            axes.minorticks_off()
            axes.grid(alpha=0.3)
        figure.axes[0].set_ylabel("Error")
        handles = [
            Line2D([], [], **_style(name, False), label=name) for name in _FORMULATIONS
        ]
        by_moved = Line2D(
            [], [], color="black", lw=1, ls="--", label="nodes moved by 20 %"
        )
        handles.append(by_moved)
        handles.append(Line2D([], [], color="0.6", ls=":", label="second order"))
        legend(figure, handles, columns=len(handles))


def _style(formulation: str, moved: bool) -> dict[str, Any]:
    i = _FORMULATIONS.index(formulation)
    return {
        "color": colour_of(i),
        "marker": marker_of(i),
        "markersize": _SIZES[i],
        "markerfacecolor": "none",
        "ls": "--" if moved else "-",
    }


def _draw(axes: Any, rows: Sequence[Row], formulation: str, moved: bool) -> None:
    line = [
        row
        for row in rows
        if row["formulation"] == formulation and bool(row["jitter"]) == moved
    ]
    if line:
        errors = [abs(row["off_z"]) for row in line]
        axes.plot([row["n"] for row in line], errors, **_style(formulation, moved))


def _second_order(axes: Any) -> None:
    axes.plot([8, 32], [4e-3, 4e-3 / 16], color="0.6", ls=":")
