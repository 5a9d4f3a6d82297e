"""Triangles and quadrilaterals split into quadrilaterals.

Every triangle becomes three quadrilaterals, with corners at the middles of its edges
and at its centroid; in a mesh with triangles every quadrilateral becomes four.  There
are then about as many unknowns as constraints on the stretch of fibres, as in the
continuum, while two triangles in place of a quadrilateral lock.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, TypeGuard

import numpy as np
from numpy import ndarray
from skfem import ElementQuad1, ElementTriP1, Mesh, MeshQuad, MeshTri

from ..checks import refuse_nodes
from ..named_nodes import NamedNodes, edge_numbers, named_nodes
from ..scikit_fem import with_names
from .edges import edges_of, named_edges
from .triangles import corner_areas, triangles_of


@dataclass(repr=False)
class SplitMesh(NamedNodes, MeshQuad):
    """Quadrilaterals into which the elements of another mesh were split.

    Attributes
    ----------
    cells
        Triangles and quadrilaterals that were split, as node numbers, arrays of shape
        (3, n) and (4, n).  Nodes of the original mesh are the first of this mesh.
    parent
        For each quadrilateral the cell that it is part of, counted through ``cells``;
        shape (n_elements,).
    originals
        Elements of the original mesh as node numbers: the cells, but each
        quadrilateral that is not convex in place of the two triangles in which it was
        cut first.
    origin
        For each cell its original element, counted through ``originals``; shape
        (n_cells,).
    """

    cells: tuple[ndarray, ...] = ()
    parent: ndarray = field(default_factory=lambda: np.empty(0, dtype=int))
    originals: tuple[ndarray, ...] = ()
    origin: ndarray = field(default_factory=lambda: np.empty(0, dtype=int))


def was_split(mesh: Mesh) -> TypeGuard[SplitMesh]:
    """Whether a mesh is a result of `split` with its parents still valid.

    Nodes may have moved, and quadrilaterals may have another order, together with their
    parents.  A mesh that was refined, restricted or renumbered is none.
    """
    if not isinstance(mesh, SplitMesh) or not mesh.cells:
        return False
    if np.shape(mesh.parent) != (mesh.nelements,):
        return False
    pairs, inverse = edges_of(mesh.cells)
    n_elements = sum(cell.shape[1] for cell in mesh.cells)
    n_points = mesh.p.shape[1] - pairs.shape[1] - n_elements
    expected = np.vstack(_quads(mesh.cells, n_points, pairs, inverse))
    actual = np.vstack([mesh.t, mesh.parent])
    return np.array_equal(_ordered(actual), _ordered(expected))


def split(mesh: Mesh) -> SplitMesh:
    """Split every triangle of a mesh in three, or every quadrilateral in four.

    A quadrilateral that is not convex is cut in two triangles first.  Boundaries,
    subdomains and named nodes keep their names.

    Parameters
    ----------
    mesh
        A `skfem.MeshTri` or `skfem.MeshQuad` with straight edges.

    Raises
    ------
    ValueError
        If it is another kind of mesh, or its positions or node numbers are invalid.

    Examples
    --------
    >>> quads = split(MeshTri().with_defaults())
    >>> quads.nelements, sorted(quads.boundaries), quads.parent
    (6, ['bottom', 'left', 'right', 'top'], array([0, 1, 0, 1, 0, 1]))
    """
    if getattr(mesh, "elem", None) not in (ElementTriP1, ElementQuad1):
        raise ValueError(
            "only triangles and quadrilaterals with straight edges can be split, not "
            f"{type(mesh).__name__}"
        )
    refuse_nodes(mesh.p, [mesh.t])
    edges = {k: mesh.facets[:, f] for k, f in (mesh.boundaries or {}).items()}
    subdomains, nodes = dict(mesh.subdomains or {}), named_nodes(mesh)
    if isinstance(mesh, MeshTri):
        return split_cells(mesh.p, [mesh.t], edges, subdomains, nodes)
    quads: Any = mesh
    convex = (corner_areas(quads) > 0).all(axis=0)
    if convex.all():
        return split_cells(mesh.p, [mesh.t], edges, subdomains, nodes)
    cells = [triangles_of(quads)[:, np.tile(~convex, 2)], mesh.t[:, convex]]
    origin = np.concatenate([*[np.flatnonzero(~convex)] * 2, np.flatnonzero(convex)])
    named = {k: np.flatnonzero(np.isin(origin, e)) for k, e in subdomains.items()}
    parts = split_cells(mesh.p, cells, edges, named, nodes)
    return replace(parts, originals=(mesh.t,), origin=origin)


def split_cells(
    points: ndarray,
    cells: Sequence[ndarray],
    edges: Mapping[str, ndarray] | None = None,
    subdomains: Mapping[str, ndarray] | None = None,
    nodes: Mapping[str, ndarray] | None = None,
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
    nodes
        Named nodes, each as node numbers.

    Raises
    ------
    MeshError
        If positions or node numbers are invalid, or an edge of a named boundary is no
        edge of the cells.
    """
    refuse_nodes(points, cells)
    pairs, inverse = edges_of(cells)
    centres = np.hstack([points[:, cell].mean(axis=1) for cell in cells])
    t, parent = _quads(cells, points.shape[1], pairs, inverse)
    mesh = SplitMesh(
        np.hstack([points, points[:, pairs].mean(axis=1), centres]),
        t,
        cells=tuple(cells),
        parent=parent,
        originals=tuple(cells),
        origin=np.arange(centres.shape[1]),
        named_nodes=dict(nodes or {}),
    )
    return _named(mesh, pairs, points, edges or {}, subdomains or {})


def _quads(
    cells: Sequence[ndarray], n_points: int, pairs: ndarray, inverse: ndarray
) -> tuple[ndarray, ndarray]:
    """Quadrilaterals of the cells as node numbers, and the cell of each."""
    middles, first_centre = n_points + inverse, n_points + pairs.shape[1]
    quads, parent, edge, element = [], [], 0, 0
    for cell in cells:
        k, n = cell.shape
        middle = middles[edge : edge + k * n].reshape(k, n)
        centre = first_centre + element + np.arange(n)
        for i in range(k):
            quads.append(np.stack([cell[i], middle[i], centre, middle[i - 1]]))
            parent.append(element + np.arange(n))
        edge, element = edge + k * n, element + n
    return np.hstack(quads), np.concatenate(parent)


def _ordered(columns: ndarray) -> ndarray:
    """The columns in lexical order."""
    return columns[:, np.lexsort(columns)]


def _named(
    mesh: SplitMesh,
    pairs: ndarray,
    points: ndarray,
    edges: Mapping[str, ndarray],
    subdomains: Mapping[str, ndarray],
) -> SplitMesh:
    """Give a mesh the boundaries and subdomains of the original.

    Each edge has become two, from its ends to its middle.
    """
    boundaries = {}
    for name, ends in edges.items():
        middle = points.shape[1] + named_edges(name, points, pairs, ends)
        halves = [edge_numbers(mesh.facets, np.stack([end, middle])) for end in ends]
        boundaries[name] = np.stack(halves, axis=1).ravel()
    parts = {
        name: np.flatnonzero(np.isin(mesh.parent, elements))
        for name, elements in subdomains.items()
    }
    return with_names(mesh, boundaries or None, parts or None)
