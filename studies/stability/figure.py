"""Many cases at a glance, as coloured cells, with matplotlib."""

import os
from collections.abc import Mapping, Sequence
from typing import TypeAlias

import matplotlib as mpl
from matplotlib.figure import Figure
from matplotlib.patches import Patch, Rectangle

from ..common.figures import figure_of, legend
from .outcomes import OUTCOMES
from .tables import Cell

#: Lines by their label, each with a cell for every column.
Lines: TypeAlias = Mapping[str, Sequence[Cell]]

_COLOURS = dict(
    zip(OUTCOMES, ("#0072B2", "#56B4E9", "#E69F00", "#CC79A7", "#D55E00"), strict=True)
)

_ROW, _CELL, _LABEL = 0.19, 0.42, 2.65  # inches

# Panels side by side among which the groups are shared out, in their order.
_PANELS = 3


def draw_outcomes(
    groups: Mapping[str, Lines],
    steps: Sequence[int],
    filename: str | os.PathLike[str] | None = None,
) -> Figure:
    """Lines of cells in groups, each cell in the colours of its outcomes.

    Parameters
    ----------
    groups
        The lines of each group by its title, with a cell for each number of steps.
    steps
        Numbers of load steps.
    filename
        Where to write a PNG.

    Examples
    --------
    >>> stiff = [({"right": 1}, "5"), ({"right": 2, "wrong": 1}, "2/3")]
    >>> figure = draw_outcomes({"fibres": {"stiff": stiff}}, [1, 2])
    >>> [text.get_text() for text in figure.axes[0].texts]
    ['fibres', '1', '2', 'stiff', '5', '2/3']
    >>> [round(part.get_width() / _CELL, 2) for part in figure.axes[0].patches]
    [1.0, 1.0, 0.67, 0.33, 1.0]
    """
    shared = _shared_out(groups)
    height = max(sum(len(lines) + 2 for lines in panel.values()) for panel in shared)
    width = _LABEL + _CELL * len(steps)
    size = len(shared) * (width + 0.2), (height + 3) * _ROW
    with figure_of(size, filename, font_size=8) as figure:
        for i, panel in enumerate(shared, start=1):
            axes = figure.add_subplot(1, len(shared), i)
            axes.set(xlim=(-_LABEL, _CELL * len(steps)), ylim=(height * _ROW, 0))
            axes.set_axis_off()
            _panel(axes, panel, steps)
        patches = [Patch(color=colour, label=k) for k, colour in _COLOURS.items()]
        title = (
            "Linear solves, or on how many meshes it is right, by number of load steps"
        )
        legend(figure, patches, len(_COLOURS), title=title)
    return figure


def _panel(
    axes: mpl.axes.Axes,
    panel: Mapping[str, Lines],
    steps: Sequence[int],
) -> None:
    y = 0.0
    for group, lines in panel.items():
        y += _ROW
        axes.text(-_LABEL, y, group, weight="bold", va="center")
        for x, n in enumerate(steps):
            axes.text((x + 0.5) * _CELL, y, str(n), ha="center", va="center")
        for label, line in lines.items():
            y += _ROW
            axes.text(-_LABEL + 0.1, y, label, va="center")
            for x, cell in enumerate(line):
                _draw(axes, cell, x * _CELL, y)
        y += _ROW


def _draw(axes: mpl.axes.Axes, cell: Cell, x: float, y: float) -> None:
    """Draw a cell from x on, in the middle of the line at y."""
    counts, text = cell
    left, bottom = x, y - 0.5 * _ROW
    for kind, count in counts.items():
        width = _CELL * count / sum(counts.values())
        axes.add_patch(
            Rectangle((left, bottom), width, _ROW, color=_COLOURS[kind], lw=0)
        )
        left += width
    axes.add_patch(Rectangle((x, bottom), _CELL, _ROW, fill=False, edgecolor="white"))
    axes.text(x + 0.5 * _CELL, y, text, color="white", ha="center", va="center")


def _shared_out(groups: Mapping[str, Lines]) -> list[dict[str, Lines]]:
    """The groups in order, in panels of about the same height."""
    whole = sum(len(lines) + 2 for lines in groups.values())
    shared: list[dict[str, Lines]] = [{} for _ in range(_PANELS)]
    before = 0
    for group, lines in groups.items():
        middle = before + 0.5 * (len(lines) + 2)
        shared[min(int(_PANELS * middle / whole), _PANELS - 1)][group] = lines
        before += len(lines) + 2
    return [panel for panel in shared if panel]
