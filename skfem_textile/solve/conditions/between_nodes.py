"""Elements between nodes that lie on a surface: how far they are off it."""

from collections.abc import Iterable
from typing import Any, NamedTuple

import numpy as np
from numpy import ndarray
from skfem import CellBasis

from .surface import Surface, distance


class Gaps(NamedTuple):
    """Gaps between elements and their surfaces, 0 where an element is on none.

    Attributes
    ----------
    share
        Largest gap of each element over its longest edge, shape (n_elements,).
    gap
        Largest gap in mm, shape (n_elements,).
    place
        Where that is in mm, shape (3, n_elements).
    """

    share: ndarray
    gap: ndarray
    place: ndarray


def gaps(
    surfaces: Iterable[tuple[Surface, ndarray]], x: ndarray, basis: CellBasis
) -> Gaps:
    """Gaps of the elements whose nodes all lie on one surface.

    Parameters
    ----------
    surfaces
        Surfaces, and the numbers of the nodes on each.
    x
        Positions of the nodes in mm, shape (3, n_nodes).
    basis
        Basis of the displacement.
    """
    nodes, n = basis.element_dofs[::3] // 3, basis.nelems
    corners = x[:, nodes[: len(basis.mesh.t)]]
    edges = np.linalg.norm(np.roll(corners, -1, axis=1) - corners, axis=0)
    shapes = _shapes(basis)
    found = Gaps(np.zeros(n), np.zeros(n), corners.mean(axis=1))
    for surface, own in surfaces:
        on_it = np.zeros(x.shape[1], dtype=bool)
        on_it[own] = True
        elements = np.flatnonzero(on_it[nodes].all(axis=0))
        points = np.einsum("pk,ike->ipe", shapes, x[:, nodes[:, elements]])
        off = np.abs(distance(surface, points.reshape(3, -1)))
        off = off.reshape(points.shape[1:])
        furthest = off.argmax(axis=0), np.arange(len(elements))
        found.gap[elements] = off[furthest]
        found.place[:, elements] = points[:, *furthest]
    found.share[:] = found.gap / edges.max(axis=0)
    return found


def _shapes(basis: CellBasis) -> ndarray:
    """Shares of the nodes midway between them, shape (n_points, n_nodes).

    Of quadrilaterals at the centre and the middles of the edges, of quadratic triangles
    between the corners and the middles of the edges.
    """
    vector: Any = basis.elem
    element = vector.elem  # of each component
    nodes = element.doflocs
    one, other = np.triu_indices(len(nodes), 1)
    points = np.unique(0.5 * (nodes[one] + nodes[other]).round(12), axis=0).T
    return np.array([element.lbasis(points, i)[0] for i in range(len(nodes))]).T
