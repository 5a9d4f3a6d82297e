"""Elements in space, those closest to points, and triangulation of surfaces."""

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from itertools import chain, permutations

import numpy as np
from numpy import ndarray
from skfem import ElementH1, ElementQuad1, ElementTriP1

from ..mesh.checks import MeshError
from ..mesh.graph import boundary_edges
from ..mesh.user_input import keep_copies, real_numbers
from .surface import GrowingSurface, OffSurfaceError, Surface, onto

# Largest number of iterations for the foot of a perpendicular on an element.  On a
# square twisted by 30° the error for a point at a tenth of a side is 1e-8 of it.
_ITERATIONS = 12

# Round-off of local coordinates, of squared distances relative to the squared distance
# of the centre, and of squared edges: it also regularises steps beyond the edges of a
# strongly bent element.
_ROUND_OFF = 1e-12


@dataclass(frozen=True, eq=False)
class Elements:
    """Triangles or quadrilaterals, by node numbers, (n_corners, n).

    Local coordinates follow scikit-fem, from 0 to 1.
    """

    nodes: ndarray

    def feet(self, positions: ndarray, points: ndarray, element: ndarray) -> ndarray:
        """Orthogonal projections of points onto elements, possibly beyond their edges.

        Returns local coordinates, shape (2, n).
        """
        centre = self.corners.mean(axis=0)[:, None]
        local, left = np.tile(centre, len(element)), np.arange(len(element))
        for _ in range(_ITERATIONS):
            before, some = local[:, left], element[left]
            away = points[:, left] - self.between(positions, some, before)
            slopes = self.slopes(positions, some, before)
            normal = np.einsum("ijn,ikn->njk", slopes, slopes)
            size = np.trace(normal, axis1=1, axis2=2)
            normal += _ROUND_OFF * size[:, None, None] * np.eye(2)
            right = np.einsum("ijn,in->nj", slopes, away)
            step = np.linalg.solve(normal, right[:, :, None])[:, :, 0].T
            # Far beyond its edges the mapping of an element is meaningless.
            local[:, left] = np.clip(before + step, -1.0, 2.0)
            left = left[np.abs(local[:, left] - before).max(axis=0) > _ROUND_OFF]
            if not left.size:
                break
        return local

    def beyond(self, local: ndarray) -> ndarray:
        """Distance of local coordinates beyond each side, 0 inside: (n_corners, n)."""
        x, y = local
        quad = len(self.nodes) == 4
        sides = [-y, x - 1, y - 1, -x] if quad else [-y, x + y - 1, -x]
        return np.maximum(sides, 0.0)

    def inside(self, local: ndarray) -> ndarray:
        """Local coordinates clipped to an element."""
        local = np.clip(local, 0.0, 1.0)
        if len(self.nodes) == 4:
            return local
        return local / np.maximum(local.sum(axis=0), 1.0)

    def between(self, values: ndarray, element: ndarray, local: ndarray) -> ndarray:
        """Nodal values, shape (..., n_nodes), at local coordinates of elements."""
        shares, _ = self._shapes(local)
        nodes = self.nodes[:, element]
        return sum(N * values[..., node] for N, node in zip(shares, nodes, strict=True))

    def slopes(self, values: ndarray, element: ndarray, local: ndarray) -> ndarray:
        """Derivatives of nodal vectors in local coordinates, shape (d, 2, n)."""
        _, slopes = self._shapes(local)
        nodes = self.nodes[:, element]
        return sum(
            values[:, None, node] * dN for dN, node in zip(slopes, nodes, strict=True)
        )

    def _shapes(self, local: ndarray) -> tuple[list[ndarray], list[ndarray]]:
        """Shape functions of the corners, (n,), and their derivatives, (2, n)."""
        shapes = [self._shape().lbasis(local, i) for i in range(len(self.nodes))]
        return [N for N, _ in shapes], [dN for _, dN in shapes]

    @property
    def corners(self) -> ndarray:
        """Local coordinates of the corners, shape (n_corners, 2)."""
        return self._shape().doflocs

    def _shape(self) -> ElementH1:
        """scikit-fem element."""
        return ElementQuad1() if len(self.nodes) == 4 else ElementTriP1()


