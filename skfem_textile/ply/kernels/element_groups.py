"""Groups of like elements of a basis with their integration points, found once."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any, Protocol, TypeAlias
from weakref import WeakKeyDictionary

import numpy as np
from numpy import ndarray
from skfem import CellBasis, ElementQuad1

from ...mesh.bases import (
    CENTRE,
    HourglassBasis,
    MeanBasis,
    centre_grad,
    components,
    element_numbers,
)
from .in_space import InSpace, angle_in_space
from .integration_points import (
    FibreDeformation,
    GeneralPoints,
    IntegrationPoints,
    QuadPoints,
    RankOneStiffness,
    Stress,
    angle_between,
)

if TYPE_CHECKING:
    from ...fabric import Fabric

# Elements that are computed at a time, so that their values stay in the processor's
# cache.  Measured: forces and matrices of 59 700 quadrilaterals with `OnePoint`, one
# thread of an Intel Xeon, take 165, 134, 131, 153 and 194 ms
# with 512, 2048, 8192, 32 768 and 65 536.
_BLOCK = 8192

_ALL = slice(None)

_GROUPS: WeakKeyDictionary[Any, WeakKeyDictionary] = WeakKeyDictionary()


@dataclass(frozen=True, eq=False)
class DeformationInSpace(InSpace, FibreDeformation):
    """Deformation of the fibres at P points of n elements, in space."""

    side: ndarray


#: Deformations at the points of a group, set by set.
Deformations: TypeAlias = list[FibreDeformation]

#: Parameters of a form: numbers, or arrays over elements and points.
Parameters: TypeAlias = dict[str, Any]


@dataclass(frozen=True, eq=False)
class ElementGroup:
    """Elements of a basis with equal numbers of nodes, modes and points.

    Attributes
    ----------
    dimension
        Components d of the displacement.
    nodes
        Node numbers, shape (n_nodes, n).
    modes
        Modes per displacement of the nodes, shape (n_modes, n_nodes, n); None if the
        modes are the displacements.
    points
        Integration points, in sets that a kernel handles at once.
    fabrics, fabric
        The fabric with its laws at the points, and at the elements (`Fabric.at`), for
        arguments in the order of the forms.
    elements, point_numbers
        Numbers of the elements and of the points of each set in the basis.
    """

    dimension: int
    nodes: ndarray
    modes: ndarray | None
    points: Sequence[IntegrationPoints]
    fabrics: Sequence["Fabric"]
    fabric: "Fabric"
    elements: Any
    point_numbers: Sequence[Any]

    def blocks(self) -> Iterator[slice]:
        """Slices of the elements whose values fit into the cache."""
        n = self.nodes.shape[1]
        return (slice(i, min(i + _BLOCK, n)) for i in range(0, n, _BLOCK))

    @property
    def n_modes(self) -> int:
        """Number of modes of an element."""
        return len(self.nodes if self.modes is None else self.modes)

    @cached_property
    def area(self) -> ndarray:
        """Area of each element, shape (n,)."""
        return sum(points.dx.sum(axis=0) for points in self.points)

    def values_at_points(self, values: ndarray) -> list[ndarray]:
        """Values at each set of points, from those at all points of the basis.

        Shapes (..., P, n), from (..., n_elements, n_points).
        """
        in_group = np.asarray(values)[..., self.elements, :]
        return [np.moveaxis(in_group[..., i], -1, -2) for i in self.point_numbers]

    def put_values(self, values: ndarray, own: Sequence[ndarray]) -> None:
        """Put values at these points among those of the basis, in place."""
        for numbers, x in zip(self.point_numbers, own, strict=True):
            values[..., self.elements, numbers] = np.moveaxis(x, -1, -2)

    def deformations(
        self, u: ndarray, points: Sequence[IntegrationPoints] | None = None
    ) -> Deformations:
        """Deformations under a DOF vector ``u`` at all or some of the points."""
        points = self.points if points is None else points
        columns = u.reshape(-1, self.dimension).T.copy()
        local = np.stack([x[self.nodes] for x in columns], axis=1)
        if self.modes is not None:
            local = transformed(self, "ran,ain->rin", local)
        return [_deformation(self, p, local) for p in points]

    def same_nodes_and_modes(self, other: "ElementGroup") -> bool:
        """Whether another group has the same nodes and modes."""
        if self.modes is None or other.modes is None:
            return self.modes is other.modes and np.array_equal(self.nodes, other.nodes)
        return np.array_equal(self.modes, other.modes) and np.array_equal(
            self.nodes, other.nodes
        )


class Kernel(Protocol):
    """Energy of a term and its derivatives with respect to strains of fibres."""

    @property
    def fabric(self) -> "Fabric":
        """The fabric with its directions and laws."""
        ...

    def takes(self, basis: CellBasis) -> bool:
        """Whether the kernel can compute on a basis of the displacement."""
        ...

    def energy(self, group: ElementGroup, fibres: Deformations, w: Parameters) -> float:
        """Energy in N·mm."""
        ...

    def stresses(
        self, group: ElementGroup, fibres: Deformations, w: Parameters
    ) -> list[Stress]:
        """Stresses at the points."""
        ...

    def rank_one_stiffnesses(
        self, group: ElementGroup, fibres: Deformations, w: Parameters
    ) -> list[RankOneStiffness]:
        """Stiffnesses that couple fibres or points."""
        ...


def element_groups(basis: Any, fabric: "Fabric") -> list[ElementGroup]:
    """Groups of the elements of a basis of the displacement, found once.

    The basis must not be changed after this.  Of `HourglassBasis` the centre comes
    first, with the fibres of the corners and no weight, then the corners.
    """
    known = _GROUPS.setdefault(basis, WeakKeyDictionary())
    if fabric not in known:
        known[fabric] = list(_new_groups(basis, fabric))
    return known[fabric]


def transformed(group: ElementGroup, rule: str, x: ndarray) -> ndarray:
    """`numpy.einsum` of the modes and values at nodes or modes, (k, d, n)."""
    modes: Any = group.modes
    parts = [np.einsum(rule, modes[..., s], x[..., s]) for s in group.blocks()]
    return np.concatenate(parts, axis=-1)


def _deformation(
    group: ElementGroup, points: IntegrationPoints, u: ndarray
) -> FibreDeformation:
    P, (_, d, n) = points.dx.shape[0], u.shape
    squared, angle, v = (np.empty((*k, n)) for k in ((2, P), (P,), (2, P, d)))
    for block in group.blocks():
        a = points.fibres(u[..., block], block)
        square = a[:, :, 0] ** 2 + a[:, :, 1] ** 2
        if d == 3:
            square += a[:, :, 2] ** 2
        v[..., block], squared[..., block] = a / square[:, :, None], square
        angle[..., block] = angle_between(a) if d == 2 else angle_in_space(a)
    at_rest = angle_between(points.A[:, :, :2])
    if d == 2:
        return FibreDeformation(v, squared, at_rest - angle)
    side = np.sign(at_rest)
    return DeformationInSpace(v, squared, at_rest - side * angle, side)


def _new_groups(basis: Any, fabric: "Fabric") -> Iterator[ElementGroup]:
    d = components(basis)
    dN = np.array([field.grad[0] for (field,) in basis.basis[::d]])
    w, nodes = basis.default_parameters(), basis.element_dofs[::d] // d
    x = np.asarray(w["x"])
    numbers = np.asarray(w["element"]) if "element" in w else element_numbers(basis)
    pair = fabric.directions(x, numbers)
    A = np.array([np.broadcast_to(a, x.shape) for a in pair])
    if isinstance(basis, MeanBasis) and basis.parts is not None:
        yield from _macro(basis, fabric, nodes, dN, A)
        return
    centre = None
    if isinstance(basis, HourglassBasis):
        centre = np.array([centre_grad(field)[0] for (field,) in basis.basis[::d]])
        dN = dN + centre
    bilinear = (
        isinstance(basis.elem.elem, ElementQuad1)
        and basis.mesh.elem is ElementQuad1
        and np.all(A[..., :1] == A)
    )
    find_points = _of_quadrilaterals if bilinear else _of_nodes
    modes, points = find_points(basis, A, dN, centre)
    n = len(points)
    at_points, of_elements = fabric.at(numbers), fabric.at(numbers[:, :1])
    fabrics, every = n * [at_points], n * [_ALL]
    yield ElementGroup(d, nodes, modes, points, fabrics, of_elements, _ALL, every)


def _of_nodes(
    basis: Any, A: ndarray, dN: ndarray, centre: ndarray | None
) -> tuple[None, list[IntegrationPoints]]:
    """Integration points of any element, after its centre if that is given."""
    nodes, dx, d = np.arange(len(dN)), basis.dx.T, components(basis)
    sets = [(dN, dx)] if centre is None else [(centre, 0 * dx), (dN, dx)]
    return None, [
        GeneralPoints(_directions(A, d), area, _products(A, gradients), nodes, len(dN))
        for gradients, area in sets
    ]


def _of_quadrilaterals(
    basis: Any, A: ndarray, dN: ndarray, centre: ndarray | None
) -> tuple[ndarray, list[IntegrationPoints]]:
    """Modes of bilinear quadrilaterals, (3, 4, n), and points, after the centre."""
    at_centre, gamma, slope = hourglass_mode(basis, dN)
    modes = np.concatenate([_products(A[..., :1], at_centre)[:, 0], gamma[None]])

    constant = _directions(A[..., :1], components(basis))
    eta, dx = (A * slope).sum(axis=1).swapaxes(1, 2), basis.dx.T
    points: list[IntegrationPoints] = [QuadPoints(constant, dx, eta)]
    if centre is not None:
        points.insert(0, QuadPoints(constant, 0 * dx[:1], 0 * eta[:, :1]))
    return modes, points


def hourglass_mode(basis: Any, dN: ndarray) -> tuple[ndarray, ndarray, ndarray]:
    """How gradients vary in bilinear quadrilaterals: ∇N_a(ξ) = ∇N_a(0) + γ_a ∇h(ξ).

    γ is the hourglass vector (Flanagan & Belytschko 1981).

    Parameters
    ----------
    basis
        Of bilinear quadrilaterals.
    dN
        ∇N_a at its points, shape (4, 2, n, P).

    Returns
    -------
    tuple
        ∇N_a(0), shape (4, 2, n, 1); γ, shape (4, n); ∇h, shape (2, n, P).
    """
    scalar, mapping, tind = ElementQuad1(), basis.mapping, basis.tind
    fields = (scalar.gbasis(mapping, CENTRE[0], a, tind)[0] for a in range(4))
    at_centre = np.array([field.grad for field in fields])
    h = np.array([1.0, -1.0, 1.0, -1.0])
    corners = basis.mesh.p[:, basis.mesh.t[:, _ALL if tind is None else tind]]
    gamma = h[:, None] - np.einsum("b,jbn,ajn->an", h, corners, at_centre[..., 0])
    slope = np.einsum("an,ajnq->jnq", gamma / (gamma**2).sum(axis=0), dN - at_centre)
    return at_centre, gamma, slope


def _macro(
    basis: Any, fabric: "Fabric", nodes: ndarray, dN: ndarray, A: ndarray
) -> Iterator[ElementGroup]:
    """Macro-elements, grouped by which of their nodes their quadrilaterals have."""
    d = components(basis)
    flat = basis.corners.reshape(-1, basis.nelems)
    patterns, pattern_of = np.unique(flat, axis=1, return_inverse=True)
    for i, pattern in enumerate(patterns.T):
        elements = np.flatnonzero(pattern_of.ravel() == i)
        corners = pattern.reshape(4, -1).T[basis.parts[elements[0]] >= 0]
        group_nodes = nodes[: corners.max() + 1, elements]
        numbers = [slice(j, j + 1) for j in range(len(corners))]
        points: list[IntegrationPoints] = [
            GeneralPoints(
                _directions(A[..., elements, j], d),
                basis.dx[elements, j].T,
                _products(A[..., elements, j], dN[four][..., elements, j]),
                four,
                len(group_nodes),
            )
            for j, four in zip(numbers, corners, strict=True)
        ]
        fabrics = [fabric.at(basis.parts[elements, j]) for j in numbers]
        laws = fabrics[0]
        places = elements, numbers
        yield ElementGroup(d, group_nodes, None, points, fabrics, laws, *places)


def _products(A: ndarray, dN: ndarray) -> ndarray:
    """A·∇N_a, shape (2, P, k, n)."""
    b = A[:, None, 0] * dN[:, 0] + A[:, None, 1] * dN[:, 1]
    return np.ascontiguousarray(b.transpose(0, 3, 1, 2))


def _directions(A: ndarray, d: int) -> ndarray:
    """Directions (2, 2, n, P) in the order of `IntegrationPoints`, z = 0 in space."""
    in_order = A.transpose(0, 3, 1, 2)
    return in_order if d == 2 else np.pad(in_order, ((0, 0), (0, 0), (0, 1), (0, 0)))
