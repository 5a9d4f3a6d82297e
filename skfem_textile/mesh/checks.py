"""Validation of a mesh before a computation."""

from collections.abc import Sequence
from typing import TypeVar

import numpy as np
from numpy import ndarray
from skfem import Element, ElementQuad1, ElementTriP1, Mesh
from skfem.helpers import det

from .bases import GAUSS, QuadMapping
from .overlap import boundary_of, cells_within, is_convex, overlap_of
from .scikit_fem import with_names
from .selection import named_nodes

# Share of the longest edge of a cell below which an edge counts as zero, and of its
# square below which a Jacobian does.  Chosen: far above rounding (2e-16), far below
# practical cells.
_NEGLIGIBLE = 1e-9

# Largest coordinate, in mm.  Chosen: areas, up to 1e200, do not overflow (1.8e308).
_FAR = 1e100

# Shortest edge, in mm.  Chosen: areas, down to 1e-200, do not vanish (2.2e-308), nor do
# their inverses overflow.
_SHORT = 1e-100

# Side of the bounding box in mm below which a mesh is in other units.  Chosen: about
# the width of a yarn; a ply of less than 1 m in metres is below it.
_SMALLEST_PLY = 1.0

# Maximum number of nodes or cells listed in a message.  Chosen: one line.
_LISTED = 10

_Mesh = TypeVar("_Mesh", bound=Mesh)


# Element types of supported meshes, and the names of their cells.
_CELLS: dict[type[Element], str] = {
    ElementQuad1: "quadrilateral",
    ElementTriP1: "triangle",
}


class MeshError(ValueError):
    """Invalid mesh; the message names the place and the remedy."""


def check_mesh(mesh: Mesh) -> None:
    """Validate a mesh of quadrilaterals or triangles.

    Raises
    ------
    MeshError
        If the mesh has other cells, positions that are not finite, unused or undefined
        nodes, names of undefined edges or nodes, edges of more than two cells, cells
        with a collapsed edge, quadrilaterals inverted at a 2×2 point, triangles without
        area, overlapping cells, nodes on the interior of an edge, or coincident nodes
        other than along a cut (`contact`).
    """
    if getattr(mesh, "elem", None) not in _CELLS:
        raise MeshError(
            "the mesh must be a skfem.MeshQuad or a skfem.MeshTri with straight edges, "
            f"not {type(mesh).__name__}"
        )
    cell = _CELLS[mesh.elem]
    refuse_nodes(mesh.p, [mesh.t], cell)
    gauss, _ = GAUSS
    unused = np.ones(mesh.p.shape[1], dtype=bool)
    unused[mesh.t] = False
    refuse(f"node(s) belong to no {cell}", unused, "remove them")
    crowded = (np.bincount(mesh.t2f.ravel()) > 2)[mesh.t2f].any(axis=0)
    shared = f"{cell}(s) share an edge with more than one other {cell}"
    refuse(shared, crowded, "keep one layer")
    mapping = QuadMapping(mesh) if cell == "quadrilateral" else mesh.mapping()
    jacobian = det(mapping.DF(gauss))  # constant for a triangle
    turn = np.sign(jacobian.sum(axis=1))
    x = mesh.p[:, mesh.t]
    length = np.linalg.norm(np.roll(x, -1, axis=1) - x, axis=0)
    longest = length.max(axis=0)
    inverted = (jacobian * turn[:, None]).min(axis=1) <= _NEGLIGIBLE * longest**2
    collapsed = length.min(axis=0) <= np.maximum(_NEGLIGIBLE * longest, _SHORT)
    correct = "correct the positions or the order of their nodes"
    refuse(f"{cell}(s) are inverted or degenerate", inverted | collapsed, correct)
    refuse(f"{cell}(s) overlap a neighbour", _overlapping(mesh, turn), correct)
    _refuse_overlap(mesh, cell)
    for name, edges in (mesh.boundaries or {}).items():
        _refuse_names(f"boundary {name!r}", edges, mesh.nfacets)
    for name, nodes in named_nodes(mesh).items():
        _refuse_names(f"named nodes {name!r}", nodes, mesh.p.shape[1])


def refuse_metres(p: ndarray) -> None:
    """Refuse positions of a mesh that is less than 1 mm wide and high."""
    width, height = np.ptp(p, axis=1)[:2]
    if max(width, height) < _SMALLEST_PLY * (1 - _NEGLIGIBLE):
        raise MeshError(
            f"the mesh is {width:.4g} mm wide and {height:.4g} mm high: are the "
            "coordinates in metres? Use coordinates in mm, or a larger ply"
        )


