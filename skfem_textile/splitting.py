"""Any mesh of triangles, or of triangles and quadrilaterals, as one of quadrilaterals.

Every triangle becomes three quadrilaterals, with corners at the middles of its edges
and at its centroid; beside triangles every quadrilateral becomes four.  There are then
about as many unknowns as fibres to be kept from stretching, as in the continuum, where
two triangles in place of a quadrilateral lock.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, TypeGuard

import numpy as np
from numpy import ndarray
from skfem import Mesh, MeshQuad, MeshTri
from skfem.helpers import cross


@dataclass(repr=False)
class SplitMesh(MeshQuad):
    """Quadrilaterals that were split off the elements of another mesh.

    Attributes
    ----------
    cells
        Triangles and quadrilaterals of the original mesh as node numbers, arrays of
        shape (3, n) and (4, n).  Its nodes are the first of this mesh.
    parent
        For each quadrilateral the element that it was part of, counted through
        ``cells``; shape (n_elements,).
    """

    cells: tuple[ndarray, ...] = ()
    parent: ndarray = field(default_factory=lambda: np.empty(0, dtype=int))


def was_split(mesh: Mesh) -> TypeGuard[SplitMesh]:
    """Whether a mesh still is what `split` made of it: not refined, nor cut down."""
    return isinstance(mesh, SplitMesh) and len(mesh.parent) == mesh.nelements


def split(mesh: Mesh) -> SplitMesh:
    """Split every triangle of a mesh in three, or every quadrilateral in four.

    A quadrilateral that is not convex is cut in two triangles first.  Boundaries and
    subdomains keep their names.

    Parameters
    ----------
    mesh
        A `skfem.MeshTri` or `skfem.MeshQuad` with straight edges.

    Raises
    ------
    ValueError
        If it is another mesh.

    Examples
    --------
    >>> quads = split(MeshTri().with_defaults())
    >>> quads.nelements, sorted(quads.boundaries), quads.parent
    (6, ['bottom', 'left', 'right', 'top'], array([0, 1, 0, 1, 0, 1]))
    """
    if type(mesh) not in (MeshTri, MeshQuad, SplitMesh):
        raise ValueError(
            "only triangles and quadrilaterals with straight edges can be split, not "
            f"{type(mesh).__name__}"
        )
    edges = {k: mesh.facets[:, f] for k, f in (mesh.boundaries or {}).items()}
    subdomains = dict(mesh.subdomains or {})
    if isinstance(mesh, MeshTri):
        return split_cells(mesh.p, [mesh.t], edges, subdomains)
    quads: Any = mesh
    convex = (_corners(quads) > 0).all(axis=0)
    if convex.all():
        return split_cells(mesh.p, [mesh.t], edges, subdomains)
    cells = [_triangles(quads)[:, np.tile(~convex, 2)], mesh.t[:, convex]]
    origin = np.concatenate([*[np.flatnonzero(~convex)] * 2, np.flatnonzero(convex)])
    named = {k: np.flatnonzero(np.isin(origin, e)) for k, e in subdomains.items()}
    return split_cells(mesh.p, cells, edges, named)


def cut(mesh: MeshQuad) -> MeshTri:
    """Cut every quadrilateral in two triangles.

    Along the diagonal that leaves the larger of the smaller triangles, so that none
    lies outside a quadrilateral that is not convex.  Boundaries and subdomains keep
    their names.

    Examples
    --------
    >>> triangles = cut(MeshQuad().with_defaults())
    >>> triangles.nelements, sorted(triangles.boundaries)
    (2, ['bottom', 'left', 'right', 'top'])
    """
    return replace(mesh, t=_turned(mesh)).to_meshtri()


def _corners(mesh: MeshQuad) -> ndarray:
    """Twice the area of the triangle at each corner, negative at a reflex one."""
    before, here, after = (mesh.p[:, np.roll(mesh.t, i, axis=0)] for i in (1, 0, -1))
    corner = cross(after - here, before - here)
    return corner * np.sign(corner.sum(axis=0))


def _turned(mesh: MeshQuad) -> ndarray:
    """Nodes of the quadrilaterals, the better diagonal from the second to the last."""
    corner = _corners(mesh)
    ends_13, ends_02 = corner[::2].min(axis=0), corner[1::2].min(axis=0)
    other = ends_02 > ends_13 + 1e-9 * np.abs(ends_13)
    return np.where(other, np.roll(mesh.t, 1, axis=0), mesh.t)


def _triangles(mesh: MeshQuad) -> ndarray:
    """Nodes of the triangles, the first of every quadrilateral and then the second."""
    t = _turned(mesh)
    return np.hstack([t[[0, 1, 3]], t[[1, 2, 3]]])


def split_cells(
    points: ndarray,
    cells: Sequence[ndarray],
    edges: Mapping[str, ndarray] | None = None,
    subdomains: Mapping[str, ndarray] | None = None,
) -> SplitMesh:
    """Split triangles in three quadrilaterals each, and quadrilaterals in four.

    Parameters
    ----------
    points
        Nodes, shape (2, n).
    cells
        Triangles and quadrilaterals as node numbers, shapes (3, n) and (4, n), anti-
        clockwise or clockwise.
    edges
        Named boundaries, each as node numbers of its edges, shape (2, m).
    subdomains
        Named subdomains, each as element numbers, counted through ``cells``.
    """
    ends = np.concatenate([_ends(cell) for cell in cells], axis=1)
    pairs, inverse = np.unique(np.sort(ends, axis=0), axis=1, return_inverse=True)
    middles = points.shape[1] + inverse.ravel()
    first_centre = points.shape[1] + pairs.shape[1]
    centres = np.hstack([points[:, cell].mean(axis=1) for cell in cells])

    quads, parent, edge, element = [], [], 0, 0
    for cell in cells:
        k, n = cell.shape
        middle = middles[edge : edge + k * n].reshape(k, n)
        centre = first_centre + element + np.arange(n)
        for i in range(k):
            quads.append(np.stack([cell[i], middle[i], centre, middle[i - 1]]))
            parent.append(element + np.arange(n))
        edge, element = edge + k * n, element + n
    mesh = SplitMesh(
        np.hstack([points, points[:, pairs].mean(axis=1), centres]),
        np.hstack(quads),
        cells=tuple(cells),
        parent=np.concatenate(parent),
    )
    return _named(mesh, pairs, points.shape[1], edges or {}, subdomains or {})


def boundary_edges(cells: Sequence[ndarray]) -> ndarray:
    """Node numbers of the edges that belong to one cell only, shape (2, n)."""
    ends = np.sort(np.concatenate([_ends(cell) for cell in cells], axis=1), axis=0)
    pairs, counts = np.unique(ends, axis=1, return_counts=True)
    return pairs[:, counts == 1]


def _ends(cell: ndarray) -> ndarray:
    """Node numbers of the edges of cells, edge by edge, shape (2, k·n)."""
    return np.stack([cell.ravel(), np.roll(cell, -1, axis=0).ravel()])


def _named(
    mesh: SplitMesh,
    pairs: ndarray,
    n_points: int,
    edges: Mapping[str, ndarray],
    subdomains: Mapping[str, ndarray],
) -> SplitMesh:
    """The mesh with the names of the original's boundaries and subdomains.

    An edge became two, from its ends to its middle.
    """
    number = {tuple(pair): n_points + i for i, pair in enumerate(pairs.T.tolist())}
    facet = {tuple(ends): i for i, ends in enumerate(mesh.facets.T.tolist())}
    boundaries = {
        name: np.array(
            [
                facet[end, number[a, b]]  # middles come after the ends
                for a, b in np.sort(ends, axis=0).T.tolist()
                for end in (a, b)
            ],
            dtype=int,
        )
        for name, ends in edges.items()
    }
    return replace(
        mesh,
        _boundaries=boundaries or None,
        _subdomains={
            name: np.flatnonzero(np.isin(mesh.parent, elements))
            for name, elements in subdomains.items()
        }
        or None,
    )
