"""Darts: cuts of a ply from where its net folds or locks to the edge of the part.

The net is laid up to the tip of a dart, and beyond it on both sides independently: on
each side the threads that come from the other side continue as geodesics.  The seam
follows the diagonals of the cells behind the tip, which bisect the fibres of the net
without the dart, and goes on as a geodesic where this net ends.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
from numpy import ndarray
from numpy.typing import ArrayLike

from ..mesh.contact import signed_areas
from ..solve.surface import OffSurfaceError, onto
from .crossings import Net
from .cuts import Cut, Seam
from .flat_pattern import (
    JUMP,
    FlatPattern,
    SeamLine,
    refuse_crossing,
    refuse_holes,
    spaced_curve,
)
from .kinematic_net import net
from .laying import QUADRANTS, Status
from .sheet import Sheet, unit
from .surfaces import positive_length
from .triangle_mesh import TriangleMesh
from .trimming import shares_inside

# Largest number of cells by which a tip is moved towards the start until the net is
# below the locking angle on both sides.
_MOVES = 6

# Number of diagonals of cells, from the first that lock, which determine the seam.
_NEAR = 8

# Spacing of the points of a seam that continues as a geodesic, relative to the cell.
_STEP = 0.5


@dataclass(frozen=True, eq=False)
class NetWithDarts:
    """Net that is laid on both sides of its darts.

    Attributes
    ----------
    sides
        The net on the side of the first warp threads of all darts, and on the side of
        the first weft threads.  Before the tips they are the same.
    darts
        Sides of the darts on which the first net lies, one for each quadrant at most.
    locking_angle
        The locking angle in radians.
    """

    sides: tuple[Net, Net]
    darts: tuple[Cut, ...]
    locking_angle: float

    def side_of(self, x: ndarray) -> ndarray:
        """Number of the side of points of the tool, (3, n): 0 or 1, shape (n,)."""
        if not self.darts:
            return np.zeros(x.shape[1], dtype=int)
        found = [dart.seam.nearest(x) for dart in self.darts]
        distance, towards = np.array(found).swapaxes(0, 1)
        nearest = distance.argmin(axis=0)
        return np.asarray(towards[nearest, np.arange(x.shape[1])] < 0).astype(int)

    def cells(self) -> tuple[ndarray, ndarray]:
        """Masks of the cells of each side, of which none is in both."""
        one, other = self.sides
        masks = one.cells.copy(), other.cells.copy()
        for dart in self.darts:
            masks[0][_on_warp_side(one, dart) == 0] = False
            masks[1][_on_warp_side(other, dart) == 1] = False
        # Both nets have the cells before the tips: they count on the first side.
        i, j = (n - m for n, m in zip(one.start, other.start, strict=True))
        rows, columns = np.nonzero(masks[1])
        inside = (rows + i >= 0) & (rows + i < masks[0].shape[0])
        inside &= (columns + j >= 0) & (columns + j < masks[0].shape[1])
        rows, columns = rows[inside], columns[inside]
        masks[1][rows, columns] = ~masks[0][rows + i, columns + j]
        return masks

    @property
    def pieces(self) -> list[tuple[Net, ndarray]]:
        """Nets, each with the mask of its cells."""
        return list(zip(self.sides, self.cells(), strict=True))

    def locked(self, tool: TriangleMesh) -> ndarray:
        """Centres of cells on the tool beyond the locking angle in mm, shape (3, n).

        They include the last crossings before folds.
        """
        found = []
        for of, mask in zip(self.sides, self.cells(), strict=True):
            high = _locked(tool, of, mask, self.locking_angle)
            found += [of.middles()[:, high], of.folds]
        return np.hstack(found)


def net_with_darts(
    tool: TriangleMesh, cell: float, locking_angle: float, **start: Any
) -> NetWithDarts:
    """Lay a net with darts where it folds, or shears beyond a locking angle.

    Each quadrant of the net has at most one dart.

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
    locked = _locked(tool, uncut, uncut.cells, locking_angle)
    tips = {
        quadrant: tip
        for quadrant in range(len(QUADRANTS))
        if (tip := _tip(uncut, quadrant, locked, locking_angle)) is not None
    }
    best = NetWithDarts((uncut, uncut), (), locking_angle)
    fewest = np.inf
    for _ in range(_MOVES if tips else 0):
        darts = tuple(
            Cut(quadrant, (tip.i, tip.j), True, _seam(tool, uncut, quadrant, tip))
            for quadrant, tip in tips.items()
        )
        sides = (
            net(tool, cell, cuts=darts, **start),
            net(tool, cell, cuts=[dart.other() for dart in darts], **start),
        )
        moved = NetWithDarts(sides, darts, locking_angle)
        count = moved.locked(tool).shape[1]
        if count >= fewest:
            break
        best, fewest = moved, count
        if not count or min(min(tip[:2]) for tip in tips.values()) <= 1:
            break
        tips = {q: tip._replace(i=tip.i - 1, j=tip.j - 1) for q, tip in tips.items()}
    return best


