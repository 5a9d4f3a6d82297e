"""Crossings of a kinematic net: positions, shear angles, and where it ends."""

from dataclasses import dataclass, replace

import numpy as np
from numpy import ndarray

from ..mesh.user_input import CopiedError, coords
from .laying import QUADRANTS, Status

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
        laid = np.all(_corners(self.status == Status.LAID), axis=0)
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
        a, b, c, d = (of[:, mask] for of in _corners(self.positions))
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
            a, b, c, d = (of[:, self.cut] for of in _corners(self.positions))
            across = np.cross(a - d, b - c, axis=0)
            area[self.cut] = 0.5 * np.linalg.norm(across, axis=0)
        return np.asarray(area)

    def middles(self) -> ndarray:
        """Centres of the cells on the surface in mm, shape (3, n_warp, n_weft)."""
        x = self.positions
        return 0.25 * (x[:, 1:, 1:] + x[:, 1:, :-1] + x[:, :-1, 1:] + x[:, :-1, :-1])

    def centres(self) -> ndarray:
        """Centres of the cells in the flat ply in mm, shape (2, n_warp, n_weft)."""
        mid = [0.5 * (s[1:] + s[:-1]) for s in self.along]
        s, t = np.meshgrid(*mid, indexing="ij")
        flat = np.einsum("ij,jab->iab", self.directions, np.array([s, t]))
        return flat + self.touch[:, None, None]

    def up_to(self, X: ndarray) -> "Net":
        """The part up to points of the flat ply in mm, shape (2, n), NaN elsewhere."""
        ends = np.linalg.solve(self.directions, X - self.touch[:, None]) / self.cell
        wanted = np.zeros(self.status.shape, dtype=bool)
        for signs in QUADRANTS:
            quadrant = tuple(
                slice(z, None, s) for z, s in zip(self.start, signs, strict=True)
            )
            part = wanted[quadrant]
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


def _corners(values: ndarray) -> list[ndarray]:
    """Values at the four corners of each cell, shape (..., n_warp, n_weft)."""
    ends = np.s_[..., 1:, 1:], np.s_[..., :-1, 1:], np.s_[..., 1:, :-1]
    return [values[at] for at in (*ends, np.s_[..., :-1, :-1])]


def up_to(ends: ndarray, shape: tuple[int, ...]) -> ndarray:
    """Mask of the crossings of a quadrant up to the cells that contain points."""
    last = np.floor(ends + 1e-11).astype(int) + 1
    last = last[:, (last > 0).all(axis=0)]
    own = np.zeros(shape, dtype=bool)
    own[tuple(np.minimum(last, np.array(shape)[:, None] - 1))] = True
    for axis in (0, 1):
        own = np.flip(np.logical_or.accumulate(np.flip(own, axis), axis), axis)
    return own
