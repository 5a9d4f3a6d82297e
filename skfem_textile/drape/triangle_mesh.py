"""Surfaces of triangles, smoothed: a partition of unity of quadrics at the vertices.

At each vertex a quadric q_i(x) = w − (c₀ + c₁u + … + c₅v²) is fitted to the vertices
around it, u and v in its tangent plane and w along its normal.  φ is their mean with
smooth weights that vanish at a distance (Ohtake, Belyaev, Alexa, Turk & Seidel 2003,
Multi-level partition of unity implicits, ACM Trans. Graph. 22:463), so that normals and
curvatures are continuous.  φ is positive on the side to which the triangles face.
"""

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy import ndarray
from scipy.sparse import csr_matrix

from ..mesh.checks import MeshError
from .elements import boundary_edges, closest_on_triangles
from .tool_mesh import ToolMesh

if TYPE_CHECKING:
    from scipy.spatial import KDTree

# Reach of the weights over the mean length of the edges.  Chosen: with a smaller one
# points between vertices of long triangles have too few quadrics, with a larger one
# details are lost.
_REACH = 2.0

# Vertices to which a quadric is fitted: six coefficients, over-determined by a half
# where the mesh is regular, of two rings of neighbours and more.
_FITTED = 18

# Vertices closer than this share of the extent are one: STL repeats them per triangle,
# in single precision.
_ONE = 1e-6

# Share of the neighbourhood's size below which a quadric has no weight: what keeps the
# fit from failing where neighbours lie on a line.
_RIDGE = 1e-9

# Cosine of the angle between normals beyond which a vertex is of another side of a thin
# part, and no neighbour.
_OTHER_SIDE = 0.0

# Share of the mean edge by which a point may lie beyond the edges of the triangles.
# Chosen: a curved outline lies beyond its chords by a tenth of their length where it
# turns by 45° along them.
_BEYOND = 0.1

# Share of the area around a vertex that its triangles must have in common: those of a
# sharp cone have a tenth, those that are oriented by chance next to nothing.
_FACING = 0.05


class _Terms(NamedTuple):
    """Pairs of a point and a vertex that reaches it: numbers, weight and quadric.

    ``weight`` and ``value`` are (n_pairs,), their derivatives (n_pairs, 3) and
    (n_pairs, 3, 3).
    """

    point: ndarray
    weight: tuple[ndarray, ndarray, ndarray]
    value: tuple[ndarray, ndarray, ndarray]


