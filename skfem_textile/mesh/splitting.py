"""Splitting into quadrilaterals, and cutting into triangles.

Split: every triangle becomes three quadrilaterals, with corners at its edge midpoints
and its centroid; in a mesh with triangles every quadrilateral becomes four.  There are
then about as many unknowns as constraints on the fibre stretch, as in the continuum,
whereas two triangles per quadrilateral lock.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, TypeGuard

import numpy as np
from numpy import ndarray
from scipy.sparse import csr_matrix, eye, hstack, identity
from skfem import ElementQuad1, ElementTriP1, Mesh, MeshQuad, MeshTri
from skfem.helpers import cross

from .checks import MeshError, refuse_nodes
from .graph import edges_of
from .progress import shown
from .scikit_fem import with_names
from .selection import NamedNodes, edge_numbers, named_nodes, with_named_nodes
from .user_input import coords


def named_edges(name: str, points: ndarray, edges: ndarray, ends: ndarray) -> ndarray:
    """Numbers of the edges of a named boundary, given as in `edge_numbers`.

    Raises an error if two of the nodes are not the ends of an edge.
    """
    numbers = edge_numbers(edges, ends)
    missing = ends[:, numbers < 0]
    if missing.size:
        a, b = missing[:, 0].tolist()
        more = missing.shape[1] - 1
        others = f", or {more} further pair(s) of its nodes" if more else ""
        raise MeshError(
            f"boundary {name!r}: no edge of the mesh joins nodes {a} and {b}, at "
            f"{coords(points[:, a])} and {coords(points[:, b])}{others}; specify "
            "edges of cells"
        )
    return numbers


def hat_functions(mesh: Mesh, n_nodes: int) -> csr_matrix:
    """Values at all nodes of functions that are 1 at one corner and 0 at the others.

    They are linear along the edges of the cells; in the middle of a cell they are the
    mean of its corners.  The mesh has triangles with edge midpoints as further nodes,
    is a `SplitMesh` (corners of its cells), or has other quadrilaterals. Shape
    (n_corners, n_nodes).
    """
    parts: Any = mesh
    cells = getattr(parts, "cells", ())
    if isinstance(mesh, MeshTri):
        groups = [mesh.facets] if n_nodes > mesh.p.shape[1] else []
    else:
        groups = [edges_of(cells)[0], *cells] if cells else []
    n = n_nodes - sum(group.shape[1] for group in groups)
    blocks = [identity(n)]
    for corners in groups:  # means of k values
        k, m = corners.shape
        indices = corners.ravel(), np.tile(np.arange(m), k)
        blocks.append(csr_matrix((np.full(k * m, 1 / k), indices), (n, m)))
    return csr_matrix(hstack(blocks))


@dataclass(repr=False)
class Made(NamedNodes):
    """Mesh whose elements were made of other ones.

    Attributes
    ----------
    parent
        Number of the other one in which each element lies, shape (n_elements,).
    made
        Node numbers and parent of each element as they were made, in lexical order.
    """

    parent: ndarray = field(default_factory=lambda: np.empty(0, dtype=int))
    made: ndarray = field(default_factory=lambda: np.empty((0, 0), dtype=int))


def _elements(t: ndarray, parent: ndarray) -> ndarray:
    """Sorted node numbers and parent of elements, in lexical order."""
    columns = np.vstack([np.sort(t, axis=0), parent])
    return columns[:, np.lexsort(columns)]


def _is_as_made(mesh: Any) -> bool:
    """True if the elements have the nodes and parents of which they were made.

    Nodes may have moved, and elements be reordered together with their parents.
    """
    if np.shape(mesh.parent) != (mesh.nelements,):
        return False
    return np.array_equal(_elements(mesh.t, mesh.parent), mesh.made)


@dataclass(repr=False)
class SplitMesh(Made, MeshQuad):
    """Quadrilaterals into which the elements of another mesh were split.

    Attributes
    ----------
    cells
        Split triangles and quadrilaterals as node numbers, arrays of shape (3, n) and
        (4, n).  Nodes of the original mesh come first.
    parent
        Index into ``cells`` of the cell that contains each quadrilateral, shape
        (n_elements,).
    originals
        Elements of the original mesh as node numbers: the cells, with each non-convex
        quadrilateral in place of the two triangles into which it was cut.
    origin
        Index into ``originals`` of the element of each cell, shape (n_cells,).
    """

    cells: tuple[ndarray, ...] = ()
    originals: tuple[ndarray, ...] = ()
    origin: ndarray = field(default_factory=lambda: np.empty(0, dtype=int))


def joined(meshes: Sequence[Any], what: str) -> Any:
    """Disjoint meshes of quadrilaterals as one, all split or none.

    Boundaries and named nodes of the same name become one; ``WHAT 1: NAME`` are the
    ones of the first mesh, and ``WHAT 1`` the subdomain of its elements.

    Examples
    --------
    >>> both = joined([split(MeshQuad().with_defaults()), split(MeshQuad())], "ply")
    >>> both.nelements, sorted(both.subdomains), len(both.boundaries["ply 1: left"])
    (8, ['ply 1', 'ply 2'], 2)
    """
    sizes = ([mesh.p.shape[1], mesh.nelements, mesh.nfacets] for mesh in meshes)
    starts = np.cumsum([[0, 0, 0], *sizes], axis=0)[:-1]
    p = np.hstack([mesh.p for mesh in meshes])
    pairs = list(zip(meshes, starts.tolist(), strict=True))
    t = np.hstack([mesh.t + node for mesh, (node, *_) in pairs])
    subdomains, names = {}, dict[str, list[ndarray]]()
    points = dict[str, list[ndarray]]()
    for i, (mesh, (node, element, facet)) in enumerate(pairs, 1):
        subdomains[f"{what} {i}"] = element + np.arange(mesh.nelements)
        named = (mesh.boundaries, facet, names), (named_nodes(mesh), node, points)
        for every, first, into in named:
            for name, numbers in (every or {}).items():
                for key in (name, f"{what} {i}: {name}"):
                    into.setdefault(key, []).append(first + np.asarray(numbers))
    boundaries = {name: np.concatenate(x) for name, x in names.items()}
    nodes = {name: np.concatenate(x) for name, x in points.items()}
    if not all(map(was_split, meshes)):
        return with_named_nodes(
            with_names(MeshQuad(p, t), boundaries, subdomains), nodes
        )
    cells = [x + node for mesh, (node, *_) in pairs for x in mesh.cells]
    counts = [sum(x.shape[1] for x in mesh.cells) for mesh in meshes]
    offsets = np.cumsum([0, *counts[:-1]])
    parent = np.concatenate(
        [x.parent + n for x, n in zip(meshes, offsets, strict=True)]
    )
    mesh = SplitMesh(
        *(p, t),
        cells=tuple(cells),
        parent=parent,
        made=_elements(t, parent),
        originals=tuple(cells),
        origin=np.arange(sum(counts)),
        named_nodes=nodes,
    )
    return with_names(mesh, boundaries, subdomains)


def was_split(mesh: Mesh) -> TypeGuard[SplitMesh]:
    """True if a mesh is a result of `split` with valid parents.

    Nodes may have moved, and quadrilaterals may be reordered together with their
    parents.  A refined, restricted or renumbered mesh is not valid.
    """
    return isinstance(mesh, SplitMesh) and bool(mesh.cells) and _is_as_made(mesh)


def split(mesh: Mesh) -> SplitMesh:
    """Split every triangle of a mesh in three, or every quadrilateral in four.

    A non-convex quadrilateral is first cut into two triangles.  Names of boundaries,
    subdomains and nodes are kept.

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
    cells, origin = [mesh.t], np.arange(mesh.nelements)
    if not isinstance(mesh, MeshTri):
        quads: Any = mesh
        convex = (corner_areas(quads) > 0).all(axis=0)
        if not convex.all():
            halves, whole = np.flatnonzero(~convex), np.flatnonzero(convex)
            cells = [triangles_of(quads)[:, np.tile(~convex, 2)], mesh.t[:, convex]]
            origin = np.concatenate([halves, halves, whole])
    subdomains = parts_of(origin, mesh.subdomains)
    parts = split_cells(mesh.p, cells, edges, subdomains, named_nodes(mesh))
    originals, of_element = original_elements(mesh)
    return replace(parts, originals=originals, origin=of_element[origin])


