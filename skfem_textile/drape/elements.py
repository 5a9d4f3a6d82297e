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
