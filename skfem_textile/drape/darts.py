"""Darts: cuts of a ply from where its net folds or locks to the edge of the part.

A dart begins at a place of the tool where the net locks, whatever the direction of the
fibres, and its seam is an edge of the tool: threads end there, and their neighbours
continue as geodesics.  Nets with several darts are laid twice, with the threads of the
left and of the right side of each seam where both meet next to a tip.
"""

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy import ndarray

from ..solve.surface import onto
from .crossings import Net
from .kinematic_net import net, nets_at_seams
from .laying import Status
from .seam_path import seam_from
from .seams import Seam, Seams
from .sheet import Sheet, boundary_edges, unit
from .surfaces import positive_length
from .triangle_mesh import TriangleMesh

# Maximum number of rounds in which darts are added where the net still locks.
_ROUNDS = 6

# Distance of a place that locks from the start, relative to the nearest one, above
# which darts are added in a later round.
_LATER = 1.15

# Radius in cells of the vicinity of a place that locks in which curvature causes it,
# and number of shifts to the middle of the curvature.
_CURVED, _SHIFTS = 4.0, 4

# Distance of a place that locks from a seam, in cells, within which it belongs to it.
_NEAR = 4.0


@dataclass(frozen=True, eq=False)
class NetWithDarts:
    """Net that is laid on both sides of its darts.

    Attributes
    ----------
    sides
        The net on the left and on the right of the darts, seen from their tips.  Before
        the tips they are the same.
    darts
        The seams of the darts.
    locking_angle
        The locking angle in radians.
    """

    sides: tuple[Net, Net]
    darts: tuple[Seam, ...]
    locking_angle: float

    def side_of(self, x: ndarray) -> ndarray:
        """Number of the side of points of the tool, (3, n): 0 or 1, shape (n,)."""
        if not self.darts:
            return np.zeros(x.shape[1], dtype=int)
        _, left, _ = Seams(self.darts).nearest(x)
        return np.asarray(left < 0).astype(int)

    def cells(self) -> tuple[ndarray, ndarray]:
        """Masks of the cells of each side, of which none is in both."""
        left, right = self.sides
        if left.seams is None or right.seams is None:
            return left.cells, np.zeros_like(right.cells)
        on_left, on_right = ~_any_corner(left.seams < 0), _any_corner(right.seams < 0)
        return left.cells & on_left, right.cells & on_right

    @property
    def pieces(self) -> list[tuple[Net, ndarray]]:
        """Nets, each with the mask of its cells."""
        return list(zip(self.sides, self.cells(), strict=True))

    def sheet(self, side: int) -> Sheet:
        """Net on one side as a ply, without the cells on the other side of seams."""
        of, sign = self.sides[side], 1 - 2 * side
        cells = of.cells
        if of.seams is not None:
            cells = cells & _any_corner(sign * of.seams >= 0)
        return Sheet.of_net(_Piece([(of, cells)]))

    def locked(self, tool: TriangleMesh) -> ndarray:
        """Centres of cells on the tool beyond the locking angle in mm, shape (3, n).

        They include the last crossings before folds.
        """
        found = []
        for of, mask in self.pieces:
            high = _locked(tool, of, mask, self.locking_angle)
            found += [of.middles()[:, high], of.folds]
        return np.hstack(found)


def net_with_darts(
    tool: TriangleMesh, cell: float, locking_angle: float, **start: Any
) -> NetWithDarts:
    """Lay a net with darts where it folds, or shears beyond a locking angle.

    Parameters
    ----------
    tool
        The tool.
    cell
        Length of the rods in mm.
    locking_angle
        Locking angle in radians.
    **start
        Start of the net and its first threads, see `net`.

    Raises
    ------
    ValueError
        If an argument is not valid.
    """
    locking_angle = float(locking_angle)
    if not 0 < locking_angle < np.pi / 2:
        raise ValueError(
            "net with darts: the locking angle must be between 0 and 90 degrees, got "
            f"{np.degrees(locking_angle):g}"
        )
    cell = positive_length("net with darts: cell", cell)
    uncut = net(tool, cell, **start)
    laid = NetWithDarts((uncut, uncut), (), locking_angle)
    for _ in range(_ROUNDS):
        places = [_most_curved(tool, x, _CURVED * cell) for x in _locking(tool, laid)]
        more = [seam_from(tool, tip, cell) for tip in places]
        if not more:
            break
        darts = (*laid.darts, *more)
        sides = nets_at_seams(tool, cell, Seams(darts), **start)
        laid = NetWithDarts(sides, darts, locking_angle)
    return laid


