"""Start of a kinematic net with the least shear over a part."""

from dataclasses import dataclass
from typing import Literal, TypeAlias, get_args

import numpy as np
from numpy import ndarray
from numpy.typing import ArrayLike

from ..solve.surface import OffSurfaceError, onto
from .crossings import Net
from .kinematic_net import NetStart, nets
from .surfaces import positive_length
from .triangle_mesh import TriangleMesh

#: Measure of the shear over a part.
Measure: TypeAlias = Literal["largest", "mean"]

# Maximum number of points of the part at which shear angles are compared.  Chosen: the
# largest angle of a smooth net changes by less than 0.1° with twice as many.
_POINTS = 2000

# Distance of a point from the nearest centre of a cell, relative to the cell, above
# which the net does not cover it.
_COVERED = 1.2

# Measure in radians of a net that does not cover the part, more by the missing share.
_EXCLUDED = np.pi

# Nets that are laid side by side, and number of nets of the local search.  Measured by
# `python -m studies nets_on_tools --case 'start*'`.
_SIDE_BY_SIDE, _LOCAL = 32, 40

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
        Positions of all starts in mm, shape (3, n).
    directions
        Directions of the x axis of the ply there, shape (3, n).
    measures
        Their measures in radians, shape (n,); NaN for nets that do not cover the part.
    """

    start: NetStart
    net: Net
    measure: float
    points: ndarray
    directions: ndarray
    measures: ndarray


def best_start(
    tool: TriangleMesh,
    cell: float,
    *,
    angles: tuple[float, float] = (0.0, np.pi / 2),
    points: ArrayLike | None = None,
    measure: Measure = "largest",
    trials: int = 288,
    seed: int = 1,
) -> BestStart:
    """Find the start with the smallest largest, or mean, shear angle over a part.

    Places and directions are compared by differential evolution and improved by the
    method of Nelder and Mead.  Nets that fold on the part, or do not cover it, are
    excluded.

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
    trials
        Number of nets of the global search, which are followed by at most 40 others.
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
    >>> x, y = (a.ravel() for a in np.meshgrid(*2 * [np.linspace(-50, 50, 11)]))
    >>> k = np.add.outer(11 * np.arange(10), np.arange(10)).ravel()
    >>> t = np.hstack([[k, k + 1, k + 12], [k, k + 12, k + 11]])
    >>> tool = drape.TriangleMesh(np.array([x, y, x**2 / 200]), t)
    >>> best = drape.best_start(tool, 25.0, trials=32)
    >>> bool(best.measure < np.radians(0.1))
    True
    """
    from scipy.optimize import differential_evolution, minimize

    cell = positive_length("best start: cell", cell)
    if measure not in get_args(Measure):
        raise ValueError(
            f"best start: the measure must be one of {', '.join(get_args(Measure))}, "
            f"got {measure!r}"
        )
    part = tool.facets.points if points is None else np.asarray(points, dtype=float)
    search = _Search(tool, cell, angles, _thinned(part, seed), measure)
    found = differential_evolution(
        lambda x: search(x.reshape(3, -1)),
        search.bounds,
        popsize=_SIDE_BY_SIDE // 3,
        maxiter=max(trials // _SIDE_BY_SIDE - 1, 0),
        seed=seed,
        init="sobol",
        polish=False,
        vectorized=True,
        updating="deferred",
    )
    if not found.fun < _EXCLUDED:
        raise ValueError(
            "best start: no net covers the part without a fold: use a smaller part, or "
            "darts"
        )
    low, high = np.transpose(search.bounds)
    simplex = found.x + np.vstack([np.zeros(3), 0.05 * np.diag(high - low)])
    minimize(
        lambda x: float(search(x[:, None])[0]),
        found.x,
        method="Nelder-Mead",
        options={
            "initial_simplex": simplex,
            "maxfev": _LOCAL,
            "xatol": _PLACE,
            "fatol": _ANGLE,
        },
    )
    return search.best()


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
    x = net.positions
    corners = x[:, 1:, 1:], x[:, :-1, 1:], x[:, 1:, :-1], x[:, :-1, :-1]
    centres = np.mean(corners, axis=0)[:, cells]
    away, nearest = KDTree(centres.T).query(points.T)
    along = np.array(
        [
            corners[0] + corners[2] - corners[1] - corners[3],
            corners[0] + corners[1] - corners[2] - corners[3],
        ]
    )[:, :, cells][:, :, nearest] / (2 * net.cell**2)
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
    """Mean of the differences to the two neighbours, of those that are known."""
    step = np.diff(values, axis=axis)
    pads = [[(0, 0)] * 2, [(0, 0)] * 2]
    pads[0][axis], pads[1][axis] = (1, 0), (0, 1)
    sides = np.array([np.pad(step, pad, constant_values=np.nan) for pad in pads])
    known = np.isfinite(sides)
    total = np.where(known, sides, 0.0).sum(axis=0)
    return np.asarray(total / np.maximum(known.sum(axis=0), 1))


def _thinned(points: ndarray, seed: int) -> ndarray:
    """Points, at most `_POINTS` of them."""
    if points.ndim != 2 or len(points) != 3 or not np.isfinite(points).all():
        raise ValueError("best start: points must be finite numbers of shape (3, n)")
    if points.shape[1] <= _POINTS:
        return points
    rng = np.random.default_rng(seed)
    return points[:, rng.choice(points.shape[1], _POINTS, replace=False)]


class _Search:
    """Measures of nets by the place of their start in a plane, and their direction.

    The plane is normal to the mean normal of the tool.
    """

    def __init__(
        self,
        tool: TriangleMesh,
        cell: float,
        angles: tuple[float, float],
        points: ndarray,
        measure: Measure,
    ) -> None:
        from scipy.spatial import KDTree

        self._tool, self._cell, self._angles = tool, cell, angles
        self._points, self._measure = points, measure
        facets = tool.facets
        self._edge = float(facets.longest_edges().mean())
        a, b, c = facets.points[:, facets.triangles()].swapaxes(0, 1)
        normal = np.cross(b - a, c - a, axis=0).sum(axis=1)
        self._normal = normal / np.linalg.norm(normal)
        axis = np.eye(3)[np.abs(self._normal).argmin()]
        first = axis - self._normal * (axis @ self._normal)
        first /= np.linalg.norm(first)
        self._axes = np.array([first, np.cross(self._normal, first)])
        self._vertices = facets.points
        self._tree = KDTree((self._axes @ self._vertices).T)
        low, high = (f(self._axes @ points, axis=1) for f in (np.min, np.max))
        # A net turned by 180°, and by 90° if the families are orthogonal, is the same.
        right = abs(np.cos(angles[1] - angles[0])) < 1e-9
        turn = 0.5 * np.pi if right else np.pi
        self.bounds = [(low[0], high[0]), (low[1], high[1]), (0.0, turn)]
        self._tried: list[tuple[ndarray, ndarray, float]] = []
        self._best: tuple[float, NetStart, Net] | None = None

    def __call__(self, x: ndarray) -> ndarray:
        """Measures of starts: places and directions, shape (3, n)."""
        measures = []
        for k in range(0, x.shape[1], _SIDE_BY_SIDE):
            starts = self._starts(x[:, k : k + _SIDE_BY_SIDE])
            laid = nets(self._tool, self._cell, starts, angles=self._angles)
            measures += [self._of(*of) for of in zip(starts, laid, strict=True)]
        return np.array(measures)

    def best(self) -> BestStart:
        """The best of all starts."""
        assert self._best is not None
        measure, start, net = self._best
        points, directions, measures = zip(*self._tried, strict=True)
        return BestStart(
            *(start, net, measure, np.array(points).T, np.array(directions).T),
            np.array(measures),
        )

    def _starts(self, x: ndarray) -> list[NetStart]:
        """Starts over places in the plane."""
        _, nearest = self._tree.query(x[:2].T)
        vertex = self._vertices[:, nearest]
        gradient = self._tool.gradient(vertex)
        gradient = gradient / np.linalg.norm(gradient, axis=0)
        step = x[:2] - self._axes @ vertex
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
        c, s = np.cos(x[2]), np.sin(x[2])
        first = self._axes[0][:, None] * c + self._axes[1][:, None] * s
        return [NetStart(p, d) for p, d in zip(points.T, first.T, strict=True)]

    def _of(self, start: NetStart, net: Net) -> float:
        shear = np.abs(shear_over(net, self._points))
        missing = float(np.isnan(shear).mean())
        if missing:
            value = np.nan
        else:
            value = float(shear.max() if self._measure == "largest" else shear.mean())
        point, first = np.asarray(start.point), np.asarray(start.first)
        self._tried.append((point, first, value))
        if missing:
            return _EXCLUDED * (1 + missing)
        if self._best is None or value < self._best[0]:
            self._best = value, start, net
        return value
