"""Seams of darts: lines on a tool at which nets end."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy import ndarray

# Number of segments whose chord is the direction of a seam at its tip.
_CHORD = 6


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
        # The first segments bend around the fillet of a corner.
        chord = (
            self.points[:, min(_CHORD, self.points.shape[1] - 1)] - self.points[:, 0]
        )
        return distance[k, n], left, (k >= _CHORD) | (chord @ off[:, 0] > 0)


class Seams:
    """Seams of darts, numbered from 1 on."""

    def __init__(self, seams: Sequence[Seam]) -> None:
        self._seams = seams

    def nearest(self, x: ndarray) -> tuple[ndarray, ndarray, ndarray]:
        """Number of the nearest seam of each point, shape (n,).

        Also the distances to its left in mm, and the mask of points behind its tip.
        """
        found = [seam.nearest(x) for seam in self._seams]
        distance, left, behind = np.array(found).swapaxes(0, 1)
        k, n = distance.argmin(axis=0), np.arange(x.shape[1])
        return k + 1, left[k, n], behind[k, n] > 0

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
