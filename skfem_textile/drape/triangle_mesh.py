"""Smoothed triangulated surfaces: weighted mean of quadrics at the vertices.

A quadric is fitted to the vertices around each vertex (`Quadrics`), so that normals and
curvatures are continuous.  φ is positive on the side that the triangles face.

A quadric q_i(x) = w − (c₀ + c₁u + … + c₅v²) belongs to each vertex x_i, with the
coordinates u and v in its tangent plane and w along its normal.  φ is their mean with
smooth weights of finite support (Ohtake, Belyaev, Alexa, Turk & Seidel 2003,
Multi-level partition of unity implicits, ACM Trans.  Graph.  22:463).
"""

from copy import copy
from typing import NamedTuple

import numpy as np
from numpy import ndarray

from ..mesh.checks import MeshError
from .sheet import boundary_edges, closest_on_triangles
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

# Distance from the nearest vertex, relative to the reach, up to which neighbours are
# listed in advance: 1/√3 of an edge, for the centres of equilateral triangles, and a
# tenth of an edge for points that are not exactly on the surface.
_AROUND = (3**-0.5 + 0.1) / 2.0

# Maximum length of these lists, twice the mean of equal triangles, and number of pairs
# of position and neighbour per block.
_NEIGHBOURS, _PAIRS = 52, 16384

# Number of positions for which values are kept: a Newton iteration returns to the last
# state after a trial step.
_KEPT = 2