def _quadrant(values: ndarray, laid: Net, quadrant: int, cells: bool) -> ndarray:
    """Values of the crossings or cells of a quadrant, from the start."""
    (i, j), (s, t) = laid.start, QUADRANTS[quadrant]
    back = 1 if cells else 0
    rows = slice(i, None) if s > 0 else slice(i - back, None, -1)
    columns = slice(j, None) if t > 0 else slice(j - back, None, -1)
    if (s < 0 and i - back < 0) or (t < 0 and j - back < 0):
        return values[..., :0, :0]
    return values[..., rows, columns]


def _on_warp_side(laid: Net, dart: Cut) -> ndarray:
    """1 for cells on the warp side of a dart, 0 on the other, −1 before its tip."""
    side = np.full(laid.cells.shape, -1)
    part = _quadrant(side, laid, dart.quadrant, cells=True)
    i, j = np.indices(part.shape)
    behind = (i >= dart.tip[0]) & (j >= dart.tip[1])
    part[...] = np.where(behind, i - dart.tip[0] >= j - dart.tip[1], part)
    return side


class _Tip(NamedTuple):
    """Tip of a dart: numbers of cells from the start along warp and weft.

    ``shift`` is the number of cells along the warp, and against the weft, by which the
    seam is off the diagonal of the tip.
    """

    i: int
    j: int
    shift: float


def _tip(
    laid: Net, quadrant: int, locked: ndarray, locking_angle: float
) -> _Tip | None:
    """Crossing of a quadrant before the cells that lock or fold; None without them.

    It is on the diagonal of the first fold, or on the mean one of the first cells that
    lock.
    """
    locks = _quadrant(locked, laid, quadrant, cells=True)
    folds = np.argwhere(
        _quadrant(laid.status == Status.FOLDED, laid, quadrant, cells=False)
    )
    if folds.size:
        i, j = folds[folds.sum(axis=1).argmin()] - 1
        offset = float(i - j)
        before = int(min(i, j))
    elif locks.any():
        angle = np.abs(_quadrant(laid.shear_angle(), laid, quadrant, cells=True))
        i, j = np.nonzero(locks)
        near = i + j < (i + j).min() + _NEAR
        weights = angle[i[near], j[near]] - locking_angle
        mean = np.average((i - j)[near], weights=weights)
        # The nearest diagonal with a cell that locks, if the mean one has none.
        lines = np.unique(i - j)
        line = lines[np.abs(lines - mean).argmin()]
        offset = float(mean if abs(line - mean) <= 0.5 else line)
        before = 0
    else:
        return None
    whole = round(offset)
    i, j = max(whole, 0), max(-whole, 0)
    chain = np.diagonal(locks, -whole)
    first = int(chain.argmax()) if chain.any() else before
    shift = 0.5 * (offset - whole)
    return _Tip(max(i + first, 1), max(j + first, 1), shift)


def _locked(
    tool: TriangleMesh, laid: Net, mask: ndarray, locking_angle: float
) -> ndarray:
    """Mask of the cells on the tool, among others, beyond the locking angle."""
    angle = np.nan_to_num(np.abs(laid.shear_angle()))
    i, j = np.nonzero(mask & laid.cells & (angle > locking_angle))
    high = np.zeros(mask.shape, dtype=bool)
    high[i, j] = tool.beyond_edges(laid.middles()[:, i, j]) == 0
    return high


def _seam(tool: TriangleMesh, laid: Net, quadrant: int, tip: _Tip) -> Seam:
    """Seam from a tip to the edges of a tool."""
    x = _quadrant(laid.positions, laid, quadrant, cells=False)
    warp = x[:, tip.i, tip.j] - x[:, tip.i - 1, tip.j]
    weft = x[:, tip.i, tip.j] - x[:, tip.i, tip.j - 1]
    # The diagonals of two neighbouring rows of cells, and a mean of them.
    share, other = abs(2 * tip.shift), int(tip.shift < 0)
    n = min(x.shape[1] - tip.i, x.shape[2] - tip.j) - 1
    k = np.arange(n)
    points = (1 - share) * x[:, tip.i + k, tip.j + k] + 0.5 * share * (
        x[:, tip.i + k + 1 - other, tip.j + k + other] + x[:, tip.i + k, tip.j + k]
    )
    points[:, 0] = x[:, tip.i, tip.j]
    ends = np.flatnonzero(~np.isfinite(points[0]))
    points = points[:, : ends[0]] if ends.size else points
    limit = int(np.ceil(np.ptp(tool.facets.points, axis=1).sum() / laid.cell / _STEP))
    if points.shape[1] == 1:
        points = np.column_stack([points, points[:, 0] + _STEP * (warp + weft) / 2])
        points = onto(tool, points)
    points = _up_to_edge(tool, points, _STEP * laid.cell, limit)
    points = onto(tool, _spaced(points, 0.5 * _STEP * laid.cell))
    gradient = unit(tool.gradient(points))
    along = np.diff(points)
    side = unit(np.cross(along, gradient[:, 1:] + gradient[:, :-1], axis=0))
    return Seam(points, side * np.sign(side[:, 0] @ (warp - weft)))


