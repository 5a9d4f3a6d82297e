"""Errors against unknowns with matplotlib."""

import os
from collections.abc import Mapping
from typing import Any

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import LogLocator, NullFormatter
from numpy.typing import ArrayLike

from skfem_textile.plot.curves import COLOURS

from ..common.figures import colour_of, figure_of, legend, marker_of


def convergence(
    rows: Mapping[str, Mapping[str, Mapping[str, tuple[ArrayLike, ArrayLike]]]],
    filename: str | os.PathLike[str] | None = None,
) -> Figure:
    """Errors against unknowns on logarithmic scales, panel by panel.

    Parameters
    ----------
    rows
        For each kind of error a row of panels by title, and in each panel the curves
        ``(unknowns, error)`` by label.  A label has one colour in all panels.
    filename
        Where to write a PNG.

    Raises
    ------
    ValueError, FileNotFoundError
        As from `picture_path`.

    Examples
    --------
    >>> lines = {"2×2": ([100, 400], [0.1, 0.02])}
    >>> figure = convergence({"mm": {"strip": lines, "trellis": lines}})
    >>> [axes.get_title() for axes in figure.axes]
    ['strip', 'trellis']
    """
    labels = dict.fromkeys(
        label
        for panels in rows.values()
        for lines in panels.values()
        for label in lines
    )
    style: dict[str, dict[str, Any]] = {
        label: {
            "color": colour_of(i),
            "marker": marker_of(i),
            "linestyle": "-" if i < len(COLOURS) else "--",
            "linewidth": 1.2,
        }
        for i, label in enumerate(labels)
    }
    columns = max(len(panels) for panels in rows.values())
    size = 2.3 * columns, 1.9 * len(rows) + 0.8
    with figure_of(size, filename, font_size=8) as figure:
        grid = figure.subplots(len(rows), columns, squeeze=False, sharex="col")
        for i, (what, panels) in enumerate(rows.items()):
            for j, (title, lines) in enumerate(panels.items()):
                axes = grid[i, j]
                for label, (x, y) in lines.items():
                    axes.loglog(x, y, markersize=4, **style[label])
                axes.set(
                    title=title if i == 0 else "",
                    xlabel="Unknowns" if i == len(rows) - 1 else "",
                    ylabel=what if j == 0 else "",
                )
                _label(axes)
                axes.grid(alpha=0.3)
        handles = [Line2D([], [], label=label, **s) for label, s in style.items()]
        legend(figure, handles, 3)
    return figure


def _label(axes: Axes) -> None:
    """Label values in full, three to a decade where there is about one."""
    low, high = axes.get_ylim()
    axes.yaxis.set_major_locator(
        LogLocator(subs=(1.0,) if high > 20 * low else (1.0, 2.0, 5.0))
    )
    axes.xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    for axis in (axes.xaxis, axes.yaxis):
        axis.set_major_formatter(lambda x, _: f"{x:g}")
        axis.set_minor_formatter(NullFormatter())
