"""Smoothed triangulated surfaces: weighted mean of quadrics at the vertices.

A quadric is fitted to the vertices around each vertex (`Quadrics`), so that normals and
curvatures are continuous.  φ is positive on the side that the triangles face.

A quadric q_i(x) = w − (c₀ + c₁u + … + c₅v²) belongs to each vertex x_i, with the
coordinates u and v in its tangent plane and w along its normal.  φ is their mean with
smooth weights of finite support (Ohtake, Belyaev, Alexa, Turk & Seidel 2003,
Multi-level partition of unity implicits, ACM Trans.  Graph.  22:463).
"""

from copy import copy
from functools import cached_property
from itertools import chain
from typing import NamedTuple

import numpy as np
from numpy import ndarray

from ..mesh.checks import MeshError
from .sheet import ClosestTriangles, boundary_edges
from .tool_mesh import ToolMesh

# Number of points to which the six coefficients of a quadric are fitted: two rings of
# neighbours and more on a regular mesh.
FITTED = 18

# Regularisation of the fit, relative to the size of the neighbourhood, for collinear
# neighbours.
_RIDGE = 1e-9

# Cosine of the angle between normals below which a point belongs to the other side of a
# thin part and is not a neighbour.
_OTHER_SIDE = 0.0

# Smallest support radius, relative to the distance of the nearest point.
_FAR = 1.5

# Maximum number of vertices listed as neighbours of a vertex: sixty times the mean of
# equal triangles.  Maximum number of pairs of position and vertex per block.
_NEIGHBOURS, _PAIRS = 2500, 16384

# Distances from the nearest vertex, relative to the reach, for which neighbours are
# counted in advance.  Beyond them the reach grows with the distance.
_LEVELS = np.linspace(0.0, 1 / _FAR, 9)

# Number of positions for which values are kept: a Newton iteration returns to the last
# state after a trial step.
_KEPT = 2


class Derivatives(NamedTuple):
    """φ, ∇φ and ∇²φ, shapes (n,), (3, n) and (3, 3, n)."""

    level: ndarray
    gradient: ndarray
    hessian: ndarray