def _up_to_edge(
    tool: TriangleMesh, points: ndarray, step: float, limit: int
) -> ndarray:
    """Polyline that ends at the first point beyond the edges, or goes on to it."""
    beyond = np.flatnonzero(tool.beyond_edges(points) > 0)
    if beyond.size:
        return points[:, : beyond[0] + 1]
    chain = list(points.T)
    for _ in range(limit):
        along = chain[-1] - chain[-2]
        ahead = chain[-1] + step * along / np.linalg.norm(along)
        try:
            chain.append(onto(tool, ahead[:, None])[:, 0])
        except OffSurfaceError:
            break
        if tool.beyond_edges(chain[-1][:, None])[0] > 0:
            break
    return np.array(chain).T


@dataclass(frozen=True, eq=False)
class Dart:
    """Dart of a flat pattern.

    Attributes
    ----------
    seam
        The seam on the tool in mm, shape (3, n), from the tip.
    edges
        Its two edges in the flat ply, shape (2, n) each.
    """

    seam: ndarray
    edges: tuple[ndarray, ndarray]

    @property
    def area(self) -> float:
        """Area between the edges in mm²."""
        one, other = self.edges
        around = np.column_stack([one, other[:, ::-1]])
        return float(abs(signed_areas(*around)))

    @property
    def lengths(self) -> tuple[float, float]:
        """Lengths of the edges in mm."""
        one, other = (
            float(np.linalg.norm(np.diff(edge), axis=0).sum()) for edge in self.edges
        )
        return one, other


@dataclass(frozen=True, eq=False)
class PatternWithDarts:
    """Flat pattern of a net with darts.

    Attributes
    ----------
    pattern
        The outline, which contains the edges of the darts.
    darts
        The darts.
    area_on_tool
        Area of the part on the tool in mm².
    shear_angle
        Largest magnitude of the shear angle inside the outline in radians.
    """

    pattern: FlatPattern
    darts: tuple[Dart, ...]
    area_on_tool: float
    shear_angle: float


def pattern_with_darts(
    laid: NetWithDarts,
    curve: ArrayLike,
    spacing: float | None = None,
    holes: Sequence[ArrayLike] = (),
) -> PatternWithDarts:
    """Flat pattern of a net with darts, trimmed along a curve on the tool.

    Parameters
    ----------
    laid
        The net, which covers the curve.
    curve, spacing, holes
        See `flat_pattern`.

    Raises
    ------
    ValueError
        If an argument is not valid, a point of a curve or of a seam is not covered, the
        outline crosses itself, or a hole crosses it or a seam.
    """
    spacing = 0.5 * laid.sides[0].cell if spacing is None else spacing
    spacing = positive_length("flat pattern: spacing", spacing)
    points = spaced_curve(curve, spacing)
    side = laid.side_of(points)
    order, seams = _with_seams(laid, points, side, spacing)
    x = np.hstack([part for part, _ in order])
    number = np.concatenate([np.full(part.shape[1], s) for part, s in order])
    flat, warp, weft = _flat(laid, x, number)
    refuse_crossing(flat, x)
    pattern = FlatPattern(flat, x, warp, weft)
    if len(holes):
        inner = tuple(_hole(laid, hole, spacing) for hole in holes)
        refuse_holes(pattern, inner)
        pattern = replace(pattern, holes=inner)
    darts = []
    for seam in seams:
        edges = [_flat(laid, seam, np.full(seam.shape[1], k))[0] for k in (0, 1)]
        darts.append(Dart(seam, (edges[0], edges[1])))
    lines = [
        SeamLine(number, edge, dart.seam)
        for number, dart in enumerate(darts, 1)
        for edge in dart.edges
    ]
    pattern = replace(pattern, seams=tuple(lines))
    area, largest = 0.0, 0.0
    for of, mask in zip(laid.sides, laid.cells(), strict=True):
        part = replace(of, status=_only(of, mask))
        shares = np.where(mask, shares_inside(part, pattern), 0.0)
        inside = shares > 0
        area += float((of.areas()[inside] * shares[inside]).sum())
        largest = max(largest, np.abs(of.shear_angle()[inside]).max(initial=0.0))
    return PatternWithDarts(pattern, tuple(darts), area, float(largest))


