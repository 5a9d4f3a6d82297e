"""Finite elements, quadrature rules, nodes and bases of the displacement.

Quadratic triangles have three points; bilinear quadrilaterals have the centre, 2×2
points or both.  The gradient of a bilinear quadrilateral is its value at the centre
plus a fluctuation, ∇N(ξ) = ∇N(0) + (∇N(ξ) − ∇N(0)).  The fluctuation equals B_HGL = γ ⊗
∇h of the paper (Hamila & Boisse 2013, §3.1).  A macro-element consists of all
quadrilaterals into which an element was split.  Elements fold first at their corners.
"""

from copy import copy
from functools import cached_property
from itertools import product
from typing import Any

import numpy as np
from numpy import ndarray
from skfem import (
    AbstractBasis,
    CellBasis,
    DiscreteField,
    Element,
    ElementComposite,
    ElementQuad1,
    ElementTriP2,
    ElementVector,
    InteriorFacetBasis,
    MappingIsoparametric,
    Mesh,
    MeshQuad,
    MeshTri,
)

from .scikit_fem import get_quadrature, jacobian, set_element_dofs, set_positions
from .user_input import with_article

#: One point at the centre, weighted with the exact area of a bilinear quadrilateral.
CENTRE = (np.array([[0.5], [0.5]]), np.array([1.0]))

#: 2×2 Gauss points.
GAUSS = get_quadrature(ElementQuad1, 3)

#: Three points of a triangle, exact to degree 2.
THREE = get_quadrature(ElementTriP2, 2)

#: Six points of a triangle, exact to degree 4.
SIX = get_quadrature(ElementTriP2, 4)


# Multiple of the round-off of positions that bounds the round-off of their inverse.
_ROUND_OFF = 32 * np.finfo(float).eps


class QuadMapping(MappingIsoparametric):
    """Mapping of a `skfem.MeshQuad` whose inverse is accurate to round-off.

    The iteration of scikit-fem ends at a change of the reference coordinates below
    1e-12, which round-off exceeds in elements that are small relative to the mesh.  Its
    Jacobian matrices, 128 bytes per element with four points, are not kept.
    """

    def __init__(self, mesh: Any) -> None:
        super().__init__(mesh, mesh.elem(), mesh.bndelem)

    def J(self, i: int, j: int, X: ndarray, tind: ndarray | None = None) -> ndarray:
        """Component of the Jacobian matrix, which scikit-fem would keep."""
        return jacobian(self, i, j, X, tind)

    def invF(
        self,
        x: ndarray,
        tind: ndarray | None = None,
        newton_max_iters: int = 50,
        newton_tol: float = 1e-12,
    ) -> ndarray:
        """Reference coordinates of points x of elements, see `MappingIsoparametric`."""
        steepest = np.abs(self.invDF(CENTRE[0], tind)).max(initial=0.0)
        round_off = _ROUND_OFF * np.abs(x).max(initial=0.0) * steepest
        tolerance = max(newton_tol, float(round_off))
        return super().invF(x, tind, newton_max_iters, tolerance)


class ElementQuad1Fluctuation(ElementQuad1):
    """Bilinear element whose gradient is the fluctuation ∇N(ξ) − ∇N(0).

    `centre_grad` returns the centre gradient ∇N(0), which its fields also contain.

    Examples
    --------
    The fluctuation of a linear field vanishes on any quadrilateral.

    >>> import numpy as np
    >>> from skfem import Basis, MeshQuad
    >>> mesh = MeshQuad(np.array([[0, 3, 2, 0], [0, 0, 2, 1.]]), [[0], [1], [2], [3]])
    >>> u = Basis(mesh, ElementQuad1Fluctuation()).interpolate(mesh.p[0] - mesh.p[1])
    >>> bool(np.allclose(u.grad, 0)), bool(np.allclose(centre_grad(u)[0], 1))
    (True, True)
    """

    def gbasis(
        self, mapping: Any, X: ndarray, i: int, tind: ndarray | None = None
    ) -> tuple[DiscreteField, ...]:
        """Value, fluctuation and centre gradient of one basis function."""
        (field,) = super().gbasis(mapping, X, i, tind)
        (centre,) = super().gbasis(mapping, CENTRE[0], i, tind)
        fluctuation = field.grad - centre.grad
        # scikit-fem's fields have a fixed set of slots; `grad3` is free here
        # because the third derivatives of a bilinear function vanish.
        constant = np.broadcast_to(centre.grad, fluctuation.shape)
        return (DiscreteField(np.array(field), grad=fluctuation, grad3=constant),)


