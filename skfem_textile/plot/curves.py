"""Load curves with matplotlib."""

import os
from collections.abc import Mapping
from itertools import cycle
from pathlib import Path

import matplotlib as mpl
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from numpy.typing import ArrayLike

from .picture_files import picture_path

# Okabe and Ito's colours, told apart with any kind of colour vision.
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000")


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
        Where to write a PNG.

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
        "font.size": 11,
    }
    with mpl.rc_context(style):
        figure = Figure(figsize=(4.8 * len(panels), 4.2), layout="constrained")
        for i, (title, lines) in enumerate(panels.items(), start=1):
            axes = figure.add_subplot(1, len(panels), i)
            for label, (x, y) in lines.items():
                axes.plot(x, y, "o-", label=label, color=colour[label], markersize=3)
            axes.set(title=title, xlabel=xlabel, ylabel=ylabel)
            axes.grid(alpha=0.3)
        figure.legend(
            handles=[
                Line2D([], [], marker="o", color=c, label=k) for k, c in colour.items()
            ],
            loc="outside lower center",
            ncols=3,
            frameon=False,
        )
        save(figure, path)
    return figure


def save(figure: Figure, path: Path | None) -> None:
    """Write a figure as PNG, beside its place first; do nothing without a path."""
    if path is not None:
        unfinished = path.with_name(f".unfinished-{path.stem}.png")
        figure.savefig(unfinished, dpi=150)
        unfinished.replace(path)
