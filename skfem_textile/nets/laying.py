"""Crossings of kinematic nets, diagonal by diagonal from their starts.

All quadrants of all nets advance together, because a surface is evaluated at many
points as fast as at one.  A crossing follows from two threads at the distance of one
cell.  Where only one of them is there, because the other has left the tool, the thread
continues as a geodesic.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from enum import IntEnum
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy import ndarray
from numpy.typing import ArrayLike
from skfem.helpers import cross

from ..mesh.user_input import coords, real_numbers
from ..surfaces.analytic import points_in_space
from ..surfaces.surface import Surface
from ..surfaces.tool_mesh import unit

if TYPE_CHECKING:
    from .seams import Seams

# Maximum number of Newton iterations for a crossing, and last step relative to the
# cell.  Convergence is quadratic, so that the error after this step is below 1e-11 of
# the cell, also where it is as long as the radius of curvature.
_MOST, _NEARLY = 30, 1e-7

# Longest step of an iteration relative to the cell, a guard against leaving the
# surface: on a fillet with a radius of one cell the tangent plane rotates by 30° over
# this length.
_LONGEST_STEP = 0.5

#: Sine of the angle between threads below which they have folded: about half a degree,
#: a guard where consecutive crossings become indistinguishable.
FOLDED = 0.01


class Status(IntEnum):
    """Crossings that were laid, and reasons for those that were not."""

    LAID = 0
    OMITTED = 1  # beyond the requested part of the net
    FOLDED = 2  # the threads do not meet, or fold onto one another
    EDGE = 3  # beyond the edges of the tool
    OFF = 4  # a thread leaves the surface
    BEHIND = 5  # depends on a crossing that is missing for another reason
    SEAM = 6  # beyond a seam, in one of its spots, or depends on such a crossing


#: True for reasons that stop all crossings behind, by their number.
_STOPS = np.isin(list(Status), (Status.FOLDED, Status.OFF, Status.BEHIND))

#: Signs of the quadrants of a net along warp and weft.
QUADRANTS = ((1, 1), (1, -1), (-1, 1), (-1, -1))


@dataclass(frozen=True, eq=False)
class Start:
    """Start of a net on a surface.

    Attributes
    ----------
    point
        Position in mm, shape (3,).
    directions
        Unit vectors of warp and weft there, columns of shape (3, 2).
    guides
        Points of the curves that the first threads follow; None for a geodesic.
    """

    point: ndarray
    directions: ndarray
    guides: tuple[ndarray | None, ndarray | None] = (None, None)


#: `Status` of crossings to lay, LAID or OMITTED, shape (r, k): a function of quadrant
#: numbers, (r, 1), and numbers of cells along warp and weft, (k,).
Wants = Callable[[ndarray, ndarray, ndarray], ndarray]

#: Mask of points near the tool, as a function of points in mm, (3, p).
OnTool = Callable[[ndarray], ndarray]


class _Diagonal(NamedTuple):
    """Crossings with the same sum of cells, r quadrants and k crossings.

    Positions, gradients there, and differences of the positions from linear
    extrapolation, (3, 3, r, k), NaN if not laid; masks, labels of seams, and statuses,
    (r, k).
    """

    values: ndarray
    on: ndarray
    seams: ndarray
    status: ndarray

    @classmethod
    def empty(cls, rows: int, count: int) -> "_Diagonal":
        return cls(
            np.full((3, 3, rows, count), np.nan),
            np.zeros((rows, count), dtype=bool),
            np.zeros((rows, count), dtype=int),
            np.full((rows, count), Status.BEHIND, dtype=np.int8),
        )

    @property
    def x(self) -> ndarray:
        """Positions, shape (3, r, k)."""
        return self.values[0]

    def shifted(self, before: int, after: int) -> "_Diagonal":
        """Copy with an empty crossing before and after."""
        rows, count = self.on.shape
        wide = _Diagonal.empty(rows, before + count + after)
        for to, values in zip(wide, self, strict=True):
            to[..., before : before + count] = values
        return wide


def lay(
    surface: Surface,
    starts: Sequence[Start],
    cell: float,
    wanted: Wants,
    on_tool: OnTool,
    seams: "Seams | None" = None,
) -> tuple[ndarray, ndarray]:
    """Lay nets from several starts at once.

    Parameters
    ----------
    surface
        The surface.
    starts
        Starts on the surface.
    cell
        Length of the rods in mm.
    wanted
        Crossings to lay; the quadrant 4k + q belongs to the start k.
    on_tool
        Points on the tool, beyond which threads end.
    seams
        Seams of darts.  Crossings that depend on others beyond them are not laid.

    Returns
    -------
    tuple
        Positions in mm, shape (3, n_starts, 4, m, m), NaN for crossings that were not
        laid, and their `Status`, (n_starts, 4, m, m).  The third axis from the end is
        for the `QUADRANTS`, and the last two are along warp and weft from the start.
    """
    front = _Front(surface, starts, cell, wanted, on_tool, seams)
    diagonals = [front.first()]
    before = _Diagonal.empty(4 * len(starts), 0)
    while np.isfinite(diagonals[-1].x[0]).any():
        diagonals.append(front.after(before, diagonals[-1]))
        before = diagonals[-2]
    x, status = _assembled(diagonals)
    shape = len(starts), 4, *status.shape[1:]
    return x.reshape(3, *shape), status.reshape(shape)


class _Front:
    """Diagonals of the quadrants of nets."""

    def __init__(
        self,
        surface: Surface,
        starts: Sequence[Start],
        cell: float,
        wanted: Wants,
        on_tool: OnTool,
        seams: "Seams | None",
    ) -> None:
        self._surface, self._cell = surface, cell
        self._wanted, self._on_tool, self._seams = wanted, on_tool, seams
        self._rows = np.arange(4 * len(starts))
        self._start = np.repeat([s.point for s in starts], 4, axis=0).T
        signs = np.array(QUADRANTS, dtype=float)
        directions = np.array([s.directions for s in starts])  # (start, 3, 2)
        signed = directions[:, None] * signs[None, :, None]
        self._along = signed.reshape(-1, 3, 2).transpose(2, 1, 0)  # (family, 3, row)
        self._gradient = surface.gradient(self._start)
        self._guides = [
            [_from_closest(s.guides[k], s.point, q[k]) for k in (0, 1)]
            for s in starts
            for q in QUADRANTS
        ]

    def first(self) -> _Diagonal:
        """The starts."""
        on = self._on_tool(self._start)[:, None]
        status = np.full(on.shape, Status.LAID, dtype=np.int8)
        values = np.array([self._start, self._gradient, np.zeros_like(self._start)])
        none = np.zeros(on.shape, dtype=int)
        return _Diagonal(values[..., None], on, none, status)

    def after(self, before: _Diagonal, last: _Diagonal) -> _Diagonal:
        """Diagonal computed from the two previous ones; the first may be empty."""
        d = last.on.shape[1]
        i = np.arange(d + 1)
        a, b = last.shifted(1, 0), last.shifted(0, 1)
        corner = before.shifted(1, 1)
        a_0, b_0 = before.shifted(2, 0), before.shifted(0, 2)
        new = _Diagonal.empty(len(self._rows), d + 1)
        new.status[:] = self._wanted(self._rows[:, None], i, d - i)
        stopped = np.zeros(new.on.shape, dtype=bool)
        stopped[:, 1:] |= _STOPS[a.status[:, 1:]]
        stopped[:, :-1] |= _STOPS[b.status[:, :-1]]
        new.status[(a.status == Status.SEAM) | (b.status == Status.SEAM)] = Status.SEAM
        has_a, has_b, has_c = (np.isfinite(of.x[0]) for of in (a, b, corner))
        open_ = (new.status == Status.LAID) & ~stopped
        crosses = open_ & has_a & has_b & has_c & (a.on | b.on | corner.on)
        warp = open_ & has_a & ~has_b & a.on
        weft = open_ & has_b & ~has_a & b.on
        new.status[new.status == Status.LAID] = Status.EDGE
        new.status[stopped] = Status.BEHIND
        parts = [(crosses, *self._crossing(crosses, a, b, corner))]
        for family, at, of, of_0 in (0, warp, a, a_0), (1, weft, b, b_0):
            if at.any():
                parts.append((at, *self._straight(family, at, of, of_0)))
        self._lay(new, parts)
        return new

    def _crossing(self, at: ndarray, a: _Diagonal, b: _Diagonal, c: _Diagonal) -> tuple:
        """Guesses, corrections and rod ends of crossings of two threads."""
        p, q, corner = a.x[:, at], b.x[:, at], c.x[:, at]
        off = 0.5 * (a.values[2][:, at] + b.values[2][:, at])
        of_seams = np.array([a.seams[at], b.seams[at]])
        return p + q - corner, off, p, q, np.zeros_like(p), of_seams

    def _straight(
        self, family: int, at: ndarray, a: _Diagonal, a_0: _Diagonal
    ) -> tuple:
        """Guesses, corrections, rod ends and planes of threads that continue alone.

        A geodesic follows the plane of the last rod and the normal of the surface.
        There is a last rod, except at the start: a crossing on the tool has a neighbour
        along the other family, unless that one stops all crossings behind it.
        """
        row, i = np.nonzero(at)
        x, gradient, off = (of[:, at] for of in a.values)
        step = x - a_0.x[:, at]
        if at.shape[1] == 2:
            step = self._cell * self._along[family][:, row]
        through, across = x.copy(), cross(step, gradient)
        for k in np.flatnonzero(i == (0 if family else at.shape[1] - 1)):
            guides = self._guides[row[k]]
            if guides[family] is None:
                continue
            guides[family], along = _from_distance(guides[family], x[:, k], self._cell)
            if guides[family].size:
                through[:, k] = guides[family][:, 0]
                step[:, k] = through[:, k] - x[:, k]
                across[:, k] = np.cross(along, gradient[:, k])
        with np.errstate(invalid="ignore"):  # a curve along the normal ends the thread
            across /= np.linalg.norm(across, axis=0)
        return x + step, off, x, through, across, np.array([a.seams[at]] * 2)

    def _lay(self, new: _Diagonal, parts: list[tuple]) -> None:
        masks, *values = zip(*parts, strict=True)
        row, i = np.hstack([np.nonzero(mask) for mask in masks])
        if not row.size:
            return
        guess, off, a, b, across, seams = map(np.hstack, values)
        crosses = np.arange(len(row)) < masks[0].sum()
        x, gradient, status = _rod_ends(
            self._surface, guess, off, a, b, across, crosses, self._cell
        )
        if self._seams is not None:
            laid = np.flatnonzero(status == Status.LAID)
            label, beyond = self._seams.labels(x[:, laid], seams[:, laid])
            new.seams[row[laid], i[laid]] = label
            beyond |= self._seams.in_spots(x[:, laid])
            status[laid[beyond]] = Status.SEAM
        new.status[row, i] = status
        laid = status == Status.LAID
        row, i, x = row[laid], i[laid], x[:, laid]
        new.values[:, :, row, i] = x, gradient[:, laid], x - guess[:, laid]
        if row.size:
            new.on[row, i] = self._on_tool(x)


def crossing(
    surface: Surface, a: ndarray, b: ndarray, corner: ndarray, cell: float
) -> tuple[ndarray, ndarray]:
    """Compute fourth corners of cells, shape (3, n), and their `Status`.

    ``a`` and ``b`` are their neighbours, ``corner`` the opposite corners, shape (3, n).
    """
    zero, crosses = np.zeros_like(a), np.ones(a.shape[1], dtype=bool)
    x, _, status = _rod_ends(surface, a + b - corner, zero, a, b, zero, crosses, cell)
    return x, status


def straight(
    surface: Surface, before: ndarray, x: ndarray, cell: float
) -> tuple[ndarray, ndarray]:
    """Next crossings of threads that continue as geodesics, (3, n), and their `Status`.

    ``x`` are their last crossings, and ``before`` the ones before, shape (3, n).
    """
    zero, crosses = np.zeros_like(x), np.zeros(x.shape[1], dtype=bool)
    across = cross(x - before, surface.gradient(x))
    across /= np.linalg.norm(across, axis=0)
    found, _, status = _rod_ends(
        surface, 2 * x - before, zero, x, x, across, crosses, cell
    )
    return found, status


def _rod_ends(
    surface: Surface,
    guess: ndarray,
    off: ndarray,
    a: ndarray,
    b: ndarray,
    across: ndarray,
    crosses: ndarray,
    cell: float,
) -> tuple[ndarray, ndarray, ndarray]:
    """Solve for rod ends on a surface; points, gradients there and `Status`.

    A rod begins at ``a``.  It ends at the end of a rod from ``b`` where ``crosses``,
    and otherwise in the plane through ``b`` with the normal ``across``.  The iteration
    begins ``off`` the guess, towards which the rod points.
    """
    x, gradient = guess + off, np.full_like(guess, np.nan)
    done, left = np.zeros(x.shape[1], dtype=bool), np.arange(x.shape[1])
    first_order = getattr(surface, "first_order", None) or (
        lambda x: (surface.level(x), surface.gradient(x))
    )
    for _ in range(_MOST):
        at, meets, third = x[:, left], crosses[left], across[:, left]
        level, g = first_order(at)
        slope = np.sqrt((g * g).sum(axis=0))
        p, q = at - a[:, left], at - b[:, left]
        on_plane = (q * third).sum(axis=0)
        rod, other = (((v * v).sum(axis=0) / cell - cell) / 2 for v in (p, q))
        rest = np.array([level / slope, rod, np.where(meets, other, on_plane)])
        one, two, third = g / slope, p / cell, np.where(meets, q / cell, third)
        normals = cross(two, third), cross(third, one), cross(one, two)
        det = (one * normals[0]).sum(axis=0)
        with np.errstate(all="ignore"):  # non-finite steps are not made
            step = sum(o * m for o, m in zip(rest, normals, strict=True)) / det
        length = np.sqrt((step * step).sum(axis=0)) / cell
        goes = np.abs(det) > FOLDED**2  # false for NaN
        x[:, left[goes]] -= (step / np.maximum(length / _LONGEST_STEP, 1.0))[:, goes]
        ready = goes & (length <= _NEARLY)
        gradient[:, left[ready]], done[left[ready]] = g[:, ready], True
        left = left[goes & ~ready]
        if not left.size:
            break
    p, q = x - a, x - b
    sine = np.sqrt((cross(p, q) ** 2).sum(axis=0)) / cell**2
    corner = a + b - guess
    backwards = ((x - corner) * (guess - corner)).sum(axis=0) <= 0
    apart = ((a - b) ** 2).sum(axis=0) >= (2 * cell) ** 2 * (1 - FOLDED**2)
    folds = crosses & (apart | (done & ((sine <= FOLDED) | backwards)))
    turned = ~crosses & done & ((p * (guess - a)).sum(axis=0) <= 0)
    status = np.where(done & ~turned, Status.LAID, Status.OFF)
    return x, gradient, np.where(folds, Status.FOLDED, status).astype(np.int8)


def _assembled(diagonals: list[_Diagonal]) -> tuple[ndarray, ndarray]:
    """Positions and statuses of quadrants, shapes (3, r, m, m) and (r, m, m)."""
    rows, count = len(diagonals[0].on), len(diagonals)
    x = np.full((3, rows, count, count), np.nan)
    status = np.full((rows, count, count), Status.EDGE, dtype=np.int8)
    for d, of in enumerate(diagonals):
        i = np.arange(d + 1)
        x[:, :, i, d - i] = of.x
        status[:, i, d - i] = of.status
    edge = status == Status.EDGE
    for behind, follows in (
        (status == Status.SEAM, Status.SEAM),
        (_STOPS[status], Status.BEHIND),
    ):
        for axis in (1, 2):
            behind = np.logical_or.accumulate(behind, axis)
        status[behind & edge] = follows
    return x, status


# Angle in degrees between two edges of an outline that meet at a corner.  Outlines of
# round parts have at least twenty edges.
_CORNER_DEG = 30.0


class CurvePlace(NamedTuple):
    """Place on a curve: number of the segment, position in mm, unit tangent, (3,)."""

    segment: int
    position: ndarray
    tangent: ndarray


def curve_points(curve: ArrayLike) -> ndarray:
    """Points of a curve of a first thread in mm, shape (3, n), without repetitions.

    Raises
    ------
    ValueError
        If there are fewer than two distinct points, or one is not finite.
    """
    points = points_in_space("net: the curve of a first thread", curve)
    apart = (points[:, 1:] != points[:, :-1]).any(axis=0)
    points = points[:, np.append(True, apart)]
    if points.shape[1] < 2:
        raise ValueError(
            "net: the curve of a first thread must have two distinct points"
        )
    return points


def closest(curve: ndarray, x: ndarray) -> CurvePlace:
    """Place on a curve closest to a point in mm, shape (3,)."""
    begin, along = curve[:, :-1], np.diff(curve)
    share = ((x[:, None] - begin) * along).sum(axis=0) / (along**2).sum(axis=0)
    feet = begin + np.clip(share, 0.0, 1.0) * along
    k = int(np.linalg.norm(feet - x[:, None], axis=0).argmin())
    return CurvePlace(k, feet[:, k], unit(along[:, k]))


def _from_closest(curve: ndarray | None, x: ndarray, sign: int) -> ndarray | None:
    """Part of a curve from the place closest to a point, in or against its direction.

    None without a curve.
    """
    if curve is None:
        return None
    place = closest(curve, x)
    rest = curve[:, place.segment + 1 :] if sign > 0 else curve[:, place.segment :: -1]
    return np.column_stack([place.position, rest])


def _from_distance(
    curve: ndarray, x: ndarray, distance: float
) -> tuple[ndarray, ndarray]:
    """Part of a curve from the next point at a distance from x, empty without one.

    Also the direction of the curve there, shape (3,).
    """
    away = np.linalg.norm(curve - x[:, None], axis=0)
    beyond = np.flatnonzero(away >= distance)
    if not beyond.size:
        return curve[:, :0], np.zeros(3)
    k = beyond[0]
    if not k:
        raise ValueError(
            f"net: the curve of a first thread is {away[0]:.3g} mm away from the "
            f"tool at {coords(curve[:, 0])} mm: specify a curve on the tool"
        )
    begin, along = curve[:, k - 1], curve[:, k] - curve[:, k - 1]
    off = begin - x
    a, b, c = along @ along, along @ off, off @ off - distance**2
    share = (np.sqrt(b * b - a * c) - b) / a
    return np.column_stack([begin + share * along, curve[:, k:]]), along


def edge_through(outline: ArrayLike, point: ArrayLike) -> ndarray:
    """Edge of a closed outline, from corner to corner, that is nearest to a point.

    Corners are points where the outline turns by more than 30°.

    Parameters
    ----------
    outline
        Points of a closed curve in mm, shape (3, n), the first not repeated, such as a
        curve of `ToolMesh.boundary`.
    point
        Point near the edge in mm, shape (3,).

    Returns
    -------
    ndarray
        Points of the edge in mm, shape (3, m), in the order of the outline; the whole
        outline, closed, if it has no corners.

    Examples
    --------
    >>> import numpy as np
    >>> from skfem_textile import drape
    >>> square = np.array([[0, 1, 2, 2, 2, 1, 0, 0], [0, 0, 0, 1, 2, 2, 2, 1], 8 * [0]])
    >>> drape.edge_through(square, (1.2, 0.1, 0)).tolist()
    [[0.0, 1.0, 2.0], [0.0, 0.0, 0.0], [0.0, 0.0, 0.0]]
    """
    points = real_numbers("edge: outline", outline)
    n = points.shape[1]
    along = np.roll(points, -1, axis=1) - points
    along = along / np.linalg.norm(along, axis=0)
    turn = (along * np.roll(along, 1, axis=1)).sum(axis=0)
    corners = np.flatnonzero(turn < np.cos(np.radians(_CORNER_DEG)))
    closed = curve_points(np.column_stack([points, points[:, 0]]))
    if not corners.size:
        return closed
    at = closest(closed, np.asarray(point, dtype=float)).segment
    begin = corners[corners <= at][-1] if (corners <= at).any() else corners[-1] - n
    after = corners[corners > at]
    end = after[0] if after.size else corners[0] + n
    return points[:, np.arange(begin, end + 1) % n]
