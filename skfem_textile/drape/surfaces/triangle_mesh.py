"""Surfaces of triangles, smoothed: the mean of quadrics at the vertices.

A quadric is fitted to the vertices around each vertex (`Quadrics`), so that normals and
curvatures are continuous.  φ is positive on the side to which the triangles face.
"""

from copy import copy

import numpy as np
from numpy import ndarray

from ...mesh.checks import MeshError
from ..elements import boundary_edges, closest_on_triangles
from ..tool_mesh import ToolMesh
from .quadrics import FITTED, Derivatives, Quadrics

# Reach of the weights over the mean length of the edges.  Chosen: with a smaller one
# points between vertices of long triangles have too few quadrics, with a larger one
# details are lost.
_REACH = 2.0

# Vertices closer than this share of the extent are one: STL repeats them per triangle,
# in single precision.
_ONE = 1e-6

# Least and largest extent in mm.  Chosen: squares of areas are finite, and not zero.
_LEAST, _LARGEST = 1e-50, 1e50

# Share of the mean edge by which a point may lie beyond the edges of the triangles.
# Chosen: a curved outline lies beyond its chords by a tenth of their length where it
# turns by 45° along them.
_BEYOND = 0.1

# Share of the mean edge by which the smoothed surface may be off the triangles.
# Chosen: even triangles on spheres, cylinders, cones and saddles are off by 0.06 at
# most with 320 triangles on a sphere; both sides of a thin shell, and triangles that
# are fourteen times as long as wide, by 0.25 and more.
_OFF = 0.1

# Share of the area around a vertex that its triangles must have in common: those of a
# sharp cone have a tenth, those that are oriented by chance next to nothing.
_FACING = 0.05


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
        edges = np.linalg.norm(
            self._x[triangles] - self._x[np.roll(triangles, 1, axis=0)], axis=2
        )
        self._edge = edges.mean()
        normals = _vertex_normals(self._x, triangles)
        self._quadrics = Quadrics(self._x, normals, _REACH * self._edge)
        self._kept: tuple[ndarray, Derivatives] | None = None

    @property
    def facets(self) -> ToolMesh:
        """The triangles as elements of a tool, without those that have no area."""
        a, b, c = self._x[self._triangles]
        area = np.linalg.norm(np.cross(b - a, c - a), axis=1)
        return ToolMesh(self._x.T, (self._triangles[:, area > 0],))

    def moved(self, origin: ndarray, turn: ndarray) -> "TriangleMesh":
        """The same surface in other axes.

        It is not fitted anew: of vertices at one distance the fit has some alone, and
        rounding tells which.

        Parameters
        ----------
        origin
            Their origin in mm, shape (3,).
        turn
            Their unit vectors, at right angles to each other, columns of shape (3, 3).
        """
        there = copy(self)
        there._x = (self._x - origin) @ turn
        there._quadrics, there._kept = self._quadrics.moved(origin, turn), None
        return there

    def beyond_edges(self, x: ndarray) -> ndarray:
        """How far points lie beyond the edges of the triangles in mm, shape (n,).

        0 where a point lies over the triangles, or beyond their edges by no more than a
        tenth of the mean edge.

        Parameters
        ----------
        x
            Points on the surface in mm, shape (3, n).
        """
        return self._away(x)[1]

    def off_triangles(self, x: ndarray) -> ndarray:
        """How far points on the smoothed surface are from the triangles in mm, (n,).

        0 where that is no more than a tenth of the mean edge, and beyond the edges.

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
        """Points as seen from the closest ones of the triangles, and `beyond_edges`."""
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
        """φ and its derivatives; those of the last positions are kept.

        An iteration asks for one after the other.
        """
        if self._kept is None or not np.array_equal(self._kept[0], x):
            self._kept = x.copy(), self._quadrics.mean(x)
        return self._kept[1]


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
    with np.errstate(over="ignore"):
        extent = np.ptp(vertices, axis=1).max()
    if not _LEAST < extent < _LARGEST:
        raise MeshError(
            f"a surface: its vertices extend over {extent:.3g} mm: give a file in mm"
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
            f"a surface: {len(used)} vertices are too few, {FITTED} at least"
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