class _Piece(NamedTuple):
    """One net with some of its cells."""

    pieces: list[tuple[Net, ndarray]]


def _any_corner(mask: ndarray) -> ndarray:
    """Mask of the cells of which any corner is in a mask of crossings."""
    return np.asarray(mask[1:, 1:] | mask[:-1, 1:] | mask[1:, :-1] | mask[:-1, :-1])


def _locking(tool: TriangleMesh, laid: NetWithDarts) -> list[ndarray]:
    """Places that fold or lock and have no dart, next to the start, shape (3,)."""
    from scipy.ndimage import label  # type: ignore[attr-defined]

    found: list[tuple[float, ndarray]] = []
    for of, mask in laid.pieces:
        high = _locked(tool, of, mask, laid.locking_angle)
        places, count = label(high | _before_folds(tool, of, mask), np.ones((3, 3)))
        away = [
            np.arange(n) + 0.5 - at for n, at in zip(high.shape, of.start, strict=True)
        ]
        order = np.abs(away[0])[:, None] + np.abs(away[1])
        for number in range(1, count + 1):
            rows, columns = np.nonzero(places == number)
            k = order[rows, columns].argmin()
            cell = rows[k], columns[k]
            found.append((float(order[cell]), of.middles()[:, *cell]))
    reach = _NEAR * laid.sides[0].cell
    chosen: list[ndarray] = []
    free = [
        one
        for one in sorted(found, key=lambda one: one[0])
        if all(seam.nearest(one[1][:, None])[0][0] > reach for seam in laid.darts)
    ]
    for away_from_start, place in free:
        # Places further away may be the consequence of those next to the start.
        if away_from_start > _LATER * free[0][0]:
            break
        if all(np.linalg.norm(place - x) > 2 * reach for x in chosen):
            chosen.append(place)
    return chosen


def _most_curved(tool: TriangleMesh, x: ndarray, radius: float) -> ndarray:
    """Middle of the positive curvature around a place, which causes its shear, (3,)."""
    points, triangles = tool.facets.points, tool.facets.triangles()
    defect = np.maximum(_defects(points, triangles), 0.0)
    for _ in range(_SHIFTS):
        weights = defect * (np.linalg.norm(points - x[:, None], axis=0) < radius)
        if weights.sum() > 0:
            x = onto(tool, (points @ weights / weights.sum())[:, None])[:, 0]
    return x


def _defects(points: ndarray, triangles: ndarray) -> ndarray:
    """Curvature of vertices: 2π minus their angles in radians, shape (n,)."""
    angles = np.zeros(points.shape[1])
    for k in range(3):
        a, b, c = (points[:, triangles[(k + m) % 3]] for m in range(3))
        cosine = (unit(b - a) * unit(c - a)).sum(axis=0)
        np.add.at(angles, triangles[k], np.arccos(np.clip(cosine, -1.0, 1.0)))
    defect = 2 * np.pi - angles
    defect[np.unique(boundary_edges([triangles]))] = 0.0
    return defect


def _before_folds(tool: TriangleMesh, laid: Net, mask: ndarray) -> ndarray:
    """Mask of the cells on the tool next to folded threads."""
    from scipy.ndimage import binary_dilation  # type: ignore[attr-defined]

    folded = binary_dilation(_any_corner(laid.status == Status.FOLDED), np.ones((3, 3)))
    i, j = np.nonzero(folded & mask)
    found = np.zeros(mask.shape, dtype=bool)
    found[i, j] = tool.beyond_edges(laid.middles()[:, i, j]) == 0
    return found


def _locked(
    tool: TriangleMesh, laid: Net, mask: ndarray, locking_angle: float
) -> ndarray:
    """Mask of the cells on the tool, among others, beyond the locking angle."""
    angle = np.nan_to_num(np.abs(laid.shear_angle()))
    i, j = np.nonzero(mask & laid.cells & (angle > locking_angle))
    high = np.zeros(mask.shape, dtype=bool)
    high[i, j] = tool.beyond_edges(laid.middles()[:, i, j]) == 0
    return high