class Quadrics:
    """Quadrics q_i = a_i + b_i·d + ½ d·H_i d of the vector d from their points.

    Points and unit normals have the shape (n, 3).  Weights vanish at the distance
    ``reach`` in mm.
    """

    def __init__(self, points: ndarray, normals: ndarray, reach: float) -> None:
        from scipy.spatial import KDTree  # not imported for other drapes

        self._tree, self._reach = KDTree(points), reach
        _, near = self._tree.query(points, FITTED)
        u, v, c = _fitted(points, normals, near)
        c_uu, c_uv, c_vv = c[:, 3:].T[:, :, None, None]
        uv = u[:, :, None] * v[:, None]
        H = -(
            2 * c_uu * u[:, :, None] * u[:, None]
            + c_uv * (uv + uv.swapaxes(1, 2))
            + 2 * c_vv * v[:, :, None] * v[:, None]
        )
        b = normals - c[:, 1, None] * u - c[:, 2, None] * v
        self._set(points, -c[:, 0], b, H)
        # Vertices near each vertex, nearest first, and how many of them can be within
        # the reach of a position at most so far away: see `_LEVELS`.
        within = reach * (1 + _LEVELS)
        count = self._tree.query_ball_point(points, within[-1], return_length=True)
        self._listed = count <= _NEIGHBOURS
        count = np.where(self._listed, count, 0)
        self._start = np.cumsum(count) - count
        at = np.repeat(np.arange(len(points)), count)
        near = _flat(self._tree.query_ball_point(points[self._listed], within[-1]))
        away = np.linalg.norm(points[at] - points[near], axis=1)
        self._near = near[np.lexsort([away, at])]
        self._counts = np.array(
            [np.bincount(at[away <= r], minlength=len(points)) for r in within]
        )

    def _set(self, points: ndarray, a: ndarray, b: ndarray, H: ndarray) -> None:
        """Store quadrics of shapes (n, 3), (n,), (n, 3) and (n, 3, 3) as columns."""
        self._quadrics = points, a, b, H
        self._c = np.column_stack([a, b, H[:, *_UPPER]]).T.copy()
        self._x = points.T.copy()

    def moved(self, origin: ndarray, turn: ndarray) -> "Quadrics":
        """The same quadrics in axes with an origin, (3,), and directions, (3, 3)."""
        from scipy.spatial import KDTree

        points, a, b, H = self._quadrics
        moved = copy(self)
        points = (points - origin) @ turn
        moved._tree = KDTree(points)
        moved._set(points, a, b @ turn, turn.T @ H @ turn)
        return moved

    def nearest(self, x: ndarray) -> tuple[ndarray, ndarray]:
        """Distances to the nearest points, and their numbers, shape (n,)."""
        distance, nearest = self._tree.query(x.T)
        return distance, np.where(np.isfinite(distance), nearest, 0)

    def mean(self, x: ndarray, order: int = 2) -> tuple[ndarray, ...]:
        """φ = Σ w q / Σ w and its derivatives at positions, shape (3, n).

        The order of the last derivative is 1 or 2.
        """
        mean = [np.full((*[3] * i, x.shape[1]), np.nan) for i in range(order + 1)]
        distance, nearest = self.nearest(x)
        # Squares of infinite distances overflow: these values remain NaN.
        finite = np.isfinite(distance)
        # Far away only the nearest points contribute: the reach slightly exceeds
        # their distance.
        reach, levels = np.maximum(self._reach, _FAR * distance), self._reach * _LEVELS
        listed = (distance <= levels[-1]) & self._listed[nearest]
        level = np.searchsorted(levels, np.where(listed, distance, 0.0))
        count = self._counts[level, nearest]
        far = np.flatnonzero(finite & ~listed)
        if far.size:
            count[far] = self._tree.query_ball_point(
                x[:, far].T, reach[far], return_length=True
            )
        for numbers in np.flatnonzero(listed), far:
            for some in _blocks(numbers, count):
                n, first, at = count[some], nearest[some], x[:, some]
                if numbers is far:
                    near = _flat(self._tree.query_ball_point(at.T, reach[some]))
                else:
                    shift = self._start[first] - (np.cumsum(n) - n)
                    near = self._near[np.arange(n.sum()) + np.repeat(shift, n)]
                block = self._mean(at, near, n, first, reach[some], order)
                for values, part in zip(mean, block, strict=True):
                    values[..., some] = part
        for values in mean:
            values.setflags(write=False)
        return tuple(mean)

    def _mean(
        self,
        x: ndarray,
        near: ndarray,
        count: ndarray,
        nearest: ndarray,
        reach: ndarray,
        order: int,
    ) -> tuple[ndarray, ...]:
        """Derivatives at n positions.

        ``near`` contains all vertices within the reach of the positions, and possibly
        others, ``count`` for each position.
        """
        at = np.repeat(np.arange(len(count)), count)
        d = np.repeat(x, count, axis=1) - self._x.take(near, axis=1)
        square = np.einsum("ip,ip->p", d, d)
        inside = np.flatnonzero(square < (reach * reach).take(at))
        at, near, d = at.take(inside), near.take(inside), d.take(inside, axis=1)
        starts = np.searchsorted(at, np.arange(len(count)))

        def total(values: ndarray) -> ndarray:
            return np.add.reduceat(values, starts, axis=-1)

        a, b, H = np.split(self._c.take(near, axis=1), [1, 4])
        dq = b + [H[i] * d[0] + H[j] * d[1] + H[k] * d[2] for i, j, k in _SYMMETRIC]
        q = a[0] + 0.5 * np.einsum("ip,ip->p", b + dq, d)
        # Wendland's C⁴ function w = (1 − s)⁶ (35 s² + 18 s + 3), slope = w′/s and bend
        # = slope′/s. With m = s ∇s: ∇w = slope m, ∇²w = bend m m + slope ∇m, ∇m = I (1
        # − s²R²/r₁²)/R² − 2 (m ρ + ρ m), r₁ to the nearest point.
        over = (1 / reach).take(at)
        s = np.sqrt(square.take(inside)) * over
        rest = 1 - s
        fourth = np.square(rest * rest)
        w = fourth * rest * rest * ((35 * s + 18) * s + 3)
        slope = fourth * rest * (-280 * s - 56)
        m, weight = d * (over * over), total(w)
        level = total(w * q) / weight
        # Derivatives of Σ w (q − φ) = 0, whose terms in the derivatives of Σ w vanish.
        off = q - level.take(at)
        of_w = grown = slope * off
        # If the reach depends on the nearest point: the gradient ρ of its logarithm.
        follows = reach > self._reach
        if far := bool(follows.any()):
            rho = follows * (x - self._x[:, nearest]) * (_FAR / reach) ** 2
            m -= s * s * rho.take(at, axis=1)
            grown = of_w * (1 - follows.take(at) * (_FAR * s) ** 2)
        gradient = total(of_w * m + w * dq) / weight
        if order == 1:
            return level, gradient
        turned = (840 * fourth * off) * m + slope * (dq - gradient.take(at, axis=1))
        if far:
            turned -= (2 * of_w) * rho.take(at, axis=1)
        hessian = np.array(
            [
                total(m[i] * turned[j] + m[j] * turned[i] + w * h)
                for i, j, h in zip(*_UPPER, H, strict=True)
            ]
        )
        hessian[:3] += total(grown) / (reach * reach)
        return level, gradient, (hessian / weight)[_SYMMETRIC]