def centre_grad(u: DiscreteField) -> ndarray:
    """Gradient at the element centre of a field on `ElementQuad1Fluctuation`.

    Raises
    ------
    ValueError
        If it is a field on another element.
    """
    if u.grad3 is None:
        raise ValueError(
            "the form requires a basis HourglassBasis(mesh) with the displacement "
            "ElementVector(ElementQuad1()), and u on this basis"
        )
    return np.asarray(u.grad3)


def quad_basis(
    mesh: Mesh, rule: tuple[ndarray, ndarray], dimension: int = 2
) -> CellBasis:
    """Displacement basis on ``mesh`` with the points and weights of ``rule``.

    Parameters
    ----------
    mesh
        A `skfem.MeshQuad`.
    rule
        `CENTRE` for one point, `GAUSS` for 2×2.
    dimension
        Number of displacement components: 2 in the plane, 3 in space.
    """
    _refuse_mesh("quad_basis", mesh)
    element = ElementVector(ElementQuad1(), dimension)
    return DisplacementBasis(mesh, element, QuadMapping(mesh), quadrature=rule)


def _refuse_mesh(what: str, mesh: Any, kind: type[Mesh] = MeshQuad) -> None:
    """Refuse a mesh of elements of another shape, and what is not a mesh."""
    if not isinstance(mesh, Mesh) or mesh.refdom is not kind.elem.refdom:
        shape = "quadrilaterals" if kind is MeshQuad else "triangles"
        raise ValueError(f"{what} requires a mesh of {shape}, not {with_article(mesh)}")


def triangle_basis(
    mesh: Mesh, dimension: int = 2, rule: tuple[ndarray, ndarray] = THREE
) -> CellBasis:
    """Basis of a quadratic displacement on a `skfem.MeshTri`."""
    _refuse_mesh("triangle_basis", mesh, MeshTri)
    element = ElementVector(ElementTriP2(), dimension)
    return DisplacementBasis(mesh, element, quadrature=rule)


def components(basis: AbstractBasis) -> int:
    """Number d of displacement components."""
    return len(basis.nodal_dofs)


def main_basis(basis: Any) -> Any:
    """The first basis of a product of bases; any other basis itself."""
    return getattr(basis, "bases", (basis,))[0]


def element_numbers(basis: Any) -> ndarray:
    """Element number at each point of a basis, shape (n_elements, n_points)."""
    defaults, tind = basis.default_parameters(), main_basis(basis).tind
    if "element" in defaults:
        return np.asarray(defaults["element"])
    numbers = np.arange(basis.nelems) if tind is None else tind
    return np.broadcast_to(numbers[:, None], basis.dx.shape)


def node_positions(basis: CellBasis) -> ndarray:
    """Nodes of a basis of the displacement, shape (2, n_nodes).

    The vertices of the mesh in their order, then the edge midpoints if the element has
    nodes there.
    """
    mesh = basis.mesh
    if not basis.elem.facet_dofs:
        return mesh.p
    return np.hstack([mesh.p, mesh.p[:, mesh.facets].mean(axis=1)])


def node_dofs(basis: CellBasis) -> ndarray:
    """Unknowns of each node of `node_positions`, shape (d, n_nodes)."""
    return np.arange(basis.N).reshape(-1, components(basis)).T


class DisplacementBasis(CellBasis):
    """`skfem.CellBasis` whose functions are evaluated when a form first needs them.

    They take 1.5 kB per element with four points; kernels use `function_gradients`.

    Parameters
    ----------
    mesh, elem, mapping, intorder, elements, **options
        See `skfem.CellBasis`.
    """

    def __init__(
        self,
        mesh: Mesh,
        elem: Element,
        mapping: Any = None,
        intorder: int | None = None,
        elements: Any = None,
        **options: Any,
    ) -> None:
        # The constructor of CellBasis would evaluate `basis`.
        kind = {"refdom": mesh.refdom}
        AbstractBasis.__init__(self, mesh, elem, mapping, intorder, **kind, **options)
        self.tind = None if elements is None else mesh.normalize_elements(elements)
        self.dx = np.abs(self.mapping.detDF(self.X, self.tind)) * self.W
        self.nelems = len(self.dx)

    @cached_property
    def basis(self) -> list[tuple[DiscreteField, ...]]:  # type: ignore[override]
        """Basis functions."""
        functions = range(self.Nbfun)
        return [self.elem.gbasis(self.mapping, self.X, i, self.tind) for i in functions]


