"""Darts: cuts of a ply from where its net folds or locks to the edge of the part.

A dart begins at a place of the tool where the net locks, whatever the direction of the
fibres, and its seam is an edge of the tool at which threads end.  Beside it the net is
laid twice, on the left and on the right, from where it is flattest: walls are free of
shear.  The curvature at the tip, which no net follows, is covered last.
"""

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy import ndarray

from ..surfaces.analytic import positive_length
from ..surfaces.surface import onto
from ..surfaces.triangle_mesh import TriangleMesh
from .crossings import Net, corners
from .kinematic_net import net, nets_at_seams
from .laying import Status
from .seams import Seam, Seams, seam_from
from .sheet import Sheet

# Maximum number of rounds in which darts are added where the net still locks.
_ROUNDS = 6

# Distance of a place that locks from the start, relative to the nearest one, above
# which darts are added in a later round.
_LATER = 1.15

# Radius in cells of the vicinity of a corner, and number of shifts to its middle.
_CORNER, _SHIFTS = 4.0, 4

# Share of the shear of a place that locks above which the curvature of a corner, within
# half of this radius, causes it.
_CAUSES = 0.5

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
    seams
        The seams of the darts, None without darts.
    locking_angle
        The locking angle in radians.
    uncut
        The net without darts.
    """

    sides: tuple[Net, Net]
    seams: Seams | None
    locking_angle: float
    uncut: Net

    @property
    def darts(self) -> tuple[Seam, ...]:
        """Seams of the darts."""
        return () if self.seams is None else self.seams.seams

    def side_of(self, x: ndarray) -> ndarray:
        """Number of the side of points of the tool, (3, n): 0 or 1, shape (n,)."""
        if self.seams is None:
            return np.zeros(x.shape[1], dtype=int)
        _, left, _ = self.seams.nearest(x)
        return np.asarray(left < 0).astype(int)

    def cells(self) -> tuple[ndarray, ndarray]:
        """Masks of the cells of each side, of which none is in both.

        A cell of the ply that both sides have belongs to the left.
        """
        left, right = self.sides
        if left.seams is None or right.seams is None:
            return left.cells, np.zeros_like(right.cells)
        on_left = left.cells & ~_any_corner(left.seams < 0)
        on_right = right.cells & _any_corner(right.seams < 0)
        return on_left, on_right & ~on_left

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
        if not cells.any():
            raise ValueError(
                "net with darts: no net can be laid on one side of the darts: use a "
                "larger locking angle, or choose another start"
            )
        return Sheet.of_net(_Piece([(of, cells)]))

    def in_spots(self, of: Net, mask: ndarray) -> ndarray:
        """Mask of the n cells of a side, in a mask, with a corner in a spot, (n,)."""
        if self.seams is None:
            return np.zeros(mask.sum(), dtype=bool)
        spots = [self.seams.in_spots(x[:, mask]) for x in corners(of.positions)]
        return np.any(spots, axis=0)

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
    laid = NetWithDarts((uncut, uncut), None, locking_angle, uncut)
    for _ in range(_ROUNDS):
        places = _locking(tool, laid)
        more = [seam_from(tool, *place, cell) for place in places]
        if not more:
            break
        seams = Seams((*laid.darts, *more), tool, cell)
        sides = nets_at_seams(tool, cell, seams, locking_angle, **start)
        laid = NetWithDarts(sides, seams, locking_angle, uncut)
    return laid


class _Piece(NamedTuple):
    """Net, and the mask of the cells that belong to the piece."""

    pieces: list[tuple[Net, ndarray]]


def _any_corner(mask: ndarray) -> ndarray:
    """Mask of the cells of which any corner is in a mask of crossings."""
    return np.any(corners(mask), axis=0)


def _locking(
    tool: TriangleMesh, laid: NetWithDarts
) -> list[tuple[ndarray, ndarray | None]]:
    """Causes of the folds and locked cells nearest to the start, see `_cause`."""
    from scipy.ndimage import label  # type: ignore[attr-defined]

    found: list[tuple[float, ndarray, ndarray | None]] = []
    for of, mask in laid.pieces:
        high = _locked(tool, of, mask, laid.locking_angle)
        places, count = label(high | _before_folds(tool, of, mask), np.ones((3, 3)))
        away = [
            np.arange(n) + 0.5 - at for n, at in zip(high.shape, of.start, strict=True)
        ]
        order = np.abs(away[0])[:, None] + np.abs(away[1])
        angle = np.nan_to_num(np.abs(of.shear_angle()))
        for number in range(1, count + 1):
            rows, columns = np.nonzero(places == number)
            # Of the nearest to the start the one that is sheared most.
            k = np.lexsort([-angle[rows, columns], order[rows, columns]])[0]
            cell = rows[k], columns[k]
            cause = _cause(tool, of, cell)
            found.append((float(order[cell]), *cause))
    reach = _NEAR * laid.sides[0].cell
    chosen: list[tuple[ndarray, ndarray | None]] = []
    free = [
        one
        for one in sorted(found, key=lambda one: one[0])
        if all(seam.nearest(one[1][:, None])[0][0] > reach for seam in laid.darts)
    ]
    for away_from_start, place, along in free:
        # Places further away may be the consequence of those next to the start.
        if away_from_start > _LATER * free[0][0]:
            break
        if all(np.linalg.norm(place - x) > 2 * reach for x, _ in chosen):
            chosen.append((place, along))
    return chosen


def _cause(
    tool: TriangleMesh, of: Net, cell: tuple[int, int]
) -> tuple[ndarray, ndarray | None]:
    """Middle of the positive curvature that causes the shear of a cell, shape (3,).

    The shear is the integral of the curvature between the start and the cell.  Its
    cause is a corner, or else the middle of this curvature: a dart that begins behind
    it takes nothing out.  Without a corner also the direction of the dart, (3,): along
    the diagonal of cells, so that both of its edges are sheared equally.
    """
    x, half = of.middles()[:, *cell], 0.5 * _CORNER * of.cell
    # From the start, the first, to the corner of the cell that is furthest from it.
    span = (
        np.r_[a : b + 2] if b >= a else np.r_[a : b - 1 : -1]
        for a, b in zip(of.start, cell, strict=True)
    )
    between = of.positions[:, *np.ix_(*span)]
    laid = np.isfinite(between[0])
    sums = np.zeros(laid.shape)
    sums[laid] = np.maximum(tool.curvature_within(between[:, laid], half), 0.0)
    causes = _CAUSES * abs(float(np.nan_to_num(of.shear_angle()[cell])))
    if tool.curvature_within(x[:, None], half)[0] >= causes:
        return _middle_of_corner(tool, x, 2 * half), None
    if sums.max() >= causes:
        most = between[:, sums == sums.max()][:, 0]
        return _middle_of_corner(tool, most, 2 * half), None
    places = np.array(np.nonzero(laid[:-1, :-1] & laid[1:, 1:]))
    weights = sums[*places]
    if not weights.any():
        weights += 1.0
    middle = np.average(places, axis=1, weights=weights)
    i, j = places[:, np.abs(places - middle[:, None]).sum(axis=0).argmin()]
    return between[:, i, j], between[:, i + 1, j + 1] - between[:, i, j]


def _middle_of_corner(tool: TriangleMesh, x: ndarray, radius: float) -> ndarray:
    """Middle of the positive curvature around a point, shape (3,)."""
    points, positive = tool.facets.points, np.maximum(tool.curvature, 0.0)
    for _ in range(_SHIFTS):
        weights = positive * (np.linalg.norm(points - x[:, None], axis=0) < radius)
        if weights.sum() > 0:
            x = onto(tool, (points @ weights / weights.sum())[:, None])[:, 0]
    return x


def _before_folds(tool: TriangleMesh, laid: Net, mask: ndarray) -> ndarray:
    """Mask of the cells on the tool next to folded threads."""
    from scipy.ndimage import binary_dilation  # type: ignore[attr-defined]

    folded = binary_dilation(_any_corner(laid.status == Status.FOLDED), np.ones((3, 3)))
    return _on_tool(tool, laid, folded & mask)


def _locked(
    tool: TriangleMesh, laid: Net, mask: ndarray, locking_angle: float
) -> ndarray:
    """Mask of the cells on the tool, among others, beyond the locking angle."""
    angle = np.nan_to_num(np.abs(laid.shear_angle()))
    return _on_tool(tool, laid, mask & laid.cells & (angle > locking_angle))


def _on_tool(tool: TriangleMesh, laid: Net, mask: ndarray) -> ndarray:
    """Mask of the cells, among others, whose middle is on the tool."""
    found = np.zeros(mask.shape, dtype=bool)
    found[mask] = tool.beyond_edges(laid.middles()[:, mask]) == 0
    return found
