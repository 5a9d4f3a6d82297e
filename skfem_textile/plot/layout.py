"""Layout of a picture: positions of panels, scales and text in mm."""

from collections.abc import Sequence
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from matplotlib.font_manager import findfont, get_font
from numpy import ndarray

from .sheet import Legend, Panel, Scale, Sheet

#: Font sizes of titles and of the numbers on a scale, in points.
TITLE, NUMBER = 8.0, 7.0

#: Length of a point in mm.
POINT = 25.4 / 72

# Line height relative to the font size.
_LINE = 1.3


class Writing(NamedTuple):
    """Line of text, centred at x unless ``align`` is left; y is its middle."""

    text: str
    x: float
    y: float
    size: float
    align: str = "center"


def font_file() -> str:
    """Path of the font file used in all pictures."""
    return str(findfont("DejaVu Sans"))


@lru_cache(maxsize=4096)
def text_width(text: str, size: float) -> float:
    """Width of a line of text in mm."""
    font = get_font(font_file())
    font.set_size(size, 72)
    font.set_text(text, 0.0)
    return float(font.get_width_height()[0] / 64 * POINT)


def wrapped(text: str, width: float, size: float) -> list[str]:
    """Split a text into lines of at most ``width`` in mm; long words are cut.

    Examples
    --------
    >>> wrapped("a title that is long", 20.0, 8.0)
    ['a title that', 'is long']
    """
    lines = [""]
    for word in text.split():
        longer = f"{lines[-1]} {word}".strip()
        if text_width(longer, size) <= width:
            lines[-1] = longer
            continue
        if lines[-1]:
            lines.append("")
        for letter in word:
            if lines[-1] and text_width(lines[-1] + letter, size) > width:
                lines.append("")
            lines[-1] += letter
    return [line for line in lines if line]


def number(x: float) -> str:
    """Format a number for a scale.

    Examples
    --------
    >>> number(-2.5), number(-1e-17), number(0.30000000000000004)
    ('−2.5', '0', '0.3')
    """
    text = f"{x:.6g}" if abs(x) > 1e-15 else "0"
    return text.replace("-", "−")


def text_height(lines: int, size: float) -> float:
    """Height of lines of text in mm."""
    return lines * _LINE * size * POINT


def text_lines(
    lines: Sequence[str], x: float, top: float, size: float
) -> list[Writing]:
    """Lines of text, one below the other."""
    step = text_height(1, size)
    return [
        Writing(line, x, top - (i + 0.5) * step, size) for i, line in enumerate(lines)
    ]


class Box(NamedTuple):
    """Rectangle in mm with the lower left corner (x, y)."""

    x: float
    y: float
    width: float
    height: float


class Bar(NamedTuple):
    """Coloured rectangle of a scale."""

    scale: Scale
    box: Box

    @property
    def colours(self) -> ndarray:
        """Its colours from left to right, shape (n, 4)."""
        return np.asarray(self.scale.colours(np.linspace(0, 1, _COLOURS)))

    @property
    def tips(self) -> tuple[ndarray, ndarray]:
        """Corners of the arrows at its ends; empty if no values lie beyond."""
        x, y, width, height = self.box
        ends = ((self.scale.below, x, -height), (self.scale.above, x + width, height))
        low, high = (
            np.array([(at, y), (at + tip, y + height / 2), (at, y + height)])[: 3 * out]
            for out, at, tip in ends
        )
        return low, high

    @property
    def zero(self) -> list[Box]:
        """Mark across the bar at zero, on a signed scale that includes zero."""
        x, y, width, height = self.box
        low, high = self.scale.low, self.scale.high
        if not (self.scale.signed and low <= 0 <= high):
            return []
        middle = x - width * low / (high - low)
        return [Box(middle - 0.5 * _MARK, y - _OUT, _MARK, height + 2 * _OUT)]


class Stroke(NamedTuple):
    """Horizontal line of a key, starting at (x, y)."""

    colour: str
    x: float
    y: float


