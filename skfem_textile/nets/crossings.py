"""Crossings of a kinematic net, where it ends, and cells laid in another order.

Where an edge of the tool turns back towards the start, the last corner of a cell
follows from three others.  Next to the seam of a dart the net is laid from where it is
flattest and sheared least.
"""

from dataclasses import dataclass, replace
from itertools import combinations
from typing import TYPE_CHECKING

import numpy as np
from numpy import ndarray

from ..mesh.user_input import CopiedError, coords
from ..surfaces.tool_mesh import unit
from .laying import QUADRANTS, Status, crossing, straight

if TYPE_CHECKING:
    from ..surfaces.triangle_mesh import TriangleMesh
    from .seams import Seams

# Rounding of the length of a rod, relative to it.
_ROUNDING = 1e-6

# Longest side of a cell at the tip of a dart relative to the rods; others are open.
_OPEN = 1.5


class NetError(CopiedError, ValueError):
    """Net that does not reach a point.

    Attributes
    ----------
    position
        Position of its end in mm, shape (3,).
    """

    def __init__(self, what: str, position: ndarray, advice: str = "") -> None:
        super().__init__(f"net: {what} at {coords(position)} mm{advice}")
        self.position = position


class FoldedNetError(NetError):
    """Net whose threads fold onto one another."""


