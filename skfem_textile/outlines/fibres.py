"""Singular fibres of a ply: fibres across which the shear angle may jump.

A motion without fibre stretch is x = f(s₁) + g(s₂) in coordinates along the fibres.
A kink of f or g runs along a fibre through the whole ply; the shear angle jumps there.
"""

from bisect import bisect_left, insort
from collections import Counter, deque
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import shapely
from numpy import ndarray
from skfem.helpers import cross

from ..fabric import Fabric, TensionOnly, TwoLaws
from ..fabric.law import domain_of, mean_slope
from ..mesh.user_input import coords
from ..solve.conditions import Conditions
from .cells import CORNER, Cell, angle, cells_of, lines_between
from .outline import Outline
from .rings import NEAR
from .seeds import ConditionSeeds, Seed, seeds_of_conditions, seeds_of_corners

#: Maximum number of lines.
MOST_LINES = 100_000

# Angle in radians between a side and fibres below which they run along it.
_ALONG_SIDE = 1e-3

#: Default of the least distance between reflections and other fibres, relative to the
#: length √area.  It is finer than practical elements.
FINEST = 1e-3


@dataclass(frozen=True, eq=False)
class SingularFibre:
    """Fibre across which the shear angle may jump.

    Attributes
    ----------
    points
        Polyline in mm, shape (2, n), from edge to edge.
    family
        0 for warp, 1 for weft.
    origin
        Why it is singular, such as "end of bottom".
    """

    points: ndarray
    family: int
    origin: str


@dataclass(frozen=True, eq=False)
class SingularFibres:
    """Singular fibres of a ply.

    Attributes
    ----------
    fibres
        Fibres across which the shear angle may jump: edges for a mesh.
    weak
        Fibres across which its derivative may jump: a mesh may be graded towards them.
    borders
        Borders between regions, polylines in mm of shape (2, n).
    held
        Held, partly held or driven pieces of the boundary, of shape (2, 2).
    dropped
        Number of reflections that were not followed.
    width
        Distance in mm to an existing fibre of the same family below which a reflection
        is not followed.
    notes
        Jumps that move with the state and are not traced.
    others
        Names of terms at which no fibres start.
    """

    fibres: list[SingularFibre]
    weak: list[SingularFibre]
    borders: list[ndarray]
    held: list[ndarray]
    dropped: int
    width: float
    notes: list[str] = field(default_factory=list)
    others: list[str] = field(default_factory=list)

    def summary(self) -> str:
        """Numbers of fibres by origin, and what was left out."""
        warp = sum(f.family == 0 for f in self.fibres)
        lines = [
            f"{len(self.fibres)} singular fibres: {warp} warp, "
            f"{len(self.fibres) - warp} weft; {len(self.weak)} weak"
        ]
        origins = Counter(f.origin for f in self.fibres)
        lines += [f"  {n} from {origin}" for origin, n in origins.items()]
        return "\n".join([*lines, *self.left_out()])

    def left_out(self) -> list[str]:
        """Jumps that are not traced, one line for each reason."""
        lines = []
        if self.dropped:
            lines.append(
                f"{self.dropped} reflections dropped, closer than {self.width:.3g} mm "
                "to another fibre"
            )
        if self.notes:
            lines.append(f"not traced, as it moves: {', '.join(self.notes)}")
        if self.others:
            lines.append(f"terms at which no fibre starts: {', '.join(self.others)}")
        return lines