class Slot(NamedTuple):
    """Panel: its box, the box of the ply within it, and its title."""

    panel: Panel
    box: Box
    ply: Box
    title: list[Writing]

    @property
    def middle(self) -> ndarray:
        """Centre of the ply's box."""
        x, y, width, height = self.ply
        return np.array([x + width / 2, y + height / 2])

    def scale_of(self, extent: tuple[ndarray, ndarray]) -> float:
        """Scale of the picture (mm per mm) at which the whole extent is visible."""
        span = np.maximum(extent[1] - extent[0], 1e-12)
        return float(min(self.ply.width / span[0], self.ply.height / span[1]))


class PlacedLegend(NamedTuple):
    """Legend: its box and content."""

    box: Box
    bars: list[Bar]
    strokes: list[Stroke]
    writings: list[Writing]

    def with_top(self, top: float) -> "PlacedLegend":
        """Legend with its top at a height, and its box down to the bottom."""
        return PlacedLegend(
            self.box._replace(y=0.0, height=top),
            [b._replace(box=b.box._replace(y=b.box.y + top)) for b in self.bars],
            [stroke._replace(y=stroke.y + top) for stroke in self.strokes],
            [writing._replace(y=writing.y + top) for writing in self.writings],
        )


class Layout(NamedTuple):
    """Layout of a picture: size in mm, panels row by row, and legends below them."""

    width: float
    height: float
    panels: list[list[Slot]]
    legends: list[PlacedLegend]


#: Margins in mm, chosen by eye, as all sizes below.
MARGIN = 2.0

# Scales: thickness, maximum length, length relative to the width above it, and gap
# between numbers.
_THICKNESS, _LONGEST, _SHARE, _GAP = 2.2, 70.0, 0.8, 1.5

# Number of colours of a scale.
_COLOURS = 256

# Width of the mark at zero, and length by which it extends beyond the bar.
_MARK, _OUT = 0.25, 0.6

# Length of the coloured line in a key, and gaps after the line and after the name.
KEY, KEY_GAP, _KEY_END = 4.0, 1.0, 4.0


def _legend(legend: Legend, cell: float) -> PlacedLegend:
    """Legend below columns of a width in mm, from y = 0 downwards."""
    left, width = legend.first * cell, (legend.last - legend.first) * cell
    placed = PlacedLegend(Box(left, 0, width, 0), [], [], [])
    middle, y = left + width / 2, -MARGIN
    if scale := legend.scale:
        length = min(_LONGEST, _SHARE * width)
        box = Box(middle - length / 2, y - _THICKNESS, length, _THICKNESS)
        placed.bars.append(Bar(scale, box))
        y = box.y - 0.5 * text_height(1, NUMBER)
        for tick, text in _numbers(scale, length):
            share = (tick - scale.low) / (scale.high - scale.low)
            placed.writings.append(Writing(text, box.x + share * length, y, NUMBER))
        y -= 0.5 * text_height(1, NUMBER)
        label = wrapped(scale.label, width - 2 * MARGIN, TITLE)
        placed.writings.extend(text_lines(label, middle, y, TITLE))
        y -= text_height(len(label), TITLE) + 1.0
    for row in _rows_of_keys(legend.keys, width - 2 * MARGIN):
        y -= text_height(1, TITLE)
        at = y + 0.5 * text_height(1, TITLE)
        x = middle - (sum(_key_width(name) for name, _ in row) - _KEY_END) / 2
        for name, colour in row:
            placed.strokes.append(Stroke(colour, x, at))
            placed.writings.append(Writing(name, x + KEY + KEY_GAP, at, TITLE, "left"))
            x += _key_width(name)
    return placed._replace(box=Box(left, y, width, -y))


def _key_width(name: str) -> float:
    return KEY + KEY_GAP + text_width(name, TITLE) + _KEY_END


def _rows_of_keys(
    keys: Sequence[tuple[str, str]], width: float
) -> list[list[tuple[str, str]]]:
    """Keys in rows of at most ``width``, unless a single key is wider."""
    rows: list[list[tuple[str, str]]] = []
    used = np.inf
    for key in keys:
        wide = _key_width(key[0])
        if used + wide - _KEY_END > width:
            rows.append([])
            used = 0.0
        rows[-1].append(key)
        used += wide
    return rows