@dataclass(frozen=True, eq=False)
class Net:
    """Crossings of a net on a surface.

    Attributes
    ----------
    positions
        Positions of the crossings in mm, shape (3, n_warp + 1, n_weft + 1), with the
        second axis along the warp.  NaN for crossings that were not laid.
    status
        `Status` of the crossings: laid, or the reason why not, (n_warp + 1, n_weft +
        1).
    along
        Coordinates of the crossings along warp and weft in the flat ply in mm.
    directions
        Unit vectors of warp and weft in the flat ply, columns of shape (2, 2).
    touch
        Origin of these coordinates in the flat ply, shape (2,).
    seams
        Numbers of the seams of darts at crossings behind their tips, negative on the
        right of a seam, shape (n_warp + 1, n_weft + 1); None without darts.
    """

    positions: ndarray
    status: ndarray
    along: tuple[ndarray, ndarray]
    directions: ndarray
    touch: ndarray
    seams: ndarray | None = None

    @property
    def cell(self) -> float:
        """Length of the rods in mm."""
        return float(self.along[0][1] - self.along[0][0])

    @property
    def start(self) -> tuple[int, int]:
        """Numbers of the crossing at which the net starts."""
        first, second = (int(np.abs(at).argmin()) for at in self.along)
        return first, second

    @property
    def cells(self) -> ndarray:
        """Mask of the cells with four crossings, shape (n_warp, n_weft).

        There are none between the edges of a dart, except at its tip.
        """
        laid = np.all(corners(self.status == Status.LAID), axis=0)
        cut = laid & self.cut
        sides = np.linalg.norm(self._sides(cut), axis=1)
        laid[cut] = sides.max(axis=0) <= _OPEN * self.cell
        return np.asarray(laid)

    @property
    def cut(self) -> ndarray:
        """Mask of the cells at tips and seams of darts, which have a free side."""
        mask = np.zeros(tuple(n - 1 for n in self.status.shape), dtype=bool)
        if self.seams is not None:
            lengths = np.linalg.norm(self._sides(~mask), axis=1)
            off = np.nan_to_num(np.abs(lengths - self.cell)).max(axis=0)
            mask |= (off > _ROUNDING * self.cell).reshape(mask.shape)
        return mask

    @property
    def pieces(self) -> list[tuple["Net", ndarray]]:
        """The net and its cells, as the pieces of a net with darts."""
        return [(self, self.cells)]

    @property
    def folds(self) -> ndarray:
        """Positions at which threads fold onto one another in mm, shape (3, n)."""
        return self._before(Status.FOLDED)

    @property
    def leaves(self) -> ndarray:
        """Positions from which a thread leaves the surface in mm, shape (3, n)."""
        return self._before(Status.OFF)

    def shear_angle(self) -> ndarray:
        """Shear angle Γ of each cell in radians, shape (n_warp, n_weft).

        The sides of a cell are equal, so that its diagonals determine the angle.  NaN
        if a corner was not laid.
        """
        x = self.positions
        one = np.linalg.norm(x[:, 1:, 1:] - x[:, :-1, :-1], axis=0)
        other = np.linalg.norm(x[:, 1:, :-1] - x[:, :-1, 1:], axis=0)
        angle = 2 * np.arctan2(other, one)
        angle[self.cut] = self._of_cut_cells()
        return self._at_rest - angle

    @property
    def _at_rest(self) -> float:
        """Angle between warp and weft in the flat ply in radians."""
        a, b = self.directions.T
        return float(np.abs(np.arctan2(np.linalg.det([a, b]), a @ b)))

    def _sides(self, mask: ndarray) -> ndarray:
        """Sides of some cells along warp, weft, warp, weft in mm, shape (4, 3, n)."""
        a, b, c, d = (of[:, mask] for of in corners(self.positions))
        return np.array([a - b, a - c, c - d, b - d])

    def _of_cut_cells(self) -> ndarray:
        """Angles between the rods of cells with a free side in radians, shape (n,)."""
        sides = self._sides(self.cut)
        lengths = np.linalg.norm(sides, axis=1)
        pairs = ((0, 1), (0, 3), (2, 1), (2, 3))
        cosines = np.array(
            [
                (sides[i] * sides[j]).sum(axis=0) / (lengths[i] * lengths[j])
                for i, j in pairs
            ]
        )
        off = np.abs(lengths - self.cell)
        best = np.argmin([off[i] + off[j] for i, j in pairs], axis=0)
        return np.arccos(np.clip(cosines[best, np.arange(len(best))], -1.0, 1.0))

    def areas(self) -> ndarray:
        """Area of each cell on the surface in mm², shape (n_warp, n_weft).

        It is cos Γ times the square of its sides for warp and weft at right angles at
        rest.  NaN if a corner was not laid.
        """
        area = self.cell**2 * np.sin(self._at_rest - self.shear_angle())
        if self.seams is not None:
            a, b, c, d = (of[:, self.cut] for of in corners(self.positions))
            across = np.cross(a - d, b - c, axis=0)
            area[self.cut] = 0.5 * np.linalg.norm(across, axis=0)
        return np.asarray(area)

    def middles(self) -> ndarray:
        """Centres of the cells on the surface in mm, shape (3, n_warp, n_weft)."""
        return np.mean(corners(self.positions), axis=0)

    def flat(self) -> ndarray:
        """Crossings in the flat ply in mm, shape (2, n_warp + 1, n_weft + 1)."""
        steps = np.array(np.meshgrid(*self.along, indexing="ij"))
        flat = np.einsum("ij,jab->iab", self.directions, steps)
        return flat + self.touch[:, None, None]

    def centres(self) -> ndarray:
        """Centres of the cells in the flat ply in mm, shape (2, n_warp, n_weft)."""
        return np.mean(corners(self.flat()), axis=0)

    def fibres(self, n: int) -> tuple[ndarray, ndarray]:
        """Directions of warp and weft at n points of the flat ply, shape (2, n)."""
        warp, weft = (np.tile(a[:, None], (1, n)) for a in self.directions.T)
        return warp, weft

    def up_to(self, X: ndarray) -> "Net":
        """The part up to points of the flat ply in mm, shape (2, n), NaN elsewhere."""
        ends = np.linalg.solve(self.directions, X - self.touch[:, None]) / self.cell
        wanted = np.zeros(self.status.shape, dtype=bool)
        for signs in QUADRANTS:
            part = wanted[quadrant_of(self.start, signs)]
            part |= up_to(ends * np.array(signs)[:, None], part.shape)
        return replace(
            self,
            positions=np.where(wanted, self.positions, np.nan),
            status=np.where(wanted, self.status, Status.OMITTED),
        )

    def at(self, X: ndarray) -> ndarray:
        """Positions of points of the flat ply, bilinear in each cell, shape (3, n).

        Parameters
        ----------
        X
            Points in mm, shape (2, n).

        Raises
        ------
        NetError
            If the net ends before a point: `FoldedNetError` if it folds.
        ValueError
            If a point is outside the requested part of the net.
        """
        return self._between(self.positions, X)

    def tangents(self, X: ndarray) -> ndarray:
        """Unit vectors along warp and weft at points of the flat ply, shape (2, 3, n).

        Central differences over two cells, linear between the crossings.

        Parameters
        ----------
        X
            Points in mm, shape (2, n), at least one cell inside the net.

        Raises
        ------
        NetError, ValueError
            See `at`.
        """
        along = (np.gradient(self.positions, axis=axis) for axis in (1, 2))
        tangents = np.array([self._between(tangent, X) for tangent in along])
        return tangents / np.linalg.norm(tangents, axis=1, keepdims=True)

    def _between(self, x: ndarray, X: ndarray) -> ndarray:
        """Values at points, bilinear between the crossings, shape (3, n)."""
        coordinates = np.linalg.solve(self.directions, X - self.touch[:, None])
        cell, share = [], []
        for s, at in zip(coordinates, self.along, strict=True):
            index = (s - at[0]) / self.cell
            if not ((index > -1e-6) & (index < len(at) - 1 + 1e-6)).all():
                raise ValueError(
                    f"net: the coordinate {s[np.abs(s).argmax()]:g} mm is outside the "
                    f"net, which extends from {at[0]:g} to {at[-1]:g} mm"
                )
            cell.append(np.clip(np.floor(index).astype(int), 0, len(at) - 2))
            share.append(index - cell[-1])
        (i, j), (p, q) = cell, share
        values = (
            (1 - p) * (1 - q) * x[:, i, j]
            + p * (1 - q) * x[:, i + 1, j]
            + (1 - p) * q * x[:, i, j + 1]
            + p * q * x[:, i + 1, j + 1]
        )
        ended = np.flatnonzero(~np.isfinite(values[0]))
        if ended.size:
            raise self._ended(int(i[ended[0]]), int(j[ended[0]]))
        return values

    def _ended(self, i: int, j: int) -> NetError:
        """Error for a net that does not reach a cell."""
        for ends, error, what in (
            (self.folds, FoldedNetError, "the threads fold onto one another"),
            (self.leaves, NetError, "a thread leaves the surface"),
        ):
            if ends.size:
                return error(what, ends[:, 0], ": use fewer cells, or start elsewhere")
        laid = np.argwhere(self.status == Status.LAID)
        last = laid[np.abs(laid - [i, j]).sum(axis=1).argmin()]
        position = self.positions[:, *last]
        return NetError("the net ends at the edge of the tool", position)

    def _before(self, status: Status) -> ndarray:
        """Positions of the neighbours, towards the start, of crossings with a status.

        Those nearest to the start, in cells, come first.
        """
        place = np.argwhere(self.status == status).T
        away = place - np.array(self.start)[:, None]
        order = np.abs(away).sum(axis=0).argsort(kind="stable")
        towards = -np.sign(away)[:, order]
        # Of three neighbours towards the start, the first that was laid.
        x = np.full((3, len(order)), np.nan)
        for share in ([[1], [1]], [[1], [0]], [[0], [1]]):
            i, j = place[:, order] + share * towards
            x = np.where(np.isfinite(x), x, self.positions[:, i, j])
        return x[:, np.isfinite(x[0])]