def _hole(laid: NetWithDarts, curve: ArrayLike, spacing: float) -> FlatPattern:
    """Outline of a hole, which must not cross a seam."""
    points = spaced_curve(curve, spacing)
    flat, warp, weft = _flat(laid, points, laid.side_of(points))
    steps = np.linalg.norm(flat - np.roll(flat, -1, axis=1), axis=0)
    if steps.max() > JUMP * spacing:
        place = np.round(points[:, steps.argmax()], 3).tolist()
        raise ValueError(
            f"net with darts: a hole crosses the seam of a dart at {place}"
        )
    return FlatPattern(flat, points, warp, weft)


def _only(laid: Net, mask: ndarray) -> ndarray:
    """Statuses with the crossings of some cells only."""
    keep = np.zeros(laid.status.shape, dtype=bool)
    for i, j in ((0, 0), (0, 1), (1, 0), (1, 1)):
        keep[i : i + mask.shape[0], j : j + mask.shape[1]] |= mask
    return np.where(keep, laid.status, Status.OMITTED)


def _with_seams(
    laid: NetWithDarts, points: ndarray, side: ndarray, spacing: float
) -> tuple[list[tuple[ndarray, int]], list[ndarray]]:
    """Parts of an outline with the number of their side, and seams up to it."""
    cuts: list[tuple[int, ndarray]] = []
    for dart in laid.darts:
        away, _ = dart.seam.nearest(points)
        k = int(away.argmin())
        end = points[:, k]
        seam = dart.seam.points
        last = int(np.linalg.norm(seam - end[:, None], axis=0).argmin())
        along = seam[:, last] - seam[:, last - 1]
        if (end - seam[:, last]) @ along < 0:
            last -= 1
        trimmed = np.column_stack([seam[:, : last + 1], end])
        cuts.append((k, _spaced(trimmed, spacing)))
    parts: list[tuple[ndarray, int]] = []
    used, begin = [], 0
    n = points.shape[1]
    for k, seam in sorted(cuts, key=lambda cut: cut[0]):
        parts += _runs(points[:, begin:k], side[begin:k])
        before, after = side[k - 2 if k > 1 else k - 2 + n], side[(k + 2) % n]
        if before == after:  # the dart is outside the outline
            begin = k
            continue
        parts += [(seam[:, ::-1], int(before)), (seam[:, 1:], int(after))]
        used.append(seam)
        begin = k + 1
    parts += _runs(points[:, begin:], side[begin:])
    return parts, used


def _runs(points: ndarray, side: ndarray) -> list[tuple[ndarray, int]]:
    """Parts of an outline on one side each."""
    ends = np.flatnonzero(np.diff(side)) + 1
    return [
        (part, int(of[0]))
        for part, of in zip(
            np.split(points, ends, axis=1), np.split(side, ends), strict=True
        )
        if len(of)
    ]


def _spaced(points: ndarray, spacing: float) -> ndarray:
    """Open polyline with points at most a spacing apart."""
    lengths = np.linalg.norm(np.diff(points), axis=0)
    at = np.concatenate([[0.0], np.cumsum(lengths)])
    more = np.linspace(0.0, at[-1], int(np.ceil(at[-1] / spacing)) + 1)
    s = np.unique(np.concatenate([at, more]))
    return np.array([np.interp(s, at, x) for x in points])


def _flat(
    laid: NetWithDarts, x: ndarray, number: ndarray
) -> tuple[ndarray, ndarray, ndarray]:
    """Points in the flat ply at points on the tool on numbered sides, and fibres."""
    flat = np.full((2, x.shape[1]), np.nan)
    for side, of in enumerate(laid.sides):
        own = np.flatnonzero(number == side)
        if not own.size:
            continue
        sheet = Sheet.of_net(of)
        places = sheet.at(x[:, own])
        off = np.flatnonzero(~places.found)
        if off.size:
            point = ", ".join(f"{c:.7g}" for c in x[:, own[off[0]]])
            raise ValueError(
                f"net with darts: the net does not cover {off.size} points of the "
                f"outline or a seam, the first at [{point}]: start elsewhere, or trim "
                "inside"
            )
        flat[:, own] = sheet.flat_at(places)
    warp, weft = (
        np.tile(a[:, None], (1, x.shape[1])) for a in laid.sides[0].directions.T
    )
    return flat, warp, weft
