"""Crossings that follow from others in another order than away from the start.

Where an edge of the tool turns back towards the start, the last corner of a cell
follows from three others.  Next to the seam of a dart the net is laid from where it is
flattest and sheared least.
"""

from dataclasses import replace
from itertools import combinations, product

import numpy as np
from numpy import ndarray

from ..surfaces.triangle_mesh import TriangleMesh
from ..surfaces.triangles import unit
from .crossings import Net
from .laying import QUADRANTS, Status, crossing, straight
from .seams import Seams

# Steps along threads.
_ALONG = ((1, 0), (-1, 0), (0, 1), (0, -1))

# Angle in radians between rods of a geodesic above which it goes on later, if it is
# still needed.
_BEND = 0.1


def with_corners(tool: TriangleMesh, net: Net, margin: float) -> Net:
    """Extend edge cells beyond the tool, so that cells at edges are complete.

    Parameters
    ----------
    tool
        The tool.
    net
        The net.
    margin
        Distance beyond the edges in mm up to which a crossing counts as on the tool.
    """
    filling = _Filling(tool, net, margin, None)
    while filling.corners(0):
        pass
    return filling.net()


def filled_at_seams(
    tool: TriangleMesh, net: Net, margin: float, seams: Seams, locking_angle: float
) -> tuple[Net, Net]:
    """Lay the cells that are still missing next to the seams of darts, on both sides.

    The thread that ends where the net is flattest and sheared least continues as a
    geodesic, and the others follow from it.  Spots are filled last, from all sides, up
    to the cells that would lock.

    Parameters
    ----------
    tool, net, margin
        See `with_corners`.
    seams
        The seams.
    locking_angle
        The locking angle in radians.
    """
    most = int(np.ceil(max(seam.length for seam in seams.seams) / net.cell))
    sides = []
    for side in (1, -1):
        filling = _Filling(tool, _padded(net, most), margin, seams, side)
        while filling.corners(0) or filling.threads():
            pass
        filling.open_spots(locking_angle)
        for least in (0, -1):
            filling.reconsider()
            while filling.corners(least):
                pass
        sides.append(filling.net())
    laid = np.any([of.status == Status.LAID for of in sides], axis=0)
    left, right = (_cropped(of, laid) for of in sides)
    return left, right


