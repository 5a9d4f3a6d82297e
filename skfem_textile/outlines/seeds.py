"""Points at which singular fibres start."""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import shapely
from numpy import ndarray
from scipy.spatial import KDTree

from .. import declarations as declared
from ..mesh.user_input import call_user_function, coords
from ..ply.loads import BodyForce, Force, Pressure, Traction
from ..solve.conditions import Condition, Conditions
from ..solve.on_surface import OnSurface
from .cells import CORNER, Cell
from .outline import Outline
from .rings import NEAR

# Intervals of each edge between whose ends functions of position are evaluated.
_INTERVALS = 256

# Part of an edge at a corner that counts as the corner, relative to the edge: a guard
# against functions such as x > 100 - 1e-3, which also select a little of the adjacent
# edges.
_AT_CORNER = 1e-3

# Intervals of an edge between which kinks of a prescribed motion are sought.  A kink
# changes the slope by more than _KINK times the largest displacement over the length.
_FINE, _KINK = 512, 1e-3

# Rounding of second differences of a motion, relative to the positions.
_ROUNDING = 64 * np.finfo(float).eps

# Part of the total variation of a traction along an edge above which the change within
# an interval may be a jump.
_JUMP = 1e-3

# Times that an interval is halved: to 1e-15 of an edge.
_HALVINGS = 50


@dataclass(frozen=True, eq=False)
class Seed:
    """Point at which singular fibres start.

    Attributes
    ----------
    point
        Position in mm, shape (2,).
    origin
        Description, such as "end of bottom".
    families
        Families of the fibres: 0 is warp, 1 is weft.
    """

    point: ndarray
    origin: str
    families: tuple[int, ...] = (0, 1)


@dataclass(frozen=True, eq=False)
class Part:
    """Parts of an outline: pieces of edges, and points.

    Attributes
    ----------
    start, end
        Ends of the pieces, anticlockwise around the ply, shape (2, n).
    points
        Positions by description.
    """

    start: ndarray
    end: ndarray
    points: dict[str, ndarray] = field(default_factory=dict)

    def ends(self, near: float) -> list[ndarray]:
        """Points at which connected pieces begin or end."""
        at_start = _coincident(self.start, self.end, near)
        at_end = _coincident(self.end, self.start, near)
        return [*self.start[:, ~at_start].T, *self.end[:, ~at_end].T]

    def runs(self, near: float, turn: float) -> list[tuple[ndarray, ndarray]]:
        """Ends of straight runs of pieces, which turn by less than ``turn`` radians."""
        along = self.end - self.start
        angle = np.arctan2(along[1], along[0])
        gap, following = KDTree(self.start.T).query(self.end.T)
        turned = (angle[following] - angle + np.pi) % (2 * np.pi) - np.pi
        goes_on = (gap <= near) & (np.abs(turned) < turn)
        after = np.where(goes_on, following, -1)
        first = np.setdiff1d(np.arange(len(angle)), after)
        runs = []
        for i in first:
            last = int(i)
            while after[last] >= 0:
                last = int(after[last])
            runs.append((self.start[:, i], self.end[:, last]))
        return runs


def _coincident(points: ndarray, others: ndarray, near: float) -> ndarray:
    """True for points, shape (2, n), that are near another."""
    return np.asarray(KDTree(others.T).query(points.T)[0] <= near)


def _between(start: ndarray, end: ndarray, s: ndarray) -> ndarray:
    """Points at shares s of the way from a start to an end, shape (2, n)."""
    return start[:, None] + s * (end - start)[:, None]


def part_of(what: str, where: Any, outline: Outline) -> Part:
    """Part of an outline that a condition or load acts on.

    Parameters
    ----------
    what
        Description of the condition or load, for messages.
    where
        Name of edges or of a point of the outline, or a function of position.
    outline
        The outline.

    Raises
    ------
    ValueError
        If the name is unknown, nothing is selected, or nodes are given by number.
    """
    start, end = outline.edges()
    if isinstance(where, str):
        if where not in outline.boundaries and where not in outline.points:
            names = ", ".join(map(repr, [*outline.boundaries, *outline.points]))
            raise ValueError(
                f"{what}: the outline has no edges or point {where!r} (available: "
                f"{names or 'none'})"
            )
        chosen = outline.boundaries.get(where, np.zeros(start.shape[1], dtype=bool))
        points = {where: outline.points[where]} if where in outline.points else {}
        return Part(start[:, chosen], end[:, chosen], points)
    if not callable(where):
        raise ValueError(
            f"{what}: nodes are not known before there is a mesh; specify the name of "
            "edges or of a point of the outline, or a function of position"
        )
    return _where(what, where, outline)


