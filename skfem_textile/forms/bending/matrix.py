"""The matrix of the bending energy of one fibre family."""

from collections.abc import Mapping
from typing import Literal, TypeAlias, get_args

import numpy as np
from numpy import ndarray
from scipy.sparse import csr_matrix
from skfem import ElementQuad1, Mesh
from skfem.assembly.basis import AbstractBasis

from ...mesh.bases import components
from .edges import end_edges
from .quadrilaterals import matrix_of_quadrilaterals
from .triangles import matrix_of_triangles

#: How fibres are held at a boundary: with their direction at rest, or by their mirror
#: images on a plane of symmetry.  Elsewhere they end freely, as in hinges.
FibreEnd: TypeAlias = Literal["clamped", "mirror"]

FIBRE_ENDS: tuple[str, ...] = get_args(FibreEnd)


def bending_matrix(
    basis: AbstractBasis, A: ndarray, D: ndarray, ends: Mapping[str, FibreEnd]
) -> csr_matrix:
    """The matrix K of ½ u·K·u = ½ ∫ D |κ|² in N/mm.

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
    held = {kind: _facets(mesh, ends, kind) for kind in FIBRE_ENDS}
    free = np.setdiff1d(mesh.boundary_facets(), np.concatenate([*held.values()]))
    facets = free, held["clamped"], held["mirror"]
    at_free, clamped, mirrors = (end_edges(mesh, A, of_kind) for of_kind in facets)
    d = components(basis)
    if isinstance(basis.elem.elem, ElementQuad1):  # type: ignore[attr-defined]
        K = matrix_of_quadrilaterals(mesh, A, D, at_free, mirrors, d)
    else:
        K = matrix_of_triangles(mesh, A, D, at_free, clamped, mirrors, d)
    return csr_matrix((K + K.T) / 2)


def _facets(mesh: Mesh, ends: Mapping[str, FibreEnd], kind: str) -> ndarray:
    named = [mesh.boundaries[name] for name, end in ends.items() if end == kind]
    return np.unique(np.concatenate([np.empty(0, dtype=int), *named]))