class _Filling:
    """Crossings of a net that are laid in another order."""

    def __init__(
        self,
        tool: TriangleMesh,
        net: Net,
        margin: float,
        seams: Seams | None,
        side: int = 1,
    ) -> None:
        from scipy.ndimage import binary_dilation  # type: ignore[attr-defined]

        self._tool, self._net, self._margin = tool, net, margin
        self._seams, self._side = seams, side
        self._x, self._status = net.positions.copy(), net.status.copy()
        self._open = np.isin(net.status, (Status.EDGE, Status.SEAM))
        self._most = np.pi
        self._front = np.ones(net.status.shape, dtype=bool)
        self._spots_open = False
        self._in_spots = np.zeros(net.status.shape, dtype=bool)
        self._labels = np.zeros(net.status.shape, dtype=int)
        self._on = np.zeros(net.status.shape, dtype=bool)
        near = binary_dilation(self._open, np.ones((3, 3))) if seams is None else True
        at = np.array(np.nonzero((net.status == Status.LAID) & near))
        self._mark(at, np.zeros((1, at.shape[1]), dtype=int))

    def net(self) -> Net:
        """The net with the crossings that were laid."""
        labels = None if self._seams is None else self._labels
        return replace(self._net, positions=self._x, status=self._status, seams=labels)

    def reconsider(self) -> None:
        """Make all missing corners candidates again."""
        self._front[:] = True

    def open_spots(self, locking_angle: float) -> None:
        """Lay crossings in spots too from now on, unless their cells lock."""
        self._most = locking_angle
        self._open |= self._in_spots
        self._spots_open = True

    def corners(self, least: int) -> int:
        """Lay missing corners of cells once, and count the candidates.

        Cells count if the other three corners have sign(label) · side ≥ ``least``.
        """
        laid = self._status == Status.LAID
        corners = _missing(laid, self._open & self._front)
        self._front[:] = False
        on, labels = (
            np.array([of[*at] for at in corners[:3]]) for of in (self._on, self._labels)
        )
        near = on.any(axis=0) & (np.sign(labels) * self._side >= least).all(axis=0)
        for one, other in combinations(labels, 2):
            near &= (one != -other) | (one == 0)
        corners = corners[:, :, near]
        _, first = np.unique(corners[3], axis=1, return_index=True)
        corner, one, other, missing = corners[:, :, first]
        if missing.size:
            x = self._x
            found, status = crossing(
                self._tool, x[:, *one], x[:, *other], x[:, *corner], self._net.cell
            )
            along = x[:, *one] - x[:, *corner], x[:, *other] - x[:, *corner]
            in_ply = (self._net.directions @ (of - corner) for of in (one, other))
            shear = np.abs(_angle(*along) - _angle(*in_ply))
            status[shear > self._most] = Status.BEHIND
            self._lay(missing, found, status, np.array([one, other]))
        return missing.shape[1]

    def threads(self) -> int:
        """Continue threads as geodesics, one for each seam, and count them."""
        at, step = self._ends()
        count, straight_on = at.shape[1], np.ones(at.shape[1], dtype=bool)
        shape = np.array(self._open.shape)[:, None]
        while at.size:
            before, x = self._x[:, *(at - step)], self._x[:, *at]
            found, status = straight(self._tool, before, x, self._net.cell)
            bend = np.linalg.norm(found - 2 * x + before, axis=0) / self._net.cell
            goes = straight_on | (bend <= _BEND)
            straight_on = np.zeros(goes.sum(), dtype=bool)
            at, step = at[:, goes] + step[:, goes], step[:, goes]
            self._lay(at, found[:, goes], status[goes], np.array([at - step]))
            ahead = at + step
            inside = ((ahead >= 0) & (ahead < shape)).all(axis=0)
            goes = np.flatnonzero(inside & self._on[*at])
            goes = goes[self._open[*ahead[:, goes]]]
            at, step, straight_on = at[:, goes], step[:, goes], straight_on[goes]
        return count

    def _ends(self) -> tuple[ndarray, ndarray]:
        """Thread ends where the net is deformed least, and their directions.

        One for each seam, shape (2, n).
        """
        ends = self._on & (self._labels * self._side >= 0)
        i, j = np.nonzero(ends[1:-1, 1:-1])
        at = np.tile(np.array([i, j]) + 1, 4)
        step = np.repeat(np.transpose(_ALONG), len(i), axis=1)
        seam, laid = self._status == Status.SEAM, self._status == Status.LAID
        able = seam[*(at + step)] & self._open[*(at + step)] & laid[*(at - step)]
        at, step = at[:, able], step[:, able]
        order = np.argsort(self._deformed(at, step), kind="stable")
        at, step = at[:, order], step[:, order]
        _, first = np.unique(self._labels[*at], return_index=True)
        return at[:, first], step[:, first]

    def _deformed(self, at: ndarray, step: ndarray) -> ndarray:
        """Deviation of the net from flat and unsheared at ends of threads, (n,).

        The largest change of the products of rods along a thread and beside its end, in
        squared cells.  Infinite unless there are two of each.
        """
        x, flat, beside = self._x, self._net.directions, step[::-1]
        before = at - step
        rods = [
            x[:, *to] - x[:, *of]
            for of, to in (
                (before - step, before),
                (before, at),
                (at - beside, at),
                (at, at + beside),
            )
        ]
        in_ply = [flat @ step] * 2 + [flat @ beside] * 2
        changes = [
            (rods[k] * rods[m]).sum(axis=0) / self._net.cell**2
            - (in_ply[k] * in_ply[m]).sum(axis=0)
            for k, m in combinations(range(4), 2)
        ]
        change = np.abs(changes).max(axis=0)
        return np.where(np.isfinite(change), change, np.inf)

    def _lay(self, at: ndarray, x: ndarray, status: ndarray, before: ndarray) -> None:
        """Lay crossings that follow from others, shape (k, 2, n), but not in spots."""
        laid = status == Status.LAID
        self._open[*at] = False  # what cannot be laid is not tried again
        self._status[*at[:, ~laid]] = Status.BEHIND
        if self._seams is not None and not self._spots_open:
            spots = np.flatnonzero(laid)
            spots = spots[self._seams.in_spots(x[:, spots])]
            self._in_spots[*at[:, spots]] = True
            laid[spots] = False
        at = at[:, laid]
        self._status[*at] = Status.LAID
        self._x[:, *at] = x[:, laid]
        self._mark(at, np.array([self._labels[*of[:, laid]] for of in before]))

    def _mark(self, at: ndarray, before: ndarray) -> None:
        """Mark the crossings that are on the tool and on their side of seams."""
        if not at.size:
            return
        x = self._x[:, *at]
        self._on[*at] = self._tool.beyond_edges(x) <= self._margin
        if self._seams is not None:
            self._labels[*at], beyond = self._seams.labels(x, before)
            self._on[*at] &= beyond <= 0
        for di, dj in product((-1, 0, 1), repeat=2):
            i, j = at[0] + di, at[1] + dj
            inside = (i >= 0) & (j >= 0) & (i < len(self._on)) & (j < len(self._on.T))
            self._front[i[inside], j[inside]] = True


def _angle(a: ndarray, b: ndarray) -> ndarray:
    """Angles between columns in radians, shape (n,)."""
    cosine = (unit(a) * unit(b)).sum(axis=0)
    return np.arccos(np.clip(cosine, -1.0, 1.0))


def _padded(net: Net, count: int) -> Net:
    """Net padded by this number of empty crossings on each side."""
    wide = [
        net.cell
        * np.arange(
            round(at[0] / net.cell) - count, round(at[-1] / net.cell) + count + 1
        )
        for at in net.along
    ]
    return replace(
        net,
        positions=np.pad(
            net.positions,
            ((0, 0), (count, count), (count, count)),
            constant_values=np.nan,
        ),
        status=np.pad(net.status, count, constant_values=Status.SEAM),
        along=(wide[0], wide[1]),
    )


def _cropped(net: Net, laid: ndarray) -> Net:
    """Net without its outer rows and columns in which no crossing was laid."""
    i, j = (
        slice(max(of[0] - 1, 0), of[-1] + 2)
        for of in (np.flatnonzero(laid.any(axis=k)) for k in (1, 0))
    )
    return replace(
        net,
        positions=net.positions[:, i, j],
        status=net.status[i, j],
        along=(net.along[0][i], net.along[1][j]),
        seams=None if net.seams is None else net.seams[i, j],
    )


def _missing(laid: ndarray, open_: ndarray) -> ndarray:
    """Cells with one missing corner: opposite corner, neighbours, missing corner.

    Numbers of crossings, shape (4, 2, n).
    """
    i, j = np.nonzero(open_)
    found = []
    for di, dj in QUADRANTS:
        a, b = i - di, j - dj
        inside = (a >= 0) & (b >= 0) & (a < laid.shape[0]) & (b < laid.shape[1])
        p, q, a, b = i[inside], j[inside], a[inside], b[inside]
        whole = laid[a, b] & laid[p, b] & laid[a, q]
        found.append(np.array([[a, b], [p, b], [a, q], [p, q]])[:, :, whole])
    return np.concatenate(found, axis=2)
