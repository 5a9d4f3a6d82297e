"""Fibres at a constant angle to a reference curve."""

from dataclasses import dataclass

import numpy as np
from numpy import ndarray
from numpy.typing import ArrayLike

# Most numbers at a time when distances to all segments are compared: 80 MB of them.
_AT_A_TIME = 10_000_000


@dataclass(frozen=True, eq=False)
class AlongCurve:
    """Directions at a constant angle to the nearest place of a polyline.

    Where the nearest place is a corner of the polyline, the tangent there is the mean
    of both sides; where several places are equally near, the first counts.

    Parameters
    ----------
    points
        Corners of the polyline in mm, in order, shape (2, n), n >= 2.
    angle
        Angle in radians from the tangent to the fibres, anticlockwise.

    Raises
    ------
    ValueError
        If there are fewer than two points, one is not finite, two that follow each
        other are the same, the line turns back on itself, or the angle is not finite.

    Examples
    --------
    >>> from skfem_textile import Fabric
    >>> arc = np.array([[0.0, 10.0, 20.0], [0.0, 0.0, 10.0]])
    >>> fabric = Fabric(warp=AlongCurve(arc), weft=AlongCurve(arc, np.pi / 2))
    >>> fabric.warp(np.array([[5.0], [3.0]])).ravel()
    array([1., 0.])
    """

    points: ArrayLike
    angle: float = 0.0

    def __post_init__(self) -> None:
        points = np.array(self.points, dtype=float)
        if points.ndim != 2 or len(points) != 2 or points.shape[1] < 2:
            raise ValueError(
                f"a reference curve needs the shape (2, n), n >= 2, not {points.shape}"
            )
        if not (np.isfinite(points).all() and np.isfinite(self.angle)):
            raise ValueError("a reference curve and its angle must be finite")
        if not (side := np.diff(points)).any(axis=0).all():
            raise ValueError("two points of a reference curve that follow are the same")
        unit = side / np.hypot(*side)
        if not (unit[:, 1:] + unit[:, :-1]).any(axis=0).all():
            raise ValueError("a reference curve turns back on itself")
        object.__setattr__(self, "points", points)

    def __call__(self, x: ndarray) -> ndarray:
        """Unit vectors at positions, both of shape (2, ...)."""
        places = np.reshape(x, (2, -1))
        n = max(1, _AT_A_TIME // np.shape(self.points)[1])
        parts = [
            self._tangent(places[:, i : i + n]) for i in range(0, len(places[0]), n)
        ]
        c, s = np.cos(self.angle), np.sin(self.angle)
        turned = np.array([[c, -s], [s, c]]) @ np.hstack(parts)
        return turned.reshape(np.shape(x))

    def _tangent(self, x: ndarray) -> ndarray:
        """Unit tangents at the nearest places, shape (2, n)."""
        points = np.asarray(self.points)
        start, side = points[:, :-1, None], np.diff(points)[:, :, None]
        share = ((x[:, None] - start) * side).sum(axis=0) / (side**2).sum(axis=0)
        share = share.clip(0.0, 1.0)
        distance = ((x[:, None] - start - share * side) ** 2).sum(axis=0)
        nearest = distance.argmin(axis=0)
        share = np.take_along_axis(share, nearest[None], axis=0)[0]
        unit = np.diff(points) / np.hypot(*np.diff(points))
        last = unit.shape[1] - 1
        before = unit[:, np.where(share == 0, nearest - 1, nearest).clip(0)]
        after = unit[:, np.where(share == 1, nearest + 1, nearest).clip(0, last)]
        tangent = before + after
        return tangent / np.hypot(*tangent)