def unit(v: ndarray) -> ndarray:
    """Normalised columns."""
    return v / np.linalg.norm(v, axis=0)


def edge_lengths(positions: ndarray, elements: ndarray) -> ndarray:
    """Lengths of the edges of elements, shape (n_corners, n_elements)."""
    x = positions[:, elements]
    return np.linalg.norm(np.roll(x, -1, axis=1) - x, axis=0)


def pairs_of(lists: ndarray) -> tuple[ndarray, ndarray]:
    """Pairs of the index of a list and a number in it, of lists of integers."""
    counts = np.fromiter(map(len, lists), dtype=int, count=len(lists))
    numbers = np.fromiter(chain.from_iterable(lists), dtype=int)
    return np.repeat(np.arange(len(lists)), counts), numbers


class ElementTree:
    """Search trees for elements near points, by corners of shape (3, n_corners, n).

    There is one for each order of magnitude of their radii.
    """

    def __init__(self, corners: ndarray) -> None:
        from scipy.spatial import KDTree  # imported only if needed

        centres = corners.mean(axis=1)
        self.radii = np.linalg.norm(corners - centres[:, None], axis=0).max(axis=0)
        size = np.frexp(self.radii)[1]
        parts = [np.flatnonzero(size == own) for own in np.unique(size)]
        self._trees = [(part, KDTree(centres[:, part].T)) for part in parts]

    def pairs(
        self, points: ndarray, reach: ndarray | float = np.inf
    ) -> tuple[ndarray, ndarray]:
        """Numbers of points, (3, n), each with all candidates for its nearest element.

        The nearest element is at most as far away as the nearest centre.
        """
        nearest = [tree.query(points.T)[0] for _, tree in self._trees]
        most = np.minimum(reach, np.min(nearest, axis=0))
        pairs = []
        for part, tree in self._trees:
            near = tree.query_ball_point(points.T, self.radii[part].max() + most)
            point, number = pairs_of(near)
            pairs.append((point, part[number]))
        point, element = np.hstack(pairs)
        order = np.lexsort([element, point])
        return point[order], element[order]


def closest_on_triangles(
    positions: ndarray,
    triangles: ndarray,
    points: ndarray,
    tree: ElementTree | None = None,
) -> tuple[ndarray, ndarray]:
    """Closest triangle to each point, (n,), and barycentric coordinates there, (3, n).

    Points have the shape (3, n).  ``tree`` is the search tree of the triangles, built
    if not given.
    """
    corners = positions[:, triangles]
    tree = tree or ElementTree(corners)
    point, triangle = tree.pairs(points)
    possible = _may_be_closest(corners, tree.radii, points, point, triangle)
    point, triangle = point[possible], triangle[possible]
    shares, distance = _closest(corners[..., triangle], points[:, point])
    order = np.lexsort([distance, point])
    first = order[np.flatnonzero(np.diff(point[order], prepend=-1))]
    return triangle[first], shares[:, first]


def _may_be_closest(
    corners: ndarray,
    radii: ndarray,
    points: ndarray,
    point: ndarray,
    triangle: ndarray,
) -> ndarray:
    """Mask of pairs whose triangle may be the closest to its point, shape (n_pairs,).

    A triangle is within its radius of its centre, and in its plane.  With the height h
    of a point over the plane, and the distance τ of its foot from the centre, no point
    of the triangle is closer than √(h² + (τ − r)²), or h for τ < r: many triangles
    face a point far away, but few of them are below it.
    """
    a, b, c = corners.swapaxes(0, 1)
    centres, normals = corners.mean(axis=1), np.cross(b - a, c - a, axis=0)
    normals /= np.maximum(np.linalg.norm(normals, axis=0), np.finfo(float).tiny)
    away = points[:, point] - centres[:, triangle]
    square = np.einsum("ip,ip->p", away, away)
    height = np.einsum("ip,ip->p", away, normals[:, triangle]) ** 2
    along = np.sqrt(np.maximum(square - height, 0.0))
    least = height + np.maximum(along - radii[triangle], 0.0) ** 2
    first = np.flatnonzero(np.diff(point, prepend=-1))
    most = np.repeat(
        np.minimum.reduceat(square, first), np.diff(first, append=len(point))
    )
    return least <= most + _ROUND_OFF * square


