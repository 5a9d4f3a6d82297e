"""Kernels: energies, stresses and stiffnesses of the forms, for all elements at once.

A kernel computes, at the points of an `ElementGroup`, the tension T and the shear
moment M times area, and their derivatives with respect to the fibre strains. Then

    f_a  = Σ b_a (T v + M ∂Γ),
    K_ac = Σ b_a b_c (E v vᵀ + T ∂²ε + M ∂²Γ) + Σ s g_a g_cᵀ,

where in the plane ∂²(ε + iθ) = −(δz/z)², and in space ∂²Γ also has a part normal to
warp and weft.  The rank-one stiffnesses s g gᵀ belong to strains of more than one fibre
or point: shear angles, their differences, and means.  If a tension depends on both
strains, D₁₂ (g₁ g₂ᵀ + g₂ g₁ᵀ) is the rank-one stiffness D₁₂ of ε₁ + ε₂, with D₁₂
subtracted from the slope of each tension.

Element matrices are symmetric and hold the d×d blocks of the pairs of nodes (a, c) with
a ≤ c, in the order of `numpy.triu_indices`: shape (n_pairs, d, d, n_elements).
"""

from collections.abc import Callable, Collection, Mapping, Sequence
from copy import copy
from dataclasses import dataclass
from functools import cached_property, partial
from typing import Any, ClassVar, NamedTuple, TypeAlias
from weakref import WeakKeyDictionary

import numpy as np
from numpy import ndarray
from skfem import CellBasis, ElementVector

from ...fabric import Fabric, Slopes, TwoLaws, is_zero
from ...fabric.law import with_slip
from ...mesh.bases import ElementQuad1Fluctuation, HourglassBasis, MeanBasis
from ...mesh.pattern import full_matrices
from ...mesh.user_input import parameter
from .elements import (
    ENTRIES,
    ElementGroup,
    FibreDeformation,
    IntegrationPoints,
    Stress,
    element_groups,
)

# Negative eigenvalues below this share of the trace are round-off, which a Cholesky
# factorisation of order n amplifies to about n² times 2e-16: 7e-14 for n = 18.
_ROUND_OFF = 1e-12

_ALL = slice(None)

#: Parameters of a form: numbers, or arrays over elements and points.
Parameters: TypeAlias = Mapping[str, Any]


class RankOneStiffness(NamedTuple):
    """Stiffness s of P strains of each element, shape (P, n), and their gradients g.

    ``gradients`` takes a block of elements and returns shape (P, n_modes, d, n_block).
    """

    stiffness: ndarray
    gradients: Callable[[slice], ndarray]


@dataclass(frozen=True, eq=False)
class Kernel:
    """Energy of a term and its derivatives with respect to fibre strains.

    It supports bases of the class ``basis_type`` (`can_compute`).
    """

    fabric: Fabric
    basis_type: ClassVar[type[CellBasis]] = CellBasis
    #: Attribute of a fabric with the law that the kernel evaluates.
    law: ClassVar[str] = "tensions"

    @cached_property
    def resists(self) -> ndarray:
        """1 for a family with a tension law, 0 for one without; shape (2, 1, 1)."""
        resists = [not is_zero(family.tension) for family in self.fabric.families]
        return np.array(resists, dtype=float)[:, None, None]

    def values(self, x: "KernelState") -> Any:
        """Values that energy, stresses and stiffnesses share, see `KernelState`."""
        raise NotImplementedError

    def laws(self, x: "KernelState") -> Sequence[Any]:
        """Law at each set of points."""
        laws = [getattr(fabric, self.law) for fabric in x.group.fabrics]
        if "slip" in x.w:
            slip = np.asarray(x.w["slip"])[..., x.group.elements, :]
            pairs = zip(laws, x.group.point_numbers, strict=True)
            laws = [with_slip(law, slip[..., i]) for law, i in pairs]
        return laws

    def energy(self, x: "KernelState") -> float:
        """Energy in N·mm."""
        raise NotImplementedError

    def stresses(self, x: "KernelState") -> list[Stress]:
        """Stresses at the points."""
        raise NotImplementedError

    def stiffnesses(self, x: "KernelState") -> list[RankOneStiffness]:
        """Stiffnesses that couple fibres or points."""
        raise NotImplementedError


