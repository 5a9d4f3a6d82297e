"""Shared parts of the figures of studies: styles of lines, frame and legend."""

import os
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import Any

import matplotlib as mpl
from matplotlib.figure import Figure

from skfem_textile.plot.curves import COLOURS
from skfem_textile.plot.picture_files import picture_path, save

_MARKERS = "osD^vP*Xdh"


def colour_of(i: int) -> str:
    """The colour of the i-th kind."""
    return COLOURS[i % len(COLOURS)]


def marker_of(i: int) -> str:
    """The marker of the i-th kind."""
    return _MARKERS[i % len(_MARKERS)]


@contextmanager
def figure_of(
    size: tuple[float, float],
    filename: str | os.PathLike[str] | None,
    font_size: int = 10,
) -> Iterator[Figure]:
    """A figure of a size in inches, which is written when the block ends.

    Raises
    ------
    ValueError, FileNotFoundError
        As from `picture_path`, before anything is drawn.
    """
    path = None if filename is None else picture_path(filename)
    style = {"axes.spines.top": False, "axes.spines.right": False}
    with mpl.rc_context(style | {"font.size": font_size}):
        figure = Figure(figsize=size, layout="constrained")
        yield figure
        save(figure, path)


def legend(figure: Figure, handles: Sequence[Any], columns: int, **more: Any) -> None:
    """A legend below the figure."""
    figure.legend(
        handles=handles,
        loc="outside lower center",
        ncols=columns,
        frameon=False,
        **more,
    )