class TriangleMesh:
    """A smooth surface through triangles.

    The triangles should be about as long as wide, and of about one size: edges and
    fillets smaller than two triangles are smoothed away.

    Parameters
    ----------
    vertices
        In mm, shape (3, n_vertices).  Those that coincide are merged.
    triangles
        Numbers of their vertices, anticlockwise seen from outside, shape (3, n).

    Raises
    ------
    MeshError
        If there are too few vertices, or numbers or positions are not valid.
    """

    def __init__(self, vertices: ndarray, triangles: ndarray) -> None:
        vertices, triangles = _merged(vertices, triangles)
        self._x, self._triangles = vertices.T, triangles
        from scipy.spatial import KDTree  # not imported for other drapes

        self._tree = KDTree(self._x)
        edges = np.linalg.norm(
            self._x[triangles] - self._x[np.roll(triangles, 1, axis=0)], axis=2
        )
        self._edge = edges.mean()
        self._reach = _REACH * self._edge
        normals = _vertex_normals(self._x, triangles)
        self._frames, self._c = _fitted(self._x, normals, self._tree)

    @property
    def facets(self) -> ToolMesh:
        """The triangles as elements of a tool, without those that have no area."""
        a, b, c = self._x[self._triangles]
        area = np.linalg.norm(np.cross(b - a, c - a), axis=1)
        return ToolMesh(self._x.T, (self._triangles[:, area > 0],))

    def beyond_edges(self, x: ndarray) -> ndarray:
        """How far points lie beyond the edges of the triangles in mm, shape (n,).

        0 where a point lies over the triangles, or beyond their edges by no more than a
        tenth of the mean edge.

        Parameters
        ----------
        x
            Points on the surface in mm, shape (3, n).
        """
        tool = self.facets
        (triangles,) = tool.cells
        triangle, shares = closest_on_triangles(tool.points, triangles, x)
        corners, normals = triangles[:, triangle], tool.normals()[:, triangle]
        away = x - (shares * tool.points[:, corners]).sum(axis=1)
        along = np.linalg.norm(away - (away * normals).sum(axis=0) * normals, axis=0)
        # Ends of the edge on which the closest point lies; at a corner they are one.
        held = np.where(
            shares > 0, corners, corners[shares.argmax(axis=0), range(len(along))]
        )
        ends = boundary_edges(tool.cells)
        edges = np.hstack([np.sort(ends, axis=0), ends[[0, 0]]])
        place = len(self._x), 1
        at_edge = np.isin(
            place @ np.array([held.min(axis=0), held.max(axis=0)]), place @ edges
        )
        at_edge &= (shares == 0).any(axis=0)
        return np.where(at_edge & (along > _BEYOND * self._edge), along, 0.0)

    def level(self, x: ndarray) -> ndarray:
        """φ, shape (n,)."""
        return self._mean(x)[0]

    def gradient(self, x: ndarray) -> ndarray:
        """∇φ, shape (3, n)."""
        return self._mean(x)[1].T

    def hessian(self, x: ndarray) -> ndarray:
        """∇²φ, shape (3, 3, n)."""
        return self._mean(x)[2].transpose(1, 2, 0)

    def _mean(self, x: ndarray) -> tuple[ndarray, ndarray, ndarray]:
        """φ = Σ w q / Σ w and its derivatives, shapes (n,), (n, 3) and (n, 3, 3)."""
        point, (w, dw, ddw), (q, dq, ddq) = self._terms(x)
        n = x.shape[1]
        places = np.ones(len(point)), (point, np.arange(len(point)))
        add = csr_matrix(places, (n, len(point)))

        def total(values: ndarray) -> ndarray:
            return (add @ values.reshape(len(point), -1)).reshape(n, *values.shape[1:])

        whole = total(w)
        level = total(w * q) / whole
        off = q - level[point]
        # Derivatives of Σ w (q − φ) = 0, whose terms in the derivatives of Σ w vanish.
        gradient = total(dw * off[:, None] + w[:, None] * dq) / whole[:, None]
        mixed = dw[:, :, None] * (dq - gradient[point])[:, None]
        second = total(
            ddw * off[:, None, None]
            + mixed
            + mixed.swapaxes(1, 2)
            + w[:, None, None] * ddq
        )
        return level, gradient, second / whole[:, None, None]

    def _terms(self, x: ndarray) -> _Terms:
        points = x.T
        near, _ = self._tree.query(points)
        # Far away the nearest vertex alone tells: the reach is a little longer.
        reach = np.maximum(self._reach, 1.5 * near)
        found = self._tree.query_ball_point(points, reach)
        counts = np.array([len(f) for f in found])
        point = np.repeat(np.arange(len(points)), counts)
        vertex = np.concatenate([np.asarray(f, dtype=int) for f in found])
        away = points[point] - self._x[vertex]
        return _Terms(point, _weight(away, reach[point]), self._quadric(vertex, away))

    def _quadric(
        self, vertex: ndarray, away: ndarray
    ) -> tuple[ndarray, ndarray, ndarray]:
        """The quadrics of vertices and their derivatives."""
        frame, c = self._frames[vertex], self._c[vertex].T
        u, v, w = np.einsum("nij,nj->in", frame, away)
        of_u, of_v = (c[1] + 2 * c[3] * u + c[4] * v, c[2] + c[4] * u + 2 * c[5] * v)
        value = w - c[0] - 0.5 * (u * (of_u + c[1]) + v * (of_v + c[2]))
        local = np.array([-of_u, -of_v, np.ones_like(u)])
        e, f = frame[:, 0], frame[:, 1]
        mixed = e[:, :, None] * f[:, None]
        second = -(
            2 * c[3][:, None, None] * e[:, :, None] * e[:, None]
            + c[4][:, None, None] * (mixed + mixed.swapaxes(1, 2))
            + 2 * c[5][:, None, None] * f[:, :, None] * f[:, None]
        )
        return value, np.einsum("in,nij->nj", local, frame), second


