"""Elements in space: edges, and the elements closest to points."""

from dataclasses import dataclass
from itertools import chain

import numpy as np
from numpy import ndarray
from skfem import ElementH1, ElementQuad1, ElementTriP1

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

    def feet(
        self, positions: ndarray, points: ndarray, element: ndarray
    ) -> tuple[ndarray, ndarray]:
        """Orthogonal projections of points onto elements, possibly beyond their edges.

        Returns local coordinates, and the vectors to the points.
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
        return local, points - self.between(positions, element, local)

    def outside(self, local: ndarray) -> ndarray:
        """Distance of local coordinates from an element, 0 inside it."""
        beyond = np.maximum(-local, 0.0).max(axis=0, initial=0.0)
        if len(self.nodes) == 4:
            return np.maximum(beyond, (local - 1).max(axis=0, initial=0.0))
        return np.maximum(beyond, local.sum(axis=0) - 1)

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
            counts = np.array([len(close) for close in near], dtype=int)
            point = np.repeat(np.arange(points.shape[1]), counts)
            element = part[np.fromiter(chain.from_iterable(near), dtype=int)]
            pairs.append((point, element))
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