def _where(what: str, where: Callable[[ndarray], ndarray], outline: Outline) -> Part:
    """Part of an outline where a function of position is true."""

    def holds(x: ndarray) -> ndarray:
        chosen = np.asarray(call_user_function(f"{what}: where", where, x))
        if chosen.dtype != bool or chosen.shape != x.shape[1:]:
            raise ValueError(
                f"{what}: where must return one bool for each position, got "
                f"{chosen.dtype} of shape {chosen.shape}"
            )
        return chosen

    start, end = outline.edges()
    s = np.linspace(0, 1, _INTERVALS + 1)
    x = start[:, :, None] + s * (end - start)[:, :, None]
    x[:, :, -1] = end
    chosen = holds(x.reshape(2, -1)).reshape(x.shape[1:])
    pieces, corners = [], []
    for a, b, on in zip(start.T, end.T, chosen, strict=True):

        def changes(s: ndarray, a: ndarray = a, b: ndarray = b) -> ndarray:
            return np.diff(holds(_between(a, b, s)))

        cuts = []
        for k in np.flatnonzero(np.diff(on)):
            before, after = _narrowed(changes, s[k], s[k + 1])
            cuts.append(before if on[k] else after)
        bounds = np.array([0.0, *cuts, 1.0])[0 if on[0] else 1 :]
        ends = _between(a, b, bounds)
        ends[:, bounds == 1] = b[:, None]
        for j in range(0, len(bounds) - 1, 2):
            low, high = bounds[j : j + 2]
            if (low == 0 or high == 1) and high - low < _AT_CORNER:
                corners.append(a if low == 0 else b)
            else:
                pieces.append(ends[:, j : j + 2])
    part = Part(*np.reshape(pieces, (-1, 2, 2)).transpose(2, 1, 0))
    near = NEAR * outline.size
    for x in corners:
        if not _coincident(x[:, None], np.hstack([part.start, part.end]), near).any():
            part.points[f"corner {coords(x)}"] = x
    for name, x in outline.points.items():
        if holds(x[:, None])[0]:
            part.points[name] = x
    if not part.start.size and not part.points:
        raise ValueError(
            f"{what}: where selects none of the points of the outline and no part of "
            f"an edge longer than 1/{_INTERVALS} of it: name a point for a support or "
            "load inside, and the edge for a short part"
        )
    return part


@dataclass(frozen=True, eq=False)
class ConditionSeeds:
    """Supported edges, and seeds of conditions and loads.

    Attributes
    ----------
    held
        Pieces that are held, partly held or driven, of shape (2, 2).
    names
        Condition of each piece.
    seeds
        Seeds at their ends, kinks and points.
    notes
        Jumps that move with the state and are not traced.
    others
        Names of terms at which no fibres start.
    """

    held: list[ndarray]
    names: list[str]
    seeds: list[Seed]
    notes: list[str]
    others: list[str]


