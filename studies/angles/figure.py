"""Loads over the references against the inclination of the fibres, with matplotlib."""

import os
from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from ..common.figures import colour_of, figure_of, legend, marker_of
from ..study import Row
from .cases import (
    ACROSS,
    ANGLES,
    INCLINATIONS,
    LAWS,
    MESHES,
    RATIOS,
    Specimen,
    limit,
)
from .tables import errors

# Width in degrees over which the lines of a panel stand beside each other.
_SPREAD = 3.0


def draw_loads(
    rows: Sequence[Row], filename: str | os.PathLike[str] | None = None
) -> Figure:
    """Loads at the largest shear angle: a panel for each kind of element and mesh.

    Points are medians of the seeds, bars go from the least to the largest load.

    Parameters
    ----------
    rows
        Rows of the cases that are judged.
    filename
        Where to write a PNG.

    Examples
    --------
    >>> figure = draw_loads([])
    >>> [axes.get_title() for axes in figure.axes[:2]]
    ['quads, 16 across', 'triangles, 16 across']
    """
    with figure_of((8.0, 6.4), filename, font_size=9) as figure:
        grid = figure.subplots(
            len(ACROSS), len(MESHES), sharex=True, sharey="row", squeeze=False
        )
        for i, across in enumerate(ACROSS):
            for j, elements in enumerate(MESHES):
                axes = grid[i, j]
                _draw(axes, rows, elements, across)
                axes.set_title(f"{elements}, {across} across")
                axes.set_ylabel("" if j else f"Load over reference, {ANGLES[-1]}°")
        for axes in grid[-1]:
            axes.set(xlabel="Fibres to the clamps (°)", xticks=INCLINATIONS)
        names = (Specimen(0.0, *given).names[1:] for given in _LINES)
        handles: list[Line2D | Patch] = [
            Line2D([], [], label=f"{law}, E/G = {ratio}", **style)
            for (law, ratio), style in zip(names, _LINES.values(), strict=True)
        ]
        legend(figure, [*handles, Patch(color="0.9", label="limit of medians")], 4)
    return figure


# Law and E/G of each line, and its style.
_LINES: dict[tuple[str, float], dict[str, Any]] = {
    (law, ratio): {
        "color": colour_of(j),
        "marker": marker_of(j),
        "linestyle": ("-", "--")[i],
        "markerfacecolor": (colour_of(j), "white")[i],
        "linewidth": 1.0,
        "markersize": 4.5,
    }
    for i, law in enumerate(LAWS)
    for j, ratio in enumerate(RATIOS)
}


def _draw(axes: Axes, rows: Sequence[Row], elements: str, across: int) -> None:
    for inclination in INCLINATIONS:
        sides = [inclination - _SPREAD, inclination + _SPREAD]
        widest = limit(inclination, across)
        axes.fill_between(sides, 1 - widest, 1 + widest, color="0.9")
    axes.axhline(1.0, color="grey", linewidth=0.8)
    beside = np.linspace(-_SPREAD, _SPREAD, len(_LINES) + 2)[1:-1]
    off = errors(rows)
    for (given, style), shift in zip(_LINES.items(), beside.tolist(), strict=True):
        loads = {}
        for inclination in INCLINATIONS:
            specimen = Specimen(inclination, *given)
            own = off.get((specimen, ANGLES[-1], elements, across), [])
            if known := [1 + error for error in own if np.isfinite(error)]:
                loads[inclination + shift] = known
        middle = [float(np.median(known)) for known in loads.values()]
        axes.plot(list(loads), middle, **style)
        for x, known in loads.items():
            axes.vlines(x, min(known), max(known), style["color"], linewidth=0.8)
    axes.grid(alpha=0.3, axis="y")