# Second derivatives xx, yy, zz, yz, xz, xy in a matrix, and their numbers in it.
_UPPER = [0, 1, 2, 1, 0, 0], [0, 1, 2, 2, 2, 1]
_SYMMETRIC = np.array([[0, 5, 4], [5, 1, 3], [4, 3, 2]])


def _flat(lists: ndarray) -> ndarray:
    """Numbers in an array of lists, one after the other."""
    return np.fromiter(chain.from_iterable(lists), dtype=np.int64)


def _blocks(numbers: ndarray, count: ndarray) -> list[ndarray]:
    """Blocks of positions with about `_PAIRS` pairs."""
    if not numbers.size:
        return []
    ends = np.cumsum(count[numbers])
    cuts = np.searchsorted(ends, np.arange(_PAIRS, ends[-1], _PAIRS))
    return [block for block in np.split(numbers, np.unique(cuts)) if block.size]


def _fitted(
    points: ndarray, normals: ndarray, near: ndarray
) -> tuple[ndarray, ndarray, ndarray]:
    """Unit vectors u and v at points, (n, 3), and coefficients of quadrics, (n, 6)."""
    axis = np.eye(3)[np.abs(normals).argmin(axis=1)]
    u = np.cross(normals, axis)
    u /= np.linalg.norm(u, axis=1, keepdims=True)
    v = np.cross(normals, u)
    frames = np.stack([u, v, normals], axis=1)
    local = np.einsum("nij,nkj->nki", frames, points[near] - points[:, None])
    size = np.linalg.norm(local, axis=2).max(axis=1)
    a, b, h = (local / size[:, None, None]).transpose(2, 0, 1)
    rows = np.stack([np.ones_like(a), a, b, a * a, a * b, b * b], axis=2)
    facing = np.einsum("nkj,nj->nk", normals[near], normals) > _OTHER_SIDE
    weight = facing * np.exp(-2 * (a * a + b * b))
    normal = np.einsum("nki,nk,nkj->nij", rows, weight, rows)
    right = np.einsum("nki,nk,nk->ni", rows, weight, h)
    c = np.linalg.solve(normal + _RIDGE * np.eye(6), right[:, :, None])[:, :, 0]
    degrees = np.array([0, 1, 1, 2, 2, 2])
    return u, v, c * size[:, None] ** (1 - degrees)


# Support radius of the weights, relative to the mean edge length.  Chosen: with a
# smaller one, points between vertices of long triangles have too few quadrics; with a
# larger one, details are lost.
_REACH = 2.0

# Distance, relative to the extent, below which vertices coincide: STL repeats them per
# triangle, in single precision.
_ONE = 1e-6

# Smallest and largest extent in mm.  Chosen: squares of areas are finite and nonzero.
_LEAST, _LARGEST = 1e-50, 1e50

# Tolerance for points beyond the edges of the triangles, relative to the mean edge.
# Chosen: a curved outline deviates from chords of 45° by a tenth of their length.
_BEYOND = 0.1

# Tolerance for the deviation of the smoothed surface from the triangles, relative to
# the mean edge.  Chosen: regular triangles on spheres, cylinders, cones and saddles
# deviate by at most 0.06 with 320 triangles on a sphere; both sides of a thin shell,
# and triangles with an aspect ratio of fourteen, by 0.25 and more.
_OFF = 0.1

# Smallest ratio of the vector area around a vertex to the total area of its triangles:
# a tenth for a sharp cone, virtually zero for random orientations.
_FACING = 0.05


