"""Elements in space: between their nodes, and feet of perpendiculars on them."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy import ndarray
from skfem import ElementH1, ElementQuad1, ElementTriP1

# Iterations to the foot of a perpendicular on an element.  Chosen: on a square that is
# twisted by 30° the foot of a point a tenth of a side away is off by 1e-8 of the side.
_ITERATIONS = 12

# Share of the squares of an element's edges that keeps a step finite where an element
# is bent so much that beyond its edges it has no area.
_RIDGE = 1e-12


@dataclass(frozen=True, eq=False)
class Elements:
    """Triangles or quadrilaterals, by the numbers of their nodes, (n_corners, n).

    Local coordinates are those of scikit-fem, from 0 to 1.
    """

    nodes: ndarray

    def feet(
        self, positions: ndarray, points: ndarray, element: ndarray
    ) -> tuple[ndarray, ndarray]:
        """Feet of perpendiculars on elements, which may go beyond them.

        Their local coordinates, and the points as seen from them.
        """
        centre = self.corners.mean(axis=0)[:, None]
        local = np.tile(centre, len(element))
        for _ in range(_ITERATIONS):
            away = points - self.between(positions, element, local)
            slopes = self.slopes(positions, element, local)
            normal = np.einsum("ijn,ikn->njk", slopes, slopes)
            size = np.trace(normal, axis1=1, axis2=2)
            normal += _RIDGE * size[:, None, None] * np.eye(2)
            right = np.einsum("ijn,in->nj", slopes, away)
            step = np.linalg.solve(normal, right[:, :, None])[:, :, 0].T
            # Far beyond its edges an element tells nothing.
            local = np.clip(local + step, -1.0, 2.0)
        return local, points - self.between(positions, element, local)

    def outside(self, local: ndarray) -> ndarray:
        """How far local coordinates are beyond an element, 0 inside it."""
        beyond = np.maximum(-local, 0.0).max(axis=0, initial=0.0)
        if len(self.nodes) == 4:
            return np.maximum(beyond, (local - 1).max(axis=0, initial=0.0))
        return np.maximum(beyond, local.sum(axis=0) - 1)

    def inside(self, local: ndarray) -> ndarray:
        """Local coordinates brought into an element."""
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
        """Derivatives of nodal vectors by local coordinates, shape (d, 2, n)."""
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
        """The element of scikit-fem."""
        return ElementQuad1() if len(self.nodes) == 4 else ElementTriP1()


def unit(v: ndarray) -> ndarray:
    """Columns at length 1."""
    return v / np.linalg.norm(v, axis=0)


def edge_lengths(positions: ndarray, elements: ndarray) -> ndarray:
    """Lengths of the edges of elements, shape (n_corners, n_elements)."""
    x = positions[:, elements]
    return np.linalg.norm(np.roll(x, -1, axis=1) - x, axis=0)


def boundary_edges(cells: Sequence[ndarray]) -> ndarray:
    """Edges of one element alone, in its sense: nodes, shape (2, n)."""
    pairs = [[cell.ravel(), np.roll(cell, -1, axis=0).ravel()] for cell in cells]
    edges = np.hstack(pairs)
    _, first, count = np.unique(
        np.sort(edges, axis=0), axis=1, return_index=True, return_counts=True
    )
    return edges[:, first[count == 1]]


def closest_on_triangles(
    positions: ndarray, triangles: ndarray, points: ndarray
) -> tuple[ndarray, ndarray]:
    """The points of triangles that are closest to points in space.

    Parameters
    ----------
    positions, triangles
        Nodes in mm, shape (3, n_nodes), and their numbers, (3, n_triangles).
    points
        In mm, shape (3, n).

    Returns
    -------
    tuple
        The triangle of each point, shape (n,), and the shares of its corners, (3, n):
        0 of those across from an edge, 1 of a corner where the point lies on it.
    """
    corners = positions[:, triangles]
    centres = corners.mean(axis=1)
    radii = np.linalg.norm(corners - centres[:, None], axis=0).max(axis=0)
    from scipy.spatial import KDTree  # not imported for other drapes

    tree = KDTree(centres.T)
    # The closest triangle is no further away than the closest centre.
    nearest, _ = tree.query(points.T)
    near = tree.query_ball_point(points.T, nearest + radii.max())
    counts = np.array([len(found) for found in near], dtype=int)
    point = np.repeat(np.arange(points.shape[1]), counts)
    triangle = np.array([t for found in near for t in found], dtype=int)
    shares, distance = _closest(corners[:, :, triangle], points[:, point])
    order = np.lexsort([distance, point])
    first = order[np.flatnonzero(np.diff(point[order], prepend=-1))]
    return triangle[first], shares[:, first]


def _closest(corners: ndarray, points: ndarray) -> tuple[ndarray, ndarray]:
    """Shares of corners in the closest points of triangles, and squared distances.

    Corners have the shape (3, 3, n), the second axis counts them.
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
