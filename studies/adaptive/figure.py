"""Estimates over errors, and position errors at equal unknowns, with matplotlib."""

import os
from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from ..common.figures import colour_of, figure_of, legend, marker_of
from ..study import Row
from .cases import KINKS
from .tables import MESHES, PASSES, SMALL

# Ends of the axes of load errors in per cent, and of position errors in mm.
_ENDS, _POSITIONS = (0.03, 30.0), (0.004, 1.0)


def draw_errors(
    rows: Sequence[Row], filename: str | os.PathLike[str] | None = None
) -> Figure:
    """Estimated against true errors of loads, and position errors by unknowns.

    Parameters
    ----------
    rows
        Rows of all tasks.
    filename
        Where to write a PNG.

    Examples
    --------
    >>> [axes.get_title() for axes in draw_errors([]).axes]
    ['Load', 'Position, 30°', 'Position, 45°', 'Position, 60°']
    """
    with figure_of((8.0, 6.6), filename, font_size=9) as figure:
        load, *positions = figure.subplots(2, 2).flat
        _draw_loads(load, [row for row in rows if row["task"] == "judges"])
        for axes, degrees in zip(positions, KINKS, strict=True):
            _draw_positions(axes, [row for row in rows if row["degrees"] == degrees])
            axes.set(
                title=f"Position, {degrees:g}°", xlabel="Unknowns", ylim=_POSITIONS
            )
            axes.set_ylabel("Error, rms over nodes (mm)")
        legend(figure, positions[0].get_legend_handles_labels()[0], len(MESHES) + 1)
    return figure


def _draw_loads(axes: Axes, rows: Sequence[Row]) -> None:
    ends = np.array(_ENDS)
    least, most = PASSES
    axes.fill_between(ends, least * ends, most * ends, color="0.9")
    axes.plot(ends, ends, color="grey", linewidth=0.8)
    axes.axvline(100 * SMALL, color="grey", linewidth=0.8, linestyle=":")
    known = [row for row in rows if row["estimate"] is not None]
    errors = [100 * abs(row["error"]) for row in known]
    axes.plot(errors, [100 * row["estimate"] for row in known], "o", markersize=3)
    axes.set(title="Load", xlabel="True error (%)", ylabel="Estimated error (%)")
    axes.set(xscale="log", yscale="log", xlim=_ENDS, ylim=_ENDS)


def _draw_positions(axes: Axes, rows: Sequence[Row]) -> None:
    for i, (mesh, label) in enumerate(({"uniform": "uniform"} | MESHES).items()):
        own = [row for row in rows if row["mesh"] == mesh]
        unknowns = [row["unknowns"] for row in own]
        errors = [row["position_error"] for row in own]
        style = {"color": colour_of(i), "marker": marker_of(i), "label": label}
        axes.loglog(unknowns, errors, markersize=4, linewidth=1.0, **style)
