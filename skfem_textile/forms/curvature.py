"""Curvature vectors of fibres as a linear operator, for bending laws.

They enter the energy ½ ∫ D |κ|² of `bending` too: at the nodes of quadrilaterals, and
as means of triangles.  Jumps of the slope s between triangles, which `bending`
penalises by ½ ∫ σ D (A·n)⁴ |[s]|² over edges with σ = σ₀ c, are here curvatures c
(A·n)² [s] on the area σ₀/c per length of an edge, with the law: the stiffness at rest
would be too large where fibres soften, and too small where they stiffen.
"""

from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple

import numpy as np
from numpy import ndarray
from scipy.sparse import block_diag, csr_matrix, diags, hstack, identity, kron, vstack
from skfem import (
    AbstractBasis,
    CellBasis,
    ElementQuad1,
    ElementTriP0,
    ElementTriP2,
    asm,
)
from skfem.helpers import dot

from ..mesh.bases import components
from ..mesh.selection import FibreEnd
from .bending import (
    FLUX,
    JUMPS,
    NONE,
    PRODUCT,
    Clamps,
    EndEdges,
    both_sides,
    component_areas,
    ends_of,
    excluded_components,
    integrals_of_curvature,
    on_quadrilaterals,
    planes_of_symmetry,
    slope_differences,
    slopes_off,
    triangle_areas,
)


class Curvature(NamedTuple):
    """Curvature vectors m = C v of one fibre family in mm⁻¹, and where they act.

    ``v`` is as in `bending_matrix`.  The energy of a law φ is Σ area φ(|m|) over the
    points, each with the curvature of a site: a node of quadrilaterals, a triangle,
    or a point of an edge between triangles.

    Attributes
    ----------
    operator
        C, shape (n_sites d, n_v).
    site
        Site of each point, shape (n_elements, n_points).
    area
        Area in mm² of each point, zero where the moment is zero.
    """

    operator: csr_matrix
    site: ndarray
    area: ndarray


def curvature_of(
    basis: AbstractBasis, A: ndarray, ends: Mapping[str, FibreEnd]
) -> Curvature:
    """Curvature vectors of fibres; parameters as `bending_matrix`."""
    mesh, d = basis.mesh, components(basis)
    at_ends = ends_of(mesh, A, ends)
    if on_quadrilaterals(basis):
        return _curvature_at_nodes(mesh, (A, A), *at_ends, d)
    return _curvature_of_triangles(mesh, (A, A), *at_ends, d)


def _curvature_at_nodes(
    mesh: Any,
    along: tuple[ndarray, ndarray],
    free: EndEdges,
    clamped: Clamps,
    mirrors: EndEdges,
    d: int,
) -> Curvature:
    """Curvature on a `skfem.MeshQuad`; its points are the corners of the elements.

    Near a plane of symmetry components of m have different weights.  The area of a node
    is the weight of the even ones, and the odd ones, which vanish on the plane, are
    scaled.
    """
    basis = CellBasis(mesh, ElementQuad1(), intorder=3)
    overlap = asm(PRODUCT, basis, D=np.ones((mesh.nelements, 1)))
    area = np.asarray(overlap.sum(axis=1)).ravel()
    left_out = excluded_components(mesh, free, mirrors, d)
    values, vectors = np.linalg.eigh(component_areas(overlap, area, left_out))
    retained = values > NONE * area[:, None]
    total = np.where(retained, values, np.inf).min(axis=1)
    total = np.where(retained.any(axis=1), total, 0.0)
    scale = np.sqrt(values * retained / np.where(total > 0, total, 1.0)[:, None])
    scaled = (vectors * scale[:, None]) @ vectors.swapaxes(1, 2) / area[:, None, None]
    L = -slope_differences(basis, along, clamped, mirrors)
    m = block_diag(list(scaled), format="csr") @ kron(L, identity(d), format="csr")
    share = (total / area)[mesh.t.T]
    return Curvature(csr_matrix(m), mesh.t.T, _corner_areas(basis) * share)


def _corner_areas(basis: CellBasis) -> ndarray:
    """∫ φ of each corner over each quadrilateral, shape (n_elements, 4)."""
    areas = [(np.asarray(phi[0]) * basis.dx).sum(axis=1) for phi in basis.basis]
    return np.transpose(areas)


class _Sites(NamedTuple):
    """Curvatures at sites, and the areas and elements where they act.

    ``operator`` has d rows per site, and ``area`` and ``element`` the shape (n_sites,
    n): each site acts in n elements.
    """

    operator: Any
    area: ndarray
    element: ndarray


