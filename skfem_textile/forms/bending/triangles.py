"""Bending of fibres on quadratic triangles, by mean curvatures of the triangles.

The mean curvature of a triangle K is that of the slopes around it,

    m_K = 1/|K| ∮ (A·n)(A·{∇u}),

with {} the mean of both sides: slopes across edges jump.  The energy is
½ Σ D |K| |m_K|², and jumps meet a small stiffness, ½ Σ_f ∫ σ D (A·n)⁴ |[∂u/∂n]|² (a C0
discontinuous Galerkin method, Huang, Huang & Han 2010).  A·∇u vanishes at a clamp, and
on a plane of symmetry ∂u/∂n of what is even.  Free ends have the slopes of their
triangles.
"""

from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy import ndarray
from scipy.sparse import block_diag, csr_matrix, diags, hstack, identity, kron
from skfem import (
    BilinearForm,
    ElementTriP0,
    ElementTriP2,
    FacetBasis,
    InteriorFacetBasis,
    asm,
)
from skfem.helpers import dot, grad

from .edges import Clamps, EndEdges

# σ over the least with which an interior penalty alone makes the energy positive on
# every mesh: ¾ |f| (1/|K⁺| + 1/|K⁻|) inside and 3 |f|/|K| on the boundary, as a
# triangle has three edges.  Chosen: with a larger one plates are stiffer; with a
# smaller one coarse cantilevers take more steps.
_JUMPS = 0.2