class TriangleMesh:
    """Smooth surface through triangles.

    The triangles should be nearly equilateral and of similar size: edges and fillets
    smaller than two triangles are smoothed.

    Parameters
    ----------
    vertices
        Vertices in mm, shape (3, n_vertices).  Coincident vertices are merged.
    triangles
        Vertex numbers, anticlockwise as seen from outside, shape (3, n).

    Raises
    ------
    MeshError
        If there are too few vertices, or numbers or positions are not valid.
    """

    def __init__(self, vertices: ndarray, triangles: ndarray) -> None:
        vertices, triangles = _merged(vertices, triangles)
        self._x, self._triangles = vertices.T, triangles
        edges = np.linalg.norm(
            self._x[triangles] - self._x[np.roll(triangles, 1, axis=0)], axis=2
        )
        self._edge = edges.mean()
        normals = _vertex_normals(self._x, triangles)
        self._quadrics = Quadrics(self._x, normals, _REACH * self._edge)
        self._kept: list[tuple[ndarray, Derivatives]] = []

    @cached_property
    def facets(self) -> ToolMesh:
        """The triangles as elements of a tool, without degenerate ones."""
        a, b, c = self._x[self._triangles]
        area = np.linalg.norm(np.cross(b - a, c - a), axis=1)
        return ToolMesh(self._x.T, (self._triangles[:, area > 0],))

    def moved(self, origin: ndarray, turn: ndarray) -> "TriangleMesh":
        """The same surface in other axes.

        It is not fitted again, because the choice among equidistant vertices depends on
        rounding.

        Parameters
        ----------
        origin
            Origin in mm, shape (3,).
        turn
            Orthogonal unit vectors, columns of shape (3, 3).
        """
        moved = copy(self)
        moved._x = (self._x - origin) @ turn
        moved._quadrics, moved._kept = self._quadrics.moved(origin, turn), []
        for derived in ("facets", "_closest", "_normals"):
            moved.__dict__.pop(derived, None)
        return moved

    def beyond_edges(self, x: ndarray) -> ndarray:
        """Distances of points beyond the edges of the triangles in mm, shape (n,).

        0 for a point over the triangles, or within a tenth of the mean edge length from
        them.

        Parameters
        ----------
        x
            Points on the surface in mm, shape (3, n).
        """
        beyond = np.zeros(x.shape[1])
        away, vertex = self._quadrics.nearest(x)
        # A point is as far from a triangle as from its nearest vertex, at most, and as
        # far from the boundary as that vertex less this distance, at least.
        near = np.flatnonzero(self._to_boundary[vertex] <= 2 * away)
        if near.size:
            beyond[near] = self._away(x[:, near])[1]
        return beyond

    def off_triangles(self, x: ndarray) -> ndarray:
        """Distances of points on the smoothed surface from the triangles in mm, (n,).

        0 within a tenth of the mean edge, and for points beyond the edges.

        Parameters
        ----------
        x
            Points on the surface in mm, shape (3, n).
        """
        away, beyond = self._away(x)
        distance = np.linalg.norm(away, axis=0)
        off = (distance > _OFF * self._edge) & (beyond == 0)
        return np.where(off, distance, 0.0)

    def _away(self, x: ndarray) -> tuple[ndarray, ndarray]:
        """Vectors to points from the closest points, and `beyond_edges`."""
        tool = self.facets
        (triangles,) = tool.cells
        triangle, shares = self._closest.at(x)
        corners, normals = triangles[:, triangle], self._normals[:, triangle]
        away = x - (shares * tool.points[:, corners]).sum(axis=1)
        along = np.linalg.norm(away - (away * normals).sum(axis=0) * normals, axis=0)
        # Ends of the edge on which the closest point lies; equal at a corner.
        edge = np.where(
            shares > 0, corners, corners[shares.argmax(axis=0), range(len(along))]
        )
        weights = len(self._x), 1
        at_edge = np.isin(
            weights @ np.array([edge.min(axis=0), edge.max(axis=0)]), self._edge_keys
        )
        at_edge &= (shares == 0).any(axis=0)
        beyond = at_edge & (along > _BEYOND * self._edge)
        return away, np.where(beyond, along, 0.0)

    @cached_property
    def _closest(self) -> "ClosestTriangles":
        tool = self.facets
        return ClosestTriangles(tool.points, tool.cells[0])

    @cached_property
    def _to_boundary(self) -> ndarray:
        """Lower bounds of the distances of the vertices from the boundary in mm."""
        from scipy.spatial import KDTree

        ends = boundary_edges(self.facets.cells)
        if not ends.size:
            return np.full(len(self._x), np.inf)
        edges = np.linalg.norm(self._x[ends[1]] - self._x[ends[0]], axis=1)
        return KDTree(self._x[ends[0]]).query(self._x)[0] - 0.5 * edges.max()

    @cached_property
    def _normals(self) -> ndarray:
        return self.facets.normals()

    @cached_property
    def _edge_keys(self) -> ndarray:
        """Numbers of the boundary edges and of their ends, see `_away`."""
        ends = boundary_edges(self.facets.cells)
        edges = np.hstack([np.sort(ends, axis=0), ends[[0, 0]]])
        return np.unique(np.array([len(self._x), 1]) @ edges)

    def level(self, x: ndarray) -> ndarray:
        """φ, shape (n,)."""
        return self._mean(x).level

    def gradient(self, x: ndarray) -> ndarray:
        """∇φ, shape (3, n)."""
        return self._mean(x).gradient

    def hessian(self, x: ndarray) -> ndarray:
        """∇²φ, shape (3, 3, n)."""
        return self._mean(x).hessian

    def first_order(self, x: ndarray) -> tuple[ndarray, ndarray]:
        """φ and ∇φ, shapes (n,) and (3, n), in less time than with ∇²φ."""
        level, gradient = self._quadrics.mean(x, order=1)
        return level, gradient

    def _mean(self, x: ndarray) -> Derivatives:
        """φ and its derivatives, which an iteration uses one after the other."""
        for at, mean in self._kept:
            if np.array_equal(at, x):
                return mean
        mean = Derivatives(*self._quadrics.mean(x))
        self._kept = [(x.copy(), mean), *self._kept[: _KEPT - 1]]
        return mean