@dataclass(eq=False)
class KernelState:
    """Kernel on a group of elements in one state.

    ``fibres`` are the deformations at the points of the group, ``places`` the same
    points, or points of another term with equal fibre deformations, and ``w`` the
    parameters of the form.  ``tension`` are fibre tensions for the stiffness; by
    default they follow from the law.  With ``stretched``, the stiffness of shortened
    fibres is the one at rest.  ``values`` are shared values of the kernel.
    """

    kernel: Kernel
    group: ElementGroup
    places: Sequence[IntegrationPoints]
    fibres: list[FibreDeformation]
    w: Parameters
    tension: ndarray | None = None
    stretched: bool = False

    def __post_init__(self) -> None:
        self.values = self.kernel.values(self)

    def for_stiffness(self, tension: ndarray, stretched: bool) -> "KernelState":
        """The state with other tensions and slopes, and the same values."""
        other = copy(self)
        other.tension, other.stretched = tension, stretched
        return other


@dataclass(eq=False)
class Tensions:
    """Law of both tensions at fibre strains of shape (2, P, n), evaluated once.

    Laws take arguments of shape (2, n, P).
    """

    law: Any
    strain: ndarray

    @property
    def energies(self) -> ndarray:
        """Energies of warp and weft, shape (2, P, n)."""
        return self._of_both(self.law.energies(self.strain.swapaxes(1, 2)))

    @cached_property
    def value(self) -> ndarray:
        """Tensions of warp and weft, shape (2, P, n)."""
        return self._of_both(self.law.value(self.strain.swapaxes(1, 2)))

    @cached_property
    def slopes(self) -> Slopes:
        """Slopes of the tensions, arrays of shape (2, P, n) and (P, n)."""
        return self._slopes(self.strain)

    def slopes_in(self, x: KernelState) -> Slopes:
        """Slopes for the stiffness in a state."""
        return self._slopes(np.maximum(self.strain, 0)) if x.stretched else self.slopes

    def _slopes(self, strain: ndarray) -> Slopes:
        direct, cross = self.law.slopes(strain.swapaxes(1, 2))
        return Slopes(self._of_both(direct), None if cross is None else cross.T)

    @staticmethod
    def _of_both(values: Sequence[ndarray]) -> ndarray:
        return np.array([x.T for x in values])


class TensionKernel(Kernel):
    """Kernel of `tension`."""

    def values(self, x: KernelState) -> list[tuple[Any, FibreDeformation, Tensions]]:
        """Each set of points, their deformation and tensions."""
        sets = zip(x.group.points, x.fibres, self.laws(x), strict=True)
        return [(p, f, Tensions(law, f.strain)) for p, f, law in sets]

    def energy(self, x: KernelState) -> float:
        """∫ Σ_α ψ(ε_α) dΩ."""
        return sum(float((p.dx * law.energies).sum()) for p, _, law in x.values)

    def stresses(self, x: KernelState) -> list[Stress]:
        """Tension and its slope; `stiffnesses` has the slope for ε₁ + ε₂."""
        tensions, stresses = _tension_values(x), []
        for i, (p, _, law) in enumerate(x.values):
            direct, cross = law.slopes_in(x)
            slope = direct if cross is None else direct - cross
            T = tensions[i] if tensions else law.value
            stresses.append(Stress(tension=p.dx * T, slope=p.dx * slope))
        return stresses

    def stiffnesses(self, x: KernelState) -> list[RankOneStiffness]:
        """Warp-weft coupling as a rank-one update of ε₁ + ε₂; empty if uncoupled."""
        if isinstance(self.fabric.tensions, TwoLaws):
            return []
        return [
            RankOneStiffness(
                p.dx * law.slopes_in(x).cross, partial(_sum_gradients, p, f)
            )
            for p, f, law in x.values
        ]

    def predicted_tension(self, x: KernelState, after: KernelState) -> list[ndarray]:
        """T(ε) + ∂T/∂ε Δε, shape (2, P, n) each."""
        return [
            law.value + law.slopes.times(f.change(g))
            for (_, f, law), g in zip(x.values, after.fibres, strict=True)
        ]