def refuse_positions(p: ndarray) -> None:
    """Refuse positions, shape (2, n), that are not finite or cannot be squared."""
    if p.size == 0:
        raise MeshError("the mesh has no nodes")
    refuse("node(s) have coordinates that are not finite", ~np.isfinite(p).all(axis=0))
    far = f"node(s) have coordinates beyond ±{_FAR:g} mm"
    refuse(far, (np.abs(p) > _FAR).any(axis=0))


def refuse_nodes(p: ndarray, cells: Sequence[ndarray], what: str = "cell") -> None:
    """Refuse invalid positions (`refuse_positions`), and cells of undefined nodes.

    Cells are arrays of node numbers of the shape (n_corners, n), numbered
    consecutively, and called ``what``.
    """
    refuse_positions(p)
    listed = [((t >= 0) & (t < p.shape[1])).all(axis=0) for t in cells]
    refuse(f"{what}(s) refer to an undefined node", ~np.concatenate(listed))


def with_edges(mesh: _Mesh) -> _Mesh:
    """Name the straight edges ``left``, ``bottom``, ``right`` and ``top``.

    They are the boundary edges on the sides of the bounding box.  Sides without an edge
    are not named, and existing names are kept.
    """
    boundary = mesh.boundary_facets()
    edges = dict(mesh.boundaries or {})
    for name, on_side in sides_of_box(mesh.p[:, mesh.facets[:, boundary]]).items():
        if name not in named_nodes(mesh):
            edges.setdefault(name, boundary[on_side])
    return with_names(mesh, edges, mesh.subdomains)


def sides_of_box(ends: ndarray) -> dict[str, ndarray]:
    """True for edges, by their ends (2, 2, n), on each side of their bounding box.

    By name; sides without an edge are omitted.
    """
    sides = {}
    for x, names in zip(ends, (("left", "right"), ("bottom", "top")), strict=True):
        for name, side in zip(names, (x.min(), x.max()), strict=True):
            on_side = (np.abs(x - side) <= _NEGLIGIBLE * np.ptp(x)).all(axis=0)
            if on_side.any():
                sides[name] = on_side
    return sides


def refuse(what: str, bad: ndarray, advice: str = "") -> None:
    """Raise an error for invalid items, given as one bool per item or as numbers."""
    numbers = np.flatnonzero(bad) if bad.dtype == bool else bad
    if numbers.size:
        first = ", ".join(map(str, numbers[:_LISTED]))
        more = ", ..." if numbers.size > _LISTED else ""
        remedy = f"; {advice}" if advice else ""
        raise MeshError(f"{numbers.size} {what}: {first}{more}{remedy}")


def _refuse_names(what: str, numbers: ndarray, n: int) -> None:
    """Refuse named edges or nodes whose numbers are not in the mesh."""
    numbers = np.asarray(numbers)
    if numbers.size and (numbers.min() < 0 or numbers.max() >= n):
        raise MeshError(
            f"{what}: its numbers must be from 0 to {n - 1}, but range from "
            f"{numbers.min()} to {numbers.max()}; define it on this mesh"
        )


def _refuse_overlap(mesh: Mesh, cell: str) -> None:
    """Refuse a mesh that overlaps itself, or touches itself except along cuts."""
    boundary = boundary_of(mesh)
    if is_convex(boundary):
        return
    found = overlap_of(boundary)
    if found is None:
        raise MeshError(
            "the mesh cannot be checked for overlaps, because too many boundary edges "
            "lie on top of others: keep one layer of cells"
        )
    layered = f"{cell}(s) lie on top of others, edge on edge"
    refuse(layered, found.layered, "keep one layer")
    overlap = f"{cell}(s) overlap others that are not neighbours"
    refuse(f"{overlap}, where the boundary crosses itself", found.crossing)
    advice = "split the cell there or move the node"
    refuse("node(s) lie in the interior of an edge", found.hanging, advice)
    advice = (
        "merge them (the sides of a cut may touch only if both of its ends are single "
        "nodes; otherwise move them apart)"
    )
    refuse("node(s) coincide with others", found.doubled, advice)
    inside = f"{overlap}, because one part of the mesh lies inside another"
    refuse(inside, cells_within(boundary))


def _overlapping(mesh: Mesh, turn: ndarray) -> ndarray:
    """Elements that lie on the same side of an edge as their neighbour.

    Two cells on either side of an edge traverse it in opposite directions if each is
    traversed anticlockwise.
    """
    start = mesh.t  # the edges run 0-1, 1-2, ..., back to 0, in the order of t2f
    along = np.where(start == mesh.facets[0, mesh.t2f], 1, -1) * turn
    total = np.zeros(mesh.nfacets)
    np.add.at(total, mesh.t2f, along)
    return (np.abs(total) == 2)[mesh.t2f].any(axis=0)