def _merged(vertices: ndarray, triangles: ndarray) -> tuple[ndarray, ndarray]:
    """Vertices without duplicates, and triangles that are not degenerate."""
    vertices = np.asarray(vertices, dtype=float)
    triangles = np.asarray(triangles, dtype=int)
    if vertices.ndim != 2 or len(vertices) != 3 or not np.isfinite(vertices).all():
        raise MeshError(
            "triangle mesh: vertices must be finite numbers of shape (3, n)"
        )
    if triangles.ndim != 2 or len(triangles) != 3 or not triangles.size:
        raise MeshError(
            "triangle mesh: triangles must be vertex numbers of shape (3, n), n >= 1"
        )
    if triangles.min() < 0 or triangles.max() >= vertices.shape[1]:
        raise MeshError("triangle mesh: a triangle refers to an undefined vertex")
    with np.errstate(over="ignore"):
        extent = np.ptp(vertices, axis=1).max()
    if not _LEAST < extent < _LARGEST:
        raise MeshError(
            f"triangle mesh: the vertices extend over {extent:.3g} mm: specify "
            "coordinates in mm"
        )
    rounded = np.round(vertices / (_ONE * extent)).T
    _, first, number = np.unique(
        rounded, axis=0, return_index=True, return_inverse=True
    )
    triangles = number.reshape(-1)[triangles]
    a, b, c = triangles
    triangles = triangles[:, (a != b) & (b != c) & (c != a)]
    used, numbers = np.unique(triangles, return_inverse=True)
    if len(used) < FITTED:
        raise MeshError(
            f"triangle mesh: there are {len(used)} vertices, but at least {FITTED} "
            "are required"
        )
    return vertices[:, first[used]], numbers.reshape(triangles.shape)


def _vertex_normals(x: ndarray, triangles: ndarray) -> ndarray:
    """Unit normals at the vertices, weighted by area, shape (n, 3)."""
    a, b, c = x[triangles]
    area = np.cross(b - a, c - a)
    normals, around = np.zeros_like(x), np.zeros((len(x), 1))
    for corner in triangles:
        np.add.at(normals, corner, area)
        np.add.at(around, corner, np.linalg.norm(area, axis=1, keepdims=True))
    length = np.linalg.norm(normals, axis=1, keepdims=True)
    if not (length > _FACING * around).all():
        raise MeshError(
            "triangle mesh: the normals of the triangles at a vertex cancel: orient "
            "the triangles consistently"
        )
    return normals / length
