"""What features cost, each added to those before it, with matplotlib."""

import os
from collections.abc import Mapping, Sequence
from typing import Any

import matplotlib as mpl
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from skfem_textile.plot.curves import COLOURS

from ..common.figures import figure_of
from .needs import two_digits

# Width and height in inches: as printed, 160 mm wide.
_SIZE = 6.3, 2.9

_MORE, _LESS, *_ = COLOURS

# Colour of changes within their scatter.
_NONE = "#bbbbbb"

# Gap between a bar and its number, and room that a number takes, as shares of the
# scale.  Chosen by eye.
_GAP, _ROOM = 0.03, 0.36


def waterfall(
    costs: Mapping[str, Sequence[tuple[float, float]]],
    names: Sequence[str],
    filename: str | os.PathLike[str] | None = None,
) -> Figure:
    """A panel for each cost; each bar leads from the cost without a feature to with it.

    Parameters
    ----------
    costs
        By the title of the panel, what each feature adds and the scatter of it.  A
        change within its scatter is grey.
    names
        The features, from the top.
    filename
        Where to write a picture.

    Examples
    --------
    >>> figure = waterfall({"s": [(2.0, 0.1), (1.0, 0.1), (0.1, 0.2)]}, "abc")
    >>> [text.get_text() for text in figure.axes[0].texts]
    ['+2', '+1', '≈ 0']
    """
    with figure_of(_SIZE, filename, font_size=8) as figure:
        panels = figure.subplots(1, len(costs), sharey=True, squeeze=False)[0]
        for axes, (title, changes) in zip(panels, costs.items(), strict=True):
            axes.set_title(title, fontsize=8)
            _panel(axes, changes)
        panels[0].set_yticks(range(len(names)), names)
        panels[0].invert_yaxis()
    return figure


def _panel(axes: mpl.axes.Axes, changes: Sequence[tuple[float, float]]) -> None:
    totals = [sum(change for change, _ in changes[:i]) for i in range(len(changes) + 1)]
    scale = max(totals)
    for row, (change, scatter) in enumerate(changes):
        if not change:
            continue
        before, after = totals[row], totals[row + 1]
        none = row > 0 and abs(change) < scatter
        colour = _NONE if none else _MORE if change > 0 else _LESS
        axes.barh(row, change, left=before, color=colour)
        if row + 1 < len(changes):
            axes.plot([after] * 2, [row - 0.4, row + 1.4], color="grey", linewidth=0.5)
        text = two_digits(change, scatter if row else 0.0)
        _write(axes, text, row, sorted((before / scale, after / scale)), scale)
    axes.set_xlim(0, 1.05 * scale)
    axes.xaxis.set_major_locator(MaxNLocator(2))
    axes.tick_params(axis="y", length=0)


def _write(
    axes: mpl.axes.Axes, text: str, row: int, ends: Sequence[float], scale: float
) -> None:
    """Write a number behind its bar, before it, or in it, where there is room."""
    low, high = ends
    style: dict[str, Any] = {"va": "center", "fontsize": 7}
    if 1 - high >= _ROOM:
        axes.text((high + _GAP) * scale, row, text, ha="left", **style)
    elif low >= _ROOM:
        axes.text((low - _GAP) * scale, row, text, ha="right", **style)
    else:
        middle = (low + high) / 2 * scale
        axes.text(middle, row, text, ha="center", color="white", **style)
