"""Loads and linear solves of several codes as coloured cells, with matplotlib."""

import os
from collections.abc import Mapping

import matplotlib as mpl
import numpy as np
from matplotlib.colors import BoundaryNorm, ListedColormap
from matplotlib.figure import Figure

from ...common.figures import figure_of
from .tables import LIMIT, Cell, Cells, power_of_ten

# Width and height in inches: as printed, 160 mm wide.
_SIZE = 6.3, 2.9

# Loads over the converged load between which cells have one colour.
_BOUNDS = (0.1, 1 - LIMIT, 1 + LIMIT, 2.0, 10.0, 100.0, 1e4, 1e8)
_COLOURS = (
    *("#CC79A7", "#0072B2", "#fee391", "#fec44f", "#fe9929", "#cc4c02", "#662506"),
)

# Colour of cells without a result, and of numbers on dark and on light cells.
_NO_RESULT, _ON_DARK, _ON_LIGHT = "#d9d9d9", "white", "black"

# Luminance below which a cell is dark.
_DARK = 0.5


def draw_grid(cells: Cells, filename: str | os.PathLike[str] | None = None) -> Figure:
    """A panel for each code; the colour is the load, the number the linear solves.

    Parameters
    ----------
    cells
        Cells of each code by E/G and distortion.
    filename
        Where to write a picture.

    Examples
    --------
    >>> of_code = {(1e2, 0.0): Cell(1.5, 1.6, 7), (1e4, 0.0): Cell()}
    >>> figure = draw_grid({"code, element": of_code})
    >>> [text.get_text() for text in figure.axes[0].texts]
    ['7', '–']
    """
    ratios = sorted({at[0] for of_code in cells.values() for at in of_code})
    distortions = sorted({at[1] for of_code in cells.values() for at in of_code})
    colours = ListedColormap(list(_COLOURS))
    norm = BoundaryNorm(_BOUNDS, len(_COLOURS))
    with figure_of(_SIZE, filename, font_size=8) as figure:
        panels = figure.subplots(1, len(cells), sharey=True, squeeze=False)[0]
        for axes, (code, of_code) in zip(panels, cells.items(), strict=True):
            _panel(axes, of_code, ratios, distortions, colours, norm)
            axes.set_title(code.replace(", ", "\n", 1), fontsize=9)
        panels[0].set_yticks(range(len(ratios)), map(power_of_ten, ratios))
        panels[0].set_ylabel("E/G")
        panels[len(panels) // 2].set_xlabel("Largest move of a node / spacing")
        scale = mpl.cm.ScalarMappable(norm, colours)
        bar = figure.colorbar(scale, ax=list(panels), pad=0.01, spacing="uniform")
        labels = f"{1 - LIMIT:g}", f"{1 + LIMIT:g}", "2", "10", "100", "10⁴"
        bar.set_ticks(_BOUNDS[1:-1], labels=labels)
        bar.set_label("Load / converged load")
    return figure


def _panel(
    axes: mpl.axes.Axes,
    of_code: Mapping[tuple[float, float], Cell],
    ratios: list[float],
    distortions: list[float],
    colours: ListedColormap,
    norm: BoundaryNorm,
) -> None:
    """The cells of one code."""
    every = [
        (i, j, of_code.get((ratio, distortion), Cell()))
        for i, ratio in enumerate(ratios)
        for j, distortion in enumerate(distortions)
    ]
    pixels = np.ones((len(ratios), len(distortions), 3))
    for i, j, cell in every:
        name = _NO_RESULT if cell.load is None else colours(norm(cell.load))
        pixels[i, j] = colour = mpl.colors.to_rgb(name)
        dark = np.dot(colour, (0.299, 0.587, 0.114)) < _DARK
        axes.text(
            j,
            i,
            "–" if cell.solves is None else f"{cell.solves:.0f}",
            color=_ON_DARK if dark else _ON_LIGHT,
            ha="center",
            va="center",
        )
    axes.imshow(pixels, aspect="auto", origin="lower")
    axes.set_xticks(range(len(distortions)), [f"{x:g}"[-3:] for x in distortions])
    axes.set_xticks(np.arange(0.5, len(distortions) - 1), minor=True)
    axes.set_yticks(np.arange(0.5, len(ratios) - 1), minor=True)
    axes.grid(which="minor", color="white", linewidth=0.8)
    axes.spines[:].set_visible(False)
    axes.tick_params(which="both", length=0)
