"""Sides of darts of a kinematic net."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy import ndarray

from .laying import Status, Wanted


@dataclass(frozen=True, eq=False)
class Seam:
    """Polyline on a tool along which a net is cut.

    Attributes
    ----------
    points
        Points in mm from the tip of the dart to the edge of the part, shape (3, n).
    side
        Unit vectors tangent to the tool and normal to the segments, towards the warp,
        shape (3, n − 1).
    """

    points: ndarray
    side: ndarray

    def nearest(self, x: ndarray) -> tuple[ndarray, ndarray]:
        """Distances from the seam in mm, and distances towards the warp, shape (n,)."""
        begin, along = self.points[:, :-1, None], np.diff(self.points)[:, :, None]
        off = x[:, None] - begin
        share = (off * along).sum(axis=0) / (along**2).sum(axis=0)
        away = off - np.clip(share, 0.0, 1.0) * along
        distance = np.sqrt((away * away).sum(axis=0))
        k, n = distance.argmin(axis=0), np.arange(x.shape[1])
        towards = (away[:, k, n] * self.side[:, k]).sum(axis=0)
        return distance[k, n], towards


@dataclass(frozen=True, eq=False)
class Cut:
    """Side of a dart in a quadrant of a net.

    Attributes
    ----------
    quadrant
        Number of the quadrant in `QUADRANTS`.
    tip
        Numbers of cells from the start to the tip, along warp and weft.
    warp_side
        True for the side of the first warp thread.
    seam
        The seam of the dart.
    """

    quadrant: int
    tip: tuple[int, int]
    warp_side: bool
    seam: Seam

    def other(self) -> "Cut":
        """The other side."""
        return Cut(self.quadrant, self.tip, not self.warp_side, self.seam)

    def offset(self, i: ndarray, j: ndarray) -> ndarray:
        """Number of cells on this side of the diagonal through the tip."""
        off = (i - self.tip[0]) - (j - self.tip[1])
        return off if self.warp_side else -off

    def behind(self, i: ndarray, j: ndarray) -> ndarray:
        """Mask of crossings that depend on the tip."""
        return (i > self.tip[0]) & (j > self.tip[1])

    def on_other_side(self, i: ndarray, j: ndarray) -> ndarray:
        """Mask of crossings of the other side, without its first thread.

        Next to the tip and to the diagonal this side has one crossing more.
        """
        first, second = (i, j) if self.warp_side else (j, i)
        _, other = self.tip if self.warp_side else self.tip[::-1]
        return (second > other + 1) & (first >= 1) & (self.offset(i, j) < -1)

    def beyond_seam(self, x: ndarray, row: ndarray, i: ndarray, j: ndarray) -> ndarray:
        """Distances of crossings of this side beyond the seam in mm, 0 before it."""
        first, second = (i, j) if self.warp_side else (j, i)
        own, other = self.tip if self.warp_side else self.tip[::-1]
        side = (row == self.quadrant) & (first > own) & (second >= other)
        side &= self.offset(i, j) >= -1
        beyond = np.zeros(len(row))
        if side.any():
            _, towards = self.seam.nearest(x[:, side])
            beyond[side] = np.maximum(-towards if self.warp_side else towards, 0.0)
        return beyond


def with_cuts(cuts: Sequence[Cut], status: ndarray, i: ndarray, j: ndarray) -> Wanted:
    """Crossings to lay on sides of darts, from the statuses of those without darts."""
    without, side = np.zeros((2, *status.shape), dtype=bool), np.zeros((len(status), 1))
    for cut in cuts:
        behind, offset = cut.behind(i, j), cut.offset(i, j)
        status[cut.quadrant, cut.on_other_side(i, j)] = Status.CUT
        without[0 if cut.warp_side else 1, cut.quadrant] = behind & (offset <= 0)
        side[cut.quadrant] = 1 if cut.warp_side else -1
    return Wanted(status, without[0], without[1], side)
