"""Smoothed triangulated surfaces.

A quadric is fitted to the vertices around each vertex (`Quadrics`), so that normals and
curvatures are continuous.  φ is positive on the side that the triangles face.
"""

from copy import copy
from functools import cached_property

import numpy as np
from numpy import ndarray

from ..mesh.checks import MeshError
from ..mesh.graph import boundary_edges
from ..mesh.user_input import coords
from .holes import filled, turning
from .quadrics import FITTED, Quadrics
from .repair import area_vectors, mean_edge, repaired
from .tool_mesh import ElementTree, ToolMesh, closest_on_triangles

# Number of positions for which values are kept in memory: a Newton iteration returns to
# the last state after a trial step.
_KEPT = 2

# Support radius of the weights, relative to the mean edge length.  With a smaller one,
# points between vertices of long triangles have too few quadrics; with a larger one,
# details are lost.
_REACH = 2.0

# Tolerance for points beyond the edges of the triangles, relative to the mean edge.  A
# curved outline deviates from chords of 45° by a tenth of their length.
_BEYOND = 0.1

# Tolerance for the deviation of the smoothed surface from the triangles, relative to
# the mean edge.  Regular triangles on spheres, cylinders, cones and saddles deviate by
# at most 0.06 with 320 triangles on a sphere; both sides of a thin shell, and triangles
# with an aspect ratio of fourteen, by 0.25 and more.
_OFF = 0.1

# Smallest ratio of the vector area around a vertex to the total area of its triangles:
# a tenth for a sharp cone, virtually zero for a spike.
_FACING = 0.05

# Standard deviation of white noise, relative to the median difference of the offsets of
# quadrics from their vertices along edges: 1.25 to 1.35 on 12 shapes.
_OF_OFFSETS = 1.3

# Noise, relative to the mean edge, that is reported, and that is refused; the largest
# error of shear angles in degrees per noise.  Measured with nets of 24×24 and 32×32
# cells: at most 75 with scattered triangles of 12 shapes (`python -m studies tools`),
# at most 125 with white noise on a hat (`pytest tests/surfaces/test_tool_repair.py`).
_NOISE, _MOST_NOISE, _SHEAR_ERROR = 0.007, 0.1, 150.0

# Height over a vertex, in mean edges, from which the side of the surface is certain.
_FAR_AWAY = 2.0


