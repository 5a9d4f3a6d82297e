"""Curves on a tool that first threads of a kinematic net follow."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy import ndarray
from numpy.typing import ArrayLike

from ..mesh.user_input import coords, real_numbers

# Angle in degrees between two edges of an outline that meet at a corner.  Outlines of
# round parts have at least twenty edges.
_CORNER_DEG = 30.0


class CurvePlace(NamedTuple):
    """Place on a curve: number of the segment, share of it, position, (3,), in mm."""

    segment: int
    share: float
    position: ndarray


@dataclass(frozen=True, eq=False)
class GuideCurve:
    """Polyline in space.

    Parameters
    ----------
    points
        Points in mm, shape (3, n).

    Raises
    ------
    ValueError
        If there are fewer than two distinct points, or one is not finite.
    """

    points: ndarray

    def __post_init__(self) -> None:
        points = real_numbers("net: curve of a first thread", self.points)
        if points.ndim != 2 or len(points) != 3 or not np.isfinite(points).all():
            raise ValueError(
                "net: the curve of a first thread must be finite numbers of shape "
                "(3, n)"
            )
        apart = (points[:, 1:] != points[:, :-1]).any(axis=0)
        points = points[:, np.append(True, apart)]
        if points.shape[1] < 2:
            raise ValueError(
                "net: the curve of a first thread must have two distinct points"
            )
        object.__setattr__(self, "points", points)

    def closest(self, x: ndarray) -> CurvePlace:
        """Place closest to a point in mm, shape (3,)."""
        begin, along = self.points[:, :-1], np.diff(self.points)
        share = ((x[:, None] - begin) * along).sum(axis=0) / (along**2).sum(axis=0)
        share = np.clip(share, 0.0, 1.0)
        feet = begin + share * along
        k = int(np.linalg.norm(feet - x[:, None], axis=0).argmin())
        return CurvePlace(k, float(share[k]), feet[:, k])

    def tangent(self, place: CurvePlace) -> ndarray:
        """Unit vector along the curve at a place, shape (3,)."""
        along = self.points[:, place.segment + 1] - self.points[:, place.segment]
        return along / np.linalg.norm(along)

    def walk(self, x: ndarray, sign: int) -> "Walk":
        """Walk from the place closest to a point, in or against its direction."""
        place = self.closest(x)
        if sign > 0:
            rest = self.points[:, place.segment + 1 :]
        else:
            rest = self.points[:, place.segment :: -1]
        return Walk(np.column_stack([place.position, rest]))


@dataclass(eq=False)
class Walk:
    """Traversal of a polyline, shape (3, n), from its first point."""

    points: ndarray

    def after(self, x: ndarray, chord: float) -> tuple[ndarray, ndarray] | None:
        """Next point at a distance from x, and the direction there, shape (3,).

        The next call starts there.  None if the curve ends before.
        """
        away = np.linalg.norm(self.points - x[:, None], axis=0)
        beyond = np.flatnonzero(away >= chord)
        if beyond.size and not beyond[0]:
            raise ValueError(
                f"net: the curve of a first thread is {away[0]:.3g} mm away from the "
                f"tool at {coords(self.points[:, 0])} mm: specify a curve "
                "on the tool"
            )
        if not beyond.size:
            self.points = self.points[:, :0]
            return None
        k = beyond[0]
        begin, end = self.points[:, k - 1], self.points[:, k]
        along, off = end - begin, begin - x
        a, b, c = along @ along, along @ off, off @ off - chord**2
        share = (np.sqrt(b * b - a * c) - b) / a
        point = begin + share * along
        self.points = np.column_stack([point, self.points[:, k:]])
        return point, along


def edge_through(outline: ArrayLike, point: ArrayLike) -> ndarray:
    """Edge of a closed outline, from corner to corner, that is nearest to a point.

    Corners are points where the outline turns by more than 30°.

    Parameters
    ----------
    outline
        Points of a closed curve in mm, shape (3, n), the first not repeated, such as a
        curve of `ToolMesh.boundary`.
    point
        Point near the edge in mm, shape (3,).

    Returns
    -------
    ndarray
        Points of the edge in mm, shape (3, m), in the order of the outline; the whole
        outline, closed, if it has no corners.

    Examples
    --------
    >>> import numpy as np
    >>> from skfem_textile import drape
    >>> square = np.array([[0, 1, 2, 2, 2, 1, 0, 0], [0, 0, 0, 1, 2, 2, 2, 1], 8 * [0]])
    >>> drape.edge_through(square, (1.2, 0.1, 0)).tolist()
    [[0.0, 1.0, 2.0], [0.0, 0.0, 0.0], [0.0, 0.0, 0.0]]
    """
    points = real_numbers("edge: outline", outline)
    n = points.shape[1]
    along = np.roll(points, -1, axis=1) - points
    along = along / np.linalg.norm(along, axis=0)
    turn = (along * np.roll(along, 1, axis=1)).sum(axis=0)
    corners = np.flatnonzero(turn < np.cos(np.radians(_CORNER_DEG)))
    closed = GuideCurve(np.column_stack([points, points[:, 0]]))
    if not corners.size:
        return closed.points
    at = closed.closest(np.asarray(point, dtype=float)).segment
    begin = corners[corners <= at][-1] if (corners <= at).any() else corners[-1] - n
    after = corners[corners > at]
    end = after[0] if after.size else corners[0] + n
    return points[:, np.arange(begin, end + 1) % n]