def matrix_of_triangles(
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
        A `skfem.MeshTri`.
    along
        Unit directions (A, B) in each element: the same for bending.
    D
        As of `bending_matrix`.
    free, clamped, mirrors
        Edges where fibres end freely, where they keep their direction, and those on
        planes of symmetry.
    d
        Components of the displacement.
    """
    (a, b), (c, e) = (mesh.p[:, mesh.t[i]] - mesh.p[:, mesh.t[0]] for i in (1, 2))
    area = 0.5 * np.abs(a * e - b * c)
    curvature = hstack([_inside(mesh, along), _prescribed(mesh, clamped)])
    n_turned = curvature.shape[1] - mesh.nvertices - mesh.nfacets

    def through(edges: EndEdges, slope: ndarray) -> Any:
        none = csr_matrix((mesh.nelements, n_turned))
        return hstack([_through(mesh, edges, slope), none])

    for edges in (free, mirrors):
        B = along[1][:, mesh.f2t[0, edges.facets]]
        curvature = curvature + through(edges, B * edges.across)
    slope = clamped.edges.A * clamped.edges.across
    K = block_diag([_of_jumps(mesh, along, D, area), csr_matrix((n_turned, n_turned))])
    K = K + _held(mesh, clamped.edges, slope, D, area, clamped.turned)
    every: Any = identity(d)
    K, curvature = kron(K, every), kron(curvature, every)
    for edges, even in _planes(mirrors, d):
        slope = edges.N * edges.across**2
        none = csr_matrix((edges.facets.size, n_turned))
        curvature = curvature - kron(through(edges, slope), even)
        K = K + kron(_held(mesh, edges, slope, D, area, none), even)
    return K + curvature.T @ kron(diags(D / area), every) @ curvature


def _planes(mirrors: EndEdges, d: int) -> Iterator[tuple[EndEdges, ndarray]]:
    """The edges on each plane of symmetry, and the projector on what is even there."""
    for normal in np.unique(mirrors.N.round(9), axis=1).T:
        own = np.abs(mirrors.N - normal[:, None]).max(axis=0) < 1e-8
        edges = EndEdges(mirrors.facets[own], mirrors.A[:, own], mirrors.N[:, own])
        N = np.pad(normal, (0, d - 2))
        yield edges, np.eye(d) - np.outer(N, N)


@BilinearForm
def _FLUX(u, v, w):
    return v * dot(w["slope"], grad(u))


@BilinearForm
def _JUMP(u, v, w):
    return w["stiffness"] * dot(w.n, grad(u)) * dot(w.n, grad(v))


def _sides(mesh: Any, element: Any) -> list[InteriorFacetBasis]:
    return [InteriorFacetBasis(mesh, element, intorder=2, side=i) for i in (0, 1)]


def _inside(mesh: Any, along: tuple[ndarray, ndarray]) -> Any:
    """∮ (A·n)(B·{∇u}) over the edges of each triangle that are inside the ply."""
    slopes, triangles = (
        _sides(mesh, element()) for element in (ElementTriP2, ElementTriP0)
    )
    n = np.asarray(slopes[0].normals)
    found: Any = 0.0
    for sign, own in zip((1, -1), triangles, strict=True):
        A, B = (direction[:, own.tind, None] for direction in along)
        slope = 0.5 * sign * dot(A, n) * B
        found = found + sum(asm(_FLUX, side, own, slope=slope) for side in slopes)
    return found


def _prescribed(mesh: Any, clamped: Clamps) -> csr_matrix:
    """∮ (A·n) A·∇u over clamps, of each triangle, by what turns them."""
    facets = clamped.edges.facets
    ends = mesh.p[:, mesh.facets[:, facets]]
    length = np.hypot(*(ends[:, 1] - ends[:, 0]))
    places = mesh.f2t[0, facets], np.arange(facets.size)
    of_triangles = csr_matrix((length, places), (mesh.nelements, facets.size))
    return of_triangles @ clamped.turned


def _through(mesh: Any, edges: EndEdges, slope: ndarray) -> Any:
    """∮ slope·∇u over edges of the boundary, of each triangle."""
    if not edges.facets.size:
        return csr_matrix((mesh.nelements, mesh.nvertices + mesh.nfacets))
    slopes, triangles = (
        FacetBasis(mesh, element(), facets=edges.facets, intorder=2)
        for element in (ElementTriP2, ElementTriP0)
    )
    return asm(_FLUX, slopes, triangles, slope=slope[:, :, None])


def _of_jumps(
    mesh: Any, along: tuple[ndarray, ndarray], D: ndarray, area: ndarray
) -> Any:
    """What meets jumps of the slope between triangles."""
    sides = _sides(mesh, ElementTriP2())
    n, length = np.asarray(sides[0].normals), sides[0].dx.sum(axis=1)[:, None]
    A, B = ([dot(x[:, side.tind, None], n) for side in sides] for x in along)
    most = np.max(
        [D[s.tind, None] * (a * b) ** 2 for s, a, b in zip(sides, A, B, strict=True)],
        axis=0,
    )
    least = 0.75 * length * sum(1 / area[side.tind, None] for side in sides)
    return sum(
        (1 if u is v else -1) * asm(_JUMP, u, v, stiffness=_JUMPS * least * most)
        for u in sides
        for v in sides
    )


def _held(
    mesh: Any,
    edges: EndEdges,
    slope: ndarray,
    D: ndarray,
    area: ndarray,
    turned: csr_matrix,
) -> Any:
    """What holds a slope along boundary edges, where turned that of the clamp."""
    if not edges.facets.size:
        n = mesh.nvertices + mesh.nfacets + turned.shape[1]
        return csr_matrix((n, n))
    basis = FacetBasis(mesh, ElementTriP2(), facets=edges.facets, intorder=2)
    slopes = np.array(
        [dot(slope[:, :, None], np.asarray(phi[0].grad)) for phi in basis.basis]
    )
    n_points = slopes.shape[2]
    columns = np.broadcast_to(basis.element_dofs[:, :, None], slopes.shape)
    points = np.arange(slopes[0].size).reshape(slopes[0].shape)
    rows = np.broadcast_to(points, slopes.shape)
    shape = slopes[0].size, basis.N
    at_points = csr_matrix((slopes.ravel(), (rows.ravel(), columns.ravel())), shape)
    off = hstack([at_points, -kron(turned, np.ones((n_points, 1)))])
    least = 3 * basis.dx.sum(axis=1) / area[basis.tind] * D[basis.tind]
    return off.T @ diags((_JUMPS * least[:, None] * basis.dx).ravel()) @ off
