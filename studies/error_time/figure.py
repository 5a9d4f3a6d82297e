"""Errors against seconds with matplotlib."""

import os
from collections.abc import Mapping
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from numpy import ndarray
from numpy.typing import ArrayLike

from ..common.figures import colour_of, figure_of, legend, marker_of

# Errors below this share of the largest one are round-off, and are not drawn.
_DECADES = 1e-8


def _best(seconds: ArrayLike, error: ArrayLike) -> tuple[ndarray, ndarray]:
    """The points for which no other is both faster and closer."""
    order = np.argsort(seconds, kind="stable")
    t, e = np.asarray(seconds)[order], np.asarray(error)[order]
    before = np.minimum.accumulate(np.append(np.inf, e[:-1]))
    return t[e < before], e[e < before]


def work_precision(
    panels: Mapping[str, Mapping[tuple[str, str], tuple[ArrayLike, ArrayLike]]],
    filename: str | os.PathLike[str] | None = None,
) -> Figure:
    """Errors against seconds on logarithmic scales, a panel for each error.

    Parameters
    ----------
    panels
        For each kind of error, the curves ``(seconds, error)`` by code and element.
        A code has one colour, an element one marker; the first code has a thicker line.
        A line joins the points for which no other of the curve is faster and closer.
    filename
        Where to write a PNG.

    Raises
    ------
    ValueError, FileNotFoundError
        As from `picture_path`.

    Examples
    --------
    >>> lines = {("ours", "Q4"): ([1, 2], [0.4, 0.1])}
    >>> figure = work_precision({"mm": lines, "°": lines})
    >>> [axes.get_ylabel() for axes in figure.axes]
    ['mm', '°']
    """
    keys = dict.fromkeys(key for lines in panels.values() for key in lines)
    codes = list(dict.fromkeys(code for code, _ in keys))
    elements = list(dict.fromkeys(element for _, element in keys))
    look: dict[str, dict[str, Any]] = {
        code: {
            "color": colour_of(i),
            "linestyle": "--" if i else "-",
            "linewidth": 1.0 if i else 2.0,
            "zorder": 2 if i else 3,
        }
        for i, code in enumerate(codes)
    }
    marker = {element: marker_of(i) for i, element in enumerate(elements)}
    lengthwise = -(-len(panels) // 2)
    with figure_of((10, 4 * lengthwise + 1), filename) as figure:
        grid = figure.subplots(lengthwise, 2, squeeze=False, sharex=True)
        for axes, (what, lines) in zip(grid.flat, panels.items(), strict=False):
            for (code, element), (seconds, error) in lines.items():
                shape, best = marker[element], _best(seconds, error)
                axes.loglog(*best, marker=shape, markersize=5, **look[code])
                axes.loglog(
                    *(seconds, error, shape),
                    **{"markersize": 3, "alpha": 0.3, "color": look[code]["color"]},
                )
            axes.set(xlabel="Seconds", ylabel=what)
            errors = np.concatenate([error for _, error in lines.values()])
            seen = errors[errors > _DECADES * errors.max()]
            axes.set_ylim(bottom=0.5 * seen.min())
            axes.grid(alpha=0.3)
        handles = [Line2D([], [], label=code, **s) for code, s in look.items()]
        handles += [
            Line2D([], [], color="0.3", linestyle="", marker=m, label=element)
            for element, m in marker.items()
        ]
        legend(figure, handles, 4)
    return figure