def seeds_of_conditions(
    outline: Outline, conditions: Conditions | None, loads: Iterable[Any]
) -> ConditionSeeds:
    """Supported edges, and seeds of conditions and loads.

    Raises
    ------
    ValueError
        If a condition or load is not valid on the outline.
    """
    near = NEAR * outline.size
    seeds = [Seed(x, f"point {name}") for name, x in outline.points.items()]
    found = ConditionSeeds([], [], seeds, [], [])
    conditions = {} if conditions is None else conditions
    if not isinstance(conditions, Mapping):
        raise ValueError(
            "conditions must be a mapping of names to Conditions, not "
            f"{type(conditions).__name__}"
        )
    for name, condition in conditions.items():
        what = f"condition {name!r}"
        if isinstance(condition, OnSurface):
            found.notes.append(f"contact ({name})")
            continue
        if not isinstance(condition, Condition):
            raise ValueError(
                f"{what} must be a Condition such as Condition('bottom'), not "
                f"{type(condition).__name__}"
            )
        part = part_of(what, condition.where, outline)
        label = condition.where if isinstance(condition.where, str) else name
        found.held.extend(np.stack([part.start.T, part.end.T], axis=2))
        found.names.extend([label] * part.start.shape[1])
        seeds += _of_part(part, label, near)
        seeds += _of_motion(part, name, condition, label, near)
    for load in loads:
        if isinstance(load, Traction):
            what, where = load.name or f"traction on {load.boundary}", load.boundary
            if where not in outline.boundaries:
                known = ", ".join(map(repr, outline.boundaries)) or "none"
                raise ValueError(
                    f"load {what!r}: the outline has no edges {where!r} (available: "
                    f"{known})"
                )
        elif isinstance(load, Force):
            what, where = load.name or "force", load.where  # type: ignore[assignment]
        elif isinstance(load, declared.Clamp):
            seeds += _of_clamp(load, outline, near)
            continue
        else:
            if not isinstance(load, BodyForce | Pressure):
                found.others.append(getattr(load, "name", type(load).__name__))
            continue
        part = part_of(f"load {what!r}", where, outline)
        seeds += _of_part(part, what, near)
        if isinstance(load, Traction) and callable(load.value):
            for ends in part.runs(near, NEAR):
                jumps = _jumps(what, load.value, *ends)
                seeds += [Seed(x, f"jump of {what}") for x in jumps]
    return found


def _of_part(part: Part, label: str, near: float) -> list[Seed]:
    ends = [Seed(x, f"end of {label}") for x in part.ends(near)]
    return ends + [Seed(x, f"point {name}") for name, x in part.points.items()]


def _of_clamp(clamp: Any, outline: Outline, near: float) -> list[Seed]:
    """Seeds at the ends of the part of an edge that a clamp holds."""
    what = f"clamp {clamp.name!r}"
    part = part_of(what, clamp.edge, outline)
    seeds = [x for x in _of_part(part, what, near) if clamp.inside(x.point[:, None])]
    for ends in part.runs(near, NEAR):
        jumps = _jumps(what, lambda x: (clamp.inside(x), 0.0), *ends)
        seeds += [Seed(x, f"end of {what}") for x in jumps]
    return seeds


def _of_motion(
    part: Part, name: str, condition: Condition, label: str, near: float
) -> list[Seed]:
    """Seeds at corners and kinks of a prescribed motion.

    A held edge that moves as a rigid body has none, even at its corners.
    """
    value, seeds = condition.value, []
    in_part = isinstance(value, list | tuple) and any(x is None for x in value)
    rigid = (condition.direction is None and not in_part) or condition.together
    rigid = rigid and not callable(value)
    if not rigid:
        runs = np.reshape(part.runs(near, CORNER), (-1, 2, 2))
        starts, ends = runs.transpose(1, 2, 0)
        inner = ends[:, _coincident(ends, starts, near)]
        seeds += [Seed(x, f"corner of {label}") for x in inner.T]
    if callable(value):
        for start, end in part.runs(near, NEAR):
            kinks = _kinks(name, condition, start, end)
            seeds += [Seed(x, f"kink of the motion of {label}") for x in kinks]
    return seeds


