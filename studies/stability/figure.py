"""The outcomes of all cases as bars, with matplotlib."""

import os
from collections import Counter
from collections.abc import Sequence

from matplotlib.figure import Figure

from ..common.figures import figure_of
from ..study import Row
from .outcomes import OUTCOMES

# Colours of the outcomes: dark to light where a run is sound, warm where it fails.
_COLOURS = "#0072B2", "#9CCBE8", "#F0C04A", "#CC79A7", "#D55E00"

# Points a letter; width and height of a bar in inches.  A page prints 6.3 inches.
_FONT, _WIDTH, _BAR = 9, 6.3, 0.24


def draw_outcomes(
    rows: Sequence[Row], filename: str | os.PathLike[str] | None = None
) -> Figure:
    """A bar for each family of problems, as long as its runs are many.

    Parameters
    ----------
    rows
        Rows with ``family`` and ``outcome``.
    filename
        Where to write a picture.

    Examples
    --------
    >>> row = {"family": "crossing", "outcome": "right"}
    >>> (axes,) = draw_outcomes([row, row | {"outcome": "wrong"}]).axes
    >>> [text.get_text() for text in axes.get_yticklabels()]
    ['crossing']
    """
    families: dict[str, Counter[str]] = {}
    for row in rows:
        families.setdefault(row["family"], Counter())[row["outcome"]] += 1
    whole: Counter[str] = sum(families.values(), Counter())
    size = _WIDTH, _BAR * (len(families) + 5)
    with figure_of(size, filename, font_size=_FONT) as figure:
        axes = figure.add_subplot()
        for y, counts in enumerate(families.values()):
            start = 0
            for kind, colour in zip(OUTCOMES, _COLOURS, strict=True):
                width = counts[kind]
                axes.barh(y, width, left=start, color=colour, height=0.75)
                start += width
        axes.set_yticks(range(len(families)), list(families))
        axes.invert_yaxis()
        axes.set_xlabel("Runs")
        axes.spines["left"].set_visible(False)
        axes.tick_params(axis="y", length=0)
        for kind, colour in zip(OUTCOMES, _COLOURS, strict=True):
            axes.barh(0, 0, color=colour, label=f"{kind}: {whole[kind]}")
        figure.legend(loc="outside lower center", ncols=2, frameon=False)
    return figure