def singular_fibres(
    outline: Outline,
    fabric: Fabric,
    conditions: Conditions | None = None,
    loads: Iterable[Any] = (),
    *,
    fabrics: Mapping[str, Fabric] | None = None,
    finest: float | None = None,
) -> SingularFibres:
    """Fibres across which the shear angle may jump.

    They start at the ends of held, partly held or driven edges, at kinks of a
    prescribed motion, at named points, at ends and jumps of loads, at ends of clamps,
    at re-entrant corners, at corners and ends of borders between regions, and where a
    fibre grazes the outline or a hole.  Held edges reflect them into the other family;
    borders reflect and transmit them.  Corners that turn by less than `CORNER`
    approximate a curve.

    Parameters
    ----------
    outline
        The outline of the ply.
    fabric
        The fabric, its directions vectors or functions of position.
    conditions
        Conditions by name; each ``where`` is the name of edges or of a point of the
        outline, or a function of position.
    loads
        Tractions, forces and clamps; no fibres start at other terms.
    fabrics
        Fabrics of regions of the outline by name; other regions have ``fabric``.
    finest
        Least distance in mm between a reflection and an existing fibre of the same
        family, by default 0.001 √area.  Where the layer √area √(G/E), over which the
        shear angle changes, is wider, its width is the least distance.

    Returns
    -------
    SingularFibres
        The fibres.

    Raises
    ------
    ValueError
        If a condition does not fit the outline, a direction is zero, not finite or
        parallel to the other family, a field has a source, or there are more than
        `MOST_LINES` fibres.

    Examples
    --------
    A bias extension of 100 mm by 200 mm: a fibre of each family from each corner.

    >>> from skfem_textile import Condition
    >>> outline = Outline([[0, 100, 100, 0], [0, 0, 200, 200]])
    >>> fabric = Fabric(1e5, 0.5, warp=(1, 1), weft=(-1, 1))
    >>> held = {"fixed": Condition("bottom"), "pulled": Condition("top", (0, 20))}
    >>> lines = singular_fibres(outline, fabric, held)
    >>> len(lines.fibres), lines.fibres[0].points.T.tolist()
    (4, [[0.0, 0.0], [100.0, 100.0]])
    """
    if finest is not None and not (np.isfinite(finest) and finest > 0):
        raise ValueError(f"finest must be a positive number of mm, got {finest}")
    cells = cells_of(outline, fabric, fabrics or {})
    supports = seeds_of_conditions(outline, conditions, loads)
    length = float(np.sqrt(outline.shape().area))
    everywhere = [fabric, *(fabrics or {}).values()]
    width = max(
        FINEST * length if finest is None else finest,
        length * max(_layer(one) for one in everywhere),
    )
    borders = lines_between(outline, cells)
    seeds = supports.seeds + seeds_of_corners(outline, cells, borders)
    tracing = _Tracing(cells, supports, borders, width, outline.size)
    tracing.strong(seeds)
    fibres, dropped, tracing.found = tracing.found, tracing.dropped, []
    for seed in _free_corners(outline, tracing) + tracing.free_ends:
        tracing.trace(seed, width)
    notes = supports.notes + [n for one in everywhere for n in _moving(one)]
    return SingularFibres(
        *(fibres, tracing.found, borders, supports.held, dropped, width),
        list(dict.fromkeys(notes)),
        supports.others,
    )


def has_free_side_along_fibres(
    outline: Outline, fabrics: Iterable[Fabric], conditions: Conditions | None
) -> bool:
    """True if fibres run along a free side.

    The shear moment is a traction on this side, which the fibre there carries alone if
    fibres are inextensible.
    """
    start, end = outline.edges()
    middle, along = 0.5 * (start + end), end - start
    held = seeds_of_conditions(outline, conditions, ()).held
    lines = shapely.multilinestrings([piece.T for piece in held])
    gaps = shapely.distance(lines, shapely.points(middle.T)) if held else np.inf
    free = np.broadcast_to(gaps > 100 * NEAR * outline.size, middle.shape[1])
    sines = [
        np.abs(cross(A[..., 0], along)) / np.hypot(*along)
        for fabric in fabrics
        for A in fabric.directions(middle[..., None])
    ]
    return bool((np.min(sines, axis=0)[free] < _ALONG_SIDE).any())


class _Tracing:
    """Fibres traced so far, by cell and family."""

    def __init__(
        self,
        cells: list[Cell],
        supports: ConditionSeeds,
        borders: list[ndarray],
        width: float,
        size: float,
    ) -> None:
        self._cells, self._width, self._near = cells, width, NEAR * size
        self._held = [shapely.linestrings(piece.T) for piece in supports.held]
        self._names = supports.names
        self._borders = [shapely.linestrings(line.T) for line in borders]
        self._known = [[_Known(cell, f) for f in range(2)] for cell in cells]
        self.found: list[SingularFibre] = []
        self.free_ends: list[Seed] = []
        self.dropped = 0

    def strong(self, seeds: list[Seed]) -> None:
        """Trace fibres from seeds, and their reflections, the nearest first."""
        queue = deque((seed, False) for seed in seeds)
        while queue:
            seed, reflected = queue.popleft()
            for end, family in self.trace(seed, self._width if reflected else 0.0):
                queue += [(s, True) for s in self._reflections(end, family, seed)]

    def held_at(self, x: ndarray) -> str:
        """Name of the condition that holds a point of the boundary; '' if free."""
        if not self._held:
            return ""
        gaps = shapely.distance(self._held, shapely.Point(x))
        i = int(gaps.argmin())
        return self._names[i] if gaps[i] <= 100 * self._near else ""

    def _reflections(self, x: ndarray, family: int, seed: Seed) -> list[Seed]:
        origin, _, _ = seed.origin.partition(", reflected")
        point, near = shapely.Point(x), 100 * self._near
        if self._borders and shapely.distance(self._borders, point).min() <= near:
            return [Seed(x, f"{origin}, reflected at a border")]
        if name := self.held_at(x):
            return [Seed(x, f"{origin}, reflected at {name}", (1 - family,))]
        self.free_ends.append(Seed(x, f"{origin}, reflected", (1 - family,)))
        return []

    def trace(self, seed: Seed, width: float) -> list[tuple[ndarray, int]]:
        """Add fibres through a seed, unless others are closer than a width.

        Returns their ends and families.
        """
        ends = []
        for cell, known in zip(self._cells, self._known, strict=True):
            for family in seed.families:
                if known[family].at(seed.point, cell.near(family)):
                    continue
                points = np.empty((2, 0))
                for sign in (1, -1):
                    half = cell.trace(family, seed.point, sign)
                    if half is None:
                        continue
                    if width and known[family].near(half, width):
                        self.dropped += 1
                        continue
                    one = half[:, :0:-1] if points.size else half
                    points = np.hstack([one, points])
                    ends.append((half[:, -1], family))
                    if (half[:, 0] == half[:, -1]).all():
                        break  # closed
                if points.size:
                    known[family].add(points)
                    self._add(SingularFibre(points, family, seed.origin))
        return ends

    def _add(self, fibre: SingularFibre) -> None:
        self.found.append(fibre)
        if len(self.found) > MOST_LINES:
            raise ValueError(
                f"there are more than {MOST_LINES} singular fibres, the last one from "
                f"{coords(fibre.points[:, 0])}: reflections closer than "
                f"{self._width:.3g} mm are left out; a larger size, or a larger "
                "`finest` of singular_fibres, leaves out more"
            )


