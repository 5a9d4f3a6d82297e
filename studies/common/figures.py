"""Figures of studies: layout, line styles, logarithmic axes and legends.

Matplotlib is imported when a figure is drawn.
"""

import os
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import Any

import numpy as np

#: File of a figure; None for a figure that is not written.
File = str | os.PathLike[str] | None

#: Width of a printed page in inches.
PAGE = 160 / 25.4

_MARKERS = "osD^vP*Xdh"


def colour_of(i: int) -> str:
    """Colour of the i-th series."""
    from skfem_textile.plot.curves import COLOURS

    return COLOURS[i % len(COLOURS)]


def style_of(i: int, **more: Any) -> dict[str, Any]:
    """Colour and marker of the i-th series."""
    return {"color": colour_of(i), "marker": _MARKERS[i % len(_MARKERS)], **more}


@contextmanager
def figure_of(size: tuple[float, float], file: File, font_size: int) -> Iterator[Any]:
    """A figure with a size in inches, written at the end of the block.

    Raises
    ------
    ValueError, FileNotFoundError
        As from `picture_path`, and if text is too small on a page, before anything is
        drawn.
    """
    from skfem_textile.plot.drawing import new_figure
    from skfem_textile.plot.layout import NUMBER

    printed = font_size * min(1.0, PAGE / size[0])
    if printed < NUMBER:
        raise ValueError(
            f"text of {printed:.1f} pt on a page: at least {NUMBER:g} pt is required"
        )
    with new_figure(file, font_size) as figure:
        figure.set_size_inches(size)
        yield figure


@contextmanager
def panels_of(
    size: tuple[float, float],
    file: File,
    font_size: int,
    titles: Sequence[str] = ("",),
    ylabels: Sequence[str] = ("",),
    xlabel: str = "",
    **sharing: Any,
) -> Iterator[tuple[Any, np.ndarray]]:
    """A figure with a grid of panels: one column per title, one row per y-label."""
    with figure_of(size, file, font_size) as figure:
        shape = len(ylabels), len(titles)
        grid = figure.subplots(*shape, squeeze=False, **sharing)
        for axes, title in zip(grid[0], titles, strict=True):
            axes.set_title(title)
        for axes, label in zip(grid[:, 0], ylabels, strict=True):
            axes.set_ylabel(label)
        for axes in grid[-1]:
            axes.set_xlabel(xlabel)
        yield figure, grid


def legend(
    figure: Any,
    styles: Mapping[str, Mapping[str, Any]],
    columns: int,
    more: Iterable[Any] = (),
) -> None:
    """Draw a legend of the lines below the figure."""
    from matplotlib.lines import Line2D

    lines = [Line2D([], [], label=label, **style) for label, style in styles.items()]
    figure.legend(
        handles=[*lines, *more],
        loc="outside lower center",
        ncols=columns,
        frameon=False,
    )


def plain_numbers(axes: Any, form: str = "g") -> None:
    """Label the major ticks of logarithmic axes with plain numbers, minor ticks not."""
    from matplotlib.ticker import NullFormatter

    for axis in (axes.xaxis, axes.yaxis):
        axis.set_major_formatter(lambda x, _: f"{x:{form if x > 1e-5 else 'g'}}")
        axis.set_minor_formatter(NullFormatter())


def ticks_of_decades(axes: Any) -> None:
    """Put y-ticks at decades, or three per decade if the range is about one decade."""
    from matplotlib.ticker import LogLocator

    low, high = axes.get_ylim()
    few = (1.0,) if high > 20 * low else (1.0, 2.0, 5.0)
    axes.yaxis.set_major_locator(LogLocator(subs=few))
