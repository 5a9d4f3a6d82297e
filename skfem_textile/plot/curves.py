"""Load curves with matplotlib."""

import os
from collections.abc import Mapping, Sequence
from itertools import cycle

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from numpy.typing import ArrayLike

from .layout import POINT, TITLE, default_width, text_width
from .picture_files import picture_path, save

# Okabe and Ito's colours, told apart with any kind of colour vision.
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000")

# Least height of a figure in inches.  Chosen by eye: room for the legend.
_LEAST_HEIGHT = 2.5

# Most columns of a legend; the line and gap before each label, and the gap after it, in
# sizes of the letters: matplotlib's defaults.
_MOST_COLUMNS, _LINE, _BETWEEN = 3, 2.8, 2.0


def curves(
    panels: Mapping[str, Mapping[str, tuple[ArrayLike, ArrayLike]]],
    xlabel: str,
    ylabel: str,
    filename: str | os.PathLike[str] | None = None,
) -> Figure:
    """Curves side by side, panel by panel; a label has one colour in all of them.

    Parameters
    ----------
    panels
        By the panel's title, the curves ``(x, y)`` in it by their label.
    xlabel, ylabel
        What is on the axes, with units.
    filename
        Where to write a PNG, or vectors: .svg, .pdf or .eps.

    Raises
    ------
    ValueError, FileNotFoundError
        As `picture_path`.

    Examples
    --------
    >>> figure = curves({"Fig. 5": {"aligned": ([0, 1], [0, 2])}}, "mm", "N")
    >>> [axes.get_title() for axes in figure.axes]
    ['Fig. 5']
    """
    path = None if filename is None else picture_path(filename)
    labels = dict.fromkeys(label for lines in panels.values() for label in lines)
    colour = dict(zip(labels, cycle(COLOURS), strict=False))
    style = {
        "axes.spines.top": False,
        "axes.spines.right": False,
        "font.size": TITLE,
        "axes.titlesize": TITLE,
        "axes.linewidth": 0.6,
        "lines.linewidth": 1.0,
    }
    width = default_width(len(panels)) / 25.4
    height = max(_LEAST_HEIGHT, 0.8 * width / len(panels))
    with mpl.rc_context(style):
        figure = Figure(figsize=(width, height), layout="constrained")
        for i, (title, lines) in enumerate(panels.items(), start=1):
            axes = figure.add_subplot(1, len(panels), i)
            for label, (x, y) in lines.items():
                axes.plot(x, y, "o-", label=label, color=colour[label], markersize=2)
            axes.set(title=title, xlabel=xlabel, ylabel=ylabel)
            axes.grid(alpha=0.3)
        figure.legend(
            handles=[
                Line2D([], [], marker="o", markersize=4, color=c, label=k)
                for k, c in colour.items()
            ],
            loc="outside lower center",
            ncols=_columns(list(labels), width * 25.4),
            frameon=False,
        )
        save(figure, path)
    return figure


def _columns(labels: Sequence[str], width: float) -> int:
    """How many columns of a legend fit a width in mm."""
    size = TITLE * POINT
    for n in range(_MOST_COLUMNS, 1, -1):
        columns = np.array_split([text_width(label, TITLE) for label in labels], n)
        widest = [column.max(initial=0.0) for column in columns]
        if sum(widest) + n * (_LINE + _BETWEEN) * size <= width:
            return n
    return 1