def _closest(corners: ndarray, points: ndarray) -> tuple[ndarray, ndarray]:
    """Barycentric coordinates of closest points, and squared distances.

    Corners have the shape (3, 3, n), with the corner number on the second axis.
    """
    a, b, c = corners.swapaxes(0, 1)
    along, across, away = b - a, c - a, points - a
    aa, ac, cc = (
        (p * q).sum(axis=0)
        for p, q in ((along, along), (along, across), (across, across))
    )
    pa, pc = ((away * edge).sum(axis=0) for edge in (along, across))
    twice = aa * cc - ac * ac
    s, t = (cc * pa - ac * pc) / twice, (aa * pc - ac * pa) / twice
    shares = np.array([1 - s - t, s, t])
    distance = ((away - s * along - t * across) ** 2).sum(axis=0)
    distance[(shares < 0).any(axis=0)] = np.inf
    for k in range(3):
        m = (k + 1) % 3
        edge, from_start = corners[:, m] - corners[:, k], points - corners[:, k]
        share = (from_start * edge).sum(axis=0) / (edge * edge).sum(axis=0)
        share = np.clip(share, 0.0, 1.0)
        on_edge = ((from_start - share * edge) ** 2).sum(axis=0)
        closer = on_edge < distance
        shares[:, closer] = 0.0
        shares[k, closer], shares[m, closer] = 1 - share[closer], share[closer]
        distance[closer] = on_edge[closer]
    return shares, distance


@dataclass(frozen=True, eq=False)
class ToolMesh:
    """Triangles and quadrilaterals in space, one block after the other.

    Parameters
    ----------
    points
        Nodes in mm, shape (3, n_nodes).
    cells
        Node numbers of the elements, arrays of shape (3, n) and (4, n), anticlockwise
        as seen from outside.

    Raises
    ------
    MeshError
        If a node is undefined or not finite, or an element has no area.
    """

    points: ndarray
    cells: tuple[ndarray, ...]

    def __post_init__(self) -> None:
        points = real_numbers("tool mesh: points", self.points)
        if points.ndim != 2 or len(points) != 3 or not np.isfinite(points).all():
            raise MeshError("tool mesh: points must be finite numbers of shape (3, n)")
        for cell in self.cells:
            if np.ndim(cell) != 2 or len(cell) not in (3, 4):
                raise MeshError(
                    "tool mesh: cells must be node numbers of shape (3, n) or (4, n), "
                    f"not {np.shape(cell)}"
                )
            if (
                np.size(cell)
                and not 0 <= np.min(cell) <= np.max(cell) < points.shape[1]
            ):
                raise MeshError("tool mesh: an element refers to an undefined node")
        object.__setattr__(self, "points", points)
        keep_copies(self, "cells")
        if not self.n_elements:
            raise MeshError("tool mesh: there are no triangles or quadrilaterals")
        flat = np.flatnonzero(~(np.linalg.norm(self._area_vectors(), axis=0) > 0))
        if flat.size:
            raise MeshError(f"tool mesh: element {flat[0] + 1} has zero area")

    @property
    def n_elements(self) -> int:
        """Number of elements."""
        return sum(np.shape(cell)[1] for cell in self.cells)

    @property
    def area(self) -> float:
        """Area in mm²."""
        return float(self.areas().sum())

    def areas(self) -> ndarray:
        """Area of each element in mm², shape (n_elements,)."""
        return 0.5 * np.linalg.norm(self._area_vectors(), axis=0)

    def centres(self) -> ndarray:
        """Means of the corners, shape (3, n_elements)."""
        return np.hstack([self.points[:, cell].mean(axis=1) for cell in self.cells])

    def normals(self) -> ndarray:
        """Unit normals at the centres, shape (3, n_elements)."""
        return unit(self._area_vectors())

    def longest_edges(self) -> ndarray:
        """Longest edge of each element in mm, shape (n_elements,)."""
        return np.hstack(
            [edge_lengths(self.points, cell).max(axis=0) for cell in self.cells]
        )

    def triangles(self) -> ndarray:
        """Nodes of triangles, with quadrilaterals cut in two, shape (3, n)."""
        return cut_in_two(self.cells)

    def boundary(self) -> list[ndarray]:
        """Closed curves along the edges of only one element, the longest first.

        Returns
        -------
        list
            Points of each curve, shape (3, n), the first not repeated.

        Raises
        ------
        MeshError
            If there is no such edge, or more than two of them meet at a node.
        """
        if not boundary_edges(self.cells).size:
            raise MeshError(
                "tool mesh: the surface is closed and has no boundary to trim along"
            )
        return [self.points[:, nodes] for nodes in loops(self.points, self.cells)]

    def _area_vectors(self) -> ndarray:
        """Normals with twice the area as length, by cross products."""
        corners = [self.points[:, cell] for cell in self.cells]
        pairs = [(x[:, 2] - x[:, 0], x[:, -1] - x[:, 1]) for x in corners]
        return np.hstack([np.cross(one, other, axis=0) for one, other in pairs])


