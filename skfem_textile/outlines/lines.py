"""Lines of a net along straight fibres: graded, or equally spaced.

In coordinates along the fibres, X = s₁ A₁ + s₂ A₂, they are s₁ = a and s₂ = b.  A
motion without fibre stretch is x = f(s₁) + g(s₂).  If f and g have kinks only at lines
of the net, the motion is linear in every cell and in every part of a cell, and elements
that are cells or parts of them represent it exactly.
"""

import logging
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy import ndarray
from scipy.integrate import cumulative_trapezoid

from ..mesh.graph import components
from .rings import NEAR

log = logging.getLogger(__name__)

# Maximum number of cells of equally spaced lines.  They take half a minute.
_MOST = 4e6

# Largest number of graded lines between two given ones: a bound on the memory.
_MOST_LINES = 1e5

# Smallest gap between lines that are added so that the families meet at the sides,
# relative to the spacing: a guard against small elements.
_NARROWEST = 0.2


class Lines(NamedTuple):
    """Lines of a family in ascending order, and which of them stay edges of a net."""

    at: ndarray
    strong: ndarray


def nearest(lines: ndarray, x: ndarray) -> ndarray:
    """Index of the nearest line."""
    return np.searchsorted((lines[1:] + lines[:-1]) / 2, x)


def graded(
    keys: ndarray,
    strong: ndarray,
    finest: float,
    largest: float,
    growth: float,
    density: float = 1.0,
) -> ndarray:
    """Add lines between given ones, graded towards the strong ones.

    Parameters
    ----------
    keys
        Lines in ascending order.
    strong
        One bool per line.
    finest, largest, growth
        Distance of lines at the strong ones, its limit, and its derivative with respect
        to the distance from them.
    density
        Factor of the number of lines.

    Raises
    ------
    ValueError
        If there would be too many lines.
    """
    lines = [keys[:1]]
    for (low, high), ends in zip(pairwise(keys), pairwise(strong), strict=True):
        x = (high - low) * _SAMPLES
        size = np.full_like(x, largest)
        for is_strong, distance in zip(ends, (x, x[::-1]), strict=True):
            if is_strong:
                size = np.minimum(size, finest + growth * distance)
        # Number of lines up to each distance: the integral of 1/size.
        count = density * cumulative_trapezoid(1 / size, x, initial=0)
        if count[-1] > _MOST_LINES:
            raise ValueError(
                f"the density {density:g} would give about {count[-1]:.1g} lines of a "
                "family: choose a smaller one"
            )
        n = max(1, int(np.ceil(count[-1] - 1e-6)))
        shares = np.arange(1, n + 1) / n * count[-1]
        lines.append(np.append(low + np.interp(shares[:-1], count, x), high))
    return np.concatenate(lines)


# Positions in a gap between two lines, from 0 to 1, dense and symmetric at both ends.
_SAMPLES = np.geomspace(1e-6, 0.5, 200)
_SAMPLES = np.concatenate([[0.0], _SAMPLES, 1 - _SAMPLES[-2::-1], [1.0]])


def even(
    corners: ndarray, sides: ndarray, in_spacings: ndarray
) -> tuple[ndarray, ndarray]:
    """Equally spaced lines between those through given points.

    If possible, lines of both families meet wherever one meets a side; otherwise this
    is logged.

    Parameters
    ----------
    corners
        Points through which lines of both families pass, shape (2, n).
    sides
        Starts and ends of the sides, which are among the corners, shape (2, 2,
        n_sides).
    in_spacings
        Matrix that converts a difference of coordinates to multiples of the largest
        distances along x and y between lines at the sides.

    Returns
    -------
    tuple of ndarray
        Lines a and b, in ascending order.

    Raises
    ------
    ValueError
        If there would be more than 4e6 cells.
    """
    outline = _Sides(corners, sides, in_spacings)
    through = outline.distinct(corners[0]), outline.distinct(corners[1])
    closed = outline.closed(through)
    if closed is None:
        log.info(
            "mesh along the fibres: some lines of warp and weft do not meet at the "
            "sides; elements there may be thin, and may lock where a side is fixed"
        )
    keys = closed or through
    counts = [np.ceil(outline.spacings(i, keys[i]) - 1e-6).clip(min=1) for i in (0, 1)]
    if closed:
        counts = outline.matched(closed, counts)
    if (cells := counts[0].sum() * counts[1].sum()) > _MOST:
        raise ValueError(
            f"the spacing is too small: the mesh would have about {cells:.1g} cells, "
            f"more than {_MOST:g}"
        )
    a, b = (
        np.interp(np.arange(n.sum() + 1), np.cumsum([0, *n]), at)
        for at, n in zip(keys, counts, strict=True)
    )
    return a, b


class _Sides:
    """Sides of an outline in coordinates along the fibres; arguments as of `even`."""

    def __init__(self, corners: ndarray, sides: ndarray, in_spacings: ndarray) -> None:
        self._start, self._along = sides[0], sides[1] - sides[0]
        self._lengths = np.linalg.norm(in_spacings @ self._along, axis=0)
        self._near = NEAR * np.ptp(corners, axis=1).max()
        self._oblique = np.abs(self._along) > self._near

    def distinct(self, lines: ndarray) -> ndarray:
        """Lines in ascending order, without those that coincide with another."""
        lines = np.sort(lines)
        return lines[np.diff(lines, prepend=-np.inf) > self._near]

    def closed(self, lines: tuple[ndarray, ndarray]) -> tuple[ndarray, ndarray] | None:
        """Lines, and lines of the other family where they meet the sides.

        None if lines would be too close to each other.
        """
        while True:
            a, b = (
                self.distinct(np.append(lines[i], self._meet(1 - i, lines[1 - i])[2]))
                for i in (0, 1)
            )
            if len(a) == len(lines[0]) and len(b) == len(lines[1]):
                return lines
            if min(self.spacings(0, a).min(), self.spacings(1, b).min()) < _NARROWEST:
                return None
            lines = a, b

    def spacings(self, axis: int, lines: ndarray) -> ndarray:
        """Number of spacings along the sides between adjacent lines, not rounded."""
        side, gap, _ = self._meet(axis, (lines[1:] + lines[:-1]) / 2)
        most = np.zeros(len(lines) - 1)
        along = np.abs(self._along[axis, side])
        np.maximum.at(most, gap, self._lengths[side] / along)
        return most * np.diff(lines)

    def matched(
        self, lines: tuple[ndarray, ndarray], counts: list[ndarray]
    ) -> list[ndarray]:
        """Subdivisions for which added lines in a closed net meet at the sides.

        Each side joins a gap between lines of one family to one of the other.
        """
        a, b = lines
        side, i, at = self._meet(0, (a[1:] + a[:-1]) / 2)
        joined = self._oblique[1, side]
        i, j = i[joined], np.searchsorted(b, at[joined]) - 1 + len(counts[0])
        n = len(counts[0]) + len(counts[1])
        label = components(n, (i, j))
        most = np.zeros(n)
        np.maximum.at(most, label, np.concatenate(counts))
        return np.split(most[label], [len(counts[0])])

    def _meet(self, axis: int, lines: ndarray) -> tuple[ndarray, ndarray, ndarray]:
        """Intersections of lines with sides: sides, lines and other coordinates."""
        crossed = np.flatnonzero(self._oblique[axis])
        start, along = self._start[:, crossed, None], self._along[:, crossed, None]
        share = (lines - start[axis]) / along[axis]
        at = start[1 - axis] + share * along[1 - axis]
        side, line = np.nonzero((share >= 0) & (share <= 1))
        return crossed[side], line, at[side, line]
