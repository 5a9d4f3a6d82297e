"""Kinematic net: inextensible rods, pinned at their crossings, laid on a surface.

Two threads start at a point along geodesics or given curves.  Every further crossing is
at the distance of one cell from two known crossings (Mack & Taylor 1956, The fitting of
woven cloth to surfaces, J.  Text.  Inst.  47:T477).  Fibres do not stretch, and forces
play no role: the first two threads determine the whole net.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
from numpy import ndarray
from numpy.typing import ArrayLike

from ..mesh.user_input import real_numbers
from ..solve.surface import Surface, onto
from ..solve.surface.surface import tangents
from .guide_curve import GuideCurve
from .laying import FOLDED, QUADRANTS, Quadrant, Start, Status, lay
from .surfaces import positive_length


class NetError(ValueError):
    """Net that does not reach a point.

    Attributes
    ----------
    position
        Position of its end in mm, shape (3,).
    """

    def __init__(self, what: str, position: ndarray, advice: str = "") -> None:
        super().__init__(f"net: {what} at {np.round(position, 3).tolist()}{advice}")
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
    """

    positions: ndarray
    status: ndarray
    along: tuple[ndarray, ndarray]
    directions: ndarray
    touch: ndarray

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
        """Mask of the cells with four crossings, shape (n_warp, n_weft)."""
        laid = self.status == Status.LAID
        return laid[1:, 1:] & laid[:-1, 1:] & laid[1:, :-1] & laid[:-1, :-1]

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
        a, b = self.directions.T
        at_rest = np.arctan2(np.linalg.det([a, b]), a @ b)
        return np.abs(at_rest) - 2 * np.arctan2(other, one)

    def areas(self) -> ndarray:
        """Area of each cell on the surface in mm², shape (n_warp, n_weft).

        It is cos Γ times the square of its sides for warp and weft at right angles at
        rest.  NaN if a corner was not laid.
        """
        a, b = self.directions.T
        at_rest = np.abs(np.arctan2(np.linalg.det([a, b]), a @ b))
        return self.cell**2 * np.sin(at_rest - self.shear_angle())

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
            part |= _up_to(ends * np.array(signs)[:, None], part.shape)
        omitted = ~wanted & (self.status == Status.LAID)
        return replace(
            self,
            positions=np.where(wanted, self.positions, np.nan),
            status=np.where(omitted | ~wanted, Status.OMITTED, self.status),
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
        """Positions of the last crossings before those with a status, shape (3, n).

        Those nearest to the start, in cells, come first.
        """
        place = np.argwhere(self.status == status).T
        away = place - np.array(self.start)[:, None]
        order = np.abs(away).sum(axis=0).argsort(kind="stable")
        i, j = (place - np.sign(away))[:, order]
        return self.positions[:, i, j]


class NetStart(NamedTuple):
    """Start of a net.

    Parameters
    ----------
    point
        Position in mm, shape (3,).
    first
        Direction in space of the x axis of the flat ply there.
    """

    point: ArrayLike
    first: ArrayLike = (1.0, 0.0, 0.0)


def net(
    surface: Surface,
    cell: float,
    warp: tuple[int, int] | None = None,
    weft: tuple[int, int] | None = None,
    *,
    angles: tuple[float, float] = (0.0, np.pi / 2),
    touch: tuple[float, float] = (0.0, 0.0),
    point: ArrayLike | None = None,
    first: ArrayLike = (1.0, 0.0, 0.0),
    warp_along: ArrayLike | None = None,
    weft_along: ArrayLike | None = None,
    over: ndarray | None = None,
    past_edges: bool = False,
) -> Net:
    """Lay a net on a surface.

    The net of a triangulated tool ends one cell beyond the edges of the tool.  A thread
    whose neighbour has ended there continues as a geodesic.  Crossings behind a fold
    are not laid: see `Net.folds`.

    Parameters
    ----------
    surface
        The surface.
    cell
        Length of the rods in mm.
    warp, weft
        Numbers of cells against and along the direction of each family, from the start
        of the net.  By default up to the edges of the tool.
    angles
        Inclination of warp and weft in the flat ply in radians.
    touch
        Start of the net in the flat ply.
    point
        Its position in space; by default (x, y, 0) of ``touch``.
    first
        Direction in space of the x axis of the ply there.
    warp_along, weft_along
        Curves in mm, shape (3, n), that the first threads follow in the order of the
        points, through the start; see `edge_through`.  By default geodesics, at the
        angle at rest to the curve of the other family if there is one.  Beyond its
        curve a thread continues as a geodesic.
    over
        Points of the flat ply in mm, shape (2, n), up to which the net is laid;
        crossings beyond all of them are omitted.  By default all are laid.
    past_edges
        Continue beyond the edges of the tool, where its surface is extrapolated.

    Raises
    ------
    ValueError
        If an argument is not valid.

    Examples
    --------
    A quarter of a sphere, with sides equal to its radius: the shear angle of the last
    cell, 53.6° in theory:

    >>> import numpy as np
    >>> from skfem_textile import drape
    >>> sphere = drape.Sphere(100.0, (0, 0, -100))
    >>> angle = drape.net(sphere, 100 / 64, (0, 64), (0, 64)).shear_angle()
    >>> round(float(np.degrees(angle[-1, -1])), 1)
    53.6
    """
    cell = positive_length("net: cell", cell)
    flat = _flat(angles)
    curves = [c if c is None else GuideCurve(c) for c in (warp_along, weft_along)]
    guess = np.array([*touch, 0.0]) if point is None else np.asarray(point, dtype=float)
    start = _start(surface, cell, guess, np.asarray(first), flat, curves)
    limits = _limits(surface, cell, (warp, weft), past_edges)
    masks = None
    if over is not None:
        ends = np.linalg.solve(flat, over - np.array(touch)[:, None]) / cell
        masks = _masks(ends, limits)
    (laid,) = _laid(surface, [start], cell, limits, masks, past_edges)
    counts = [n if n is None else _counts("", n) for n in (warp, weft)]
    return _joined(laid, cell, flat, np.array(touch, dtype=float), counts)


def nets(
    surface: Surface,
    cell: float,
    starts: Sequence[NetStart],
    *,
    angles: tuple[float, float] = (0.0, np.pi / 2),
) -> list[Net]:
    """Nets from several starts up to the edges of a tool, laid side by side.

    It takes much less time than one `net` after the other.

    Parameters
    ----------
    surface
        The tool.
    cell, angles
        See `net`.
    starts
        Starts.

    Raises
    ------
    ValueError
        If an argument is not valid.
    """
    cell = positive_length("net: cell", cell)
    flat = _flat(angles)
    points = onto(surface, np.array([s.point for s in starts], dtype=float).T)
    found = [
        Start(point, tangents(surface, point, np.asarray(s.first)) @ flat)
        for point, s in zip(points.T, starts, strict=True)
    ]
    limits = _limits(surface, cell, (None, None), False)
    laid = _laid(surface, found, cell, limits, None, False)
    return [_joined(of, cell, flat, np.zeros(2), (None, None)) for of in laid]


def _flat(angles: tuple[float, float]) -> ndarray:
    """Unit vectors of warp and weft in the flat ply, columns of shape (2, 2)."""
    flat = np.array([np.cos(angles), np.sin(angles)])
    if not abs(np.linalg.det(flat)) > FOLDED:
        raise ValueError("net: warp and weft must not be parallel")
    return flat


def _start(
    surface: Surface,
    cell: float,
    point: ndarray,
    first: ndarray,
    flat: ndarray,
    curves: list[GuideCurve | None],
) -> Start:
    """Start of a net on a surface, and on the curves of its first threads."""
    for curve in curves:
        if curve is None:
            continue
        on_curve = curve.closest(point).position
        if not np.linalg.norm(on_curve - point) <= cell:
            raise ValueError(
                f"net: the curve of a first thread passes the start "
                f"{np.round(point, 3).tolist()} at a distance of "
                f"{np.linalg.norm(on_curve - point):.3g} mm: specify a start on it"
            )
        point = on_curve
    start = onto(surface, point[:, None])[:, 0]
    directions = tangents(surface, start, first) @ flat
    given = [c and tangents(surface, start, c.tangent(c.closest(start))) for c in curves]
    cosine, sine = flat[:, 0] @ flat[:, 1], np.linalg.det(flat)
    for family, (own, other) in enumerate((given, given[::-1])):
        sign = 1 if family else -1
        if own is not None:
            directions[:, family] = own[:, 0]
        elif other is not None:
            directions[:, family] = other @ [cosine, sign * sine]
    return Start(start, directions, (curves[0], curves[1]))


def _limits(
    surface: Surface,
    cell: float,
    counts: tuple[Any, Any],
    past_edges: bool,
) -> ndarray:
    """Largest numbers of cells of the quadrants along warp and weft, shape (4, 2)."""
    facets = getattr(surface, "facets", None)
    given = []
    for name, n in zip(("warp", "weft"), counts, strict=True):
        if n is not None:
            given.append(_counts(name, n))
        elif facets is None or past_edges:
            raise ValueError(
                f"net: specify the numbers of cells along the {name}, because the "
                "surface has no edges at which the net could end"
            )
        else:
            # No thread is longer than the way around the box of a tool.
            most = int(np.ceil(np.ptp(facets.points, axis=1).sum() / cell)) + 1
            given.append((most, most))
    return np.array([[n[s > 0] for n, s in zip(given, q)] for q in QUADRANTS])


def _counts(name: str, n: Any) -> tuple[int, int]:
    """Validated numbers of cells against and along a direction, not both zero."""
    counts = real_numbers(f"net: {name}", n)
    integral = counts.shape == (2,) and (counts == np.round(counts)).all()
    if not integral or counts.min() < 0 or counts.sum() < 1:
        raise ValueError(
            f"net: {name} must be two whole numbers of cells, against and along its "
            f"direction, not both zero; got {n!r}"
        )
    return int(counts[0]), int(counts[1])


def _masks(ends: ndarray, limits: ndarray) -> list[ndarray]:
    """Masks of the crossings of each quadrant up to points, in cells, (2, n)."""
    masks = []
    for signs, shape in zip(QUADRANTS, limits + 1, strict=True):
        mask = _up_to(ends * np.array(signs)[:, None], tuple(shape))
        mask[0], mask[:, 0] = True, True
        masks.append(mask)
    return masks


def _up_to(ends: ndarray, shape: tuple[int, ...]) -> ndarray:
    """Mask of the crossings of a quadrant up to the cell of any given point."""
    last = np.floor(ends + 1e-11).astype(int) + 1
    last = last[:, (last > 0).all(axis=0)]
    own = np.zeros(shape, dtype=bool)
    own[tuple(np.minimum(last, np.array(shape)[:, None] - 1))] = True
    for axis in (0, 1):
        own = np.flip(np.logical_or.accumulate(np.flip(own, axis), axis), axis)
    return own


def _laid(
    surface: Surface,
    starts: list[Start],
    cell: float,
    limits: ndarray,
    masks: list[ndarray] | None,
    past_edges: bool,
) -> list[list[Quadrant]]:
    """Quadrants of nets from starts on a surface."""
    beyond = None if past_edges else getattr(surface, "beyond_edges", None)
    if beyond is not None:
        for start in starts:
            if beyond(start.point[:, None])[0] > 0:
                raise ValueError(
                    f"net: the start {np.round(start.point, 3).tolist()} is beyond the "
                    "edges of the tool: start on the tool"
                )

    def wanted(row: ndarray, i: ndarray, j: ndarray) -> ndarray:
        m, n = limits[row % 4].transpose(2, 0, 1)
        inside = (i <= m) & (j <= n)
        for quadrant, mask in enumerate(masks or []):
            m, n = limits[quadrant]
            inside[quadrant] &= mask[np.minimum(i, m), np.minimum(j, n)]
        return np.where(inside, Status.LAID, Status.OMITTED)

    def on_tool(x: ndarray, row: ndarray, i: ndarray, j: ndarray) -> ndarray:
        if beyond is None:
            return np.ones(x.shape[1], dtype=bool)
        return np.asarray(beyond(x) == 0)

    return lay(surface, starts, cell, wanted, on_tool)


def _joined(
    quadrants: list[Quadrant],
    cell: float,
    flat: ndarray,
    touch: ndarray,
    counts: Sequence[tuple[int, int] | None],
) -> Net:
    """Net of four quadrants with given numbers of cells, or as far as it was laid."""
    sizes = np.array([quadrant.status.shape for quadrant in quadrants]) - 1
    signs = np.array(QUADRANTS)
    reach = [
        [int(sizes[signs[:, axis] == s, axis].max()) for s in (-1, 1)]
        if given is None
        else list(given)
        for axis, given in enumerate(counts)
    ]
    shape = tuple(sum(sides) + 1 for sides in reach)
    x = np.full((3, *shape), np.nan)
    status = np.full(shape, Status.BEHIND, dtype=np.int8)
    for quadrant_signs, quadrant in zip(QUADRANTS, quadrants, strict=True):
        place, size = [], []
        for (before, after), s, n in zip(
            reach, quadrant_signs, quadrant.status.shape, strict=True
        ):
            size.append(min(n, (after if s > 0 else before) + 1))
            place.append(before + s * np.arange(size[-1]))
        at, part = np.ix_(*place), np.s_[..., : size[0], : size[1]]
        x[:, *at], status[at] = quadrant.positions[part], quadrant.status[part]
    along = [cell * np.arange(-before, after + 1) for before, after in reach]
    return Net(x, status, (along[0], along[1]), flat, touch)
