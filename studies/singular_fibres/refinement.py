"""Local refinement of triangles that keeps the names of boundaries.

A triangle with a bisected edge also has its longest edge bisected, which bounds the
angles from below (Rivara 1984): it becomes two, three or four triangles.
"""

import numpy as np
from numpy import ndarray
from skfem import MeshTri

from skfem_textile.mesh.selection import edge_numbers


def refined(mesh: MeshTri, elements: ndarray) -> MeshTri:
    """Bisect every edge of some elements, and further edges for conformity.

    Names of boundaries and subdomains are kept.

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
    fine = MeshTri(points, cells)
    boundaries = {
        name: _halves(mesh, numbers, middle, fine)
        for name, numbers in (mesh.boundaries or {}).items()
    }
    return MeshTri(points, cells, boundaries or None, subdomains or None)


def _longest_first(mesh: MeshTri) -> tuple[ndarray, ndarray]:
    """Corners of each triangle, the longest edge between the first two, and its edges.

    The edges join corners 0 and 1, 1 and 2, 2 and 0.
    """
    x = mesh.p[:, mesh.t]
    longest = np.linalg.norm(np.roll(x, -1, axis=1) - x, axis=0).argmax(axis=0)
    turned = (np.arange(3)[:, None] + longest) % 3
    corners = np.take_along_axis(mesh.t, turned, axis=0)
    return corners, np.take_along_axis(mesh.t2f, turned, axis=0)


def _parts(t: ndarray, middle: ndarray) -> tuple[ndarray, ndarray]:
    """Triangles between corners a, b, c and edge midpoints, and the parent of each.

    ``middle`` are the midpoint nodes of ab, bc and ca; −1 if there is none.
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
    for marked, triangles in cases:
        for corners in triangles:
            cells.append(np.stack(corners)[:, marked])
            parent.append(np.flatnonzero(marked))
    return np.hstack(cells), np.concatenate(parent)


def _halves(mesh: MeshTri, numbers: ndarray, middle: ndarray, fine: MeshTri) -> ndarray:
    """Numbers in a refined mesh of some edges, or of both of their halves."""
    ends, node = mesh.facets[:, numbers], middle[numbers]
    unsplit = ends[:, node < 0]
    halves = [np.stack([end, node])[:, node >= 0] for end in ends]
    return edge_numbers(fine.facets, np.hstack([unsplit, *halves]))
