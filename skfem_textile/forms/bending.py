"""Bending of fibres, one family at a time: the constant matrix of ½ D ∫ |κ|².

Bending laws use the same curvature vectors, see `curvature` and `bending_laws`.

κ = ∇∇x : A⊗A is the second derivative of the position along the fibre in mm⁻¹.  It is
linear in the displacement, rotates with the ply in space, and vanishes at rest, even
where fibres are curved in the plane.

Bending of fibres on bilinear quadrilaterals, by curvatures at the nodes.

The weak curvature at node i is m_i = (M⁻¹ L u)_i with M lumped and

    L_ij = Σ_e [∫ (A·∇φ_i)(A·∇φ_j) − ∮ φ_i (A·N)(A·{∇φ_j})],

where ∮ is over interior edges and {} is the mean of both sides; the contributions of
both sides cancel where A is continuous.  The energy is ½ Σ D W_i |m_i|² with the areas
W_i of the nodes.  At free fibre ends the moment is zero: these nodes are excluded, and
their area is assigned to nodes of the same elements.  At a clamp A·∇u = 0, which is the
natural condition of L.  On a plane of symmetry with the normal N the component of m
along N, which is odd, is excluded, and ∂u/∂N = 0 for the even components.

Bending of fibres on quadratic triangles, by mean curvatures of the triangles.

The mean curvature of a triangle K follows from the slopes around it,

    m_K = 1/|K| ∮ (A·n)(A·{∇u}),

where {} is the mean of both sides, because slopes jump across edges.  The energy is ½ Σ
D |K| |m_K|², and jumps are penalised by ½ Σ_f ∫ σ D (A·n)⁴ |[∂u/∂n]|² (a C0
discontinuous Galerkin method, Huang, Huang & Han 2010).  A·∇u = 0 at a clamp, and on a
plane of symmetry ∂u/∂n = 0 for the even components.  At free ends the slope is taken
from the adjacent triangle.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy import ndarray
from scipy.sparse import block_diag, csr_matrix, diags, hstack, identity, kron
from skfem import (
    AbstractBasis,
    BilinearForm,
    CellBasis,
    ElementQuad1,
    ElementTriP0,
    ElementTriP2,
    FacetBasis,
    InteriorFacetBasis,
    Mesh,
    asm,
)
from skfem.helpers import dot, grad

from ..mesh.bases import components
from ..mesh.selection import FIBRE_ENDS, FibreEnd

# Angle in radians between fibres and a boundary below which they are taken as parallel.
# A larger value would ignore the slope of crossing fibres; a smaller one would mistake
# round-off for an angle.
_ALONG = 1e-6


@dataclass(frozen=True, eq=False)
class EndEdges:
    """Boundary edges at which fibres end.

    Attributes
    ----------
    facets
        Edge numbers, shape (n,).
    A
        Unit fibre direction at each edge, shape (2, n).
    N
        Outward unit normal, shape (2, n).
    length
        Shape (n,).
    """

    facets: ndarray
    A: ndarray
    N: ndarray
    length: ndarray

    @property
    def across(self) -> ndarray:
        """A·N, shape (n,)."""
        return (self.A * self.N).sum(axis=0)

    def where(self, chosen: Any) -> "EndEdges":
        """Some of the edges, by a mask or a slice."""
        arrays = self.facets, self.A, self.N, self.length
        return EndEdges(*(x[..., chosen] for x in arrays))


@dataclass(frozen=True, eq=False)
class Clamps:
    """Clamped boundary edges: fibre direction fixed, or rotated as prescribed.

    Attributes
    ----------
    edges
        The edges.
    turned
        Coefficients of the prescribed A·∇u (A·N), shape (n, 2 m): for each of m clamps
        with the rotation R, the unknowns are the columns of R − I for x and y at rest.
    """

    edges: EndEdges
    turned: csr_matrix


def clamps(edges: EndEdges, turning: Sequence[ndarray]) -> Clamps:
    """Clamped edges, and the edge numbers of each rotating clamp."""
    columns = [
        np.isin(edges.facets, facets) * (edges.A * edges.across) for facets in turning
    ]
    shape = edges.facets.size, 2 * len(turning)
    return Clamps(edges, csr_matrix(np.reshape(columns, shape[::-1]).T))


def edges_with_fibres(mesh: Mesh, A: ndarray, facets: ndarray) -> EndEdges:
    """Boundary edges with the fibre directions there.

    A is the unit direction of the fibres in each element, shape (2, n_elements).
    """
    ends = mesh.p[:, mesh.facets[:, facets]]
    along = ends[:, 1] - ends[:, 0]
    length = np.hypot(*along)
    N = np.array([along[1], -along[0]]) / length
    elements = mesh.f2t[0, facets]
    out = ends.mean(axis=1) - mesh.p[:, mesh.t[:, elements]].mean(axis=1)
    N = N * np.sign((N * out).sum(axis=0))
    return EndEdges(facets, A[:, elements], N, length)


def end_edges(mesh: Mesh, A: ndarray, facets: ndarray) -> EndEdges:
    """Boundary edges not parallel to fibres; parameters as in `edges_with_fibres`."""
    edges = edges_with_fibres(mesh, A, facets)
    return edges.where(np.abs(edges.across) > _ALONG)


# Threshold below which an eigenvalue of a sum of N⊗N is treated as zero.
NONE = 1e-9


def matrix_of_quadrilaterals(
    mesh: Any,
    along: tuple[ndarray, ndarray],
    D: ndarray,
    free: EndEdges,
    clamped: Clamps,
    mirrors: EndEdges,
    d: int,
) -> Any:
    """Matrix of the bending energy on a `skfem.MeshQuad`; see `_matrix`."""
    basis = CellBasis(mesh, ElementQuad1(), intorder=3)
    overlap, stiffness = (asm(PRODUCT, basis, D=x[:, None]) for x in (D * 0 + 1, D))
    area, D_area = (np.asarray(x.sum(axis=1)).ravel() for x in (overlap, stiffness))
    L = slope_differences(basis, along, clamped, mirrors)
    left_out = excluded_components(mesh, free, mirrors, d)
    weights = (
        component_areas(overlap, area, left_out) * (D_area / area**3)[:, None, None]
    )
    if not mirrors.facets.size:
        return kron(L.T @ diags(weights[:, 0, 0]) @ L, identity(d))
    every = kron(L, identity(d), format="csr")
    return every.T @ block_diag(weights, format="csr") @ every


def slope_differences(
    basis: CellBasis,
    along: tuple[ndarray, ndarray],
    clamped: Clamps,
    mirrors: EndEdges,
) -> csr_matrix:
    """L: weak curvatures at the nodes, times their areas."""
    mesh: Any = basis.mesh
    A, B = along
    L = asm(_ALONG_FIBRES, basis, A=A[:, :, None], B=B[:, :, None])
    if np.ptp(along, axis=2).any():
        L = L - _of_jumps_between_quadrilaterals(mesh, A, B)
    if mirrors.facets.size:
        edges = FacetBasis(mesh, ElementQuad1(), facets=mirrors.facets, intorder=3)
        L = L - asm(_EVEN, edges, A=mirrors.A[:, :, None])
    return hstack([L, -_prescribed_slopes(mesh, clamped)], format="csr")


@BilinearForm
def PRODUCT(u, v, w):
    """Product D u v."""
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


def both_sides(mesh: Any, element: Any, order: int) -> list[InteriorFacetBasis]:
    """Bases of interior edges in the elements on both sides."""
    return [InteriorFacetBasis(mesh, element, intorder=order, side=i) for i in (0, 1)]


def _of_jumps_between_quadrilaterals(mesh: Any, A: ndarray, B: ndarray) -> Any:
    """∮ φ_i ½ [(A·N) B + (B·N) A]·{∇φ_j} over interior edges; [] is the jump."""
    sides = both_sides(mesh, ElementQuad1(), 3)
    n = np.asarray(sides[0].normals)
    one, other = (
        0.5 * (dot(a, n) * b + dot(b, n) * a)
        for side in sides
        for a, b in [(A[:, side.tind, None], B[:, side.tind, None])]
    )
    jump = one - other
    return sum(asm(_OF_JUMP, side, sides[0], jump=jump) for side in sides)


def _prescribed_slopes(mesh: Any, clamped: Clamps) -> csr_matrix:
    """∮ φ_i (A·N) A·∇u over clamps, in terms of the rotation unknowns."""
    ends = mesh.facets[:, clamped.edges.facets]
    half = 0.5 * clamped.edges.length
    columns = np.tile(np.arange(len(half)), 2)
    shape = mesh.nvertices, len(half)
    to_nodes = csr_matrix((np.tile(half, 2), (ends.ravel(), columns)), shape=shape)
    return to_nodes @ clamped.turned


def excluded_components(
    mesh: Any, free: EndEdges, mirrors: EndEdges, d: int
) -> ndarray:
    """Projectors on the excluded components of m, shape (n_nodes, d, d)."""
    N = np.zeros((d, mirrors.facets.size))
    N[:2] = mirrors.N
    projectors = np.zeros((mesh.nvertices, d, d))
    for nodes in mesh.facets[:, mirrors.facets]:
        np.add.at(projectors, nodes, np.einsum("in,jn->nij", N, N))
    nodes = np.unique(mesh.facets[:, mirrors.facets])
    values, vectors = np.linalg.eigh(projectors[nodes])
    odd = vectors * (values > NONE)[:, None]
    projectors[nodes] = odd @ vectors.swapaxes(1, 2)
    projectors[mesh.facets[:, free.facets]] = np.eye(d)
    return projectors


def component_areas(overlap: csr_matrix, area: ndarray, left_out: ndarray) -> ndarray:
    """Areas of the components of m at the nodes, shape (n_nodes, d, d).

    The area of an excluded component is distributed equally among the retained
    components at nodes of the same elements.
    """
    n, d, _ = left_out.shape
    projectors = np.eye(d) - left_out
    giving = np.flatnonzero(left_out.any(axis=(1, 2)))
    adjacency = (overlap[giving] != 0).astype(float)
    receivers = (adjacency @ projectors.reshape(n, -1)).reshape(-1, d, d)
    shares = np.linalg.pinv(receivers) @ left_out[giving] * area[giving, None, None]
    received = (adjacency.T @ shares.reshape(-1, d * d)).reshape(n, d, d)
    return area[:, None, None] * projectors + projectors @ received @ projectors


# σ relative to the smallest interior penalty with which the energy is positive on every
# mesh: ¾ |f| (1/|K⁺| + 1/|K⁻|) inside and 3 |f|/|K| on the boundary, as a triangle has
# three edges.  With a larger value plates are stiffer; with a smaller one coarse
# cantilevers take more steps.
JUMPS = 0.2


def matrix_of_triangles(
    mesh: Any,
    along: tuple[ndarray, ndarray],
    D: ndarray,
    free: EndEdges,
    clamped: Clamps,
    mirrors: EndEdges,
    d: int,
) -> Any:
    """Matrix of the bending energy on a `skfem.MeshTri`; see `_matrix`."""
    area = triangle_areas(mesh)
    K = _penalties(mesh, along, D, clamped, mirrors, d)
    curvature = integrals_of_curvature(mesh, along, free, clamped, mirrors, d)
    every: Any = identity(d)
    return K + curvature.T @ kron(diags(D / area), every) @ curvature


def triangle_areas(mesh: Any) -> ndarray:
    """Areas of triangles."""
    (a, b), (c, e) = (mesh.p[:, mesh.t[i]] - mesh.p[:, mesh.t[0]] for i in (1, 2))
    area: ndarray = 0.5 * np.abs(a * e - b * c)
    return area


def _penalties(
    mesh: Any,
    along: tuple[ndarray, ndarray],
    D: ndarray,
    clamped: Clamps,
    mirrors: EndEdges,
    d: int,
) -> Any:
    """Penalty matrix of jumps of the slope, and of slopes relative to clamps."""
    area, n_turned = triangle_areas(mesh), clamped.turned.shape[1]
    slope = clamped.edges.A * clamped.edges.across
    K = block_diag([_of_jumps(mesh, along, D, area), csr_matrix((n_turned, n_turned))])
    K = K + _clamp_penalty(mesh, clamped.edges, slope, D, area, clamped.turned)
    K = kron(K, identity(d))
    for edges, even in planes_of_symmetry(mirrors, d):
        slope = edges.N * edges.across**2
        none = csr_matrix((edges.facets.size, n_turned))
        K = K + kron(_clamp_penalty(mesh, edges, slope, D, area, none), even)
    return K


def integrals_of_curvature(
    mesh: Any,
    along: tuple[ndarray, ndarray],
    free: EndEdges,
    clamped: Clamps,
    mirrors: EndEdges,
    d: int,
) -> Any:
    """Mean curvatures of the triangles, times their areas."""
    curvature = hstack([_inside(mesh, along), _prescribed(mesh, clamped)])
    n_turned = clamped.turned.shape[1]

    def through(edges: EndEdges, slope: ndarray) -> Any:
        none = csr_matrix((mesh.nelements, n_turned))
        return hstack([_through(mesh, edges, slope), none])

    for edges in (free, mirrors):
        B = along[1][:, mesh.f2t[0, edges.facets]]
        curvature = curvature + through(edges, B * edges.across)
    curvature = kron(curvature, identity(d))
    for edges, even in planes_of_symmetry(mirrors, d):
        slope = edges.N * edges.across**2
        curvature = curvature - kron(through(edges, slope), even)
    return curvature


def planes_of_symmetry(mirrors: EndEdges, d: int) -> Iterator[tuple[EndEdges, ndarray]]:
    """Edges on each plane of symmetry, and the projector on the even components."""
    for normal in np.unique(mirrors.N.round(9), axis=1).T:
        on = np.abs(mirrors.N - normal[:, None]).max(axis=0) < 1e-8
        N = np.pad(normal, (0, d - 2))
        yield mirrors.where(on), np.eye(d) - np.outer(N, N)


@BilinearForm
def FLUX(u, v, w):
    """Slope of u along a vector, times v."""
    return v * dot(w["slope"], grad(u))


@BilinearForm
def _JUMP(u, v, w):
    return w["stiffness"] * dot(w.n, grad(u)) * dot(w.n, grad(v))


def _inside(mesh: Any, along: tuple[ndarray, ndarray]) -> Any:
    """∮ (A·n)(B·{∇u}) over the edges of each triangle that are inside the ply."""
    slopes, triangles = (
        both_sides(mesh, element(), 2) for element in (ElementTriP2, ElementTriP0)
    )
    n = np.asarray(slopes[0].normals)
    inside: Any = 0.0
    for sign, basis in zip((1, -1), triangles, strict=True):
        A, B = (direction[:, basis.tind, None] for direction in along)
        slope = 0.5 * sign * dot(A, n) * B
        inside = inside + sum(asm(FLUX, side, basis, slope=slope) for side in slopes)
    return inside


def _prescribed(mesh: Any, clamped: Clamps) -> csr_matrix:
    """∮ (A·n) A·∇u over clamps of each triangle, per rotation unknown."""
    facets = clamped.edges.facets
    indices = mesh.f2t[0, facets], np.arange(facets.size)
    shape = mesh.nelements, facets.size
    of_triangles = csr_matrix((clamped.edges.length, indices), shape)
    return of_triangles @ clamped.turned


def _through(mesh: Any, edges: EndEdges, slope: ndarray) -> Any:
    """∮ slope·∇u over boundary edges, for each triangle."""
    if not edges.facets.size:
        return csr_matrix((mesh.nelements, mesh.nvertices + mesh.nfacets))
    slopes, triangles = (
        FacetBasis(mesh, element(), facets=edges.facets, intorder=2)
        for element in (ElementTriP2, ElementTriP0)
    )
    return asm(FLUX, slopes, triangles, slope=slope[:, :, None])


def _of_jumps(
    mesh: Any, along: tuple[ndarray, ndarray], D: ndarray, area: ndarray
) -> Any:
    """Penalty on jumps of the slope between triangles."""
    sides = both_sides(mesh, ElementTriP2(), 2)
    n, length = np.asarray(sides[0].normals), sides[0].dx.sum(axis=1)[:, None]
    A, B = ([dot(x[:, side.tind, None], n) for side in sides] for x in along)
    most = np.max(
        [D[s.tind, None] * (a * b) ** 2 for s, a, b in zip(sides, A, B, strict=True)],
        axis=0,
    )
    least = 0.75 * length * sum(1 / area[side.tind, None] for side in sides)
    return sum(
        (1 if u is v else -1) * asm(_JUMP, u, v, stiffness=JUMPS * least * most)
        for u in sides
        for v in sides
    )


def _clamp_penalty(
    mesh: Any,
    edges: EndEdges,
    slope: ndarray,
    D: ndarray,
    area: ndarray,
    turned: csr_matrix,
) -> Any:
    """Penalty matrix of the slope relative to the clamp along boundary edges."""
    if not edges.facets.size:
        n = mesh.nvertices + mesh.nfacets + turned.shape[1]
        return csr_matrix((n, n))
    off, basis = slopes_off(mesh, edges, slope, turned)
    least = 3 * basis.dx.sum(axis=1) / area[basis.tind] * D[basis.tind]
    return off.T @ diags((JUMPS * least[:, None] * basis.dx).ravel()) @ off


def slopes_off(
    mesh: Any, edges: EndEdges, slope: ndarray, turned: csr_matrix
) -> tuple[Any, FacetBasis]:
    """Operator of slopes relative to the clamp at points of edges, and their basis."""
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
    return hstack([at_points, -kron(turned, np.ones((n_points, 1)))]), basis


def bending_matrix(
    basis: AbstractBasis, A: ndarray, D: ndarray, ends: Mapping[str, FibreEnd]
) -> csr_matrix:
    """Matrix K of ½ v·K·v = ½ ∫ D |κ|² in N/mm.

    v is the displacement, followed by the columns of R − I for x and y at rest, for
    each clamp with the rotation R.

    Parameters
    ----------
    basis
        Basis of the displacement, of bilinear quadrilaterals or quadratic triangles.
    A
        Unit direction of the fibres in each element, shape (2, n_elements).
    D
        Bending stiffness per width of ply in N·mm in each element, shape (n_elements,).
    ends
        Boundary conditions of fibre ends, by boundary name.
    """
    return _matrix(basis, (A, A), D, *ends_of(basis.mesh, A, ends))


def ends_of(
    mesh: Mesh, A: ndarray, ends: Mapping[str, FibreEnd]
) -> tuple[EndEdges, Clamps, EndEdges]:
    """Free, clamped and mirrored edges at which fibres end."""
    turning = [mesh.boundaries[name] for name, end in ends.items() if callable(end)]
    keeping, mirrored = (_facets(mesh, ends, kind) for kind in FIBRE_ENDS)
    clamped = np.unique(np.concatenate([keeping, *turning]))
    free = np.setdiff1d(mesh.boundary_facets(), np.concatenate([clamped, mirrored]))
    at_free, at_clamps, mirrors = (
        end_edges(mesh, A, facets) for facets in (free, clamped, mirrored)
    )
    return at_free, clamps(at_clamps, turning), mirrors


def twist_matrix(
    basis: AbstractBasis, A: ndarray, B: ndarray, D: ndarray
) -> csr_matrix:
    """Matrix K of ½ u·K·u = ½ ∫ D |τ|² in N/mm, with the twist τ = ∇∇x : A⊗B.

    For orthogonal directions, z = c x y has the twist c.

    Parameters
    ----------
    basis
        See `bending_matrix`.
    A, B
        Unit directions of both families in each element, shape (2, n_elements).
    D
        Twist stiffness per width of ply in N·mm in each element, shape (n_elements,).
    """
    mesh: Mesh = basis.mesh
    edges = edges_with_fibres(mesh, A, mesh.boundary_facets())
    none = edges.where(slice(0))
    return _matrix(basis, (A, B), D, edges, clamps(none, []), none)


@np.errstate(over="ignore", invalid="ignore")  # a run refuses non-finite values
def _matrix(
    basis: AbstractBasis,
    along: tuple[ndarray, ndarray],
    D: ndarray,
    free: EndEdges,
    clamped: Clamps,
    mirrors: EndEdges,
) -> csr_matrix:
    """Matrix of ½ ∫ D |∇∇x : A⊗B|² in space or in the plane.

    The unit directions (A, B) in each element, ``along``, are equal for bending.  D is
    as in `bending_matrix`.  Fibre ends are hinged at ``free`` edges, and ``mirrors``
    are edges on planes of symmetry.
    """
    mesh: Mesh = basis.mesh
    quads = on_quadrilaterals(basis)
    matrix = matrix_of_quadrilaterals if quads else matrix_of_triangles
    K = matrix(mesh, along, D, free, clamped, mirrors, components(basis))
    return _symmetric(K)


def _symmetric(K: Any) -> csr_matrix:
    return csr_matrix((K + K.T) / 2)


def on_quadrilaterals(basis: AbstractBasis) -> bool:
    """Return True for bilinear quadrilaterals, False for quadratic triangles."""
    return isinstance(basis.elem.elem, ElementQuad1)  # type: ignore[attr-defined]


def _facets(mesh: Mesh, ends: Mapping[str, FibreEnd], kind: str) -> ndarray:
    named = [mesh.boundaries[name] for name, end in ends.items() if end == kind]
    return np.unique(np.concatenate([np.empty(0, dtype=int), *named]))