class ShearKernel(Kernel):
    """Kernel of `shear`."""

    law: ClassVar[str] = "shear_law"

    def values(self, x: KernelState) -> list[tuple[Any, Any, FibreDeformation]]:
        """Each set of points, their law and deformation."""
        return [*zip(x.group.points, self.laws(x), x.fibres, strict=True)]

    def energy(self, x: KernelState) -> float:
        """∫ w(Γ) dΩ."""
        return sum(
            float((p.dx * _of_shear(law, "energy", f)).sum()) for p, law, f in x.values
        )

    def stresses(self, x: KernelState) -> list[Stress]:
        """Shear moment."""
        return [
            Stress(moment=p.dx * _of_shear(law, "value", f)) for p, law, f in x.values
        ]

    def stiffnesses(self, x: KernelState) -> list[RankOneStiffness]:
        """Slope of the shear law, along the gradient of the shear angle."""
        return [
            RankOneStiffness(
                p.dx * _of_shear(law, "tangent", f),
                partial(_angle_gradients, [(p, f)]),
            )
            for p, law, f in x.values
        ]


@dataclass(frozen=True, eq=False)
class HourglassKernel(Kernel):
    """Kernel of `hourglass`: points at the centre, then at the corners."""

    C_s: float | None = None
    basis_type: ClassVar[type[CellBasis]] = HourglassBasis

    def values(self, x: KernelState) -> tuple[ndarray, ndarray]:
        """C_s A/4 and Γ(ξ_k) − Γ(0), shape (4, n)."""
        _, corners = x.group.points
        at_centre, at_corners = x.fibres
        C_s: Any = self.C_s
        if C_s is None:
            C_s = np.broadcast_to(parameter(x.w, "C_s"), corners.dx.T.shape).T
        return corners.dx * C_s, at_corners.shear_angle - at_centre.shear_angle

    def energy(self, x: KernelState) -> float:
        """½ C_s Σ_k A/4 (Γ(ξ_k) − Γ(0))²."""
        C_s, difference = x.values
        return 0.5 * float((C_s * difference**2).sum())

    def stresses(self, x: KernelState) -> list[Stress]:
        """Moments at the points, and the opposite moments at the centre."""
        C_s, difference = x.values
        moment = C_s * difference
        one_centre = len(x.fibres[0].shear_angle) == 1
        opposite = moment.sum(axis=0, keepdims=True) if one_centre else moment
        return [Stress(moment=-opposite), Stress(moment=moment)]

    def stiffnesses(self, x: KernelState) -> list[RankOneStiffness]:
        """C_s, along the gradient of Γ(ξ_k) − Γ(0)."""
        C_s, _ = x.values
        centre, corners = zip(x.group.points, x.fibres, strict=True)
        return [RankOneStiffness(C_s, partial(_angle_gradients, [corners, centre]))]


