"""Quadrilaterals cut in two triangles each."""

from dataclasses import dataclass, field, replace
from typing import TypeGuard

import numpy as np
from numpy import ndarray
from skfem import ElementQuad1, Mesh, MeshQuad, MeshTri
from skfem.helpers import cross

from ..checks import refuse_nodes
from ..named_nodes import NamedNodes, named_nodes

# Areas that differ by less than this share count as equal.  Chosen: above rounding, so
# that the cut of a parallelogram does not depend on it.
_EQUAL_AREAS = 1e-9


@dataclass(repr=False)
class CutMesh(NamedNodes, MeshTri):
    """Triangles into which quadrilaterals were cut.

    Attributes
    ----------
    quads
        The quadrilaterals as node numbers, shape (4, n).
    parent
        For each triangle its quadrilateral; shape (n_elements,).
    """

    quads: ndarray = field(default_factory=lambda: np.empty((4, 0), dtype=int))
    parent: ndarray = field(default_factory=lambda: np.empty(0, dtype=int))


def was_cut(mesh: Mesh) -> TypeGuard[CutMesh]:
    """Whether a mesh is a result of `cut` with its parents still valid."""
    if not isinstance(mesh, CutMesh) or np.shape(mesh.parent) != (mesh.nelements,):
        return False
    if not np.array_equal(np.unique(mesh.parent), np.arange(mesh.quads.shape[1])):
        return False
    among = mesh.t[:, None] == mesh.quads[:, mesh.parent]
    return bool(among.any(axis=1).all())


def cut(mesh: MeshQuad) -> CutMesh:
    """Cut every quadrilateral in two triangles.

    The diagonal is the one whose smaller triangle is larger, so that no triangle lies
    outside a quadrilateral that is not convex.  Boundaries, subdomains and named
    nodes keep their names.

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
    triangles = replace(mesh, t=_with_diagonal(mesh)).to_meshtri()
    return CutMesh(
        triangles.p,
        triangles.t,
        triangles.boundaries,
        triangles.subdomains,
        named_nodes=dict(named_nodes(mesh)),
        quads=mesh.t,
        parent=np.tile(np.arange(mesh.nelements), 2),
    )


def corner_areas(mesh: MeshQuad) -> ndarray:
    """Twice the area of the triangle at each corner, negative at a reflex one."""
    before, here, after = (mesh.p[:, np.roll(mesh.t, i, axis=0)] for i in (1, 0, -1))
    corner = cross(after - here, before - here)
    return corner * np.sign(corner.sum(axis=0))


def _with_diagonal(mesh: MeshQuad) -> ndarray:
    """Nodes of the quadrilaterals, rotated: the diagonal joins second and last."""
    corner = corner_areas(mesh)
    ends_13, ends_02 = corner[::2].min(axis=0), corner[1::2].min(axis=0)
    switch = ends_02 > ends_13 + _EQUAL_AREAS * np.abs(ends_13)
    return np.where(switch, np.roll(mesh.t, 1, axis=0), mesh.t)


def triangles_of(mesh: MeshQuad) -> ndarray:
    """Nodes of the triangles: the first of every quadrilateral, then the second."""
    t = _with_diagonal(mesh)
    return np.hstack([t[[0, 1, 3]], t[[1, 2, 3]]])