def cut_in_two(cells: tuple[ndarray, ...]) -> ndarray:
    """Nodes of triangles, with quadrilaterals cut in two, shape (3, n)."""
    cuts = {3: ([0, 1, 2],), 4: ([0, 1, 2], [0, 2, 3])}
    return np.hstack([cell[cut] for cell in cells for cut in cuts[len(cell)]])


def loops(points: ndarray, cells: Sequence[ndarray]) -> list[ndarray]:
    """Nodes of the closed curves along the boundary of cells, the longest first.

    Raises
    ------
    MeshError
        If more than two edges of the boundary meet at a node.
    """
    start, end = boundary_edges(cells).tolist()
    after = dict(zip(start, end, strict=True))
    if len(after) < len(start) or set(start) != set(end):
        raise MeshError(
            "tool mesh: the boundary crosses itself, or the elements are oriented "
            "inconsistently"
        )
    found = []
    while after:
        at, nodes = next(iter(after)), []
        while at in after:
            nodes.append(at)
            at = after.pop(at)
        found.append(np.array(nodes))
    return sorted(found, key=lambda nodes: -curve_length(points[:, nodes]))


def curve_length(curve: ndarray) -> float:
    """Length of a closed polyline, shape (d, n)."""
    return float(np.linalg.norm(np.roll(curve, -1, axis=1) - curve, axis=0).sum())


# Corners of a cube, and its six tetrahedra along the paths from the first corner to the
# last.
_CORNERS = np.array([[i, j, k] for i in (0, 1) for j in (0, 1) for k in (0, 1)])
_TETRAHEDRA = np.array(
    [
        np.cumsum([np.zeros(3, int), *np.eye(3, dtype=int)[list(path)]], axis=0)
        @ np.array([4, 2, 1])
        for path in permutations(range(3))
    ]
)


