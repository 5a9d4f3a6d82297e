"""Legends: scales with their numbers, and keys, placed below panels."""

from collections.abc import Sequence

import numpy as np

from ..sheet import Legend, Scale
from .placed import Bar, Below, Box, Stroke
from .text import (
    NUMBER,
    TITLE,
    Writing,
    number,
    text_height,
    text_lines,
    text_width,
    wrapped,
)

#: Margins in mm, chosen by eye, as all sizes below.
MARGIN = 2.0

# Of a scale: its thickness, its greatest length, its length over the width below which
# it stands, and the gap between its numbers.
_THICKNESS, _LONGEST, _SHARE, _GAP = 2.2, 70.0, 0.8, 1.5

# Length of the coloured line in a key, and the gaps after it and after the name.
KEY, KEY_GAP, _KEY_END = 4.0, 1.0, 4.0


class LegendLines:
    """A legend whose lines are known, to be placed.

    Parameters
    ----------
    legend
        The legend.
    cell
        Width of a column in mm.
    """

    def __init__(self, legend: Legend, cell: float) -> None:
        self.legend, self.x = legend, legend.first * cell
        self.width = (legend.last - legend.first) * cell
        self.label = (
            wrapped(legend.scale.label, self.width - 2 * MARGIN, TITLE)
            if legend.scale
            else []
        )
        scale = (
            _THICKNESS
            + text_height(1, NUMBER)
            + text_height(len(self.label), TITLE)
            + 1.0
        )
        self.keys = _rows_of_keys(legend.keys, self.width - 2 * MARGIN)
        self.height = MARGIN + text_height(len(self.keys), TITLE)
        self.height += scale if legend.scale else 0.0

    def placed(self, top: float) -> Below:
        """What is in the legend, from ``top`` down."""
        below = Below(Box(self.x, 0.0, self.width, top), [], [], [])
        middle, y = self.x + self.width / 2, top - MARGIN
        if self.legend.scale:
            y = self._place_scale(below, middle, y) - 1.0
        for row in self.keys:
            y -= text_height(1, TITLE)
            self._place_keys(below, row, middle, y + 0.5 * text_height(1, TITLE))
        return below

    def _place_scale(self, below: Below, middle: float, top: float) -> float:
        scale = self.legend.scale
        assert scale is not None
        length = min(_LONGEST, _SHARE * self.width)
        box = Box(middle - length / 2, top - _THICKNESS, length, _THICKNESS)
        below.bars.append(Bar(scale, box))
        y = box.y - 0.5 * text_height(1, NUMBER)
        for tick, text in _numbers(scale, length):
            share = (tick - scale.low) / (scale.high - scale.low)
            below.writings.append(Writing(text, box.x + share * length, y, NUMBER))
        low = box.y - text_height(1, NUMBER)
        below.writings.extend(text_lines(self.label, middle, low, TITLE))
        return low - text_height(len(self.label), TITLE)

    @staticmethod
    def _place_keys(
        below: Below, row: Sequence[tuple[str, str]], middle: float, y: float
    ) -> None:
        x = middle - (sum(_key_width(name) for name, _ in row) - _KEY_END) / 2
        for name, colour in row:
            below.strokes.append(Stroke(colour, x, y))
            below.writings.append(Writing(name, x + KEY + KEY_GAP, y, TITLE, "left"))
            x += _key_width(name)


def _key_width(name: str) -> float:
    return KEY + KEY_GAP + text_width(name, TITLE) + _KEY_END


def _rows_of_keys(
    keys: Sequence[tuple[str, str]], width: float
) -> list[list[tuple[str, str]]]:
    """Keys in rows that are not wider than ``width``, unless a key is."""
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
    """As many numbers as stand on a scale of a length without touching."""
    for intervals in range(6, 0, -1):
        ticks = scale.ticks(intervals)
        found = [(float(x), number(x)) for x in ticks]
        wide = max((text_width(text, NUMBER) for _, text in found), default=0.0)
        apart = np.diff(ticks).min() if len(ticks) > 1 else np.inf
        if apart / (scale.high - scale.low) * length >= wide + _GAP:
            break
    return found
