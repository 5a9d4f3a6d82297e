"""Cells of an outline with one fabric each, and fibres traced within them."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Self

import numpy as np
import scipy  # whose modules are imported on first use
import shapely
from numpy import ndarray
from shapely.geometry.polygon import orient
from skfem.helpers import cross

from ..fabric import Fabric, unit_vectors
from ..fabric.fabric import PARALLEL
from ..mesh.user_input import coords
from .outline import Outline, by_ring
from .rings import NEAR

#: Turn in radians from which a corner counts as one; a smaller one approximates a
#: curve.  A circle of 18 corners turns by 0.349.
CORNER = 0.35

# Turn in radians below which an edge continues straight.  It is far above rounding
# (2e-16 over the shortest edge, 1e-9 of the size).
_STRAIGHT = 1e-6

# Position of a curved fibre: tolerance of a step relative to the size, far below
# `CURVED_NEAR`.
_STEP = 1e-10

#: Distance relative to the size below which points on curved fibres coincide.
CURVED_NEAR = 1e-7

# Curved fibres are polylines: largest distance from the curve relative to the size, and
# largest turn in radians from side to side.  Both are invisible in a picture.
_SAGITTA, _TURN = 1e-5, 0.05

# Parts of a side of a polyline whose chord leaves the cell: their distance from the
# curve is a 400th of it, within `CURVED_NEAR`.
_FINER = 20

# Length of a fibre, relative to the size, beyond which it does not reach the outline.
_LONGEST = 50.0

# Points along the longer side of a cell at which fields are checked, a limit of work: a
# square cell has 1600 of them.
_GRID = 40

# Times that a square around a source of a field is divided into four.
_DIVISIONS = 24


def angle(u: ndarray, v: ndarray) -> Any:
    """Angle in radians from vectors in the plane to others, positive to the left."""
    return np.arctan2(cross(u, v), (u * v).sum(axis=0))


@dataclass(frozen=True, eq=False)
class Field:
    """Directions of a fibre family: a line field, without orientation.

    Attributes
    ----------
    name
        ``warp`` or ``weft``.
    direction
        A vector or a function of position.
    constant
        The unit vector, shape (2,), if it is constant; else None.
    """

    name: str
    direction: Any
    constant: ndarray | None

    @classmethod
    def of(cls, name: str, direction: Any) -> Self:
        """Field of a fabric; refuses directions per element."""
        if hasattr(direction, "region") or (
            not callable(direction) and np.size(direction) != 2
        ):
            raise ValueError(
                f"{name}: directions per element belong to a mesh; singular fibres "
                "require a vector or a function of position, and a fabric for each "
                "region of the outline"
            )
        if callable(direction):
            return cls(name, direction, None)
        v = unit_vectors(name, np.ravel(direction), np.zeros((2, 1)))[:, 0]
        v[np.abs(v) < 1e-15] = 0.0  # above cos 90°, 6e-17
        return cls(name, direction, v)

    def at(self, x: ndarray) -> ndarray:
        """Unit vectors at points, shape (2, n); raises an error with the place."""
        if self.constant is not None:
            return np.broadcast_to(self.constant[:, None], x.shape)
        try:
            return np.broadcast_to(unit_vectors(self.name, self.direction, x), x.shape)
        except ValueError as error:
            for i in range(x.shape[1] if x.shape[1] > 1 else 0):
                self.at(x[:, i : i + 1])  # find the place
            raise ValueError(f"{error}; it is not at {coords(x[:, 0])}") from None


class Cell:
    """Part of an outline with one fabric.

    Attributes
    ----------
    shape
        The part, its outer ring anticlockwise.
    fields
        Directions of warp and weft.
    size
        Size of the outline in mm, to which tolerances refer.
    start, end
        Ends of each edge, the cell on its left, shape (2, n).
    turn
        Turn at the start of each edge in radians, negative where re-entrant.
    """

    def __init__(
        self, shape: shapely.Polygon, fields: list[Field], size: float
    ) -> None:
        self.shape, self.fields, self.size = shape, fields, size
        rings = corners_of_rings(shape)
        self.start = np.hstack(rings)
        self.end = np.hstack([np.roll(ring, -1, axis=1) for ring in rings])
        # Unit vectors along the edges, and along the edge before each.
        self._after = (self.end - self.start) / np.hypot(*(self.end - self.start))
        parts = by_ring(rings, self._after)
        self._before = np.hstack([np.roll(part, 1, axis=1) for part in parts])
        turn = angle(self._before, self._after)
        self.turn = np.where(np.abs(turn) < _STRAIGHT, 0.0, turn)

    def _leads_inside(self, corner: Any, d: ndarray, least: float = NEAR) -> ndarray:
        """True where a direction leads from corners into the cell.

        ``least`` is the least angle to the edges, negative to include directions along
        them.
        """
        left = cross(self._before[:, corner], d), cross(self._after[:, corner], d)
        convex = self.turn[corner] >= 0
        return np.where(convex, np.minimum(*left), np.maximum(*left)) > least

    def near(self, family: int) -> float:
        """Distance in mm below which a point is on the polyline of a fibre."""
        straight = self.fields[family].constant is not None
        return (NEAR if straight else 2 * _SAGITTA) * self.size

    def grazing(self, family: int) -> ndarray:
        """True for corners at which a fibre touches the edge, shape (n,)."""
        d, every = self.fields[family].at(self.start), slice(None)
        inside = [self._leads_inside(every, v) for v in (d, -d)]
        along = [self._leads_inside(every, v, -NEAR) for v in (d, -d)]
        return (self.turn < 0) & np.any(inside, axis=0) & np.all(along, axis=0)

    def trace(self, family: int, p: ndarray, sign: int) -> ndarray | None:
        """Fibre from a point to the edge of the cell.

        Returned as a polyline of shape (2, n), or None if the fibre does not lead into
        the cell.
        """
        field, near = self.fields[family], NEAR * self.size
        if shapely.Point(p).distance(self.shape) > near:
            return None
        d = sign * field.at(p[:, None])[:, 0]
        if not self._enters(p, d):
            return None
        if field.constant is None:
            return self._curve(family, p, d)
        found = self._exit(p, d, 2 * self.size, near, near)
        return found and np.stack([p, found[0]], axis=1)

    def _enters(self, p: ndarray, d: ndarray) -> bool:
        near = NEAR * self.size
        corner = np.hypot(*(self.start - p[:, None])) <= near
        if corner.any():
            return bool(self._leads_inside(corner, d[:, None]).any())
        sides = shapely.linestrings(np.stack([self.start, self.end], axis=1).T)
        on = shapely.distance(sides, shapely.Point(p)) <= near
        return bool((cross(self._after[:, on], d) > NEAR).all())

    def _exit(
        self, q: ndarray, d: ndarray, length: float, near: float, least: float
    ) -> tuple[ndarray, int] | None:
        """Exit of a ray from q, inside the cell: point and edge.

        None if it does not within a length, from the distance ``least`` on.  Corners
        within the distance ``near`` of the ray are on it, and it passes those that it
        only touches.
        """
        a, b = self.start - q[:, None], self.end - q[:, None]
        ca, cb = cross(d, a), cross(d, b)
        ca[np.abs(ca) <= near] = 0.0
        cb[np.abs(cb) <= near] = 0.0
        proper = np.flatnonzero((ca < 0) & (cb > 0))
        share = ca[proper] / (ca[proper] - cb[proper])
        points = self.start[:, proper] + share * (self.end - self.start)[:, proper]
        corner = np.flatnonzero(ca == 0)
        corner = corner[~self._leads_inside(corner, d[:, None])]
        points = np.hstack([points, self.start[:, corner]])
        edge = np.append(proper, corner)
        t = d @ (points - q[:, None])
        valid = np.flatnonzero((t > least) & (t <= length + near))
        if not valid.size:
            return None
        i = valid[t[valid].argmin()]
        return points[:, i], int(edge[i])

    def _curve(self, family: int, p: ndarray, d: ndarray) -> ndarray | None:
        """Curved fibre from a point in a direction, by an adaptive Runge–Kutta."""
        field, near, along = self.fields[family], CURVED_NEAR * self.size, d

        def direction(s: float, x: ndarray) -> ndarray:
            try:
                v = field.at(x[:, None])[:, 0]
            except ValueError:
                if self.shape.contains(shapely.Point(x)):
                    raise
                return along  # a field need not be defined outside
            return v if v @ along >= 0 else -v

        steps = scipy.integrate.DOP853(
            direction,
            0.0,
            p,
            _LONGEST * self.size,
            max_step=self.size / 8,
            rtol=1e-13,
            atol=_STEP * self.size,
        )
        points = [p]
        while steps.status == "running":
            steps.step()
            if steps.status == "failed":
                break
            dense: Any = steps.dense_output()
            low, high = float(steps.t_old or 0.0), float(steps.t)
            middle = direction(0.0, dense((low + high) / 2))
            last = direction(0.0, steps.y)
            turn = float(np.abs(angle(along, middle)) + np.abs(angle(middle, last)))
            sides = (high - low) * turn / (8 * _SAGITTA * self.size)
            n = 1 + int(max(np.sqrt(sides), turn / _TURN))
            s = np.linspace(low, high, n + 1)
            q = dense(s)
            for i in range(n):
                least = near if len(points) == 1 else -near
                found = self._chord_exit(points[-1], q[:, i + 1], least)
                if found:  # by the chord: does the fibre itself leave?
                    end = self._end_of(dense, s[i : i + 2], points[-1], least)
                    if end is not None:
                        points.append(end)
                        polyline = np.stack(points, axis=1)
                        long = np.hypot(*np.ptp(polyline, axis=1)) > near
                        return polyline if long else None
                side = shapely.LineString([points[-1], q[:, i + 1]])
                is_back = side.dwithin(shapely.Point(p), self.near(family))
                if is_back and s[i] > 0.01 * self.size:
                    return np.stack([*points, p], axis=1)  # closed
                points.append(q[:, i + 1])
            along = last
        raise ValueError(
            f"{field.name}: the fibre from {coords(p)} does not reach the outline; "
            f"it was followed to {coords(points[-1])}: are there sources nearby?"
        )

    def _chord_exit(
        self, q0: ndarray, q1: ndarray, least: float
    ) -> tuple[ndarray, int] | None:
        """Exit of a chord from the cell, see `_exit`."""
        length, near = float(np.hypot(*(q1 - q0))), CURVED_NEAR * self.size
        if length <= 1e-3 * near:
            return None
        return self._exit(q0, (q1 - q0) / length, length, near, least)

    def _end_of(
        self, dense: Any, side: ndarray, start: ndarray, least: float
    ) -> ndarray | None:
        """Where a side of a curved fibre leaves the cell; None if only its chord does.

        ``dense`` is the position along the step, and ``side`` the ends of the side.
        """
        s = np.linspace(side[0], side[1], _FINER + 1)
        points = np.hstack([start[:, None], dense(s[1:])])
        for low, high, q0, q1 in zip(s, s[1:], points.T, points.T[1:], strict=False):
            found = self._chord_exit(q0, q1, least)
            if found:
                return self._on_edge(dense, low, high, *found)
        return None

    def _on_edge(
        self, dense: Any, low: float, high: float, at: ndarray, edge: int
    ) -> ndarray:
        """Intersection of a curved fibre with the edge that its chord meets."""
        a, e = self.start[:, edge], self._after[:, edge]
        if np.hypot(*(at - a)) <= CURVED_NEAR * self.size:
            return a

        def offset(s: float) -> float:
            return float(cross(e, dense(s) - a))

        x = at
        if offset(low) * offset(high) < 0:
            accuracy = 1e-14 * self.size
            x = dense(scipy.optimize.brentq(offset, low, high, xtol=accuracy))
        return a + (e @ (x - a)).clip(0, np.hypot(*(self.end[:, edge] - a))) * e

    def check_fields(self) -> None:
        """Refuse fields that vanish, are parallel, or have sources within the cell."""
        if all(field.constant is not None for field in self.fields):
            return
        x0, y0, x1, y1 = self.shape.bounds
        step = max(x1 - x0, y1 - y0) / _GRID
        shift = 0.5 * step  # a centre is often a round number
        x = np.arange(x0 - shift, x1 + step, step)
        y = np.arange(y0 - shift, y1 + step, step)
        grid = np.stack(np.meshgrid(x, y))
        inside = shapely.contains_xy(self.shape, *grid)
        points = np.hstack([grid[:, inside], self.start])
        warp, weft = (field.at(points) for field in self.fields)
        parallel = points[:, np.abs(cross(warp, weft)) < PARALLEL]
        # Twice the angle from warp to weft, independent of their orientations.
        z = ((weft[0] + 1j * weft[1]) / (warp[0] + 1j * warp[1])) ** 2
        twice = np.full(inside.shape, np.nan)
        twice[inside] = np.angle(z)[: inside.sum()]
        rows, columns = (
            [np.s_[..., :-1, :], np.s_[..., 1:, :]],
            [np.s_[..., :-1], np.s_[..., 1:]],
        )
        for before, after in (rows, columns):
            p, q, x, y = twice[before], twice[after], grid[before], grid[after]
            passes = (p * q < 0) & (np.abs(p - q) < np.pi)
            share = p[passes] / (p - q)[passes]
            at = x[:, passes] + share * (y - x)[:, passes]
            parallel = np.hstack([parallel, at])
        if parallel.size:
            raise ValueError(f"warp and weft are parallel at {coords(parallel[:, 0])}")
        complete = inside[:-1, :-1] & inside[1:, :-1] & inside[:-1, 1:] & inside[1:, 1:]
        corners = grid[:, :-1, :-1][:, complete]
        for field in self.fields:
            if field.constant is None:
                self._refuse_sources(field, corners, step)

    def _refuse_sources(self, field: Field, corner: ndarray, step: float) -> None:
        """Refuse a field that turns around a point in squares, by their corners."""
        for _ in range(_DIVISIONS):
            corner = corner[:, _turns_around(field, corner, step)]
            if not corner.size:
                return
            step /= 2
            shifts = step * np.array([[0, 1, 0, 1], [0, 0, 1, 1]])
            corner = (corner[:, :, None] + shifts[:, None]).reshape(2, -1)
        where = coords(corner[:, _turns_around(field, corner, step)][:, 0] + step / 2)
        raise ValueError(
            f"{field.name} has a source or a centre near {where}; cut a hole there"
        )


# Points along each side of a square between which the turns of a field are summed up, a
# limit of work.
_ALONG_SIDE = 8


def _turns_around(field: Field, corner: ndarray, step: float) -> ndarray:
    """True for squares around which the field turns by a multiple of π, shape (n,)."""
    if not corner.size:
        return np.empty(0, dtype=bool)
    s = np.linspace(0, 1, _ALONG_SIDE, endpoint=False)
    one, zero = np.ones_like(s), np.zeros_like(s)
    x = np.concatenate([s, one, 1 - s, zero])
    y = np.concatenate([zero, s, one, 1 - s])
    points = corner[:, :, None] + step * np.stack([x, y])[:, None]
    v = field.at(points.reshape(2, -1)).reshape(points.shape)
    z = (v[0] + 1j * v[1]) ** 2  # independent of the orientation
    turn = np.angle(np.roll(z, -1, axis=1) / z).sum(axis=1)
    return np.abs(turn) > np.pi


def corners_of_rings(shape: shapely.Polygon) -> list[ndarray]:
    """Corners of the rings of a polygon, each of shape (2, n), the outer one first."""
    return [x[:-1].T for x in map(shapely.get_coordinates, shapely.get_rings(shape))]


def cells_of(
    outline: Outline, fabric: Fabric, fabrics: Mapping[str, Fabric]
) -> list[Cell]:
    """Cells of an outline: its regions, and the parts outside of them."""
    if unknown := [name for name in fabrics if name not in outline.regions]:
        known = ", ".join(map(repr, outline.regions)) or "none"
        raise ValueError(
            f"the outline has no region {unknown[0]!r} (available: {known})"
        )
    for name, other in {"": fabric, **fabrics}.items():
        if not isinstance(other, Fabric):
            what = f"region {name!r}" if name else "the outline"
            raise ValueError(f"{what} requires a Fabric, not {type(other).__name__}")
    shape = outline.shape()
    polygons = {name: shapely.Polygon(x.T) for name, x in outline.regions.items()}
    rest = shape.difference(shapely.union_all([*polygons.values()]))
    parts = [(fabric, rest if polygons else shape)]
    parts += [(fabrics.get(n, fabric), shape & of) for n, of in polygons.items()]
    cells = []
    for of_part, part in parts:
        fields = [Field.of(f.name, f.direction) for f in of_part.families]
        for polygon in shapely.get_parts(part):
            if polygon.geom_type == "Polygon" and polygon.area > NEAR * shape.area:
                cells.append(Cell(orient(polygon), fields, outline.size))
                cells[-1].check_fields()
    return cells


def lines_between(outline: Outline, cells: list[Cell]) -> list[ndarray]:
    """Borders between cells: polylines of shape (2, n)."""
    if len(cells) == 1:
        return []
    start = np.hstack([cell.start for cell in cells])
    end = np.hstack([cell.end for cell in cells])
    middle = shapely.points(((start + end) / 2).T)
    within = shapely.distance(outline.shape().boundary, middle) > NEAR * outline.size
    sides = shapely.linestrings(np.stack([start, end], axis=1).T[within])
    merged = shapely.line_merge(shapely.union_all(sides))
    return [np.array(line.coords).T for line in shapely.get_parts(merged)]
