"""Start of a kinematic net with the least shear over a part."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal, NamedTuple, TypeAlias, get_args

import numpy as np
from numpy import ndarray
from numpy.typing import ArrayLike

from ..mesh.progress import shown
from ..mesh.user_input import coords
from ..surfaces.analytic import points_in_space, positive_length
from ..surfaces.surface import Axes, OffSurfaceError, onto
from ..surfaces.tool_mesh import unit
from ..surfaces.triangle_mesh import TriangleMesh
from .crossings import Net, corners
from .kinematic_net import NetStart, nets

#: Measure of the shear over a part.
Measure: TypeAlias = Literal["largest", "mean"]

# Maximum number of points of the part at which shear angles are compared.  The largest
# angle of a smooth net changes by less than 0.1° with twice as many.
_POINTS = 2000

# Distance of a point from the nearest centre of a cell, relative to the cell, above
# which the net does not cover it.
_COVERED = 1.2

# Measure in radians of a net that does not cover the part, more by the missing share.
_EXCLUDED = np.pi

# Number of starts of the search that are compared again with smaller cells.
_FINALISTS = 8

# Nets that are laid side by side, and number of nets of the local search.  Measured by
# `python -m studies nets_on_tools --case 'start*'`.
_SIDE_BY_SIDE, _LOCAL = 32, 40

# Generations, and changes of the local search, without an improvement after which the
# search ends.  Measured by `python -m studies nets_on_tools --case 'start*'`.
_GENERATIONS, _CHANGES = 2, 10

# Ends of the local search: change of the place relative to the part, and of the measure
# in radians, 0.01°.
_PLACE, _ANGLE = 1e-3, 2e-4


@dataclass(frozen=True, eq=False)
class BestStart:
    """Start with the least shear, and all starts that were compared.

    Attributes
    ----------
    start
        The start.
    net
        Its net.
    measure
        Its measure in radians.
    points
        Positions of all starts of the search in mm, shape (3, n).
    directions
        Directions of the x axis of the ply there, shape (3, n).
    measures
        Their measures in radians, shape (n,); NaN for nets that do not cover the part.
    others
        Measures in radians of the further starts, which are at least ``measure``; NaN
        as above.
    """

    start: NetStart
    net: Net
    measure: float
    points: ndarray
    directions: ndarray
    measures: ndarray
    others: ndarray


def best_start(
    tool: TriangleMesh,
    cell: float,
    *,
    angles: tuple[float, float] = (0.0, np.pi / 2),
    points: ArrayLike | None = None,
    measure: Measure = "largest",
    search_cell: float | None = None,
    fixed_direction: bool = False,
    others: Sequence[NetStart] = (),
    trials: int = 288,
    seed: int = 1,
) -> BestStart:
    """Find the start that minimises the largest, or mean, shear angle over a part.

    Places and directions are compared by differential evolution, beginning with the
    first of the further starts, and improved by the method of Nelder and Mead.  Both
    end when the measure improves no more.  Nets that fold on the part, or do not cover
    it, are excluded.

    Parameters
    ----------
    tool
        The tool.
    cell
        Length of the rods in mm.
    angles
        Inclination of warp and weft in the flat ply in radians.
    points
        Points of the part on the tool in mm, shape (3, n), equally distributed, at
        which shear angles are compared, such as the corners of its triangles.  By
        default the corners of all triangles.
    measure
        The largest magnitude of the shear angle, or its mean.
    search_cell
        Length of the rods of the search in mm, by default ``cell``.  The best starts of
        the search are compared again with the length ``cell``.
    fixed_direction
        Search for the place alone: the x axis of the ply is the projection of the x
        axis of the tool, see `Axes.at`.
    others
        Further starts with which the best of the search are compared, such as the
        default; none is better than the result.
    trials
        Largest number of nets of the global search, which are followed by at most 40
        others.
    seed
        Seed of the search.

    Raises
    ------
    ValueError
        If an argument is not valid, or no net covers the part.

    Examples
    --------
    >>> import numpy as np
    >>> from skfem_textile import drape
    >>> x, y = (a.ravel() for a in np.meshgrid(*2 * [np.linspace(-50, 50, 7)]))
    >>> k = np.add.outer(7 * np.arange(6), np.arange(6)).ravel()
    >>> t = np.hstack([[k, k + 1, k + 8], [k, k + 8, k + 7]])
    >>> tool = drape.TriangleMesh(np.array([x, y, x**2 / 200]), t)
    >>> best = drape.best_start(tool, 50.0, trials=8)
    >>> bool(best.measure < np.radians(0.1))
    True
    """
    cell = positive_length("best start: cell", cell)
    if measure not in get_args(Measure):
        raise ValueError(
            f"best start: the measure must be one of {', '.join(get_args(Measure))}, "
            f"got {measure!r}"
        )
    rods = positive_length("best start: search cell", search_cell or cell)
    if points is None:
        points = tool.facets.points
    part = points_in_space("best start: points", points)
    search = _Search(tool, rods, angles, _thinned(part, seed), measure, fixed_direction)
    with shown(search.progress):
        if not others or search(search.place(others[0])[:, None])[0] > _ANGLE:
            _run(search, trials, seed, others)
        return search.best(cell, others)


def _run(search: "_Search", trials: int, seed: int, others: Sequence[NetStart]) -> None:
    """Compare starts over the part, then around the best of them."""
    from scipy.optimize import differential_evolution, minimize

    found = differential_evolution(
        lambda x: search(x.reshape(len(search.bounds), -1)),
        search.bounds,
        x0=search.place(others[0]) if others else None,
        callback=_Patience(_GENERATIONS),
        popsize=_SIDE_BY_SIDE // 3,
        maxiter=max(trials // _SIDE_BY_SIDE - 1, 0),
        seed=seed,
        init="sobol",
        polish=False,
        vectorized=True,
        updating="deferred",
    )
    if found.fun < _EXCLUDED:
        low, high = np.transpose(search.bounds)
        steps = np.vstack([np.zeros(len(low)), 0.05 * np.diag(high - low)])
        minimize(
            lambda x: float(search(x[:, None])[0]),
            found.x,
            method="Nelder-Mead",
            callback=_Patience(_CHANGES),
            options={
                "initial_simplex": found.x + steps,
                "maxfev": _LOCAL,
                "xatol": _PLACE,
                "fatol": _ANGLE,
            },
        )


def shear_over(net: Net, points: ndarray) -> ndarray:
    """Shear angles of a net at points of the tool, (3, n), in radians.

    They are extrapolated linearly from the nearest centre of a cell.  NaN for points
    that the net does not cover.
    """
    from scipy.spatial import KDTree

    angle, cells = net.shear_angle(), net.cells
    shear = np.full(points.shape[1], np.nan)
    if not cells.any():
        return shear
    a, b, c, d = corners(net.positions)
    centres = net.middles()[:, cells]
    away, nearest = KDTree(centres.T).query(points.T)
    along = np.array([a + c - b - d, a + b - c - d])[:, :, cells][:, :, nearest]
    along /= 2 * net.cell**2
    off = points - centres[:, nearest]
    cosine = (along[0] * along[1]).sum(axis=0) * net.cell**2
    one, other = (off * along).sum(axis=1)
    # Coordinates in cells, in axes that are not orthogonal.
    square = 1 - np.minimum(cosine**2, 0.99)
    s, t = (one - cosine * other) / square, (other - cosine * one) / square
    slopes = [_slope(angle, axis)[cells][nearest] for axis in (0, 1)]
    value = angle[cells][nearest] + slopes[0] * s + slopes[1] * t
    covered = away <= _COVERED * net.cell
    shear[covered] = value[covered]
    return shear


def _slope(values: ndarray, axis: int) -> ndarray:
    """Mean of the differences to both neighbours, without those that are NaN."""
    step = np.diff(values, axis=axis, prepend=np.nan, append=np.nan)
    sides = np.array([np.delete(step, end, axis) for end in (-1, 0)])
    known = np.isfinite(sides)
    total = np.where(known, sides, 0.0).sum(axis=0)
    return np.asarray(total / np.maximum(known.sum(axis=0), 1))


def _thinned(points: ndarray, seed: int) -> ndarray:
    """Points, at most `_POINTS` of them."""
    if not points.size:
        raise ValueError("best start: specify at least one point of the part")
    if points.shape[1] <= _POINTS:
        return points
    rng = np.random.default_rng(seed)
    return points[:, rng.choice(points.shape[1], _POINTS, replace=False)]


class _Tried(NamedTuple):
    """Start, objective of its net in radians, and points that it does not cover."""

    start: NetStart
    value: float
    missing: ndarray
    net: Net | None


class _Patience:
    """End of a search after a number of changes without an improvement."""

    def __init__(self, most: int) -> None:
        self._most, self._least, self._waited = most, np.inf, 0

    def __call__(self, intermediate_result: Any) -> None:
        """Count a generation, or a change."""
        value = float(intermediate_result.fun)
        self._waited = 0 if value < self._least - _ANGLE else self._waited + 1
        self._least = min(value, self._least)
        if self._waited >= self._most:
            raise StopIteration


class _Search:
    """Objective of the search as a function of start point and direction.

    Start points are given in a plane normal to the mean normal of the tool.  The
    direction may be fixed.
    """

    def __init__(
        self,
        tool: TriangleMesh,
        cell: float,
        angles: tuple[float, float],
        points: ndarray,
        measure: Measure,
        fixed_direction: bool,
    ) -> None:
        from scipy.spatial import KDTree

        self._tool, self._cell, self._angles = tool, cell, angles
        self._points, self._measure = points, measure
        facets = tool.facets
        self._edge = float(facets.longest_edges().mean())
        self._normal = unit((facets.areas() * facets.normals()).sum(axis=1))
        axis = np.eye(3)[np.abs(self._normal).argmin()]
        first = unit(axis - self._normal * (axis @ self._normal))
        self._axes = np.array([first, np.cross(self._normal, first)])
        self._vertices = facets.points
        self._tree = KDTree((self._axes @ self._vertices).T)
        low, high = (f(self._axes @ points, axis=1) for f in (np.min, np.max))
        # A net turned by 180°, and by 90° if the families are orthogonal, is the same.
        right = abs(np.cos(angles[1] - angles[0])) < 1e-9
        turn = 0.5 * np.pi if right else np.pi
        self._fixed = fixed_direction
        self.bounds = [(low[0], high[0]), (low[1], high[1])]
        if not fixed_direction:
            self.bounds.append((0.0, turn))
        self._tried: list[_Tried] = []

    def progress(self) -> str:
        """Number of nets that were laid, and the least shear of those that cover."""
        least = min((one.value for one in self._tried), default=_EXCLUDED)
        found = f", the best with {np.degrees(least):.1f}°" * (least < _EXCLUDED)
        return f"comparing starts: {len(self._tried)} nets{found}"

    def __call__(self, x: ndarray) -> ndarray:
        """Objectives of n starts, given by points and directions, (3, n) or (2, n)."""
        found = self._measured(self._starts(x), self._cell)
        self._tried += [one._replace(net=None) for one in found]
        return np.array([one.value for one in found])

    def best(self, cell: float, others: Sequence[NetStart]) -> BestStart:
        """The best of the starts with the smallest objectives, and of others."""
        order = sorted(self._tried, key=lambda one: one.value)
        starts = [one.start for one in order[:_FINALISTS]]
        found = self._measured([*starts, *others], cell)
        best = min(found, key=lambda one: one.value)
        if best.net is None or best.missing.size:
            share = best.missing.shape[1] / self._points.shape[1]
            raise ValueError(
                "best start: no net covers the part without a fold; the best of "
                f"{len(self._tried) + len(others)} misses {100 * share:.2g} % of it, "
                f"around {coords(best.missing.mean(axis=1), 4)} mm: use a smaller "
                "part, or darts"
            )
        tried = [(np.asarray(s.point), np.asarray(s.first)) for s, *_ in self._tried]
        points, directions = np.array(tried).transpose(1, 2, 0)
        values = np.array([one.value for one in self._tried])
        given = np.array([one.value for one in found[len(starts) :]])
        measures, known = (np.where(x < _EXCLUDED, x, np.nan) for x in (values, given))
        best_net = best.start, best.net, best.value
        return BestStart(*best_net, points, directions, measures, known)

    def _measured(self, starts: Sequence[NetStart], cell: float) -> "list[_Tried]":
        """Lay the nets of several starts at once, and evaluate their objectives."""
        found = []
        for k in range(0, len(starts), _SIDE_BY_SIDE):
            some = starts[k : k + _SIDE_BY_SIDE]
            laid = nets(self._tool, cell, some, angles=self._angles)
            found += [self._of(*of) for of in zip(some, laid, strict=True)]
        return found

    def place(self, start: NetStart) -> ndarray:
        """Variables of a start on the tool, within the bounds, (3,) or (2,)."""
        point, first = (self._axes @ np.asarray(x) for x in (start.point, start.first))
        x = [*point, np.arctan2(first[1], first[0]) % (0.5 * np.pi)]
        low, high = np.transpose(self.bounds)
        return np.clip(x[: len(low)], low, high)

    def _starts(self, x: ndarray) -> list[NetStart]:
        """Starts on the tool above points of the plane."""
        points = self._over(x[:2])
        if self._fixed:
            first = np.array([Axes.at(self._tool, p).turn[:, 0] for p in points.T])
        else:
            first = (self._axes.T @ np.array([np.cos(x[2]), np.sin(x[2])])).T
        return [NetStart(p, d) for p, d in zip(points.T, first, strict=True)]

    def _over(self, x: ndarray) -> ndarray:
        """Points of the tool above points of the plane, shape (3, n)."""
        _, nearest = self._tree.query(x.T)
        vertex = self._vertices[:, nearest]
        gradient = unit(self._tool.gradient(vertex))
        step = x - self._axes @ vertex
        far = np.maximum(np.linalg.norm(step, axis=0) / self._edge, 1.0)
        away = self._axes.T @ (step / far)
        slope = self._normal @ gradient
        # Along the normal of the plane, back to the tangent plane of the tool.
        steep = np.abs(slope) < 0.2
        rise = (away * gradient).sum(axis=0) / np.where(steep, 1.0, slope)
        moved = vertex + np.where(steep, 0.0, away - self._normal[:, None] * rise)
        try:
            points = onto(self._tool, moved)
        except OffSurfaceError:
            points = onto(self._tool, vertex)
        beyond = self._tool.beyond_edges(points) > 0
        points[:, beyond] = vertex[:, beyond]
        return points

    def _of(self, start: NetStart, net: Net) -> "_Tried":
        shear = np.abs(shear_over(net, self._points))
        missing = np.isnan(shear)
        if missing.any():
            value = _EXCLUDED * (1 + float(missing.mean()))
        else:
            value = float(shear.max() if self._measure == "largest" else shear.mean())
        return _Tried(start, value, self._points[:, missing], net)
