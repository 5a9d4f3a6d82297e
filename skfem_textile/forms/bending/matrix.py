"""The matrices of the bending energy of one fibre family, and of twist."""

from collections.abc import Callable, Mapping
from typing import Literal, TypeAlias, get_args

import numpy as np
from numpy import ndarray
from numpy.typing import ArrayLike
from scipy.sparse import csr_matrix
from skfem import ElementQuad1, Mesh
from skfem.assembly.basis import AbstractBasis

from ...mesh.bases import components
from .edges import Clamps, EndEdges, boundary_edges, clamps, end_edges
from .quadrilaterals import matrix_of_quadrilaterals
from .triangles import matrix_of_triangles

#: A clamp that turns: its rotation at a load factor, in space a vector along the axis,
#: as long as the angle in radians, and in the plane the angle.
Turning: TypeAlias = Callable[[float], ArrayLike]

#: Names of what holds fibres at a boundary.
EndName: TypeAlias = Literal["clamped", "mirror"]

#: How fibres are held at a boundary: with their direction at rest, by their mirror
#: images on a plane of symmetry, or in a clamp that turns.  Elsewhere they end freely,
#: as in hinges.
FibreEnd: TypeAlias = EndName | Turning

FIBRE_ENDS: tuple[str, ...] = get_args(EndName)


def bending_matrix(
    basis: AbstractBasis, A: ndarray, D: ndarray, ends: Mapping[str, FibreEnd]
) -> csr_matrix:
    """The matrix K of ½ v·K·v = ½ ∫ D |κ|² in N/mm.

    v is the displacement, and after it the columns of R − I that belong to x and y at
    rest, of each clamp that turns by R.

    Parameters
    ----------
    basis
        Basis of the displacement, of bilinear quadrilaterals or quadratic triangles.
    A
        Unit direction of the fibres in each element, shape (2, n_elements).
    D
        Bending stiffness per width of ply in N·mm in each element, shape (n_elements,).
    ends
        How fibres are held where they end, by the names of boundaries.
    """
    mesh: Mesh = basis.mesh
    turning = [mesh.boundaries[name] for name, end in ends.items() if callable(end)]
    keeping, mirrored = (_facets(mesh, ends, kind) for kind in FIBRE_ENDS)
    clamped = np.unique(np.concatenate([keeping, *turning]))
    free = np.setdiff1d(mesh.boundary_facets(), np.concatenate([clamped, mirrored]))
    at_free, at_clamps, mirrors = (
        end_edges(mesh, A, facets) for facets in (free, clamped, mirrored)
    )
    return _matrix(basis, (A, A), D, at_free, clamps(at_clamps, turning), mirrors)


def twist_matrix(
    basis: AbstractBasis, A: ndarray, B: ndarray, D: ndarray
) -> csr_matrix:
    """The matrix K of ½ u·K·u = ½ ∫ D |τ|² in N/mm, with the twist τ = ∇∇x : A⊗B.

    Of directions at right angles, z = c x y has the twist c.

    Parameters
    ----------
    basis
        As of `bending_matrix`.
    A, B
        Unit directions of both families in each element, shape (2, n_elements).
    D
        Twist stiffness per width of ply in N·mm in each element, shape (n_elements,).
    """
    mesh: Mesh = basis.mesh
    edges = boundary_edges(mesh, A, mesh.boundary_facets())
    none = EndEdges(edges.facets[:0], edges.A[:, :0], edges.N[:, :0])
    return _matrix(basis, (A, B), D, edges, clamps(none, []), none)


def _matrix(
    basis: AbstractBasis,
    along: tuple[ndarray, ndarray],
    D: ndarray,
    free: EndEdges,
    clamped: Clamps,
    mirrors: EndEdges,
) -> csr_matrix:
    """The matrix of ½ ∫ D |∇∇x : A⊗B|² for the directions (A, B) of ``along``."""
    mesh: Mesh = basis.mesh
    d = components(basis)
    if isinstance(basis.elem.elem, ElementQuad1):  # type: ignore[attr-defined]
        K = matrix_of_quadrilaterals(mesh, along, D, free, clamped, mirrors, d)
    else:
        K = matrix_of_triangles(mesh, along, D, free, clamped, mirrors, d)
    return csr_matrix((K + K.T) / 2)


def _facets(mesh: Mesh, ends: Mapping[str, FibreEnd], kind: str) -> ndarray:
    named = [mesh.boundaries[name] for name, end in ends.items() if end == kind]
    return np.unique(np.concatenate([np.empty(0, dtype=int), *named]))