def triangles_on(
    surface: Surface, low: ndarray, high: ndarray, cells: int
) -> tuple[ndarray, ndarray]:
    """Triangles on a surface within a box, by marching tetrahedra.

    Parameters
    ----------
    surface
        The surface.
    low, high
        Corners of the box in mm, shape (3,).
    cells
        Number of cubes along its longest side.

    Returns
    -------
    tuple
        Corners of the triangles in mm, shape (3, n), and their numbers, (3,
        n_triangles); empty if the surface is outside the box.

    Examples
    --------
    >>> import numpy as np
    >>> from skfem_textile import drape
    >>> box = np.full(3, -1.1), np.full(3, 1.1)
    >>> x, t = drape.triangles_on(drape.Sphere(1.0), *box, 24)
    >>> a, b, c = x[:, t[0]], x[:, t[1]], x[:, t[2]]
    >>> area = 0.5 * np.linalg.norm(np.cross(b - a, c - a, axis=0), axis=0).sum()
    >>> bool(abs(area / (4 * np.pi) - 1) < 0.01)
    True
    """
    spacing = float((high - low).max()) / cells
    counts = np.maximum(np.ceil((high - low) / spacing - 1e-9).astype(int), 1)
    grid = np.meshgrid(
        *(np.linspace(a, b, n + 1) for a, b, n in zip(low, high, counts, strict=True)),
        indexing="ij",
    )
    points = np.array(grid).reshape(3, -1)
    with np.errstate(all="ignore"):  # values that are not finite are on neither side
        level = surface.level(points)
    strides = np.array([(counts[1] + 1) * (counts[2] + 1), counts[2] + 1, 1])
    first = np.array(np.meshgrid(*map(np.arange, counts), indexing="ij"))
    cubes = strides @ first.reshape(3, -1)
    corners = (cubes[:, None] + _CORNERS @ strides).T
    above = level[corners] > 0
    crossed = (above != above[0]).any(axis=0) & np.isfinite(level[corners]).all(axis=0)
    tetrahedra = corners[:, crossed][_TETRAHEDRA].transpose(1, 0, 2).reshape(4, -1)
    ends = np.sort(_crossed_edges(tetrahedra, level).reshape(2, -1), axis=0)
    # One number an edge, which sorts far faster than pairs, in the same order.
    edges, inverse = np.unique(ends[0] * level.size + ends[1], return_inverse=True)
    pairs = np.divmod(edges, level.size)
    share = level[pairs[0]] / (level[pairs[0]] - level[pairs[1]])
    x = points[:, pairs[0]] * (1 - share) + points[:, pairs[1]] * share
    with suppress(OffSurfaceError):  # at a kink, they stay on the edges of the cubes
        x = onto(surface, x)
    return x, inverse.reshape(3, -1)


def triangles_within(
    surface: Surface, low: ndarray, high: ndarray, cells: int
) -> tuple[ndarray, ndarray, ndarray]:
    """Triangles of a surface in a box: corners, connectivity and normals.

    A `TriangleMesh` returns its own triangles, without extension beyond its edges.

    Parameters
    ----------
    surface, low, high, cells
        See `triangles_on`.

    Returns
    -------
    tuple
        Corners (3, n), their numbers (3, n_triangles), and normals of any length (3,
        n_triangles).
    """
    tool = surface.surface if isinstance(surface, GrowingSurface) else surface
    facets = getattr(tool, "facets", None)
    if facets is None or getattr(surface, "t", 1.0) == 0:
        x, triangles = triangles_on(surface, low, high, cells)
        return x, triangles, surface.gradient(x[:, triangles].mean(axis=1))
    x, triangles = facets.points, facets.triangles()
    if isinstance(surface, GrowingSurface):
        point = surface.point[:, None]
        x = point + (x - point) / surface.t
    inside = (np.clip(x.T, low, high) == x.T).all(axis=1)
    triangles = triangles[:, inside[triangles].any(axis=0)]
    a, b, c = x[:, triangles].swapaxes(0, 1)
    return np.clip(x.T, low, high).T, triangles, np.cross(b - a, c - a, axis=0)


def _crossed_edges(tetrahedra: ndarray, level: ndarray) -> ndarray:
    """Cut edges of tetrahedra: end nodes of the 3 edges of each triangle, (2, 3, n)."""
    above = level[tetrahedra] > 0
    order = np.argsort(above, axis=0, kind="stable")  # those below first
    a, b, c, d = np.take_along_axis(tetrahedra, order, axis=0)
    n = above.sum(axis=0)
    one, two, three = (np.flatnonzero(n == k) for k in (1, 2, 3))
    crossed = [
        ([d, d, d], [a, b, c], one),
        ([a, a, a], [b, c, d], three),
        ([a, a, b], [c, d, c], two),
        ([b, b, a], [d, c, d], two),
    ]
    edges = [np.array(ends)[:, :, of] for *ends, of in crossed]
    return np.concatenate(edges, axis=2)