def _curvature_of_triangles(
    mesh: Any,
    along: tuple[ndarray, ndarray],
    free: EndEdges,
    clamped: Clamps,
    mirrors: EndEdges,
    d: int,
) -> Curvature:
    """Curvature on a `skfem.MeshTri`: means of triangles, and jumps at edges."""
    area = triangle_areas(mesh)
    m = integrals_of_curvature(mesh, along, free, clamped, mirrors, d)
    means = kron(diags(1 / area), identity(d)) @ m
    each = [_Sites(means, area[:, None], np.arange(mesh.nelements)[:, None])]
    each += _jumps(mesh, along[0], clamped, mirrors, d)
    starts = np.cumsum([0, *(len(one.area) for one in each)])
    entries = [
        (
            one.element.ravel(),
            np.repeat(start + np.arange(len(one.area)), one.area.shape[1]),
            one.area.ravel(),
        )
        for start, one in zip(starts, each, strict=False)
    ]
    element, site, areas = (np.concatenate(x) for x in zip(*entries, strict=True))
    order = np.argsort(element, kind="stable")
    element, site, areas = element[order], site[order], areas[order]
    first = np.searchsorted(element, np.arange(mesh.nelements))
    column = np.arange(len(element)) - first[element]
    shape = mesh.nelements, column.max() + 1
    sites, of_points = np.zeros(shape, dtype=int), np.zeros(shape)
    sites[element, column], of_points[element, column] = site, areas
    operator = vstack([one.operator for one in each], format="csr")
    return Curvature(csr_matrix(operator), sites, of_points)


def _jumps(
    mesh: Any, A: ndarray, clamped: Clamps, mirrors: EndEdges, d: int
) -> Iterator[_Sites]:
    """Jumps between triangles, and slopes relative to clamps and planes of symmetry."""
    area, n_turned = triangle_areas(mesh), clamped.turned.shape[1]
    one, other = both_sides(mesh, ElementTriP2(), 2)
    n_points, tinds = one.dx.shape[1], np.array([one.tind, other.tind])
    n, length = np.asarray(one.normals), one.dx.sum(axis=1)[:, None]
    elements = tinds.T
    across = np.max([dot(A[:, x, None], n) ** 2 for x in tinds], axis=0)
    c = 0.75 * length * (1 / area[elements]).sum(axis=1, keepdims=True)
    jump = _normal_slopes(other, n) - _normal_slopes(one, n)
    jump = hstack([jump, csr_matrix((jump.shape[0], n_turned))])
    rows = diags((c * across).ravel()) @ jump
    half = (0.5 * JUMPS / c * one.dx).ravel()
    yield _Sites(
        kron(rows, identity(d)),
        np.stack([half, half], axis=-1),
        np.repeat(elements, n_points, axis=0),
    )
    none = csr_matrix((mirrors.facets.size, n_turned))
    of_clamps = clamped.edges.A * clamped.edges.across
    edges = [(clamped.edges, of_clamps, clamped.turned, np.eye(d))]
    for plane, even in planes_of_symmetry(mirrors, d):
        turned = none[: plane.facets.size]
        edges.append((plane, plane.N * plane.across**2, turned, even))
    for at, slope, turned, even in edges:
        if at.facets.size:
            off, basis = slopes_off(mesh, at, slope, turned)
            inside = mesh.f2t[0, at.facets][:, None]
            c = 3 * basis.dx.sum(axis=1, keepdims=True) / area[inside] + 0 * basis.dx
            yield _Sites(
                kron(diags(c.ravel()) @ off, even),
                (JUMPS / c * basis.dx).reshape(-1, 1),
                (inside + np.zeros(c.shape, dtype=int)).reshape(-1, 1),
            )


def _normal_slopes(side: Any, n: ndarray) -> csr_matrix:
    """Operator of ∂u/∂n at the points of edges, from one side."""
    slopes = np.array([dot(n, np.asarray(phi[0].grad)) for phi in side.basis])
    columns = np.broadcast_to(side.element_dofs[:, :, None], slopes.shape)
    rows = np.broadcast_to(
        np.arange(slopes[0].size).reshape(slopes[0].shape), slopes.shape
    )
    shape = slopes[0].size, side.N
    return csr_matrix((slopes.ravel(), (rows.ravel(), columns.ravel())), shape)


def gradient_along(basis: AbstractBasis, A: ndarray, sites: Curvature) -> csr_matrix:
    """Operator G of A·∇u, averaged around the sites, (n_sites d, n_unknowns).

    ``A`` is as in `bending_matrix`.
    """
    mesh, d = basis.mesh, components(basis)
    scalar = basis.elem.elem  # type: ignore[attr-defined]
    slopes = CellBasis(mesh, scalar, intorder=3)
    if on_quadrilaterals(basis):
        G = asm(FLUX, slopes, slopes, slope=A[:, :, None])
        area = np.bincount(mesh.t.T.ravel(), _corner_areas(slopes).ravel())
    else:
        means = asm(
            FLUX, slopes, slopes.with_element(ElementTriP0()), slope=A[:, :, None]
        )
        means = diags(1 / triangle_areas(mesh)) @ means
        element = np.repeat(np.arange(mesh.nelements), sites.site.shape[1])
        shape = sites.operator.shape[0] // d, mesh.nelements
        share = csr_matrix((sites.area.ravel(), (sites.site.ravel(), element)), shape)
        G, area = share @ means, np.asarray(share.sum(axis=1)).ravel()
    every = kron(diags(1 / area) @ G, identity(d), format="csr")
    every.resize(every.shape[0], sites.operator.shape[1])
    return csr_matrix(every)