def corners(values: ndarray) -> list[ndarray]:
    """Values at the four corners of each cell, shape (..., n_warp, n_weft)."""
    ends = np.s_[..., 1:, 1:], np.s_[..., :-1, 1:], np.s_[..., 1:, :-1]
    return [values[at] for at in (*ends, np.s_[..., :-1, :-1])]


def quadrant_of(start: tuple[int, int], signs: tuple[int, int]) -> tuple[slice, slice]:
    """Crossings of a quadrant of a net, from its start."""
    return slice(start[0], None, signs[0]), slice(start[1], None, signs[1])


def up_to(ends: ndarray, shape: tuple[int, ...]) -> ndarray:
    """Mask of the crossings of a quadrant up to the cells that contain points."""
    last = np.floor(ends + 1e-11).astype(int) + 1
    last = last[:, (last > 0).all(axis=0)]
    own = np.zeros(shape, dtype=bool)
    own[tuple(np.minimum(last, np.array(shape)[:, None] - 1))] = True
    for axis in (0, 1):
        own = np.flip(np.logical_or.accumulate(np.flip(own, axis), axis), axis)
    return own


# Steps along threads.
_ALONG = ((1, 0), (-1, 0), (0, 1), (0, -1))

# Angle in radians between rods of a geodesic above which it goes on later, if it is
# still needed.
_BEND = 0.1


def with_corners(tool: "TriangleMesh", net: Net, margin: float) -> Net:
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
    tool: "TriangleMesh", net: Net, margin: float, seams: "Seams", locking_angle: float
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
        tool: "TriangleMesh",
        net: Net,
        margin: float,
        seams: "Seams | None",
        side: int = 1,
    ) -> None:
        from scipy.ndimage import binary_dilation  # type: ignore[attr-defined]

        self._tool, self._net, self._margin = tool, net, margin
        self._seams, self._side = seams, side
        self._x, self._status = net.positions.copy(), net.status.copy()
        self._open = np.isin(net.status, (Status.EDGE, Status.SEAM))
        self._most = np.pi
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
        corners = _missing(laid, self._open)
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
            self._on[*at] &= ~beyond


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