class TriangleMesh:
    """Smooth surface through triangles.

    The triangles should be nearly equilateral and of similar size: edges and fillets
    smaller than two triangles are smoothed.

    Parameters
    ----------
    vertices
        Vertices in mm, shape (3, n_vertices).  Copies of a vertex, within a tolerance
        that follows from the edges around it, are merged.
    triangles
        Vertex numbers, anticlockwise as seen from outside, shape (3, n).  Triangles
        that face the other way than their neighbours are turned.

    Attributes
    ----------
    remarks
        A line for each repair of the triangles, and for each property that affects
        results, such as holes and noise.

    Raises
    ------
    MeshError
        If there are too few vertices, numbers or positions are not valid, the triangles
        do not meet or are not a surface with two sides, or the mesh is a thin shell or
        too rough.

    Examples
    --------
    >>> import numpy as np
    >>> from skfem_textile import drape
    >>> s = np.linspace(-50.0, 50.0, 21)
    >>> x, y = (a.ravel() for a in np.meshgrid(s, s))
    >>> k = np.add.outer(21 * np.arange(20), np.arange(20)).ravel()
    >>> t = np.hstack([[k, k + 1, k + 22], [k, k + 22, k + 21]])
    >>> t[:, 7] = t[::-1, 7]
    >>> drape.TriangleMesh(np.array([x, y, 0 * x]), t).remarks
    ('1 of 800 triangles turned to the side of the others',)
    """

    def __init__(self, vertices: ndarray, triangles: ndarray) -> None:
        vertices, triangles, remarks = repaired(vertices, triangles, FITTED)
        self._x, self._triangles = vertices.T, triangles
        self._edge = mean_edge(self._x, triangles)
        normals = _vertex_normals(self._x, triangles)
        self._quadrics = Quadrics(self._x, normals, _REACH * self._edge)
        self._kept: list[tuple[ndarray, tuple[ndarray, ...]]] = []
        self.remarks = tuple(filter(None, (*remarks, self._of_noise())))

    def _of_noise(self) -> str:
        """Remark about vertices that scatter about a smooth surface."""
        offset = self._quadrics.offsets()
        ends = np.array([self._triangles, np.roll(self._triangles, 1, axis=0)])
        change = np.abs(offset[ends[0]] - offset[ends[1]])
        noise = _OF_OFFSETS * float(np.median(change))
        if noise > _NOISE * self._edge:
            text = (
                f"the vertices scatter by {noise:.2g} mm, {noise / self._edge:.2g} of "
                "the mean edge, about a smooth surface, because of noise or of details "
                "smaller than two triangles"
            )
            if noise > _MOST_NOISE * self._edge:
                raise MeshError(
                    f"triangle mesh: {text}: smooth the surface, or export it with "
                    "smaller triangles"
                )
            error = _SHEAR_ERROR * noise / self._edge
            return f"{text}: errors of shear angles may reach {error:.1g} degrees"
        worst = int(np.abs(offset).argmax())
        if abs(offset[worst]) > _OFF * self._edge:
            return (
                f"the vertex at {coords(self._x[worst])} mm is {abs(offset[worst]):.2g}"
                " mm away from the smooth surface through its neighbours: sharp edges "
                "are rounded there, unless the vertex is wrong"
            )
        return ""

    @cached_property
    def facets(self) -> ToolMesh:
        """The triangles as elements of a tool, without degenerate ones."""
        area = np.linalg.norm(area_vectors(self._x, self._triangles), axis=1)
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
        for kept in ("facets", "_edges"):
            moved.__dict__.pop(kept, None)
        moved._x = (self._x - origin) @ turn
        moved._quadrics, moved._kept = self._quadrics.moved(origin, turn), []
        return moved

    def without_holes(self) -> "TriangleMesh":
        """The surface with smooth patches over its holes.

        For nets that are laid over a hole and trimmed by it.  Ends of tubes are not
        holes: a patch there would turn by more than π.  If a part has no other edge,
        its longest is its outer edge.  The triangles of a patch have the size of its
        edges.

        Raises
        ------
        MeshError
            If edges of holes meet at a vertex.

        Examples
        --------
        >>> import numpy as np
        >>> from skfem_textile import drape
        >>> s = np.linspace(-50.0, 50.0, 21)
        >>> x, y = (a.ravel() for a in np.meshgrid(s, s))
        >>> k = np.add.outer(21 * np.arange(20), np.arange(20)).ravel()
        >>> t = np.hstack([[k, k + 1, k + 22], [k, k + 22, k + 21]])
        >>> outside = np.hypot(x, y)[t].min(axis=0) > 20
        >>> ring = drape.TriangleMesh(np.array([x, y, 0 * x]), t[:, outside])
        >>> len(ring.facets.boundary()), len(ring.without_holes().facets.boundary())
        (2, 1)
        """
        return TriangleMesh(*filled(self._x.T, self._triangles))

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
        near = self._edges.near(x)
        beyond[near] = self._away(x[:, near])[1]
        return beyond

    def from_triangles(self, x: ndarray) -> ndarray:
        """Distances of points, (3, n), from the triangles in mm, shape (n,)."""
        return np.asarray(np.linalg.norm(self._away(x)[0], axis=0))

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
        tool, edges = self.facets, self._edges
        (triangles,) = tool.cells
        triangle, shares = closest_on_triangles(
            tool.points, triangles, x, edges.elements
        )
        corners, normals = triangles[:, triangle], edges.normals[:, triangle]
        away = x - (shares * tool.points[:, corners]).sum(axis=1)
        along = np.linalg.norm(away - (away * normals).sum(axis=0) * normals, axis=0)
        # Ends of the edge on which the closest point lies; equal at a corner.
        edge = np.where(
            shares > 0, corners, corners[shares.argmax(axis=0), range(len(along))]
        )
        code = edge.min(axis=0) * len(self._x) + edge.max(axis=0)
        at_edge = np.isin(code, edges.codes) & (shares == 0).any(axis=0)
        beyond = at_edge & (along > _BEYOND * self._edge)
        return away, np.where(beyond, along, 0.0)

    @cached_property
    def _edges(self) -> "_Edges":
        return _Edges(self.facets)

    @cached_property
    def curvature(self) -> ndarray:
        """Gauss curvature of the vertices, 2π less the angles there in radians, (n,).

        0 at edges.
        """
        curvature = np.pi + turning(self._x.T, self.facets.triangles())
        curvature[np.unique(boundary_edges(self.facets.cells))] = 0.0
        return curvature

    def curvature_within(self, x: ndarray, radius: float) -> ndarray:
        """Integral of the curvature over balls around points, in radians, (n,)."""
        from scipy.spatial import KDTree

        curved = np.flatnonzero(self.curvature)
        pairs = KDTree(x.T).query_ball_tree(KDTree(self._x[curved]), radius)
        return np.array([self.curvature[curved[of]].sum() for of in pairs])

    def far_away(self, x: ndarray) -> tuple[ndarray, ndarray]:
        """Side of the tool of points far away, 0 near it, and the normal there.

        Without evaluating φ: the sign of the height over the nearest vertex, 0 for
        heights up to twice the mean edge; and its normal, shapes (n,) and (3, n).
        """
        heights, normals = self._quadrics.heights(x)
        far = np.abs(heights) > _FAR_AWAY * self._edge
        return np.where(far, np.sign(heights), 0.0), normals

    def level(self, x: ndarray) -> ndarray:
        """φ, shape (n,)."""
        return self._mean(x)[0]

    def gradient(self, x: ndarray) -> ndarray:
        """∇φ, shape (3, n)."""
        return self._mean(x)[1]

    def hessian(self, x: ndarray) -> ndarray:
        """∇²φ, shape (3, 3, n)."""
        return self._mean(x)[2]

    def first_order(self, x: ndarray) -> tuple[ndarray, ndarray]:
        """φ and ∇φ, shapes (n,) and (3, n), in less time than with ∇²φ."""
        level, gradient = self._quadrics.mean(x, order=1)
        return level, gradient

    def _mean(self, x: ndarray) -> tuple[ndarray, ...]:
        """φ, ∇φ and ∇²φ; the last evaluations are kept."""
        for at, mean in self._kept:
            if np.array_equal(at, x):
                return mean
        mean = self._quadrics.mean(x)
        self._kept = [(x.copy(), mean), *self._kept[: _KEPT - 1]]
        return mean