@shown("splitting the mesh")
def split_cells(
    points: ndarray,
    cells: Sequence[ndarray],
    edges: Mapping[str, ndarray] | None = None,
    subdomains: Mapping[str, ndarray] | None = None,
    nodes: Mapping[str, ndarray] | None = None,
) -> SplitMesh:
    """Split triangles into three quadrilaterals each, and quadrilaterals into four.

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
        Named subdomains, each as indices into ``cells``.
    nodes
        Named nodes, each as node numbers.

    Raises
    ------
    MeshError
        If positions or node numbers are invalid, or an edge of a named boundary is not
        an edge of the cells.
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
        made=_elements(t, parent),
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


def _named(
    mesh: SplitMesh,
    pairs: ndarray,
    points: ndarray,
    edges: Mapping[str, ndarray],
    subdomains: Mapping[str, ndarray],
) -> SplitMesh:
    """Transfer boundaries and subdomains of the original to a split mesh.

    Each edge is split at its midpoint.
    """
    boundaries = {}
    for name, ends in edges.items():
        middle = points.shape[1] + named_edges(name, points, pairs, ends)
        halves = [edge_numbers(mesh.facets, np.stack([end, middle])) for end in ends]
        boundaries[name] = np.stack(halves, axis=1).ravel()
    return with_names(mesh, boundaries or None, parts_of(mesh.parent, subdomains))


def parts_of(
    parent: ndarray, subdomains: Mapping[str, ndarray] | None
) -> dict[str, ndarray] | None:
    """Elements whose parents are in subdomains, by name; None if there are none."""
    return {
        name: np.flatnonzero(np.isin(parent, elements))
        for name, elements in (subdomains or {}).items()
    } or None


def at_nodes(
    points: ndarray,
    cells: Sequence[ndarray],
    nodes: ndarray,
    elements: ndarray,
    parent: ndarray,
) -> csr_matrix:
    """Values at the nodes of cells of fields on a mesh that was made of them.

    The nodes of the cells come first in the mesh.  Where they have moved, the field is
    evaluated at their old position, in an element of the mesh that was made of a
    neighbour: it is linear in the triangles of each quadrilateral, and linear or
    quadratic in triangles.

    Parameters
    ----------
    points
        Nodes of the cells, shape (2, n_points).
    cells
        Cells as node numbers, arrays of shape (3, n) and (4, n).
    nodes
        Nodes of the mesh, shape (2, n_nodes): vertices, then midpoints of edges.
    elements
        Its elements as node numbers, shape (3, 4 or 6, n_elements).
    parent
        Cell of which each was made, shape (n_elements,).

    Returns
    -------
    scipy.sparse.csr_matrix
        Shape (n_points, n_nodes).
    """
    n, shape = points.shape[1], (points.shape[1], nodes.shape[1])
    moved = (points != nodes[:, :n]).any(axis=0)
    if not moved.any():
        return csr_matrix(eye(*shape))
    if len(elements) == 4:
        elements = np.hstack([elements[[0, 1, 2]], elements[[0, 2, 3]]])
        parent = np.tile(parent, 2)
    made = csr_matrix((np.ones(len(parent)), (parent, np.arange(len(parent)))))
    corner = np.concatenate([cell.ravel(order="F") for cell in cells])
    sides = np.concatenate([np.full(cell.shape[1], len(cell)) for cell in cells])
    of_corner = np.repeat(np.arange(len(sides)), sides)
    corners = csr_matrix((np.ones(corner.size), (corner, of_corner)))
    node, element = (corners @ made).nonzero()
    node, element = node[moved[node]], element[moved[node]]
    a, b, c = nodes[:, elements[:3, element]].transpose(1, 0, 2)
    x, area = points[:, node], cross(b - a, c - a)
    share = (
        np.stack([cross(c - b, x - b), cross(a - c, x - c), cross(b - a, x - a)]) / area
    )
    order = np.lexsort([share.min(axis=0), node])
    last = order[np.append(np.diff(node[order]) > 0, True)]
    node, element, share = node[last], element[last], share[:, last]
    if len(elements) == 6:
        after = np.roll(share, -1, axis=0)
        share = np.vstack([share * (2 * share - 1), 4 * share * after])
    still = np.flatnonzero(~moved)
    rows = np.append(np.tile(node, len(share)), still)
    columns = np.append(elements[:, element].ravel(), still)
    return csr_matrix(
        (np.append(share.ravel(), np.ones(len(still))), (rows, columns)), shape
    )


# Relative difference below which areas count as equal.  Chosen: above rounding, so that
# the cut of a parallelogram does not depend on it.
_EQUAL_AREAS = 1e-9


@dataclass(repr=False)
class Changed(Made):
    """Mesh made of another one, whose nodes come first and may have moved.

    Attributes
    ----------
    original
        The other mesh.
    parent
        Its element in which each element lies, of a `SplitMesh` the index into its
        ``originals``, shape (n_elements,).
    """

    original: Any = None


@dataclass(repr=False)
class CutMesh(Changed, MeshTri):
    """Triangles into which the elements of another mesh were cut."""


@dataclass(repr=False)
class MovedMesh(Changed, MeshQuad):
    """Quadrilaterals of another mesh, whose nodes have moved."""


def changed(mesh: Mesh, original: Any, parent: ndarray) -> Any:
    """A mesh with the mesh of which it was made, the first one; names are kept."""
    if was_changed(original):
        original, parent = original.original, original.parent[parent]
    kind: Any = CutMesh if isinstance(mesh, MeshTri) else MovedMesh
    return kind(
        *(mesh.p, mesh.t, mesh.boundaries, mesh.subdomains),
        named_nodes=dict(named_nodes(mesh)),
        parent=parent,
        made=_elements(mesh.t, parent),
        original=original,
    )


def was_changed(mesh: Mesh) -> TypeGuard[Changed]:
    """True if a mesh is a result of `cut` or `fit_to_fibres` with valid parents.

    Nodes may have moved, and elements be reordered together with their parents.  A
    refined, restricted or renumbered mesh is not valid.
    """
    return isinstance(mesh, Changed) and _is_as_made(mesh)


def cut(mesh: MeshQuad) -> CutMesh:
    """Cut every quadrilateral into two triangles.

    The diagonal maximises the area of the smaller triangle, so that no triangle lies
    outside a non-convex quadrilateral.  Of a `SplitMesh` the elements of the original
    mesh are cut, and its triangles stay.  Names of boundaries, subdomains and nodes are
    kept.

    Raises
    ------
    ValueError
        If it is another kind of mesh, or its positions or node numbers are invalid.

    Examples
    --------
    >>> triangles = cut(MeshQuad().with_defaults())
    >>> triangles.nelements, sorted(triangles.boundaries)
    (2, ['bottom', 'left', 'right', 'top'])
    """
    if getattr(mesh, "elem", None) != ElementQuad1:
        raise ValueError(f"only a skfem.MeshQuad can be cut, not {type(mesh).__name__}")
    refuse_nodes(mesh.p, [mesh.t])
    if was_split(mesh):
        return _cut_originals(mesh)
    triangles = replace(mesh, t=_with_diagonal(mesh)).to_meshtri()
    triangles = with_named_nodes(triangles, named_nodes(mesh))
    return changed(triangles, mesh, np.tile(np.arange(mesh.nelements), 2))


def _cut_originals(mesh: SplitMesh) -> CutMesh:
    """Triangles of the originals of a split mesh."""
    n = 1 + max(int(cell.max()) for cell in mesh.originals)
    triangles, parent, first = [], [], 0
    for cell in mesh.originals:
        parts = cell if len(cell) == 3 else triangles_of(MeshQuad(mesh.p, cell))
        number = first + np.arange(cell.shape[1])
        triangles.append(parts)
        parent.append(np.resize(number, parts.shape[1]))
        first += cell.shape[1]
    made, of = MeshTri(mesh.p[:, :n], np.hstack(triangles)), np.concatenate(parent)
    boundaries = {}
    for name, facets in (mesh.boundaries or {}).items():
        corner, middle = np.sort(mesh.facets[:, facets], axis=0)
        halves = np.argsort(middle, kind="stable")
        boundaries[name] = edge_numbers(made.facets, corner[halves].reshape(-1, 2).T)
    subdomains = {
        name: mesh.origin[mesh.parent[elements]]
        for name, elements in (mesh.subdomains or {}).items()
    }
    made = with_names(made, boundaries or None, parts_of(of, subdomains))
    return changed(with_named_nodes(made, named_nodes(mesh)), mesh, of)


def corner_areas(mesh: MeshQuad) -> ndarray:
    """Twice the area of the triangle at each corner, negative at a reflex corner."""
    before, at, after = (mesh.p[:, np.roll(mesh.t, i, axis=0)] for i in (1, 0, -1))
    corner = cross(after - at, before - at)
    return corner * np.sign(corner.sum(axis=0))


def _with_diagonal(mesh: MeshQuad) -> ndarray:
    """Nodes of quadrilaterals, with the diagonal from second to last."""
    corner = corner_areas(mesh)
    ends_13, ends_02 = corner[::2].min(axis=0), corner[1::2].min(axis=0)
    switch = ends_02 > ends_13 + _EQUAL_AREAS * np.abs(ends_13)
    return np.where(switch, np.roll(mesh.t, 1, axis=0), mesh.t)


def triangles_of(mesh: MeshQuad) -> ndarray:
    """Nodes of the triangles: the first of every quadrilateral, then the second."""
    t = _with_diagonal(mesh)
    return np.hstack([t[[0, 1, 3]], t[[1, 2, 3]]])


def original_elements(mesh: Mesh) -> tuple[tuple[ndarray, ...], ndarray]:
    """Elements that a mesh was made of, and the original of each element.

    They are the elements of the mesh itself if it was neither split, cut nor fitted.

    Returns
    -------
    tuple
        Original elements as node numbers, arrays of shape (3, n) and (4, n); and the
        index of the original of each element of the mesh, shape (n_elements,).

    Examples
    --------
    >>> from skfem import MeshTri
    >>> from skfem_textile import split
    >>> cells, parent = original_elements(split(MeshTri()))
    >>> [cell.shape for cell in cells], parent
    ([(3, 2)], array([0, 1, 0, 1, 0, 1]))
    """
    if was_split(mesh):
        return mesh.originals, mesh.origin[mesh.parent]
    if was_changed(mesh):
        return original_elements(mesh.original)[0], mesh.parent
    return (mesh.t,), np.arange(mesh.nelements)


def sets_of(mesh: Mesh) -> tuple[dict[str, ndarray], dict[str, ndarray]]:
    """Nodes of boundaries and named nodes, and original elements of subdomains."""
    cells, parent = original_elements(mesh)
    n_nodes = 1 + max(cell.max() for cell in cells)
    nodes = {
        name: mesh.facets[:, np.asarray(edges)].ravel()
        for name, edges in (mesh.boundaries or {}).items()
    }
    for name, members in named_nodes(mesh).items():
        nodes[name] = np.concatenate([nodes.get(name, members[:0]), members])
    parts = {
        name: np.unique(parent[np.asarray(members)])
        for name, members in (mesh.subdomains or {}).items()
    }
    return {name: np.unique(at[at < n_nodes]) for name, at in nodes.items()}, parts