class MeanTensionKernel(Kernel):
    """Kernel of `mean_tension`."""

    basis_type: ClassVar[type[CellBasis]] = MeanBasis

    def values(
        self, x: KernelState
    ) -> "tuple[list[ndarray], ndarray, ndarray, Tensions]":
        """Stretches at the points, (2, P, n) each, their means, E_d, and tensions.

        Means and E_d have the shape (2, 1, n).  E_d is 0 for a family without a law.
        The tensions are those at the means.
        """
        group = x.group
        law: Any = group.fabric.tensions
        if "slip" in x.w:
            law = with_slip(law, np.asarray(x.w["slip"])[..., group.elements, :])
        stretches = [f.stretch for f in x.fibres]
        E_d = np.asarray(parameter(x.w, "E_d"))[:, group.elements, 0]
        means = _mean(group, stretches)
        law = Tensions(law, np.log(means))
        return stretches, means, self.resists * E_d[:, None], law

    def energy(self, x: KernelState) -> float:
        """∫ Σ_α ψ(ln λ̄_α) + ½ E_d (λ_α − λ̄_α)² dΩ."""
        stretches, means, E_d, law = x.values
        density = law.energies
        return sum(
            float((p.dx * (density + 0.5 * E_d * (stretch - means) ** 2)).sum())
            for p, stretch in zip(x.group.points, stretches, strict=True)
        )

    def stresses(self, x: KernelState) -> list[Stress]:
        """Tension λ ∂ψ/∂λ, and its slope λ² E_d + T for strain deviations."""
        stretches, means, E_d, law = x.values
        T = _tension_values(x)
        if not T:
            N = law.value / means
            T = [stretch * (N + E_d * (stretch - means)) for stretch in stretches]
        return [
            Stress(tension=p.dx * T_p, slope=p.dx * (E_d * stretch**2 + T_p))
            for p, T_p, stretch in zip(x.group.points, T, stretches, strict=True)
        ]

    def stiffnesses(self, x: KernelState) -> list[RankOneStiffness]:
        """Remaining slope of the laws, along the gradient of the mean stretch."""
        group, (stretches, means, E_d, law) = x.group, x.values
        direct, cross = law.slopes_in(x)
        slope = (direct - law.value) / means**2 - E_d
        if cross is not None:
            cross = cross / (means[0] * means[1])
            slope = np.array([*(slope - cross), cross])

        def gradients(block: slice) -> ndarray:
            d = x.fibres[0].v.shape[2]
            g = np.zeros((2, group.n_modes, d, group.area[block].size))
            for p, f, stretch in zip(group.points, x.fibres, stretches, strict=True):
                share = (p.dx * stretch)[:, :, None, block] / group.area[block]
                g += p.strain_gradients(share * f.v[..., block], block)
            return g if cross is None else np.array([*g, g[0] + g[1]])

        return [RankOneStiffness((group.area * slope)[:, 0], gradients)]

    def predicted_tension(self, x: KernelState, after: KernelState) -> list[ndarray]:
        """Tension over stretch to first order, times the new stretch; (2, P, n) each.

        The force N is conjugate to the stretch and is linear in the increment to first
        order.  The tension λ N is not: the stretch of a rotating fibre grows to second
        order.
        """
        group, (stretches, means, E_d, law) = x.group, x.values
        changes = [
            stretch * f.change(g)
            for stretch, f, g in zip(stretches, x.fibres, after.fibres, strict=True)
        ]
        mean_change = _mean(group, changes)
        T, (direct, cross) = law.value, law.slopes
        N = T / means + (direct - T) / means**2 * mean_change
        if cross is not None:
            N += cross * (mean_change / means)[::-1] / means
        mean_after = means + mean_change
        return [
            f.stretch * (N + E_d * (stretch + change - mean_after))
            for f, stretch, change in zip(after.fibres, stretches, changes, strict=True)
        ]


def can_compute(kernel: Kernel | None, basis: Any) -> bool:
    """True if a kernel supports a basis: one with elements, and unknowns node by node.

    Node k has the unknowns from dk on, with d = 2 or 3 components, and vertices are
    nodes: an unknown is neither a derivative nor discontinuous.
    """
    if kernel is None or not isinstance(basis, kernel.basis_type):
        return False
    if not isinstance(basis.elem, ElementVector) or not basis.nelems:
        return False
    fluctuates = isinstance(basis.elem.elem, ElementQuad1Fluctuation)
    if basis.elem.dim not in (2, 3) or basis.elem.elem.nodal_dofs != 1:
        return False
    if fluctuates != (kernel.basis_type is HourglassBasis):
        return False
    if basis not in _NODE_BY_NODE:
        _NODE_BY_NODE[basis] = _node_by_node(basis)
    return _NODE_BY_NODE[basis]


_NODE_BY_NODE: WeakKeyDictionary[Any, bool] = WeakKeyDictionary()


def _node_by_node(basis: Any) -> bool:
    d = basis.elem.dim
    of_nodes = basis.element_dofs.reshape(-1, d, basis.nelems)
    first = of_nodes[:, :1]
    return bool(np.all((first % d == 0) & (of_nodes == first + np.arange(d)[:, None])))


def _angle_gradients(
    angles: Sequence[tuple[IntegrationPoints, FibreDeformation]], block: slice
) -> ndarray:
    """∂Γ/∂u_a at a set of points; given two sets, the first minus the second."""
    g, *others = (p.gradients(f.angle_derivatives(block), block) for p, f in angles)
    return g - others[0] if others else g


def _sum_gradients(
    points: IntegrationPoints, fibres: FibreDeformation, block: slice
) -> ndarray:
    """∂(ε₁ + ε₂)/∂u_a."""
    return points.gradients(fibres.v[..., block], block)