class _Edges:
    """Search trees of the elements of a tool, and of its open edges.

    ``codes`` are the numbers low · n + high of the end nodes of these edges, and of the
    nodes themselves, ``normals`` the normals of the elements.
    """

    def __init__(self, tool: ToolMesh) -> None:
        from scipy.spatial import KDTree  # imported only if needed

        self.elements = ElementTree(tool.points[:, tool.triangles()])
        self.normals = tool.normals()
        begin, end = np.sort(boundary_edges(tool.cells), axis=0)
        n, x = tool.points.shape[1], tool.points
        self.codes = np.hstack([begin * n + end, begin * n + begin, end * n + end])
        self._nodes, self._middles = KDTree(x.T), None
        if begin.size:
            self._middles = KDTree(0.5 * (x[:, begin] + x[:, end]).T)
            self._half = 0.5 * np.linalg.norm(x[:, begin] - x[:, end], axis=0).max()

    def near(self, x: ndarray) -> ndarray:
        """Indices of points that may be closest to an open edge.

        No point of an edge is closer than its middle by more than half of its length,
        and the tool is at most as far away as its nearest node.
        """
        if self._middles is None:
            return np.zeros(0, dtype=int)
        to_edge = self._middles.query(x.T)[0] - self._half
        return np.flatnonzero(to_edge <= self._nodes.query(x.T)[0])


def _vertex_normals(x: ndarray, triangles: ndarray) -> ndarray:
    """Unit normals at the vertices, weighted by area, shape (n, 3)."""
    area = area_vectors(x, triangles)
    normals, around = np.zeros_like(x), np.zeros((len(x), 1))
    for corner in triangles:
        np.add.at(normals, corner, area)
        np.add.at(around, corner, np.linalg.norm(area, axis=1, keepdims=True))
    length = np.linalg.norm(normals, axis=1, keepdims=True)
    if not (length > _FACING * around).all():
        place = x[(length / np.maximum(around, 1e-300)).argmin()]
        raise MeshError(
            f"triangle mesh: the triangles at the vertex {coords(place)} mm are folded "
            "onto each other, like a spike: correct this vertex"
        )
    return normals / length