def _numbers(scale: Scale, length: float) -> list[tuple[float, str]]:
    """Numbers that fit on a scale of a length without overlap."""
    for intervals in range(6, 0, -1):
        ticks = scale.ticks(intervals)
        labelled = [(float(x), number(x)) for x in ticks]
        wide = max((text_width(text, NUMBER) for _, text in labelled), default=0.0)
        spacing = np.diff(ticks).min() if len(ticks) > 1 else np.inf
        if spacing / (scale.high - scale.low) * length >= wide + _GAP:
            break
    return labelled


#: Widths of a column and of a page of a journal in mm (Elsevier: 90 and 190, Springer:
#: 84 and 174).
COLUMN, PAGE = 85.0, 174.0

#: Dots per inch in print.
PRINTED = 300

# Chosen by eye, in mm: maximum and minimum height of a ply, and of all plies of a page.
_MOST_HEIGHT, _LEAST_HEIGHT, _PAGE_HEIGHT = 80.0, 10.0, 200.0

# Number of panels side by side in a column of a journal.
_FEW_COLUMNS = 2


def lay_out(sheet: Sheet, size: float | tuple[float, float] | None = None) -> Layout:
    """Place panels and legends.

    The size is the width in mm, or width and height; by default a journal's column or
    page, with the required height. Sizes that are too small are refused.
    """
    width, height = _size(size, len(sheet.rows[0]))
    cell = width / len(sheet.rows[0])
    titles = [
        [wrapped(panel.title, cell - 2 * MARGIN, TITLE) for panel in row]
        for row in sheet.rows
    ]
    above = [MARGIN + text_height(max(map(len, row)), TITLE) for row in titles]
    legends = [_legend(legend, cell) for legend in sheet.legends]
    low = max((legend.box.height for legend in legends), default=0.0) + MARGIN
    high = _ply_height(sheet, cell, height and height - low - sum(above))
    total = low + sum(above) + high * len(sheet.rows)
    panels, top = [], total
    for row, lines, over in zip(sheet.rows, titles, above, strict=True):
        y = top - over - high
        slots = []
        for i, (panel, title) in enumerate(zip(row, lines, strict=True)):
            x = i * cell
            ply = Box(x + MARGIN, y, cell - 2 * MARGIN, high)
            written = text_lines(title, x + cell / 2, top - MARGIN, TITLE)
            slots.append(Slot(panel, Box(x, y, cell, over + high), ply, written))
        panels.append(slots)
        top = y
    return Layout(width, total, panels, [legend.with_top(low) for legend in legends])


def default_width(columns: int) -> float:
    """Width of a picture in mm by its number of columns."""
    return COLUMN if columns <= _FEW_COLUMNS else PAGE


def _size(
    size: float | tuple[float, float] | None, columns: int
) -> tuple[float, float | None]:
    """Width, and height if given."""
    if size is None:
        return default_width(columns), None
    given = np.atleast_1d(np.asarray(size, dtype=float))
    if given.shape not in ((1,), (2,)) or not (0 < given.min() <= given.max() < np.inf):
        raise ValueError(
            f"size must be the width, or the width and height, in mm, got {size!r}"
        )
    width, *height = given.tolist()
    return width, height[0] if height else None


def _ply_height(sheet: Sheet, cell: float, left: float | None) -> float:
    """Height of each row of plies in mm."""
    low, high = sheet.extent
    width, n = cell - 2 * MARGIN, len(sheet.rows)
    if left is None:
        most = min(_MOST_HEIGHT, max(_PAGE_HEIGHT / n, 2 * _LEAST_HEIGHT))
        height = width * (high[1] - low[1]) / max(high[0] - low[0], 1e-12)
        left = n * float(np.clip(height, _LEAST_HEIGHT, most))
    if min(width, left / n) < 0.5 * _LEAST_HEIGHT:
        raise ValueError(
            f"the size leaves {max(width, 0):.3g} mm × {max(left / n, 0):.3g} mm for "
            "each ply: pass a larger size"
        )
    return left / n