def _mean(group: ElementGroup, values: list[ndarray]) -> ndarray:
    """Mean over each element of values at its points, shape (2, 1, n)."""
    pairs = zip(group.points, values, strict=True)
    return sum((p.dx * x).sum(axis=1, keepdims=True) for p, x in pairs) / group.area


def _tension_values(x: KernelState) -> list[ndarray]:
    """Tensions of the state at each set of points; empty: use the law."""
    if x.tension is None:
        return []
    T = np.asarray(x.tension)[..., x.group.elements, :]
    at_points = (T[..., i].swapaxes(1, 2) for i in x.group.point_numbers)
    return [x.kernel.resists * T_p for T_p in at_points]


def _of_shear(law: Any, part: str, fibres: FibreDeformation) -> ndarray:
    """Energy, value or tangent of the shear law, shape (P, n); laws take (n, P)."""
    angle = fibres.shear_angle.T
    return np.broadcast_to(getattr(law, part)(angle), angle.shape).T


class SharedGroup(NamedTuple):
    """Elements with the same nodes and modes, with the points of each term.

    The first of several points with equal fibre deformations represents all.
    """

    group: ElementGroup
    terms: dict[Any, tuple[ElementGroup, list[IntegrationPoints]]]


def shared_groups(terms: Sequence[Any]) -> list[SharedGroup]:
    """Element groups of terms; terms with the same nodes and modes share a group."""
    groups: list[SharedGroup] = []
    for term in terms:
        for group in element_groups(term.basis, term.kernel.fabric):
            alike = (s for s in groups if _equal(s.group, group, "nodes", "modes"))
            if (shared := next(alike, None)) is None:
                groups.append(shared := SharedGroup(group, {}))
            known = [p for _, points in shared.terms.values() for p in points]
            shared.terms[term] = (
                group,
                [
                    next((p for p in known if _equal(new, p, "b", "A")), new)
                    for new in group.points
                ],
            )
    return groups


def _equal(one: Any, other: Any, *names: str) -> bool:
    """True if attributes, arrays or None, are equal in two objects of a class."""
    return type(one) is type(other) and all(
        np.array_equal(getattr(one, name), getattr(other, name)) for name in names
    )


def element_forces(states: Collection[KernelState]) -> ndarray:
    """Sum of the nodal forces of kernels on a group, shape (n_nodes, d, n)."""
    (x, *_), stresses = states, _sum_of_stresses(states)
    group = x.group
    f = np.empty((len(group.nodes), x.fibres[0].v.shape[2], group.area.size))
    whole = len(group.blocks) == 1
    for block in group.blocks:
        modal = np.zeros((group.n_modes, f.shape[1], block.stop - block.start))
        for points, (fibres, stress) in stresses.items():
            of_block = stress if whole else stress.of(block)
            modal += points.forces(fibres.forces(of_block, block), block)
        if group.modes is not None:
            modal = np.einsum("ran,rin->ain", group.modes[..., block], modal)
        f[..., block] = modal
    return f