class _Known:
    """Fibres of a family in a cell, for queries of distance."""

    def __init__(self, cell: Cell, family: int) -> None:
        self._direction = cell.fields[family].constant
        self._straight: list[tuple[float, float, float]] = []
        self._curved: list[Any] = []

    def add(self, points: ndarray) -> None:
        """Add a fibre, shape (2, n)."""
        if (d := self._direction) is None:
            self._curved.append(shapely.linestrings(points.T))
        else:
            t = d @ points
            insort(self._straight, (float(cross(d, points[:, 0])), t.min(), t.max()))

    def at(self, x: ndarray, distance: float) -> bool:
        """True if a point is on a known fibre, within a distance."""
        return self._beside([x], x, distance)

    def near(self, half: ndarray, distance: float) -> bool:
        """True if a fibre from a seed runs beside a known one, within a distance."""
        line = shapely.linestrings(half.T)
        middle = np.array(line.interpolate(0.5, normalized=True).coords[0])
        return self._beside([half[:, 0], middle], middle, distance)

    def _beside(self, points: list[ndarray], middle: ndarray, distance: float) -> bool:
        if (d := self._direction) is None:
            if not self._curved:
                return False
            close = [
                shapely.dwithin(self._curved, shapely.Point(x), distance)
                for x in points
            ]
            return bool(np.all(close, axis=0).any())
        offset, t = float(cross(d, points[0])), float(d @ middle)
        i = bisect_left(self._straight, (offset - distance,))
        while i < len(self._straight) and self._straight[i][0] <= offset + distance:
            if self._straight[i][1] - distance <= t <= self._straight[i][2] + distance:
                return True
            i += 1
        return False


def _free_corners(outline: Outline, tracing: _Tracing) -> list[Seed]:
    """Seeds at convex corners between free edges."""
    seeds = []
    for ring in outline.rings:
        after = np.roll(ring, -1, axis=1) - ring
        before = np.roll(after, 1, axis=1)
        for i in np.flatnonzero(angle(before, after) >= CORNER):
            x = ring[:, i]
            if not (
                tracing.held_at(x - before[:, i] / 2)
                or tracing.held_at(x + after[:, i] / 2)
            ):
                seeds.append(Seed(x, f"free corner {coords(x)}"))
    return seeds


def _layer(fabric: Fabric) -> float:
    """√(G/E): shear stiffness at rest over the stiffness of the softer family."""
    zero = np.zeros(1)
    E = min(float(np.mean(mean_slope(f.tension, zero))) for f in fabric.families)
    G = float(np.mean(fabric.shear_law.tangent(zero)))
    return float(np.sqrt(max(G, 0.0) / E)) if E > 0 else 1.0


# Strains and shear angles in radians up to which laws are searched for softening.
_STRAIN, _ANGLE = 0.02, 1.0


def _moving(fabric: Fabric) -> list[str]:
    """Slack zones and softening bands, which move with the state."""
    notes = []
    tensions = fabric.tensions
    if isinstance(tensions, TwoLaws):
        notes += [
            f"slack zones (TensionOnly of {name})"
            for name, law in zip(("warp", "weft"), tensions.laws, strict=True)
            if isinstance(law, TensionOnly)
            or isinstance(getattr(law, "law", None), TensionOnly)
        ]
    pairs = [(f"tension of {f.name}", f.tension, _STRAIN) for f in fabric.families]
    for name, law, most in [*pairs, ("shear", fabric.shear_law, _ANGLE)]:
        low, high = domain_of(law)
        x = np.linspace(max(0.0, np.max(low)), min(most, np.min(high)), 200)[1:-1]
        x = x[:, None, None]  # laws may have values per element
        with np.errstate(all="ignore"):
            soft = x[np.any(law.tangent(x) + 0 * x < 0, axis=(1, 2))]
        if soft.size:
            notes.append(f"softening bands ({name} beyond {soft.min():.2g})")
    return notes
