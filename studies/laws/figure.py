"""Errors of loads with each material, with matplotlib."""

import os
from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from ..angles.cases import LIMITS
from ..common.figures import colour_of, figure_of, legend, marker_of
from ..study import Row
from .cases import LINEAR, MATERIALS, judged_methods
from .tables import errors

# Methods beside each other in a column of width 1.
_SPREAD = 0.25


def draw_errors(
    rows: Sequence[Row], filename: str | os.PathLike[str] | None = None
) -> Figure:
    """Errors of loads: a panel for each refinement, a point for each mesh.

    Parameters
    ----------
    rows
        Rows of references and of cases that are judged.
    filename
        Where to write a PNG.

    Examples
    --------
    >>> [axes.get_title() for axes in draw_errors([]).axes]
    ['16 across', '32 across']
    """
    with figure_of((8.0, 3.8), filename, font_size=9) as figure:
        panels = figure.subplots(1, len(LIMITS), sharey=True)
        for axes, (across, limit) in zip(panels, LIMITS.items(), strict=True):
            axes.axhspan(-100 * limit, 100 * limit, color="0.9")
            _draw(axes, rows, across)
            axes.set_title(f"{across} across")
            names = [material.name for material in MATERIALS]
            axes.set_xticks(range(len(names)), names, rotation=20)
            axes.grid(alpha=0.3, axis="y")
        panels[0].set_ylabel("Error of the load (%)")
        handles = [
            Line2D([], [], linestyle="", label=method.name, **_style(i))
            for i, method in enumerate(judged_methods(LINEAR))
        ]
        legend(figure, handles, len(handles))
    return figure


def _draw(axes: Axes, rows: Sequence[Row], across: int) -> None:
    for place, material in enumerate(MATERIALS):
        for i, method in enumerate(judged_methods(LINEAR)):
            off = 100 * errors(rows, material, method, across)
            x = np.full(len(off), place + _SPREAD * (i - 1))
            axes.plot(x, off, linestyle="", alpha=0.7, **_style(i))


def _style(i: int) -> dict[str, Any]:
    return {"color": colour_of(i), "marker": marker_of(i), "markersize": 4.0}
