"""Panels and legends placed on a picture, in mm, so that none is on another."""

import numpy as np

from ..sheet import Sheet
from .legend import MARGIN, LegendLines
from .placed import Box, Layout, Place
from .text import TITLE, text_height, text_lines, wrapped

#: Widths of a column and of a page of a journal, in mm.  Elsevier's are 90 and 190,
#: Springer's 84 and 174.
COLUMN, PAGE = 85.0, 174.0

#: Dots per inch of a picture that is printed.
PRINTED = 300

# Chosen by eye, in mm: the most and least height of a ply and of all plies of a page.
_MOST_HEIGHT, _LEAST_HEIGHT, _PAGE_HEIGHT = 80.0, 10.0, 200.0

# Columns of panels that fit a column of a journal.
_FEW_COLUMNS = 2


def lay_out(sheet: Sheet, size: float | tuple[float, float] | None = None) -> Layout:
    """Place panels and legends.

    Parameters
    ----------
    sheet
        Panels and legends.
    size
        Width in mm, or width and height; by default a journal's column or page, and as
        high as needed.

    Raises
    ------
    ValueError
        If the size is not one or two numbers above zero, or leaves no room.
    """
    width, height = _size(size, len(sheet.rows[0]))
    cell = width / len(sheet.rows[0])
    titles = [
        [wrapped(panel.title, cell - 2 * MARGIN, TITLE) for panel in row]
        for row in sheet.rows
    ]
    above = [MARGIN + text_height(max(map(len, row)), TITLE) for row in titles]
    legends = [LegendLines(legend, cell) for legend in sheet.legends]
    low = max((legend.height for legend in legends), default=0.0) + MARGIN
    high = _ply_height(sheet, cell, height and height - low - sum(above))
    whole = low + sum(above) + high * len(sheet.rows)
    places, top = [], whole
    for row, lines, over in zip(sheet.rows, titles, above, strict=True):
        y = top - over - high
        placed = []
        for i, (panel, title) in enumerate(zip(row, lines, strict=True)):
            x = i * cell
            ply = Box(x + MARGIN, y, cell - 2 * MARGIN, high)
            written = text_lines(title, x + cell / 2, top - MARGIN, TITLE)
            placed.append(Place(panel, Box(x, y, cell, over + high), ply, written))
        places.append(placed)
        top = y
    return Layout(width, whole, places, [legend.placed(low) for legend in legends])


def default_width(columns: int) -> float:
    """Width in mm of a picture of columns of panels."""
    return COLUMN if columns <= _FEW_COLUMNS else PAGE


def _size(
    size: float | tuple[float, float] | None, columns: int
) -> tuple[float, float | None]:
    """Width, and height if it is given."""
    if size is None:
        return default_width(columns), None
    given = np.atleast_1d(np.asarray(size, dtype=float))
    if given.shape not in ((1,), (2,)) or not (0 < given.min() <= given.max() < np.inf):
        raise ValueError(f"size {size!r}: give the width in mm, or width and height")
    width, *height = given.tolist()
    return width, height[0] if height else None


def _ply_height(sheet: Sheet, cell: float, left: float | None) -> float:
    """Height of each row of plies."""
    low, high = sheet.extent
    width, n = cell - 2 * MARGIN, len(sheet.rows)
    if left is None:
        most = min(_MOST_HEIGHT, max(_PAGE_HEIGHT / n, 2 * _LEAST_HEIGHT))
        wanted = width * (high[1] - low[1]) / max(high[0] - low[0], 1e-12)
        left = n * float(np.clip(wanted, _LEAST_HEIGHT, most))
    if min(width, left / n) < 0.5 * _LEAST_HEIGHT:
        raise ValueError(
            f"the size leaves {max(width, 0):.3g} mm × {max(left / n, 0):.3g} mm for "
            "each ply: give a larger one"
        )
    return left / n
