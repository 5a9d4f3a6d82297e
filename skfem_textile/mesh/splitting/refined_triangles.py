"""Triangles refined at their longest edges.

A triangle of which an edge is halved has its longest edge halved too, so that angles do
not get small (Rivara 1984): it becomes two triangles, three, or four.
"""

from dataclasses import dataclass

import numpy as np
from numpy import ndarray
from skfem import MeshTri

from ..named_nodes import edge_numbers, named_nodes, with_named_nodes


@dataclass(frozen=True, eq=False)
class RefinedTriangles:
    """A mesh of triangles of which some were refined.

    Attributes
    ----------
    mesh
        The refined mesh.  Its first nodes are those of the mesh before.
    parent
        For each element of ``mesh`` the one before that it is part of; shape
        (n_elements,).
    ends
        Each further node lies in the middle between these two, shape (2, n_new).
    """

    mesh: MeshTri
    parent: ndarray
    ends: ndarray


def refine_triangles(mesh: MeshTri, elements: ndarray) -> RefinedTriangles:
    """Halve every edge of some elements, and the edges that this asks for.

    Boundaries and subdomains keep their names, and named nodes theirs.

    Parameters
    ----------
    mesh
        The mesh.
    elements
        Numbers of elements.
    """
    t, edges = _longest_first(mesh)
    halved = np.zeros(mesh.nfacets, dtype=bool)
    halved[edges[:, elements]] = True
    while not halved[edges[0, halved[edges].any(axis=0)]].all():
        halved[edges[0, halved[edges].any(axis=0)]] = True
    ends = mesh.facets[:, halved]
    middle = np.full(mesh.nfacets, -1)
    middle[halved] = mesh.nvertices + np.arange(ends.shape[1])
    cells, parent = _parts(t, middle[edges])
    points = np.hstack([mesh.p, mesh.p[:, ends].mean(axis=1)])
    subdomains = {
        name: np.flatnonzero(np.isin(parent, numbers))
        for name, numbers in (mesh.subdomains or {}).items()
    }
    cells = np.ascontiguousarray(cells)
    refined = MeshTri(points, cells)
    boundaries = {
        name: _halves(mesh, numbers, middle, refined)
        for name, numbers in (mesh.boundaries or {}).items()
    }
    named = MeshTri(points, cells, boundaries or None, subdomains or None)
    nodes = named_nodes(mesh)
    return RefinedTriangles(with_named_nodes(named, nodes), parent, ends)


def _longest_first(mesh: MeshTri) -> tuple[ndarray, ndarray]:
    """Corners of each triangle, the longest edge between the first two; its edges.

    The edges are those of corners 0 and 1, 1 and 2, 2 and 0.
    """
    x = mesh.p[:, mesh.t]
    longest = np.linalg.norm(np.roll(x, -1, axis=1) - x, axis=0).argmax(axis=0)
    turned = (np.arange(3)[:, None] + longest) % 3
    corners = np.take_along_axis(mesh.t, turned, axis=0)
    return corners, np.take_along_axis(mesh.t2f, turned, axis=0)


def _parts(t: ndarray, middle: ndarray) -> tuple[ndarray, ndarray]:
    """Triangles between corners and middles of edges, and the parent of each.

    Parameters
    ----------
    t
        Corners a, b, c of the triangles.
    middle
        Nodes in the middle of ab, bc and ca; −1 where there is none.
    """
    (a, b, c), (ab, bc, ca) = t, middle
    first, second, third = middle >= 0
    cases = (
        (~first, [(a, b, c)]),
        (first & ~third, [(c, a, ab)]),
        (first & ~second, [(b, c, ab)]),
        (first & second & ~third, [(b, bc, ab), (bc, c, ab)]),
        (first & third & ~second, [(c, ca, ab), (ca, a, ab)]),
        (second & third, [(a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca)]),
    )
    cells, parent = [], []
    for there, triangles in cases:
        for corners in triangles:
            cells.append(np.stack(corners)[:, there])
            parent.append(np.flatnonzero(there))
    return np.hstack(cells), np.concatenate(parent)


def _halves(
    mesh: MeshTri, numbers: ndarray, middle: ndarray, refined: MeshTri
) -> ndarray:
    """Numbers in a refined mesh of some edges, or of both of their halves."""
    ends, node = mesh.facets[:, numbers], middle[numbers]
    whole = ends[:, node < 0]
    halves = [np.stack([end, node])[:, node >= 0] for end in ends]
    return edge_numbers(refined.facets, np.hstack([whole, *halves]))