# Coordinates of missing neighbours in mm, whose weight is zero.
_MISSING = 1e100


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
        # The vertices within the reach of each point whose nearest vertex is this one.
        around = reach * _AROUND
        within = reach + around
        count = self._tree.query_ball_point(points, within, return_length=True)
        most = min(_NEIGHBOURS, count.max())
        self._near = self._tree.query(points, most, distance_upper_bound=within)[1]
        self._around = np.where(count > most, 0.0, around)

    def _set(self, points: ndarray, a: ndarray, b: ndarray, H: ndarray) -> None:
        """Store quadrics, shapes (n, 3), (n,), (n, 3) and (n, 3, 3), as polynomials.

        Their origin is the mean of the points, near which round-off is smallest.
        """
        self._quadrics = points, a, b, H
        self._origin = points.mean(axis=0)
        x = points - self._origin
        Hx = np.einsum("nij,nj->ni", H, x)
        level = a + ((0.5 * Hx - b) * x).sum(axis=1)
        rows = np.column_stack([level, b - Hx, H[:, *_UPPER], x, np.ones(len(x))])
        # The last row represents missing neighbours.
        missing = np.repeat([0.0, _MISSING, 1.0], [10, 3, 1])
        self._table = np.vstack([rows, missing])

    def moved(self, origin: ndarray, turn: ndarray) -> "Quadrics":
        """The same quadrics in axes with an origin, (3,), and directions, (3, 3)."""
        from scipy.spatial import KDTree

        points, a, b, H = self._quadrics
        moved = copy(self)
        points = (points - origin) @ turn
        moved._tree = KDTree(points)
        moved._set(points, a, b @ turn, turn.T @ H @ turn)
        return moved

    def mean(self, x: ndarray) -> Derivatives:
        """φ = Σ w q / Σ w and its derivatives at positions, shape (3, n)."""
        n = x.shape[1]
        mean = Derivatives(*(np.full((*[3] * i, n), np.nan) for i in range(3)))
        distance, nearest = self._tree.query(x.T)
        finite = np.isfinite(distance)  # its square may overflow: the values are NaN
        # Far away only the nearest points contribute: the reach slightly exceeds
        # their distance.
        reach = np.maximum(self._reach, _FAR * distance)
        listed = finite & (distance <= np.append(self._around, 0.0)[nearest])
        count = np.full(n, self._near.shape[1])
        others = np.flatnonzero(finite & ~listed)
        if others.size:
            count[others] = self._tree.query_ball_point(
                x[:, others].T, reach[others], return_length=True
            )
            others = others[np.argsort(count[others])]
        for left in np.flatnonzero(listed), others:
            while left.size:
                k = count[left[-1]]
                left, some = np.split(left, [-max(_PAIRS // k, 1)])
                if listed[some[0]]:
                    near = self._near[nearest[some]]
                else:
                    near = self._tree.query(x[:, some].T, k)[1].reshape(-1, k)
                block = self._mean(x[:, some], near, reach[some])
                for values, part in zip(mean, block, strict=True):
                    values[..., some] = part
        for values in mean:
            values.setflags(write=False)
        return mean

    def _mean(self, x: ndarray, near: ndarray, reach: ndarray) -> Derivatives:
        """Weighted mean of k quadrics at each of n positions.

        Arguments are the indices of the quadrics, (n, k), of which the nearest is the
        first where the reach depends on it, and the reach, (n,).
        """
        x, reach = x - self._origin[:, None], reach[:, None]
        terms = (_monomials(x).T @ _FACTORS).reshape(-1, 7, 14)
        c = self._table[near]
        # Values and gradients of the quadrics, and the vectors d from their points.
        q, dq, d = np.split(terms @ c.swapaxes(1, 2), [1, 4], axis=1)
        s = np.minimum(np.sqrt(np.einsum("nik,nik->nk", d, d)) / reach, 1.0)
        # Wendland's C⁴ function w = (1 − s)⁶ (35 s² + 18 s + 3), slope = w′/s and bend
        # = slope′/s. With m = s ∇s: ∇w = slope m, ∇²w = bend m m + slope ∇m, ∇m = I (1
        # − s²R²/r₁²)/R² − 2 (m ρ + ρ m), r₁ to the nearest point.
        inside = 1 - s
        square = inside * inside
        fourth = square * square
        w = fourth * square * ((35 * s + 18) * s + 3)
        slope = fourth * inside * (-280 * s - 56)
        bend = 1680 * fourth
        total = w.sum(axis=1)
        level = np.einsum("nk,nk->n", w, q[:, 0]) / total
        # Derivatives of Σ w (q − φ) = 0, whose terms in the derivatives of Σ w vanish.
        off = q[:, 0] - level[:, None]
        of_w = slope * off
        m, grown = d / (reach**2)[:, None], of_w
        # If the reach depends on the nearest point: the gradient ρ of its logarithm.
        follows = reach > self._reach
        if far := bool(follows.any()):
            first = x.T - self._table[near[:, 0], 10:13]
            rho = (follows * first * (_FAR / reach) ** 2)[:, :, None]
            m -= (s * s)[:, None] * rho
            grown = of_w * (1 - follows * (_FAR * s) ** 2)
        gradient = (m @ of_w[:, :, None] + dq @ w[:, :, None]) / total[:, None, None]
        turned = (0.5 * bend * off)[:, None] * m + slope[:, None] * (dq - gradient)
        if far:
            turned -= (2 * of_w)[:, None] * rho
        half = m @ turned.swapaxes(1, 2)
        second = half + half.swapaxes(1, 2) + (w[:, None] @ c)[:, 0, 4 + _SYMMETRIC]
        second += (grown.sum(axis=1) / reach[:, 0] ** 2)[:, None, None] * np.eye(3)
        second /= total[:, None, None]
        return Derivatives(level, gradient[:, :, 0].T, second.transpose(1, 2, 0))


# Second derivatives xx, yy, zz, yz, xz, xy in a matrix, and their numbers in it.
_UPPER = [0, 1, 2, 1, 0, 0], [0, 1, 2, 2, 2, 1]
_SYMMETRIC = np.array([[0, 5, 4], [5, 1, 3], [4, 3, 2]])


def _factors() -> ndarray:
    """Factors of the table of quadrics in q, ∇q and d, from monomials: (10, 7, 14)."""
    factors, i = np.zeros((10, 7, 14)), np.arange(3)
    factors[range(10), 0, range(10)] = 1.0
    factors[0, 1 + i, 1 + i] = 1.0
    factors[1 + i, 1 + i[:, None], 4 + _SYMMETRIC] = 1.0
    factors[0, 4 + i, 10 + i], factors[1 + i, 4 + i, 13] = -1.0, 1.0
    return factors


def _monomials(x: ndarray) -> ndarray:
    """1, x, y, z, x²/2, y²/2, z²/2, yz, xz and xy, shape (10, n)."""
    one = np.ones((1, x.shape[1]))
    return np.concatenate([one, x, 0.5 * x * x, x[[1, 0, 0]] * x[[2, 2, 1]]])


_FACTORS = _factors().reshape(10, -1)


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

    @property
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
        return self._away(x)[1]

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
        triangle, shares = closest_on_triangles(tool.points, triangles, x)
        corners, normals = triangles[:, triangle], tool.normals()[:, triangle]
        away = x - (shares * tool.points[:, corners]).sum(axis=1)
        along = np.linalg.norm(away - (away * normals).sum(axis=0) * normals, axis=0)
        # Ends of the edge on which the closest point lies; equal at a corner.
        edge = np.where(
            shares > 0, corners, corners[shares.argmax(axis=0), range(len(along))]
        )
        ends = boundary_edges(tool.cells)
        edges = np.hstack([np.sort(ends, axis=0), ends[[0, 0]]])
        weights = len(self._x), 1
        at_edge = np.isin(
            weights @ np.array([edge.min(axis=0), edge.max(axis=0)]), weights @ edges
        )
        at_edge &= (shares == 0).any(axis=0)
        beyond = at_edge & (along > _BEYOND * self._edge)
        return away, np.where(beyond, along, 0.0)

    def level(self, x: ndarray) -> ndarray:
        """φ, shape (n,)."""
        return self._mean(x).level

    def gradient(self, x: ndarray) -> ndarray:
        """∇φ, shape (3, n)."""
        return self._mean(x).gradient

    def hessian(self, x: ndarray) -> ndarray:
        """∇²φ, shape (3, 3, n)."""
        return self._mean(x).hessian

    def _mean(self, x: ndarray) -> Derivatives:
        """φ and its derivatives, which an iteration uses one after the other."""
        for at, mean in self._kept:
            if np.array_equal(at, x):
                return mean
        mean = self._quadrics.mean(x)
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