def element_matrices(states: Collection[KernelState]) -> ndarray:
    """Sum of the element matrices of kernels on a group.

    Returned as blocks of the pairs of nodes, shape (n_pairs, d, d, n).
    """
    (x, *_), stresses = states, _sum_of_stresses(states)
    group = x.group
    d, n_nodes = x.fibres[0].v.shape[2], len(group.nodes)
    rank_one = [s for x in states for s in x.kernel.stiffnesses(x)]
    n_modes = max(points.n_modes for points in stresses)
    used: Any = _ALL
    if n_modes < group.n_modes:
        used = np.flatnonzero(np.triu_indices(group.n_modes)[1] < n_modes)
    K = np.empty((n_nodes * (n_nodes + 1) // 2, d, d, group.area.size))
    whole = len(group.blocks) == 1
    for block in group.blocks:
        n = block.stop - block.start
        n_pairs = group.n_modes * (group.n_modes + 1) // 2
        symmetric = np.zeros((n_pairs, d * (d + 1) // 2, n))
        for points, (fibres, stress) in stresses.items():
            of_block = stress if whole else stress.of(block)
            parts = fibres.stiffness(of_block, block)
            points.add_stiffness(symmetric, *parts, block)
        k = symmetric[used][:, ENTRIES[d]]
        for stiffness, gradients in rank_one:  # Σ s g_a g_cᵀ over points
            g = gradients(block)
            scaled, start = stiffness[:, block][:, None, None] * g, 0
            for a in range(n_modes):
                row = np.einsum("pin,pcjn->cijn", scaled[:, a], g[:, a:n_modes])
                k[start : start + len(row)] += row
                start += len(row)
        if group.modes is None:
            K[..., block] = k
        else:
            nodal_blocks(k, group.modes[:n_modes, :, block], K[..., block])
    return K


def _sum_of_stresses(
    states: Collection[KernelState],
) -> dict[IntegrationPoints, tuple[FibreDeformation, Stress]]:
    """Deformation and the sum of the stresses of all kernels at each set of points."""
    sums: dict[IntegrationPoints, tuple[FibreDeformation, Stress]] = {}
    for x in states:
        sets = zip(x.places, x.fibres, x.kernel.stresses(x), strict=True)
        for points, fibres, stress in sets:
            _, others = sums.get(points, (fibres, Stress()))
            parts = zip(others, stress, strict=True)
            sums[points] = (
                fibres,
                Stress(
                    *(b if a is None else a if b is None else a + b for a, b in parts)
                ),
            )
    return sums


def nodal_blocks(K: ndarray, modes: ndarray, out: ndarray) -> None:
    """Blocks of the pairs of nodes from blocks of the pairs of modes: Rᵀ K R."""
    (n_modes, n_nodes, n), d = modes.shape, K.shape[1]
    k = full_matrices(K).reshape(n_modes, d, n_modes, d, n)
    half = np.einsum("ran,risjn->asijn", modes, k)
    start = 0
    for a, row in enumerate(half):
        end = start + n_nodes - a
        np.einsum("sijn,scn->cijn", row, modes[:, a:], out=out[start:end])
        start = end


def positive_part(K: ndarray | None) -> ndarray | None:
    """The nearest positive semi-definite element matrices (Higham 1988).

    Negative eigenvalues are set to zero.  Input and output are blocks of the pairs of
    nodes, shape (n_pairs, d, d, n).
    """
    if K is None or not np.isfinite(K).all():
        return K
    full = full_matrices(K)
    indefinite = _indefinite(full)
    if not indefinite.any():
        return K
    some = full[..., indefinite].transpose(2, 0, 1)
    values, V = np.linalg.eigh(some)
    some -= (V * np.minimum(values, 0.0)[:, None]) @ V.swapaxes(1, 2)
    full[..., indefinite] = some.transpose(1, 2, 0)
    n_nodes, d = len(full) // K.shape[1], K.shape[1]
    first, second = np.triu_indices(n_nodes)
    return full.reshape(n_nodes, d, n_nodes, d, -1)[first, :, second]


def _indefinite(full: ndarray) -> ndarray:
    """True for matrices with a negative eigenvalue beyond round-off, shape (n,).

    By the pivots of LDLᵀ factors of all matrices at once, which take a fiftieth of the
    time of eigenvalues.  The matrices have shape (m, m, n).
    """
    left, found = full.copy(), np.zeros(full.shape[2], dtype=bool)
    diagonal = np.arange(len(full))
    left[diagonal, diagonal] += _ROUND_OFF * np.trace(full)
    for i in diagonal:
        pivot, row = left[i, i], left[i, i + 1 :]
        found |= ~(pivot > 0)
        factors = row * np.divide(1.0, pivot, out=np.zeros_like(pivot), where=~found)
        left[i + 1 :, i + 1 :] -= factors[:, None] * row
    return found


def node_pair_blocks(K: ndarray, nodes: ndarray, d: int) -> ndarray:
    """Blocks of the pairs of nodes of full symmetric matrices.

    K has the shape (d n_nodes, d n_nodes, n); ``nodes``, shape (n_nodes, n), may
    contain a node several times.
    """
    n_nodes = len(nodes)
    first, second = np.triu_indices(n_nodes)
    K = K.reshape(n_nodes, d, n_nodes, d, -1)[first, :, second]
    same = (nodes[first] == nodes[second]) & (first != second)[:, None]
    return K + np.where(same[:, None, None], K.swapaxes(1, 2), 0.0)
