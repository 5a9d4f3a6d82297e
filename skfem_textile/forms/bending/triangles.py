"""Bending of fibres on quadratic triangles, by a C0 interior penalty.

Second derivatives are constant in each triangle, and slopes jump between them:

    Σ_e ∫ D κ(u) κ(v) − Σ_f ∫ {D κ(u) (A·n)²} [∂v/∂n] + {D κ(v) (A·n)²} [∂u/∂n]
    + Σ_f ∫ σ D (A·n)⁴ [∂u/∂n] [∂v/∂n]

(Brenner & Sung 2005), with [] the jump over the edge f and {} the mean of both sides.
Clamps and planes of symmetry hold the slope in the same way; free ends ask for nothing.
"""

from typing import Any

import numpy as np
from numpy import ndarray
from scipy.sparse import identity, kron
from skfem import (
    BilinearForm,
    CellBasis,
    ElementTriP2G,
    FacetBasis,
    InteriorFacetBasis,
    asm,
)
from skfem.helpers import dot, grad

from .edges import EndEdges

# The penalty over the least with which the energy is positive on every mesh.  That is
# ¾ |f| (1/|K⁺| + 1/|K⁻|) inside and 3 |f|/|K| on the boundary, as a triangle has three
# edges and constant second derivatives.
_PENALTY = 4 / 3


def matrix_of_triangles(
    mesh: Any, A: ndarray, D: ndarray, clamped: EndEdges, mirrors: EndEdges, d: int
) -> Any:
    """The matrix of the bending energy.

    Parameters
    ----------
    mesh
        A `skfem.MeshTri`.
    A, D
        As of `bending_matrix`.
    clamped, mirrors
        Edges where fibres keep their direction, and those on planes of symmetry.
    d
        Components of the displacement.
    """
    basis = CellBasis(mesh, ElementTriP2G(), intorder=2)
    area = basis.dx.sum(axis=1)
    fields = {"A": A[:, :, None], "D": D[:, None]}
    K = asm(_INSIDE, basis, **fields) + _of_slopes(mesh, A, D, area)
    if clamped.facets.size:
        K = K + _held(mesh, clamped, D, area, clamped.A * clamped.across)
    K = kron(K, identity(d))
    for normal in np.unique(mirrors.N.round(9), axis=1).T:
        own = np.abs(mirrors.N - normal[:, None]).max(axis=0) < 1e-8
        edges = EndEdges(mirrors.facets[own], mirrors.A[:, own], mirrors.N[:, own])
        N = np.pad(edges.N[:, 0], (0, d - 2))
        held = _held(mesh, edges, D, area, edges.N * edges.across**2)
        K = K + kron(held, np.eye(d) - np.outer(N, N))
    return K


def _curvature(A: Any, u: Any) -> Any:
    H = u.hess
    return A[0] ** 2 * H[0][0] + 2 * A[0] * A[1] * H[0][1] + A[1] ** 2 * H[1][1]


@BilinearForm
def _INSIDE(u, v, w):
    return w["D"] * _curvature(w["A"], u) * _curvature(w["A"], v)


@BilinearForm
def _BETWEEN(u, v, w):
    """U and v on one side each; ``sign`` is that of the normal out of it."""
    slope_u, slope_v = (
        sign * dot(w.n, grad(x)) for sign, x in ((w["sign_u"], u), (w["sign_v"], v))
    )
    moment_u = 0.5 * w["M_u"] * _curvature(w["A_u"], u)
    moment_v = 0.5 * w["M_v"] * _curvature(w["A_v"], v)
    return w["penalty"] * slope_u * slope_v - moment_u * slope_v - moment_v * slope_u


@BilinearForm
def _AT_END(u, v, w):
    """``slope`` is (A·N) A at a clamp and (A·N)² N on a plane of symmetry."""
    slope_u, slope_v = dot(w["slope"], grad(u)), dot(w["slope"], grad(v))
    moment_u, moment_v = (w["D"] * _curvature(w["A"], x) for x in (u, v))
    return w["penalty"] * slope_u * slope_v - moment_u * slope_v - moment_v * slope_u


def _of_slopes(mesh: Any, A: ndarray, D: ndarray, area: ndarray) -> Any:
    """What meets jumps of the slope between triangles."""
    sides = [InteriorFacetBasis(mesh, ElementTriP2G(), side=i) for i in (0, 1)]
    n, length = np.asarray(sides[0].normals), sides[0].dx.sum(axis=1)[:, None]
    across = [dot(A[:, side.tind, None], n) for side in sides]
    M = [D[s.tind, None] * x**2 for s, x in zip(sides, across, strict=True)]
    least = 0.75 * length * sum(1 / area[side.tind, None] for side in sides)
    # The square of the larger moment of a unit curvature over its stiffness.
    most = np.max([m * x**2 for m, x in zip(M, across, strict=True)], axis=0)
    K = 0.0
    for i, of_u in enumerate(sides):
        for j, of_v in enumerate(sides):
            fields = {
                "A_u": A[:, of_u.tind, None],
                "A_v": A[:, of_v.tind, None],
                **{"M_u": M[i], "M_v": M[j], "penalty": _PENALTY * least * most},
                **{"sign_u": (-1.0) ** i, "sign_v": (-1.0) ** j},
            }
            K = K + asm(_BETWEEN, of_u, of_v, **fields)
    return K


def _held(mesh: Any, edges: EndEdges, D: ndarray, area: ndarray, slope: ndarray) -> Any:
    """What holds a slope along boundary edges."""
    basis = FacetBasis(mesh, ElementTriP2G(), facets=edges.facets)
    length = basis.dx.sum(axis=1)
    stiffness = D[basis.tind]
    least = 3 * length / area[basis.tind] * stiffness
    fields = {"A": edges.A[:, :, None], "D": stiffness[:, None]}
    return asm(
        _AT_END,
        basis,
        **fields,
        slope=slope[:, :, None],
        penalty=(_PENALTY * least)[:, None],
    )
