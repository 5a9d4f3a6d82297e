"""Inf-sup constants and distances against the size of elements, with matplotlib."""

import os
from collections.abc import Sequence
from typing import Any

import matplotlib as mpl
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import FixedLocator, LogLocator, NullFormatter, NullLocator

from ..common.figures import colour_of, figure_of, legend, marker_of
from ..study import Row
from .cases import ACROSS, IRREGULAR, METHODS, Layout
from .tables import of

#: Results by what the axis calls them.
_RESULTS = {
    "inf_sup": "Inf-sup constant",
    "smooth_from_kernel": "Distance, smooth motion",
    "kinked_from_kernel": "Distance, kinked motion",
}

_LAYOUTS = (Layout(0), Layout(30), Layout(45), IRREGULAR)

# Labels of an axis over less than a decade or so, as multiples of powers of ten.
_FEW = (1.0, 2.0, 5.0)

_STYLES: dict[str, dict[str, Any]] = {
    method.name: {
        "color": colour_of(i),
        "marker": marker_of(i),
        "linestyle": "--" if method.triangles else "-",
        "linewidth": 1.2,
        "markersize": 4.5,
        "markerfacecolor": "white" if method.triangles else colour_of(i),
    }
    for i, method in enumerate(METHODS)
}


def draw_constants(
    rows: Sequence[Row], filename: str | os.PathLike[str] | None = None
) -> Figure:
    """A column of panels for each layout of fibres, a row for each result.

    Parameters
    ----------
    rows
        Rows of the study.
    filename
        Where to write a PNG.

    Examples
    --------
    >>> figure = draw_constants([])
    >>> [axes.get_title() for axes in figure.axes[:2]]
    ['Fibres at 0°', 'Fibres at 30°']
    """
    size = 1.7 * len(_LAYOUTS), 1.8 * len(_RESULTS) + 0.5
    with figure_of(size, filename, font_size=8) as figure:
        grid = figure.subplots(
            len(_RESULTS), len(_LAYOUTS), sharex=True, sharey="row", squeeze=False
        )
        for i, (key, label) in enumerate(_RESULTS.items()):
            for j, layout in enumerate(_LAYOUTS):
                axes = grid[i, j]
                for method in METHODS:
                    found = of(rows, method, layout)
                    values = [row[key] for row in found.values()]
                    axes.loglog(list(found), values, **_STYLES[method.name])
                axes.set_title(f"Fibres at {layout.name}" if i == 0 else "")
                axes.set_ylabel(label if j == 0 else "")
                axes.grid(alpha=0.3)
            _label(grid[i, 0])
        _slope(grid[0, 0], 1, 0.075)
        _slope(grid[0, 0], 2, 0.012)
        for axes in grid[-1]:
            axes.set_xlabel("Spacings a side, 1/h")
        handles = [Line2D([], [], label=name, **s) for name, s in _STYLES.items()]
        legend(figure, handles, 3)
    return figure


def _label(axes: mpl.axes.Axes) -> None:
    """Label the numbers of spacings and no others, and values without powers of ten."""
    axes.xaxis.set_major_locator(FixedLocator(ACROSS))
    axes.xaxis.set_minor_locator(NullLocator())
    low, high = axes.get_ylim()
    axes.yaxis.set_major_locator(LogLocator(subs=(1.0,) if high > 20 * low else _FEW))
    for axis in (axes.xaxis, axes.yaxis):
        axis.set_major_formatter(lambda x, _: f"{x:g}")
        axis.set_minor_formatter(NullFormatter())


def _slope(axes: mpl.axes.Axes, power: int, start: float) -> None:
    """A short line that falls with a power of h."""
    first, last = 4.0, 7.0
    end = start * (first / last) ** power
    axes.plot([first, last], [start, end], color="grey", linewidth=0.8)
    name = "h" if power == 1 else "h²"
    axes.annotate(name, (last, end), (3, -3), textcoords="offset points", color="grey")