class HourglassBasis(DisplacementBasis):
    """Basis of the fluctuation at the 2×2 points, each of weight A/4 (§3.2).

    A is the reference area of the element.

    Parameters
    ----------
    mesh
        A `skfem.MeshQuad`.
    dimension
        Components of the displacement; or its element ``ElementVector(ElementQuad1(),
        d)``, also in a composite element.
    mapping, dofs, elements
        See `skfem.CellBasis`.
    quadrature
        The 2×2 points; others are refused.

    Raises
    ------
    ValueError
        If other points or another mesh are given.
    """

    def __init__(
        self,
        mesh: Mesh,
        dimension: int | Element = 2,
        mapping: Any = None,
        dofs: Any = None,
        elements: Any = None,
        quadrature: tuple[ndarray, ndarray] = GAUSS,
    ) -> None:
        _refuse_mesh("HourglassBasis", mesh)
        if not np.array_equal(quadrature[0], GAUSS[0]):
            raise ValueError("HourglassBasis has the 2×2 points: omit the quadrature")
        if not isinstance(dimension, Element):
            dimension = ElementVector(ElementQuad1(), dimension)
        element, options = _fluctuating(dimension), {"quadrature": GAUSS, "dofs": dofs}
        super().__init__(mesh, element, mapping, elements=elements, **options)
        centre, _ = CENTRE
        self.dx = np.abs(self.mapping.detDF(centre, self.tind)) * self.W

    def gradients(self) -> tuple[ndarray, ndarray]:
        """Gradients of the functions of one component, and those at the centre.

        Shape (4, 2, n_elements, 4).
        """
        centre, at_points = (gradients_at(self, X) for X in (CENTRE[0], self.X))
        # With the rounding of the fields of the element.
        return centre + (at_points - centre), np.broadcast_to(centre, at_points.shape)


def _fluctuating(element: Any) -> Element:
    """Element with the gradient of a bilinear displacement replaced."""
    if isinstance(element, ElementComposite):
        return ElementComposite(*map(_fluctuating, element.elems))
    if isinstance(element, ElementVector) and type(element.elem) is ElementQuad1:
        return ElementVector(ElementQuad1Fluctuation(), element.dim)
    return element


def function_gradients(basis: Any) -> ndarray:
    """Gradients of the functions of one component of a basis of the displacement.

    Shape (n_nodes, 2, n_elements, n_points).
    """
    if type(basis) not in (DisplacementBasis, MeanBasis):
        functions = basis.basis[:: components(basis)]
        return np.array([np.asarray(field.grad)[0] for (field, *_) in functions])
    return gradients_at(basis, basis.X)


def gradients_at(basis: Any, X: ndarray) -> ndarray:
    """Gradients of the functions of one component at points of the reference element.

    Shape (n_nodes, 2, n_elements, n_points).
    """
    nodes, inverse = basis.elem.elem, basis.mapping.invDF(X, basis.tind)
    local = (nodes.lbasis(X, i)[1] for i in range(len(nodes.doflocs)))
    return np.array([np.einsum("ijkl,il->jkl", inverse, x) for x in local])


def displacement_gradient(
    basis: Any, u: ndarray, gradients: ndarray | None = None
) -> ndarray:
    """Displacement gradient ∇u at the points of a basis.

    Parameters
    ----------
    basis
        Basis of the displacement.
    u
        Displacement, shape (n_unknowns,).
    gradients
        `function_gradients` of the basis, if they are known.

    Returns
    -------
    ndarray
        Shape (d, 2, n_elements, n_points).
    """
    dN = function_gradients(basis) if gradients is None else gradients
    nodal = u[basis.element_dofs].reshape(len(dN), -1, basis.nelems)
    return np.einsum("ain,ajnp->ijnp", nodal, dN)


