"""Extents that indicate another unit of length."""

import logging
from collections.abc import Sequence

import numpy as np
from numpy import ndarray

from .user_input import printable

log = logging.getLogger(__name__)

#: Least extent in mm of tools, parts and outlines of plies; below it their unit of
#: length is another one.  Chosen: the diameter of a coin is larger.
SMALLEST = 5.0

#: Ratio of two extents below which the unit of one of them is doubtful.  Chosen: above
#: the ratio of millimetre and inch.
OTHER_UNIT = 0.05


def extent_of(points: ndarray) -> float:
    """Largest extent of points along an axis; points have the shape (d, n)."""
    return float(np.ptp(points, axis=1).max())


def diagonal_of(points: ndarray) -> float:
    """Diagonal of the bounding box of points, shape (d, n)."""
    return float(np.linalg.norm(np.ptp(points, axis=1)))


def warn_of_outline(file: object, outline: ndarray, tools: Sequence[ndarray]) -> None:
    """Warn if the extents of an outline and of the largest tool indicate two units.

    Parameters
    ----------
    file
        File of the outline.
    outline, tools
        Points of the outline and of the tools in mm, shapes (2, n) and (3, n).
    """
    if not tools:
        return
    extent, of_tools = extent_of(outline), max(map(extent_of, tools))
    if min(extent, of_tools) < OTHER_UNIT * max(extent, of_tools):
        log.warning(
            "%s: the outline extends over %.4g mm, the tools over %.4g mm: check the "
            "units, which --outline-unit and --unit set",
            *(printable(file), extent, of_tools),
        )