def _weight(away: ndarray, reach: ndarray) -> tuple[ndarray, ndarray, ndarray]:
    """Wendland's C⁴ function of the distance over the reach, and its derivatives.

    With s = r/R it is (1 − s)⁶ (35 s² + 18 s + 3); of its argument away, shape (n, 3).
    """
    s = np.minimum(np.linalg.norm(away, axis=1) / reach, 1.0)
    squared = reach**2
    value = (1 - s) ** 6 * (35 * s * s + 18 * s + 3)
    slope = -56 * (1 - s) ** 5 * (5 * s + 1) / squared  # w′/(r R) over R
    bend = 1680 * (1 - s) ** 4 / squared**2
    outer = away[:, :, None] * away[:, None]
    second = slope[:, None, None] * np.eye(3) + bend[:, None, None] * outer
    return value, slope[:, None] * away, second


def _merged(vertices: ndarray, triangles: ndarray) -> tuple[ndarray, ndarray]:
    """Vertices without repetition, and triangles that are not degenerate.

    Raises
    ------
    MeshError
        If they are no surface.
    """
    vertices = np.asarray(vertices, dtype=float)
    triangles = np.asarray(triangles, dtype=int)
    if vertices.ndim != 2 or len(vertices) != 3 or not np.isfinite(vertices).all():
        raise MeshError("a surface: vertices must be finite, shape (3, n)")
    if triangles.ndim != 2 or len(triangles) != 3 or not triangles.size:
        raise MeshError("a surface: triangles must be numbers of vertices, (3, n)")
    if triangles.min() < 0 or triangles.max() >= vertices.shape[1]:
        raise MeshError("a surface: a triangle has a vertex that is not there")
    extent = np.ptp(vertices, axis=1).max()
    rounded = np.round(vertices / (_ONE * extent or 1.0)).T
    _, first, number = np.unique(
        rounded, axis=0, return_index=True, return_inverse=True
    )
    triangles = number.reshape(-1)[triangles]
    a, b, c = triangles
    triangles = triangles[:, (a != b) & (b != c) & (c != a)]
    used, numbers = np.unique(triangles, return_inverse=True)
    if len(used) < _FITTED:
        raise MeshError(
            f"a surface: {len(used)} vertices are too few, {_FITTED} at least"
        )
    return vertices[:, first[used]], numbers.reshape(triangles.shape)


def _vertex_normals(x: ndarray, triangles: ndarray) -> ndarray:
    """Unit normals at the vertices, weighted by area, shape (n, 3).

    Raises
    ------
    MeshError
        If the triangles around a vertex face each other.
    """
    a, b, c = x[triangles]
    area = np.cross(b - a, c - a)
    normals, around = np.zeros_like(x), np.zeros((len(x), 1))
    for corner in triangles:
        np.add.at(normals, corner, area)
        np.add.at(around, corner, np.linalg.norm(area, axis=1, keepdims=True))
    length = np.linalg.norm(normals, axis=1, keepdims=True)
    if not (length > _FACING * around).all():
        raise MeshError(
            "a surface: triangles at a vertex face each other, orient them alike"
        )
    return normals / length


def _fitted(x: ndarray, normals: ndarray, tree: "KDTree") -> tuple[ndarray, ndarray]:
    """Frames of the vertices, rows (n, 3, 3), and coefficients of quadrics, (n, 6)."""
    axis = np.eye(3)[np.abs(normals).argmin(axis=1)]
    u = np.cross(normals, axis)
    u /= np.linalg.norm(u, axis=1, keepdims=True)
    frames = np.stack([u, np.cross(normals, u), normals], axis=1)
    _, near = tree.query(x, _FITTED)
    local = np.einsum("nij,nkj->nki", frames, x[near] - x[:, None])
    size = np.linalg.norm(local, axis=2).max(axis=1)
    a, b, h = (local / size[:, None, None]).transpose(2, 0, 1)
    rows = np.stack([np.ones_like(a), a, b, a * a, a * b, b * b], axis=2)
    facing = np.einsum("nkj,nj->nk", normals[near], normals) > _OTHER_SIDE
    weight = facing * np.exp(-2 * (a * a + b * b))
    normal = np.einsum("nki,nk,nkj->nij", rows, weight, rows)
    right = np.einsum("nki,nk,nk->ni", rows, weight, h)
    c = np.linalg.solve(normal + _RIDGE * np.eye(6), right[:, :, None])[:, :, 0]
    degrees = np.array([0, 1, 1, 2, 2, 2])
    return frames, c * size[:, None] ** (1 - degrees)
