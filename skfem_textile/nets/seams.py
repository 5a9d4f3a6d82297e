"""Seams of darts: lines on a tool at which nets end."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy import ndarray

# Radius of a disc relative to the length of a seam, at least a cell, and the Gauss
# curvature of a disc in radians above which it is concentrated there.  It is the shear
# that a net would carry along the seam, 11°, above the noise of triangles.
_DISC, _CONCENTRATED = 0.05, 0.2

# Distance of concentrated curvature from the seam up to which it belongs to the seam,
# relative to the length of the seam.
_BESIDE = 0.25

#: Integral of the Gauss curvature in radians over balls around points in mm, (3, n), of
#: a radius in mm, shape (n,).
Curvature = Callable[[ndarray, float], ndarray]


@dataclass(frozen=True, eq=False)
class Seam:
    """Polyline on a tool along which a net is cut.

    Attributes
    ----------
    points
        Points in mm from the tip of the dart to the edge of the part, shape (3, n).
    left
        Unit vectors tangent to the tool and normal to the segments, towards the left,
        shape (3, n − 1).
    """

    points: ndarray
    left: ndarray

    @property
    def length(self) -> float:
        """Length in mm."""
        return float(np.linalg.norm(np.diff(self.points), axis=0).sum())

    def nearest(self, x: ndarray) -> tuple[ndarray, ndarray, ndarray]:
        """Distances from the seam, and distances to its left, in mm, shape (n,).

        Also the mask of points that are behind the tip.
        """
        begin, along = self.points[:, :-1, None], np.diff(self.points)[:, :, None]
        off = x[:, None] - begin  # (3, segment, point)
        share = (off * along).sum(axis=0) / (along**2).sum(axis=0)
        away = off - np.clip(share, 0.0, 1.0) * along
        distance = np.sqrt((away * away).sum(axis=0))
        k, n = distance.argmin(axis=0), np.arange(x.shape[1])
        left = (away[:, k, n] * self.left[:, k]).sum(axis=0)
        return distance[k, n], left, (k > 0) | (share[0] > 0)


class Seams:
    """Seams of darts, numbered from 1 on.

    A net cannot lie unsheared where the curvature of the tool is concentrated.  These
    spots next to seams are left out when it is laid, and filled from all sides.
    """

    def __init__(
        self, seams: Sequence[Seam], curvature: Curvature, cell: float
    ) -> None:
        self.seams, self._curvature, self._cell = tuple(seams), curvature, cell

    def nearest(self, x: ndarray) -> tuple[ndarray, ndarray, ndarray]:
        """Number of the nearest seam of each point, shape (n,).

        Also the distances to its left in mm, and the mask of points behind its tip.
        """
        found = [seam.nearest(x) for seam in self.seams]
        distance, left, behind = np.array(found).swapaxes(0, 1)
        k, n = distance.argmin(axis=0), np.arange(x.shape[1])
        return k + 1, left[k, n], behind[k, n] > 0

    def in_spots(self, x: ndarray) -> ndarray:
        """Mask of points at tips, or where curvature is concentrated at seams, (n,)."""
        mask = np.zeros(x.shape[1], dtype=bool)
        for seam in self.seams:
            mask |= np.linalg.norm(x - seam.points[:, :1], axis=0) < self._cell
            distance, *_ = seam.nearest(x)
            near = np.flatnonzero(~mask & (distance < _BESIDE * seam.length))
            if near.size:
                radius = max(_DISC * seam.length, self._cell)
                within = self._curvature(x[:, near], radius)
                mask[near] = np.abs(within) > _CONCENTRATED
        return mask

    def labels(self, x: ndarray, before: ndarray) -> tuple[ndarray, ndarray]:
        """Numbers of the nearest seams, negative on their right.

        A crossing is on the side of the crossings from which it follows, also if it is
        beyond the seam.

        Parameters
        ----------
        x
            Crossings in mm, shape (3, n).
        before
            Numbers of seams of the crossings from which they follow, shape (2, n).

        Returns
        -------
        tuple
            Numbers, 0 before the tips, and distances beyond the seams in mm, (n,).
        """
        number, left, known = self.nearest(x)
        side = np.where(left >= 0, 1, -1)
        for label in before:
            follows = np.abs(label) == number
            side = np.where(follows, np.sign(label), side)
        beyond = np.where(known, np.maximum(-side * left, 0.0), 0.0)
        return np.where(known, side * number, 0), beyond
