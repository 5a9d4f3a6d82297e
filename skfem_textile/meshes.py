"""What a quadrilateral mesh must fulfil before anything is computed on it."""

from dataclasses import replace

import numpy as np
from numpy import ndarray
from skfem import Mesh, MeshQuad, MeshQuad2
from skfem.helpers import det

from .elements import GAUSS

# An edge this much shorter than the others, or a Jacobian as small, is none.
_NEGLIGIBLE = 1e-9


class MeshError(ValueError):
    """A mesh that cannot be computed on; the message says where and what to do."""


def check_quads(mesh: Mesh) -> None:
    """Refuse a mesh that is not a sound mesh of bilinear quadrilaterals.

    Raises
    ------
    MeshError
        If the mesh has other cells, positions that are not finite, unused nodes or
        nodes that are not there, edges of more than two quadrilaterals,
        quadrilaterals with a collapsed edge or inverted at a 2×2 point, or
        quadrilaterals that overlap a neighbour.
    """
    if not isinstance(mesh, MeshQuad) or isinstance(mesh, MeshQuad2):
        raise MeshError(f"the mesh must be a skfem.MeshQuad, not {type(mesh).__name__}")
    listed = (mesh.t >= 0) & (mesh.t < mesh.p.shape[1])
    _refuse("quadrilateral(s) name a node that is not there", ~listed.all(axis=0))
    _refuse("node(s) not finite", ~np.isfinite(mesh.p).all(axis=0))
    gauss, _ = GAUSS
    used = np.zeros(mesh.p.shape[1], dtype=bool)
    used[mesh.t] = True
    _refuse("node(s) belong to no quadrilateral; remove them", ~used)
    shared = np.bincount(mesh.t2f.ravel())
    crowded = (shared > 2)[mesh.t2f].any(axis=0)
    _refuse("quadrilateral(s) share an edge with more than one other", crowded)
    jacobian = det(mesh.mapping().DF(gauss))
    turn = np.sign(jacobian.sum(axis=1))
    _refuse(
        "quadrilateral(s) inverted or degenerate",
        _inverted(mesh, jacobian * turn[:, None]) | _collapsed(mesh),
    )
    _refuse("quadrilateral(s) lie on top of a neighbour", _overlapping(mesh, turn))


def with_edges(mesh: MeshQuad) -> MeshQuad:
    """Name the straight edges ``left``, ``bottom``, ``right`` and ``top``.

    They are the boundary edges on the sides of the mesh's bounding box.  A side on
    which there is none, and a name that the mesh has already, are left alone.
    """
    boundary = mesh.boundary_facets()
    x = mesh.p[:, mesh.facets[:, boundary]]
    edges = dict(mesh.boundaries or {})
    for axis, sides in enumerate((("left", "right"), ("bottom", "top"))):
        low, high = mesh.p[axis].min(), mesh.p[axis].max()
        for name, side in zip(sides, (low, high), strict=True):
            on_side = (np.abs(x[axis] - side) <= _NEGLIGIBLE * (high - low)).all(axis=0)
            if on_side.any():
                edges.setdefault(name, boundary[on_side])
    return replace(mesh, _boundaries=edges)


def _refuse(what: str, bad: ndarray) -> None:
    if bad.any():
        first = ", ".join(str(i) for i in np.flatnonzero(bad)[:10])
        more = ", ..." if bad.sum() > 10 else ""
        raise MeshError(f"{bad.sum()} {what}: {first}{more}")


def _inverted(mesh: MeshQuad, jacobian: ndarray) -> ndarray:
    """Elements whose Jacobian vanishes or changes sign among the 2×2 points."""
    return jacobian.min(axis=1) <= _NEGLIGIBLE * _edge_lengths(mesh).max(axis=0) ** 2


def _collapsed(mesh: MeshQuad) -> ndarray:
    """Elements with an edge of no length."""
    length = _edge_lengths(mesh)
    return length.min(axis=0) <= _NEGLIGIBLE * length.max(axis=0)


def _edge_lengths(mesh: MeshQuad) -> ndarray:
    x = mesh.p[:, mesh.t]
    return np.linalg.norm(np.roll(x, -1, axis=1) - x, axis=0)


def _overlapping(mesh: MeshQuad, turn: ndarray) -> ndarray:
    """Elements that lie on the same side of some edge as their neighbour there.

    Walked anticlockwise, two quadrilaterals on either side of an edge run along
    it in opposite directions.
    """
    start = mesh.t  # the edges run 0-1, 1-2, 2-3, 3-0, in the order of t2f
    along = np.where(start == mesh.facets[0, mesh.t2f], 1, -1) * turn
    both = np.zeros(mesh.nfacets)
    np.add.at(both, mesh.t2f, along)
    return (np.abs(both) == 2)[mesh.t2f].any(axis=0)
