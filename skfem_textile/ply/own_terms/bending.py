"""What makes the term of fibres that resist bending."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from scipy.sparse import csr_matrix
from skfem import CellBasis, Mesh

from ...fabric import Fabric
from ...forms.bending import FIBRE_ENDS, FibreEnd, bending_matrix, twist_matrix


def bending_stiffness(
    basis: CellBasis, fabric: Fabric, ends: Mapping[str, FibreEnd]
) -> csr_matrix:
    """The matrix K of ½ u·K·u = ½ ∫ (D₁ |κ₁|² + D₂ |κ₂|² + D_t |τ|²) in N/mm.

    Parameters
    ----------
    basis
        Basis of the displacement.
    fabric
        Directions, taken at the mean of the nodes of each element, and stiffnesses.
    ends
        How fibres are held where they end, by the names of boundaries.
    """
    mesh = basis.mesh
    centres = mesh.p[:, mesh.t].mean(axis=1)[:, :, None]
    warp, weft = (
        np.broadcast_to(A, centres.shape)[..., 0] for A in fabric.directions(centres)
    )
    *bending, twist = (
        np.broadcast_to(D, mesh.nelements).astype(float)
        for D in (*fabric.bending, fabric.twist)
    )
    K: Any = 0.0
    for A, D in zip((warp, weft), bending, strict=True):
        if D.any():
            K = K + bending_matrix(basis, A, D, ends)
    if twist.any():
        K = K + twist_matrix(basis, warp, weft, twist)
    return csr_matrix(K)


def checked_ends(mesh: Mesh, ends: Mapping[str, FibreEnd]) -> dict[str, FibreEnd]:
    """Fibre ends by the names of boundaries.

    Raises
    ------
    ValueError
        If a boundary or an end is unknown, or two boundaries share an edge.
    """
    if not isinstance(ends, Mapping):
        raise ValueError(
            "fibre_ends must be a mapping of names of boundaries to "
            f"{' or '.join(FIBRE_ENDS)}, not {ends!r}"
        )
    boundaries, taken = mesh.boundaries or {}, np.empty(0, dtype=int)
    for name, end in ends.items():
        if name not in boundaries:
            names = ", ".join(map(repr, boundaries)) or "none"
            raise ValueError(
                f"fibre_ends: the mesh has no boundary {name!r} (it has: {names})"
            )
        if end not in FIBRE_ENDS:
            raise ValueError(
                f"fibre_ends: {name!r} must be {' or '.join(FIBRE_ENDS)}, not {end!r}"
            )
        edges = np.unique(boundaries[name])
        if not np.isin(edges, mesh.boundary_facets()).all():
            raise ValueError(f"fibre_ends: {name!r} has edges inside the ply")
        if np.isin(edges, taken).any():
            raise ValueError(f"fibre_ends: {name!r} overlaps another of them")
        taken = np.append(taken, edges)
    return dict(ends)
