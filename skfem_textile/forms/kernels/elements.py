"""Fibres at the integration points of elements, and groups of like elements.

A fibre a = F·A is linear in the modes u_a of an element,

    a = A + Σ_a b_a u_a,

so that a kernel needs only one mesh-dependent number per mode, fibre and point.  The
modes are displacements of nodes, with b_a = A·∇N_a, or combinations of these.  Element
matrices are symmetric and hold the d×d blocks of the pairs of modes (a, c) with a ≤ c,
in the order of `numpy.triu_indices`: shape (n_pairs, d, d, n).

In the plane a fibre written as a complex number z = a_x + i a_y has the logarithm ε +
iθ, its strain and its inclination.  Symmetric d×d matrices are given by their entries
at and above the diagonal.

In space, at a point with e = a/λ, v = e/λ, c = e₁·e₂, s = ``|e₁×e₂|``, n = e₁×e₂/s
and, where the weft lies anticlockwise of the warp at rest, g = ∂Γ/∂a = (e_β −
c e_α)/(s λ_α),

    ∂²Γ/∂a_α²   = −(g ⊗ v + v ⊗ g) − (c/s) n ⊗ n/λ_α²,
    ∂²Γ/∂a₁∂a₂  = n ⊗ n/(s λ₁λ₂).

Both are signed sums of squares: −(g ⊗ v + v ⊗ g) is ½ times (v − g)² − (v + g)², and
with m_α = n/λ_α the rest is (1 − c)/2s times (m₁ + m₂)² minus (1 + c)/2s times (m₁ −
m₂)².
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import combinations_with_replacement
from typing import TYPE_CHECKING, Any, NamedTuple, TypeAlias
from weakref import WeakKeyDictionary

import numpy as np
from numpy import ndarray
from skfem import ElementQuad1
from skfem.helpers import cross

from ...mesh.bases import (
    CENTRE,
    HourglassBasis,
    MeanBasis,
    components,
    element_numbers,
    function_gradients,
    gradients_at,
)
from ...mesh.pattern import Sums

if TYPE_CHECKING:
    from ...fabric import Fabric

# Number of elements per block, chosen so that their values stay in the processor cache.
# Measured: forces and matrices of 59 700 quadrilaterals with `OnePoint`, one thread of
# an Intel Xeon, take 165, 134, 131, 153 and 194 ms with 512, 2048, 8192, 32 768 and 65
# 536.
_BLOCK = 8192

_ALL = slice(None)

_GROUPS: WeakKeyDictionary[Any, WeakKeyDictionary] = WeakKeyDictionary()

#: Values at points; None for zero.
Values: TypeAlias = ndarray | None


#: Number of each entry of a symmetric d×d matrix among those at and above the diagonal.
ENTRIES = {
    2: np.array([[0, 1], [1, 2]]),
    3: np.array([[0, 1, 2], [1, 3, 4], [2, 4, 5]]),
}

# Entries of a symmetric 3×3 matrix, and which of them are on the diagonal.
_PAIRS = tuple(combinations_with_replacement(range(3), 2))
_DIAGONAL = [k for k, (i, j) in enumerate(_PAIRS) if i == j]


class Stress(NamedTuple):
    """Tension and its slope, (2, P, n), and shear moment, (P, n), times area.

    None stands for zero; a tension has a slope.
    """

    tension: Values = None
    moment: Values = None
    slope: Values = None

    def of(self, block: slice) -> "Stress":
        """The stresses of a block of elements."""
        return Stress(*(None if x is None else x[..., block] for x in self))


@dataclass(frozen=True, eq=False)
class FibreDeformation:
    """Deformation of the fibres at P points of n elements, in the plane.

    Attributes
    ----------
    v
        a/λ² of warp and weft, shape (2, P, d, n): ∂ε/∂u_a = b_a v, and in the plane
        ∂θ/∂u_a = b_a Jv.
    squared_stretch
        Squared stretch λ² of both, shape (2, P, n).
    shear_angle
        Shear angle Γ, shape (P, n).
    """

    v: ndarray
    squared_stretch: ndarray
    shear_angle: ndarray

    @cached_property
    def strain(self) -> ndarray:
        """Fibre strain ε of warp and weft, shape (2, P, n)."""
        return 0.5 * np.log(self.squared_stretch)

    @cached_property
    def stretch(self) -> ndarray:
        """Stretch λ of warp and weft, shape (2, P, n)."""
        return np.sqrt(self.squared_stretch)

    def change(self, after: "FibreDeformation") -> ndarray:
        """First-order change of strain to another deformation, shape (2, P, n).

        ∂ε·Δz = v·Δz, and v·z = 1.
        """
        products = (x * y for x, y in zip(self._along, after._along, strict=True))
        return sum(products) * after.squared_stretch - 1.0

    @property
    def _along(self) -> ndarray:
        """Components of v, shape (d, 2, P, n)."""
        return np.moveaxis(self.v, 2, 0)

    def forces(self, stress: Stress, block: slice) -> ndarray:
        """T v + M ∂Γ of warp and weft with the stress of a block, (2, P, d, n)."""
        T, M, _ = stress
        v = self.v[..., block]
        forces = np.zeros(v.shape) if T is None else T[:, :, None] * v
        if M is not None:
            forces += M[:, None] * self.angle_derivatives(block)
        return forces

    def stiffness(self, stress: Stress, block: slice) -> tuple[ndarray, Values]:
        """E v vᵀ + T ∂²ε + M ∂²Γ with the stress of a block of elements.

        Diagonal blocks of both fibres, per b_a b_c, shape (2, P, d (d + 1)/2, n), and
        the block of warp and weft, (P, d (d + 1)/2, n), None if they do not couple.
        """
        T, M, E = stress
        x, y = self.v[:, :, 0, block], self.v[:, :, 1, block]
        xx, xy, yy = x * x, x * y, y * y
        minus_theta, minus_eps = 2 * xy, xx - yy  # the xx entries of −∂²θ and −∂²ε
        first = second = np.zeros(1)
        if T is not None:
            first, second = T * minus_eps, T * minus_theta
        if M is not None:
            signed = np.array([M, -M])
            first, second = first - signed * minus_theta, second + signed * minus_eps
        direct = np.empty((*x.shape[:2], 3, x.shape[-1]))
        direct[:, :, 0], direct[:, :, 1], direct[:, :, 2] = -first, -second, first
        if E is not None:
            direct[:, :, 0] += E * xx
            direct[:, :, 1] += E * xy
            direct[:, :, 2] += E * yy
        return direct, None

    def angle_derivatives(self, block: slice) -> ndarray:
        """∂Γ with respect to warp and weft, shape (2, P, d, n)."""
        v = self.v[..., block]
        warp, weft = np.stack([-v[:, :, 1], v[:, :, 0]], axis=2)
        return np.array([warp, -weft])


@dataclass(frozen=True, eq=False)
class DeformationInSpace(FibreDeformation):
    """Deformation of the fibres at P points of n elements, in space.

    Attributes
    ----------
    side
        1 if the weft lies anticlockwise of the warp at rest, −1 if clockwise: the sign
        of the angle between them.  Broadcasts to (P, n).
    """

    side: ndarray

    @cached_property
    def _crossing(self) -> tuple[ndarray, ndarray, ndarray, ndarray]:
        """∂Γ/∂a of warp and weft, (2, P, 3, n), n, (P, 3, n), c and s, (P, n)."""
        stretch = self.stretch[:, :, None]
        e = self.v * stretch
        normal = cross(*e.transpose(0, 2, 1, 3)).swapaxes(0, 1)
        c = (e[0] * e[1]).sum(axis=1)
        s = np.sqrt((normal**2).sum(axis=1))
        g = (e[::-1] - c[:, None] * e) / (s[:, None] * stretch)
        return self.side[:, None] * g, normal / s[:, None], c, s

    def stiffness(self, stress: Stress, block: slice) -> tuple[ndarray, Values]:
        """See `FibreDeformation`."""
        T, M, E = stress
        v, squared = self.v[..., block], self.squared_stretch[..., block]
        direct = np.zeros((*v.shape[:2], len(_PAIRS), v.shape[-1]))
        if T is not None and E is not None:
            direct[:, :, _DIAGONAL] += (T / squared)[:, :, None]
            _add_square(direct, E - 2 * T, v)
        return direct, None if M is None else self._add_shear(direct, M, block)

    def _add_shear(self, direct: ndarray, M: ndarray, block: slice) -> ndarray:
        """Add M ∂²Γ/∂a_α², and return M ∂²Γ/∂a₁∂a₂."""
        g, n, c, s = (x[..., block] for x in self._crossing)
        v, squared = self.v[..., block], self.squared_stretch[..., block]
        side = np.broadcast_to(self.side, self.squared_stretch.shape[1:])[..., block]
        half, lifted = 0.5 * M, 0.5 * M * side / s
        together, apart = lifted * (1 - c), -lifted * (1 + c)
        _add_square(direct, half, v - g)
        _add_square(direct, -half, v + g)
        normal = np.zeros((len(M), len(_PAIRS), M.shape[-1]))
        _add_square(normal[None], 1.0, n[None])
        direct += ((together + apart) / squared)[:, :, None] * normal
        root = np.sqrt(squared[0] * squared[1])
        return ((together - apart) / root)[:, None] * normal

    def angle_derivatives(self, block: slice) -> ndarray:
        """See `FibreDeformation`."""
        return self._crossing[0][..., block]


class GeneralPoints:
    """P integration points in each of n elements, and sums over them.

    The modes are displacements of the nodes.  ``block`` selects elements; arguments and
    returned values refer to these only.

    Parameters
    ----------
    A
        Reference directions of warp and weft, shape (2, 2, n, P).
    dN
        Gradients of the shape functions of k nodes, shape (k, 2, n, P).
    dx
        Areas, shape (P, n).
    d
        Components of the displacement.
    nodes, n_nodes
        Element nodes on which the fibres depend, shape (k,), and total number of nodes;
        by default all nodes.

    Attributes
    ----------
    A
        Directions of warp and weft, shape (2, P, d, n).
    b
        b_a of warp and weft, shape (2, P, k, n); with A it identifies sets of points
        with equal deformations.
    n_modes
        Number of modes on which the fibres depend, the first of all.
    angle_at_rest
        Angle from warp to weft, broadcasts to (P, n).
    """

    def __init__(
        self,
        A: ndarray,
        dN: ndarray,
        dx: ndarray,
        d: int,
        nodes: ndarray | None = None,
        n_nodes: int = 0,
    ) -> None:
        self.A, self.dx = A.transpose(0, 3, 1, 2).copy(), dx
        if d == 3:  # z = 0
            self.A = np.pad(self.A, ((0, 0), (0, 0), (0, 1), (0, 0)))
        b = A[:, None, 0] * dN[:, 0] + A[:, None, 1] * dN[:, 1]
        self.b = np.ascontiguousarray(b.transpose(0, 3, 1, 2))
        self._nodes = nodes = np.arange(len(dN)) if nodes is None else nodes
        self._n_nodes = self.n_modes = n_nodes = n_nodes or len(nodes)

        # for each of the k nodes, numbers of its pairs with it and the following ones
        number = np.zeros((n_nodes, n_nodes), dtype=int)
        first, second = np.triu_indices(n_nodes)
        number[first, second] = number[second, first] = np.arange(len(first))
        self.angle_at_rest = angle_between(self.A[:, :, :2])
        pairs = [number[x, nodes[a:]] for a, x in enumerate(nodes)]
        every = len(nodes) == n_nodes  # then they are consecutive
        self._pairs = [slice(p[0], p[-1] + 1) if every else p for p in pairs]

    def fibres(self, u: ndarray, block: slice) -> ndarray:
        """Fibre vectors a of warp and weft, shape (2, P, d, n), for modes u."""
        A = self.A if self.A.shape[-1] == 1 else self.A[..., block]
        return A + np.einsum("fpan,ain->fpin", self.b[..., block], u[self._nodes])

    def forces(self, forces: ndarray, block: slice) -> ndarray:
        """Σ b_a f over fibres and points, shape (n_modes, d, n)."""
        f = np.zeros((self._n_nodes, *forces.shape[2:]))
        f[self._nodes] = np.einsum("fpan,fpin->ain", self.b[..., block], forces)
        return f

    def add_stiffness(
        self, K: ndarray, direct: ndarray, across: Values, block: slice
    ) -> None:
        """Add Σ b_a b_c k over fibres and points, see `FibreDeformation.stiffness`.

        K has the symmetric blocks of the pairs of modes by their entries at and above
        the diagonal, shape (n_pairs, d (d + 1)/2, n).  The coupling of warp and weft is
        multiplied by b¹_a b²_c + b²_a b¹_c.
        """
        b = self.b[..., block]
        for a, pairs in enumerate(self._pairs):
            products = b[:, :, a, None] * b[:, :, a:]
            K[pairs] += np.einsum("fpcn,fpen->cen", products, direct)
            if across is not None:
                both = b[0, :, a, None] * b[1, :, a:] + b[1, :, a, None] * b[0, :, a:]
                K[pairs] += np.einsum("pcn,pen->cen", both, across)

    def strain_gradients(self, v: ndarray, block: slice) -> ndarray:
        """Σ b_a v over points for warp and weft, shape (2, n_modes, d, n)."""
        g = np.zeros((2, self._n_nodes, *v.shape[2:]))
        g[:, self._nodes] = np.einsum("fpan,fpin->fain", self.b[..., block], v)
        return g

    def gradients(self, x: ndarray, block: slice) -> ndarray:
        """Σ b_a x over the fibres of each point, shape (P, n_modes, d, n).

        x of warp and weft has the shape (2, P, d, n): v for ε₁ + ε₂, ∂Γ for Γ.
        """
        warp, weft = x
        b_1, b_2 = self.b[..., block, None].swapaxes(-1, -2)
        g = np.zeros((len(self.dx), self._n_nodes, *warp.shape[1:]))
        g[:, self._nodes] = b_1 * warp[:, None] + b_2 * weft[:, None]
        return g


@dataclass(eq=False)
class QuadPoints:
    """Integration points of bilinear quadrilaterals with constant fibre directions.

    There are three modes: the changes of warp and weft at the centre, and the hourglass
    mode, whose coefficient at a point is b = η.

    Attributes
    ----------
    A, dx
        See `GeneralPoints`; A is the same for all points.
    b
        η of warp and weft, shape (2, P, n).
    """

    A: ndarray
    dx: ndarray
    b: ndarray

    @cached_property
    def angle_at_rest(self) -> ndarray:
        """See `GeneralPoints`."""
        return angle_between(self.A[:, :, :2])

    @cached_property
    def n_modes(self) -> int:
        """Without the hourglass mode if all points are at the centre."""
        return 3 if self.b.any() else 2

    def fibres(self, u: ndarray, block: slice) -> ndarray:
        """See `GeneralPoints`."""
        A = self.A if self.A.shape[-1] == 1 else self.A[..., block]
        return A + u[:2, None] + self.b[..., block][:, :, None] * u[2]

    def forces(self, forces: ndarray, block: slice) -> ndarray:
        """See `GeneralPoints`."""
        hourglass = np.einsum("fpn,fpin->in", self.b[..., block], forces)
        return np.concatenate([forces.sum(axis=1), hourglass[None]])

    def add_stiffness(
        self, K: ndarray, direct: ndarray, across: Values, block: slice
    ) -> None:
        """See `GeneralPoints`."""
        eta = self.b[..., block]
        mixed = eta[:, :, None] * direct
        # pairs of modes: 0, 3, 5 are diagonal, 2, 4 couple to the hourglass mode
        for diagonal, coupled, fibre, product in zip(
            (0, 3), (2, 4), direct, mixed, strict=True
        ):
            K[diagonal] += fibre.sum(axis=0)
            K[coupled] += product.sum(axis=0)
        K[5] += np.einsum("fpn,fpcn->cn", eta, mixed)
        if across is not None:  # pair 1 is warp and weft
            by_warp, by_weft = eta[:, :, None] * across
            K[1] += across.sum(axis=0)
            K[2] += by_weft.sum(axis=0)
            K[4] += by_warp.sum(axis=0)
            K[5] += 2 * np.einsum("pn,pcn->cn", eta[0], by_weft)

    def strain_gradients(self, v: ndarray, block: slice) -> ndarray:
        """See `GeneralPoints`."""
        g = np.zeros((2, 3, *v.shape[2:]))
        g[0, 0], g[1, 1] = v.sum(axis=1)
        g[:, 2] = np.einsum("fpn,fpin->fin", self.b[..., block], v)
        return g

    def gradients(self, x: ndarray, block: slice) -> ndarray:
        """See `GeneralPoints`."""
        eta, g = self.b[..., block], np.empty((x.shape[1], 3, *x.shape[2:]))
        g[:, 0], g[:, 1] = x
        g[:, 2] = eta[0][:, None] * g[:, 0] + eta[1][:, None] * g[:, 1]
        return g


#: Integration points of elements.
IntegrationPoints: TypeAlias = GeneralPoints | QuadPoints


def angle_between(a: ndarray) -> ndarray:
    """Angle from the first to the second fibre, of the vectors a, (2, P, d, n).

    In (−π, π], and in space in [0, π].
    """
    if a.shape[2] == 3:
        n = cross(*a.transpose(0, 2, 1, 3)).swapaxes(0, 1)
        return np.arctan2(np.sqrt((n**2).sum(axis=1)), (a[0] * a[1]).sum(axis=1))
    (x1, y1), (x2, y2) = a.transpose(0, 2, 1, 3)
    return np.arctan2(x1 * y2 - y1 * x2, x1 * x2 + y1 * y2)


class ElementGroup:
    """Elements of a basis with equal numbers of nodes, modes and points.

    Parameters
    ----------
    nodes
        Node numbers, shape (n_nodes, n).
    modes
        Coefficients of the modes per nodal displacement, shape (n_modes, n_nodes, n);
        None if the modes are the displacements.
    points
        Integration points, in sets that a kernel evaluates together.
    fabrics, fabric
        The fabric with its laws at the points, and at the elements (`Fabric.at`), for
        arguments in the order of the forms.
    elements, point_numbers
        Numbers of the elements and of the points of each set in the basis.

    Attributes
    ----------
    n_modes
        Number of modes of an element.
    area
        Area of each element, shape (n,).
    blocks
        Slices of elements whose values fit into the cache.
    """

    def __init__(
        self,
        nodes: ndarray,
        modes: ndarray | None,
        points: Sequence[IntegrationPoints],
        fabrics: Sequence["Fabric"],
        fabric: "Fabric",
        elements: Any = _ALL,
        point_numbers: Sequence[Any] = (_ALL, _ALL),
    ) -> None:
        self.nodes, self.modes, self.points = nodes, modes, points
        self.fabrics, self.fabric = fabrics, fabric
        self.elements, self.point_numbers = elements, point_numbers[: len(points)]
        self.n_modes, n = len(nodes if modes is None else modes), nodes.shape[1]
        self.area: ndarray = sum(p.dx.sum(axis=0) for p in points)
        starts = range(0, n, _BLOCK)
        self.blocks = [slice(i, min(i + _BLOCK, n)) for i in starts]
        self._sums: Sums | None = None
        self._last: tuple[ndarray, list[FibreDeformation]] = np.empty(0), []

    def sum_at_nodes(self, values: ndarray, n_nodes: int) -> ndarray:
        """Sums over elements of values at their nodes, (n_nodes_of_element, n)."""
        if self._sums is None:
            self._sums = Sums(self.nodes, n_nodes)
        return self._sums(values)

    def last_deformations(self, u: ndarray) -> list[FibreDeformation]:
        """Deformations at all points, kept for the last ``u``.

        Forms on one basis share them, as do residual and tangent.
        """
        last = self._last
        if not np.array_equal(u, last[0]):
            self._last = last = u.copy(), self.deformations(u, self.points)
        return last[1]

    def deformations(
        self, u: ndarray, points: Sequence[IntegrationPoints]
    ) -> list[FibreDeformation]:
        """Deformations at the given integration points for a DOF vector ``u``."""
        if not points:
            return []
        d, n = points[0].A.shape[2], self.nodes.shape[1]
        columns = u.reshape(-1, d).T.copy()
        local = np.stack([x[self.nodes] for x in columns], axis=1)
        arrays = [
            (np.empty((2, P, d, n)), np.empty((2, P, n)), np.empty((P, n)))
            for P in (len(p.dx) for p in points)
        ]
        for block in self.blocks:
            modes = local[..., block]
            if self.modes is not None:
                modes = np.einsum("ran,ain->rin", self.modes[..., block], modes)
            for p, (v, squared, angle) in zip(points, arrays, strict=True):
                a = p.fibres(modes, block)
                square = a[:, :, 0] ** 2 + a[:, :, 1] ** 2
                if d == 3:
                    square += a[:, :, 2] ** 2
                v[..., block], squared[..., block] = a / square[:, :, None], square
                angle[..., block] = angle_between(a)
        deformations: list[FibreDeformation] = []
        for p, (v, squared, angle) in zip(points, arrays, strict=True):
            at_rest = p.angle_at_rest
            if d == 2:
                fibres = FibreDeformation(v, squared, at_rest - angle)
            else:
                side = np.sign(at_rest)
                fibres = DeformationInSpace(v, squared, at_rest - side * angle, side)
            deformations.append(fibres)
        return deformations


def element_groups(basis: Any, fabric: "Fabric") -> list[ElementGroup]:
    """Groups of the elements of a basis of the displacement, cached.

    The basis must not be changed afterwards.  For `HourglassBasis` the centre comes
    first, with the fibres of the corners and zero weight, then the corners.
    """
    known = _GROUPS.setdefault(basis, WeakKeyDictionary())
    if fabric not in known:
        known[fabric] = list(_new_groups(basis, fabric))
    return known[fabric]


def _new_groups(basis: Any, fabric: "Fabric") -> Iterator[ElementGroup]:
    d, numbers = components(basis), element_numbers(basis)
    nodes, x = basis.element_dofs[::d] // d, np.asarray(basis.global_coordinates())
    pair = fabric.directions(x, numbers)
    A = np.array([np.broadcast_to(a, x.shape) for a in pair])
    fluctuates = isinstance(basis, HourglassBasis)
    if not fluctuates:
        dN = function_gradients(basis)
    if isinstance(basis, MeanBasis) and basis.parts is not None:
        yield from _macro_groups(basis, fabric, nodes, dN, A)
        return
    modes, sets = None, []
    if fluctuates:
        dN, centre = basis.gradients()
        sets.append((centre, 0 * basis.dx.T))
    sets.append((dN, basis.dx.T))
    points: list[IntegrationPoints]
    if (
        isinstance(basis.elem.elem, ElementQuad1)
        and basis.mesh.elem is ElementQuad1
        and np.all(A[..., :1] == A)
    ):
        at_centre, gamma, slope = hourglass_mode(basis, dN)
        centres = GeneralPoints(A[..., :1], at_centre, basis.dx.T[:1], d)
        modes = np.concatenate([centres.b[:, 0], gamma[None]])
        eta = (A * slope).sum(axis=1).swapaxes(1, 2)
        points = [QuadPoints(centres.A, basis.dx.T, eta)]
        if fluctuates:
            no_dx, no_eta = 0 * basis.dx.T[:1], 0 * eta[:, :1]
            points.insert(0, QuadPoints(centres.A, no_dx, no_eta))
    else:
        points = [GeneralPoints(A, gradients, dx, d) for gradients, dx in sets]
    laws = len(points) * [fabric.at(numbers)]
    yield ElementGroup(nodes, modes, points, laws, fabric.at(numbers[:, :1]))


def hourglass_mode(basis: Any, dN: ndarray) -> tuple[ndarray, ndarray, ndarray]:
    """Variation of gradients in bilinear quadrilaterals: ∇N_a(ξ) = ∇N_a(0) + γ_a ∇h(ξ).

    γ is the hourglass vector (Flanagan & Belytschko 1981).  From ∇N_a at the points,
    shape (4, 2, n, P), these are ∇N_a(0), shape (4, 2, n, 1), γ, shape (4, n), and ∇h,
    shape (2, n, P).
    """
    at_centre, tind = gradients_at(basis, CENTRE[0]), basis.tind
    h = np.array([1.0, -1.0, 1.0, -1.0])
    corners = basis.mesh.p[:, basis.mesh.t[:, _ALL if tind is None else tind]]
    gamma = h[:, None] - np.einsum("b,jbn,ajn->an", h, corners, at_centre[..., 0])
    slope = np.einsum("an,ajnq->jnq", gamma / (gamma**2).sum(axis=0), dN - at_centre)
    return at_centre, gamma, slope


def _macro_groups(
    basis: Any, fabric: "Fabric", nodes: ndarray, dN: ndarray, A: ndarray
) -> Iterator[ElementGroup]:
    """Macro-elements, grouped by the nodes that their quadrilaterals share."""
    d = components(basis)
    flat = basis.corners.reshape(-1, basis.nelems)
    patterns, pattern_of = np.unique(flat, axis=1, return_inverse=True)
    for i, pattern in enumerate(patterns.T):
        elements = np.flatnonzero(pattern_of.ravel() == i)
        corners = pattern.reshape(4, -1).T[basis.parts[elements[0]] >= 0]
        own_nodes = nodes[: corners.max() + 1, elements]
        numbers = [slice(j, j + 1) for j in range(len(corners))]
        points: list[IntegrationPoints] = [
            GeneralPoints(
                A[..., elements, j],
                dN[four][..., elements, j],
                basis.dx[elements, j].T,
                *(d, four, len(own_nodes)),
            )
            for j, four in zip(numbers, corners, strict=True)
        ]
        laws = [fabric.at(basis.parts[elements, j]) for j in numbers]
        yield ElementGroup(own_nodes, None, points, laws, laws[0], elements, numbers)


def _add_square(total: ndarray, factor: ndarray | float, x: ndarray) -> None:
    """Add factor · x xᵀ of vectors x, shape (f, P, 3, n), by entries of `_PAIRS`."""
    for k, (i, j) in enumerate(_PAIRS):
        total[:, :, k] += factor * x[:, :, i] * x[:, :, j]