def _kinks(
    name: str, condition: Condition, start: ndarray, end: ndarray
) -> list[ndarray]:
    """Points between two ends at which the slope of a prescribed motion jumps."""

    def motion(s: ndarray) -> ndarray:
        x = _between(start, end, s)
        try:
            return condition.values(name, x, 1.0, 2)
        except ValueError:
            return condition.values(name, x, 1.0, 3)

    def bends(s: ndarray) -> ndarray:
        """Norm of the second differences, shape (n - 2,)."""
        u = motion(s)
        return np.linalg.norm(u[:, 2:] - 2 * u[:, 1:-1] + u[:, :-2], axis=0)

    s = np.linspace(0, 1, _FINE + 1)
    size = float(np.abs(motion(s)).max())
    bend = np.pad(bends(s), 1)
    peak = (bend[1:-1] >= bend[:-2]) & (bend[1:-1] > bend[2:])
    rounding = _ROUNDING * max(np.abs(start).max(), np.abs(end).max())
    peak &= bend[1:-1] > max(_KINK * size / _FINE, rounding)
    kinks = []
    for i in np.flatnonzero(peak) + 1:
        low, high, last = s[i - 1], s[i + 1], bend[i]
        for _ in range(_HALVINGS):
            fine = np.linspace(low, high, 9)  # a quarter of the interval before
            bend_there = bends(fine)
            k = int(bend_there.argmax())
            # Four times finer: a kink bends a quarter, a smooth motion a sixteenth.
            if bend_there[k] < last / 8:
                break
            low, high, last = fine[k], fine[k + 2], bend_there[k]
            if last < 1e-14 * size or high - low < 1e-13:
                break
        if high - low < 1e-6 * (s[1] - s[0]):
            kinks.append(start + 0.5 * (low + high) * (end - start))
    return kinks


def _narrowed(
    steps: Callable[[ndarray], ndarray], low: float, high: float
) -> tuple[float, float]:
    """Interval in which a function jumps, from its ``steps`` between positions."""
    for _ in range(_HALVINGS):
        halves = np.linspace(low, high, 3)
        half = int(steps(halves).argmax())
        low, high = halves[half], halves[half + 1]
    return low, high


def _jumps(what: str, value: Any, start: ndarray, end: ndarray) -> list[ndarray]:
    """Points between two ends at which a function of position jumps."""

    def steps(s: ndarray) -> ndarray:
        x = _between(start, end, s)
        f = call_user_function(f"the value of {what}", value, x)
        f = np.stack(np.broadcast_arrays(*f, x[0])[:2])
        return np.asarray(np.linalg.norm(np.diff(f, axis=1), axis=0))

    s = np.linspace(0, 1, _FINE + 1)
    first = steps(s)
    jumps = []
    for i in np.flatnonzero(first > _JUMP * first.sum()):
        low, high = _narrowed(steps, s[i], s[i + 1])
        if steps(np.array([low, high]))[0] > first[i] / 2:
            jumps.append(start + 0.5 * (low + high) * (end - start))
    return jumps


def seeds_of_corners(
    outline: Outline, cells: list[Cell], borders: list[ndarray]
) -> list[Seed]:
    """Seeds at re-entrant corners, grazing points and corners and ends of borders."""
    near = NEAR * outline.size
    lines = shapely.MultiLineString([line.T for line in borders]) if borders else None
    boundary = outline.shape().boundary
    seeds = []
    for cell in cells:
        corners = shapely.points(cell.start.T)
        on_border = np.zeros(len(corners), dtype=bool)
        if lines is not None:
            on_border = shapely.distance(lines, corners) <= near
        on_outline = shapely.distance(boundary, corners) <= near
        touches = [cell.grazing(family) for family in range(2)]
        for i, x in enumerate(cell.start.T):
            turn = cell.turn[i]
            if on_border[i] and on_outline[i]:
                seeds.append(Seed(x, f"end of a border at {coords(x)}"))
            elif on_border[i] and abs(turn) >= CORNER:
                seeds.append(Seed(x, f"corner of a border at {coords(x)}"))
            elif turn <= -CORNER:
                seeds.append(Seed(x, f"re-entrant corner {coords(x)}"))
            elif families := tuple(f for f in range(2) if touches[f][i]):
                what = "a border" if on_border[i] else _ring_at(outline, corners[i])
                families = (0, 1) if on_border[i] else families
                seeds.append(Seed(x, f"grazing {what} at {coords(x)}", families))
    return seeds


def _ring_at(outline: Outline, point: shapely.Point) -> str:
    """Name of the ring of an outline that is closest to a point."""
    rings = [shapely.LinearRing(ring.T) for ring in outline.rings]
    i = int(shapely.distance(rings, point).argmin())
    n = len(outline.holes)
    return "the outline" if i == 0 else "the hole" if n == 1 else f"hole {i}"
