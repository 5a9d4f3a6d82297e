"""Tables of coloured cells, for the outcomes of many cases, with matplotlib."""

import os
from collections.abc import Mapping, Sequence
from typing import TypeAlias

import matplotlib as mpl
from matplotlib.figure import Figure
from matplotlib.patches import Patch, Rectangle

from .curves import save
from .picture_files import picture_path

#: A cell: number of cases by outcome, and its text.
Cell: TypeAlias = tuple[Mapping[str, int], str]

#: Lines by their label, each with a cell for every column.
Lines: TypeAlias = Mapping[str, Sequence[Cell]]

# Chosen by eye: height of a row, widths of a cell, of the labels, of their indent and
# between panels, all in inches; rows for the legend; text size in points.
_ROW, _CELL, _LABEL, _INDENT, _GAP = 0.19, 0.42, 2.3, 0.1, 0.2
_LEGEND_ROWS, _TEXT_SIZE = 3, 8

# Rows of a group besides its lines: its title, and a blank one.
_EXTRA_ROWS = 2


def outcome_table(
    groups: Mapping[str, Lines],
    columns: Sequence[str],
    colours: Mapping[str, str],
    xlabel: str,
    filename: str | os.PathLike[str] | None = None,
    panels: int = 3,
) -> Figure:
    """Draw a table in groups of lines, with cells in the colours of their outcomes.

    Parameters
    ----------
    groups
        Lines by the title of their group.
    columns
        Titles of the columns.
    colours
        Colour of each outcome, in the order of the legend.
    xlabel
        Title of the columns.
    filename
        Where to write a PNG.
    panels
        Number of panels, side by side, that take the groups in their order.

    Raises
    ------
    ValueError, FileNotFoundError
        As `picture_path`.

    Examples
    --------
    >>> stiff = [({"good": 1}, "5"), ({"good": 2, "bad": 1}, "-")]
    >>> groups = {"fibres": {"stiff": stiff}}
    >>> colours = {"good": "green", "bad": "red"}
    >>> figure = outcome_table(groups, ["1", "2"], colours, "steps")
    >>> [text.get_text() for text in figure.axes[0].texts]
    ['fibres', '1', '2', 'stiff', '5', '-']
    >>> [round(part.get_width() / _CELL, 2) for part in figure.axes[0].patches]
    [1.0, 1.0, 0.67, 0.33, 1.0]
    """
    path = None if filename is None else picture_path(filename)
    shared = _groups_by_panel(groups, panels)
    height = max(
        sum(len(lines) + _EXTRA_ROWS for lines in panel.values()) for panel in shared
    )
    width = _LABEL + _CELL * len(columns)
    with mpl.rc_context({"font.size": _TEXT_SIZE}):
        figure = Figure(
            figsize=(len(shared) * (width + _GAP), (height + _LEGEND_ROWS) * _ROW),
            layout="constrained",
        )
        for i, panel in enumerate(shared, start=1):
            axes = figure.add_subplot(1, len(shared), i)
            axes.set(xlim=(-_LABEL, _CELL * len(columns)), ylim=(height * _ROW, 0))
            axes.set_axis_off()
            _panel(axes, panel, columns, colours)
        figure.legend(
            handles=[Patch(color=colour, label=k) for k, colour in colours.items()],
            title=xlabel,
            loc="outside lower center",
            ncols=len(colours),
            frameon=False,
        )
        save(figure, path)
    return figure


def _panel(
    axes: mpl.axes.Axes,
    panel: Mapping[str, Lines],
    columns: Sequence[str],
    colours: Mapping[str, str],
) -> None:
    y = 0.0
    for group, lines in panel.items():
        y += _ROW
        axes.text(-_LABEL, y, group, weight="bold", va="center")
        for x, column in enumerate(columns):
            axes.text((x + 0.5) * _CELL, y, column, ha="center", va="center")
        for label, line in lines.items():
            y += _ROW
            axes.text(-_LABEL + _INDENT, y, label, va="center")
            for x, cell in enumerate(line):
                _draw(axes, cell, x * _CELL, y, colours)
        y += _ROW


def _draw(
    axes: mpl.axes.Axes, cell: Cell, x: float, y: float, colours: Mapping[str, str]
) -> None:
    """Draw a cell with its left side at x, centred vertically at y."""
    counts, text = cell
    left, bottom = x, y - 0.5 * _ROW
    for outcome, count in counts.items():
        width = _CELL * count / sum(counts.values())
        axes.add_patch(
            Rectangle((left, bottom), width, _ROW, color=colours[outcome], lw=0)
        )
        left += width
    axes.add_patch(Rectangle((x, bottom), _CELL, _ROW, fill=False, edgecolor="white"))
    axes.text(x + 0.5 * _CELL, y, text, color="white", ha="center", va="center")


def _groups_by_panel(
    groups: Mapping[str, Lines], panels: int
) -> list[dict[str, Lines]]:
    """Distribute the groups in order over panels of about the same height."""
    total = sum(len(lines) + _EXTRA_ROWS for lines in groups.values())
    shared: list[dict[str, Lines]] = [{} for _ in range(panels)]
    before = 0
    for group, lines in groups.items():
        middle = before + 0.5 * (len(lines) + _EXTRA_ROWS)
        shared[min(int(panels * middle / total), panels - 1)][group] = lines
        before += len(lines) + _EXTRA_ROWS
    return [panel for panel in shared if panel]
