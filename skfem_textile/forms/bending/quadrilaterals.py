"""Bending of fibres on bilinear quadrilaterals, by curvatures at the nodes.

In the weak sense the curvature at node i is m_i = (M⁻¹ L u)_i with M lumped and

    L_ij = Σ_e [∫ (A·∇φ_i)(A·∇φ_j) − ∮ φ_i (A·N)(A·{∇φ_j})],

where ∮ goes over interior edges and {} is the mean of both sides; where A does not
jump its parts cancel.  The energy is ½ Σ D W_i |m_i|² with the areas W_i of the nodes.
Where fibres end freely their moment is zero: these nodes are left out, and their area
goes to nodes of the same elements.  At a clamp A·∇u vanishes, which is the natural
condition of L.  On a plane of symmetry with the normal N the part of m along N is left
out, as it is odd there, and ∂u/∂N vanishes of what is even.
"""

from typing import Any

import numpy as np
from numpy import ndarray
from scipy.sparse import block_diag, csr_matrix, diags, hstack, identity, kron
from skfem import (
    BilinearForm,
    CellBasis,
    ElementQuad1,
    FacetBasis,
    InteriorFacetBasis,
    asm,
)
from skfem.helpers import dot, grad

from .edges import Clamps, EndEdges

# Eigenvalues of sums of N⊗N that count as zero.
_NONE = 1e-9


def matrix_of_quadrilaterals(
    mesh: Any,
    along: tuple[ndarray, ndarray],
    D: ndarray,
    free: EndEdges,
    clamped: Clamps,
    mirrors: EndEdges,
    d: int,
) -> Any:
    """The matrix of the bending energy.

    Parameters
    ----------
    mesh
        A `skfem.MeshQuad`.
    along
        Unit directions (A, B) in each element: the same for bending.
    D
        As of `bending_matrix`.
    free, clamped, mirrors
        Edges where fibres end freely, where they are clamped, and those on planes of
        symmetry.
    d
        Components of the displacement.
    """
    basis = CellBasis(mesh, ElementQuad1(), intorder=3)
    overlap, stiffness = (asm(_PRODUCT, basis, D=x[:, None]) for x in (D * 0 + 1, D))
    area, D_area = (np.asarray(x.sum(axis=1)).ravel() for x in (overlap, stiffness))
    A, B = along
    L = asm(_ALONG_FIBRES, basis, A=A[:, :, None], B=B[:, :, None])
    if np.ptp(along, axis=2).any():
        L = L - _of_jumps(mesh, A, B)
    if mirrors.facets.size:
        edges = FacetBasis(mesh, ElementQuad1(), facets=mirrors.facets, intorder=3)
        L = L - asm(_EVEN, edges, A=mirrors.A[:, :, None])
    L = hstack([L, -_prescribed(mesh, clamped)], format="csr")
    left_out = _left_out(mesh, free, mirrors, d)
    weights = _weights(overlap, area, left_out) * (D_area / area**3)[:, None, None]
    if not mirrors.facets.size:
        return kron(L.T @ diags(weights[:, 0, 0]) @ L, identity(d))
    every = kron(L, identity(d), format="csr")
    return every.T @ block_diag(weights, format="csr") @ every


@BilinearForm
def _PRODUCT(u, v, w):
    return w["D"] * u * v


@BilinearForm
def _ALONG_FIBRES(u, v, w):
    of_u, of_v = ([dot(w[k], grad(x)) for k in "AB"] for x in (u, v))
    return 0.5 * (of_u[0] * of_v[1] + of_u[1] * of_v[0])


@BilinearForm
def _EVEN(u, v, w):
    """φ (A·N)(A·∇u) where ∂u/∂N = 0."""
    across = dot(w["A"], w.n)
    return v * across * (dot(w["A"], grad(u)) - across * dot(w.n, grad(u)))


@BilinearForm
def _OF_JUMP(u, v, w):
    return 0.5 * v * dot(w["jump"], grad(u))


def _of_jumps(mesh: Any, A: ndarray, B: ndarray) -> Any:
    """∮ φ_i ½ [(A·N) B + (B·N) A]·{∇φ_j} over interior edges; [] is the jump."""
    sides = [
        InteriorFacetBasis(mesh, ElementQuad1(), intorder=3, side=side)
        for side in (0, 1)
    ]
    n = np.asarray(sides[0].normals)
    one, other = (
        0.5 * (dot(a, n) * b + dot(b, n) * a)
        for side in sides
        for a, b in [(A[:, side.tind, None], B[:, side.tind, None])]
    )
    jump = one - other
    return sum(asm(_OF_JUMP, side, sides[0], jump=jump) for side in sides)


def _prescribed(mesh: Any, clamped: Clamps) -> csr_matrix:
    """∮ φ_i (A·N) A·∇u over clamps, by what turns them."""
    ends = mesh.facets[:, clamped.edges.facets]
    half = 0.5 * np.hypot(*(mesh.p[:, ends[1]] - mesh.p[:, ends[0]]))
    columns = np.tile(np.arange(len(half)), 2)
    shape = mesh.nvertices, len(half)
    to_nodes = csr_matrix((np.tile(half, 2), (ends.ravel(), columns)), shape=shape)
    return to_nodes @ clamped.turned


def _left_out(mesh: Any, free: EndEdges, mirrors: EndEdges, d: int) -> ndarray:
    """Projectors on the components of m that are left out, shape (n_nodes, d, d)."""
    N = np.zeros((d, mirrors.facets.size))
    N[:2] = mirrors.N
    projectors = np.zeros((mesh.nvertices, d, d))
    for nodes in mesh.facets[:, mirrors.facets]:
        np.add.at(projectors, nodes, np.einsum("in,jn->nij", N, N))
    nodes = np.unique(mesh.facets[:, mirrors.facets])
    values, vectors = np.linalg.eigh(projectors[nodes])
    odd = vectors * (values > _NONE)[:, None]
    projectors[nodes] = odd @ vectors.swapaxes(1, 2)
    projectors[mesh.facets[:, free.facets]] = np.eye(d)
    return projectors


def _weights(overlap: csr_matrix, area: ndarray, left_out: ndarray) -> ndarray:
    """Areas of the components of m at the nodes, shape (n_nodes, d, d).

    What is left out gives its area in equal parts to what is kept at nodes of the same
    elements.
    """
    n, d, _ = left_out.shape
    kept = np.eye(d) - left_out
    giving = np.flatnonzero(left_out.any(axis=(1, 2)))
    beside = (overlap[giving] != 0).astype(float)
    receivers = (beside @ kept.reshape(n, -1)).reshape(-1, d, d)
    given = np.linalg.pinv(receivers) @ left_out[giving] * area[giving, None, None]
    received = (beside.T @ given.reshape(-1, d * d)).reshape(n, d, d)
    return area[:, None, None] * kept + kept @ received @ kept
