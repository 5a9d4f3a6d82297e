"""Errors against unknowns with matplotlib."""

import os
from collections.abc import Mapping
from typing import Any

import matplotlib as mpl
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import NullFormatter
from numpy.typing import ArrayLike

from .curves import COLOURS, save
from .picture_files import picture_path

_MARKERS = "osD^vP*Xdh"


def convergence(
    rows: Mapping[str, Mapping[str, Mapping[str, tuple[ArrayLike, ArrayLike]]]],
    filename: str | os.PathLike[str] | None = None,
) -> Figure:
    """Errors against unknowns on logarithmic scales, panel by panel.

    Parameters
    ----------
    rows
        By what is off, a row of panels by their title, and in these the curves
        ``(unknowns, error)`` by their label, which has one colour in all of them.
    filename
        Where to write a PNG.

    Raises
    ------
    ValueError, FileNotFoundError
        As `picture_path`.

    Examples
    --------
    >>> lines = {"2×2": ([100, 400], [0.1, 0.02])}
    >>> figure = convergence({"mm": {"strip": lines, "trellis": lines}})
    >>> [axes.get_title() for axes in figure.axes]
    ['strip', 'trellis']
    """
    path = None if filename is None else picture_path(filename)
    labels = dict.fromkeys(
        label
        for panels in rows.values()
        for lines in panels.values()
        for label in lines
    )
    style: dict[str, dict[str, Any]] = {
        label: {
            "color": COLOURS[i % len(COLOURS)],
            "marker": _MARKERS[i % len(_MARKERS)],
            "linestyle": "-" if i < len(COLOURS) else "--",
            "linewidth": 1.2,
        }
        for i, label in enumerate(labels)
    }
    columns = max(len(panels) for panels in rows.values())
    with mpl.rc_context(
        {"font.size": 10, "axes.spines.top": False, "axes.spines.right": False}
    ):
        figure = Figure(figsize=(3.2 * columns, 2.8 * len(rows)), layout="constrained")
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
                axes.xaxis.set_minor_formatter(NullFormatter())
                axes.grid(alpha=0.3)
        figure.legend(
            handles=[Line2D([], [], label=label, **s) for label, s in style.items()],
            loc="outside lower center",
            ncols=3,
            frameon=False,
        )
        save(figure, path)
    return figure