class MeanBasis(DisplacementBasis):
    """Basis of the displacement with the parameters of means over elements.

    ``w["share"]`` is the area fraction of each point in its element, shape (n_elements,
    n_points).

    Attributes
    ----------
    parts
        Numbers of the quadrilaterals into which each element was split, see
        `MacroBasis`; None if no element was split.
    """

    parts: ndarray | None = None

    @classmethod
    def at_points_of(cls, basis: CellBasis) -> "MeanBasis":
        """The basis of the same functions and points as another one."""
        means = cls.__new__(cls)
        vars(means).update(vars(basis))
        return means

    @cached_property
    def share(self) -> ndarray:
        """Area fraction of each point in its element, shape (n_elements, n_points)."""
        return self.dx / self.dx.sum(axis=1, keepdims=True)

    def default_parameters(self) -> dict[str, Any]:
        """Positions, area fractions and, for macro-elements, the quadrilaterals."""
        fields = {"x": self.global_coordinates(), "share": self.share}
        return fields if self.parts is None else fields | {"element": self.parts}

    def from_ply_points(self, x: ndarray) -> ndarray:
        """Convert values at the points of the ply to values at these points.

        The integration points of the ply are the same or, for macro-elements, the
        centres of the quadrilaterals, shape (..., n_quadrilaterals, 1).
        """
        return x if self.parts is None else x[..., self.parts, 0]

    def to_ply_points(self, x: ndarray) -> ndarray:
        """Convert values at these points to values at the points of the ply."""
        if self.parts is None:
            return x
        exists = self.parts >= 0
        values = np.empty((*x.shape[:-2], exists.sum(), 1))
        values[..., self.parts[exists], 0] = x[..., exists]
        return values


def mean(w: Any, x: ndarray) -> ndarray:
    """Element mean of values at points, shape (..., n_elements, 1).

    ``w`` are the form parameters on a `MeanBasis`.
    """
    if "share" not in w:
        raise ValueError("the form requires a MeanBasis or a MacroBasis")
    return (w["share"] * x).sum(axis=-1, keepdims=True)


#: Line on a `MacroBasis` in a composite problem.
NO_SECOND_FIELD = (
    "a MacroBasis has the displacement alone: for a second field use a basis such as "
    "quad_basis(mesh, CENTRE).with_element(element), or assemble the second field on "
    "another basis"
)


class MacroBasis(MeanBasis):
    """Basis of the displacement on the original elements of a split mesh.

    The points of an element are the centres of its quadrilaterals, weighted with their
    areas; the basis functions belong to all their nodes.

    Parameters
    ----------
    mesh
        A split mesh (`SplitMesh`).
    dimension
        Components of the displacement.
    **kwargs
        Passed to `skfem.CellBasis`: ``mapping``, ``dofs``.

    Attributes
    ----------
    parts
        Numbers of the quadrilaterals of each element, shape (n_elements, n_points),
        padded with −1.
    corners
        Local node number in the element of each corner of its quadrilaterals, shape (4,
        n_points, n_elements).

    Raises
    ------
    ValueError
        If ``dimension`` is an element.
    """

    parts: ndarray

    def __init__(self, mesh: Any, dimension: int = 2, **kwargs: Any) -> None:
        if isinstance(dimension, Element):
            raise ValueError(
                "MacroBasis: dimension must be 2 or 3, not an element: "
                f"{NO_SECOND_FIELD}"
            )
        if not len(getattr(mesh, "parent", ())):
            raise ValueError(
                "MacroBasis requires a split mesh, MacroBasis(split(mesh)), not "
                f"{with_article(mesh)}"
            )
        element = ElementVector(ElementQuad1(), dimension)
        super().__init__(mesh, element, quadrature=CENTRE, **kwargs)
        bilinear: Any = self.basis
        x = np.asarray(self.global_coordinates())
        self.parts = _parts(mesh.parent)
        exists = self.parts >= 0
        self.nelems, n_points = self.parts.shape
        self.X = np.repeat(self.X, n_points, axis=1)
        self.dx = np.where(exists, self.dx[self.parts, 0], 0.0)
        set_positions(self, x[:, self.parts, 0])

        # Nodes of an element, and the local node number of each corner of its parts.
        nodes = np.where(exists, mesh.t[:, self.parts], mesh.t[:, self.parts[:, :1]])
        own_nodes, which = _distinct(nodes.transpose(0, 2, 1).reshape(-1, self.nelems))
        self.corners = corners = which.reshape(4, n_points, self.nelems)
        dofs = self.nodal_dofs[:, own_nodes].transpose(1, 0, 2)
        set_element_dofs(self, dofs.reshape(-1, self.nelems))

        values = np.zeros((len(own_nodes), self.nelems, n_points))
        gradients = np.zeros((len(own_nodes), 2, self.nelems, n_points))
        for i, j in product(range(4), range(n_points)):
            elements = np.flatnonzero(exists[:, j])
            a, part = corners[i, j, elements], self.parts[elements, j]
            values[a, elements, j] = 0.25  # at the centre of a bilinear quadrilateral
            (function,) = bilinear[dimension * i]
            gradients[a, :, elements, j] = function.grad[0, :, part, 0]
        self.basis = [
            (_along(axis, dimension, N, dN),)
            for N, dN in zip(values, gradients, strict=True)
            for axis in range(dimension)
        ]

    def with_elements(self, elements: Any) -> "MacroBasis":  # type: ignore[override]
        """Basis on the elements whose quadrilaterals are all among the given ones.

        ``elements`` are numbers or names of subdomains of the split mesh.
        """
        chosen = self.mesh.normalize_elements(elements)
        inside = np.isin(self.parts, chosen) | (self.parts < 0)
        rows, part = np.flatnonzero(inside.all(axis=1)), copy(self)
        part.parts, part.corners = self.parts[rows], self.corners[..., rows]
        part.nelems, part.dx = len(rows), self.dx[rows]
        set_positions(part, np.asarray(self.global_coordinates())[:, rows])
        set_element_dofs(part, self.element_dofs[:, rows])
        part.basis = [
            (DiscreteField(field[:, rows], np.asarray(field.grad)[:, :, rows]),)
            for (field,) in self.basis
        ]
        return part


def _along(axis: int, dimension: int, N: ndarray, dN: ndarray) -> DiscreteField:
    """Basis function of a displacement along one axis."""
    value = np.zeros((dimension, *N.shape))
    gradient = np.zeros((dimension, *dN.shape))
    value[axis], gradient[axis] = N, dN
    return DiscreteField(value, gradient)


def _parts(parent: ndarray) -> ndarray:
    """Parts of each parent, shape (n_parents, n_most), padded with −1."""
    order, counts = np.argsort(parent, kind="stable"), np.bincount(parent)
    parts = np.full((len(counts), counts.max()), -1)
    parts[np.arange(counts.max()) < counts[:, None]] = order
    return parts


def _distinct(nodes: ndarray) -> tuple[ndarray, ndarray]:
    """Distinct nodes of each column, and the index of each entry among them.

    They are in the order of appearance, so that elements of one kind share one
    numbering.  A column with fewer distinct nodes than others repeats its first.
    """
    rows = np.arange(len(nodes))[:, None]
    first = (nodes[:, None] == nodes).argmax(axis=1)
    which = np.take_along_axis((first == rows).cumsum(axis=0) - 1, first, axis=0)
    distinct = np.repeat(nodes[:1], which.max() + 1, axis=0)
    np.put_along_axis(distinct, which, nodes, axis=0)
    return distinct, which


def sided(vectors: ndarray, normals: ndarray) -> ndarray:
    """Lengths of area vectors, negative where they oppose the normal of their element.

    An area in space has no sign, and a ply may lie upside down.  A part of an element
    that faces the opposite way is folded.

    Parameters
    ----------
    vectors, normals
        Arrays of vectors that broadcast, shape (3, ...).
    """
    side = (vectors * normals).sum(axis=0)
    return np.copysign(np.linalg.norm(vectors, axis=0), side)


_MIDDLE = np.array([[0.5]]), np.array([1.0])


class JumpBasis(InteriorFacetBasis):
    """Basis of the displacement at the midpoints of interior edges, on both sides.

    Each edge has two points at its midpoint, one in the element on either side; a jump
    is the difference between them.  Their weights add up to (A⁺ + A⁻)/4, with the
    reference areas of the two elements.

    Parameters
    ----------
    mesh
        A `skfem.MeshQuad`.
    **kwargs
        Passed to `skfem.InteriorFacetBasis`: ``mapping``, ``dofs``.
    """

    def __init__(self, mesh: Mesh, **kwargs: Any) -> None:
        _refuse_mesh("JumpBasis", mesh)
        element = ElementVector(ElementQuad1())
        super().__init__(mesh, element, quadrature=_MIDDLE, **kwargs)
        other = InteriorFacetBasis(mesh, element, quadrature=_MIDDLE, side=1, **kwargs)
        set_element_dofs(self, np.vstack([self.element_dofs, other.element_dofs]))
        first, second = np.eye(2)  # 1 at the point of this side, 0 at the other
        self.basis = [
            (DiscreteField(np.asarray(field) * sign, np.asarray(field.grad) * sign),)
            for sign, side in ((first, self), (second, other))
            for (field,) in side.basis
        ]
        self._sides = np.array([self.tind, other.tind]).T
        self.X = np.repeat(self.X, 2, axis=1)
        centre, _ = CENTRE
        areas = [np.abs(self.mapping.detDF(centre, s.tind)) for s in (self, other)]
        # (A⁺ + A⁻)/4, half of it for each of the two points
        self.dx = np.repeat(sum(areas) / 8, 2, axis=1)

    def default_parameters(self) -> dict[str, Any]:
        """Position, and the element of each point."""
        return {"x": self.global_coordinates(), "element": self._sides}
