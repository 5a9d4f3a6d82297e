"""Kernels: energies, stresses and stiffnesses of the forms, for all elements at once.

A kernel knows, at the points of an `ElementGroup`, the tension T and the shear moment M
times area, and their slopes with respect to the strains of the fibres.  Then

    f_a  = Σ b_a (T v + M ∂Γ),
    K_ac = Σ b_a b_c (E v vᵀ + T ∂²ε + M ∂²Γ) + Σ s g_a g_cᵀ,

where in the plane ∂²(ε + iθ) = −(δz/z)², and in space ∂²Γ has a part across warp and
weft too.  The rank-one stiffnesses s g gᵀ belong to strains of more than one fibre or
point: shear angles, their differences, and means.  Where a tension takes both strains,
D₁₂ (g₁ g₂ᵀ + g₂ g₁ᵀ) is the rank-one stiffness D₁₂ of ε₁ + ε₂, less D₁₂ in the slope of
each tension.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from numpy import ndarray
from skfem import CellBasis

from ...fabric import Fabric, Slopes, TwoLaws, is_zero
from ...mesh.bases import ElementQuad1Fluctuation, HourglassBasis, MeanBasis
from .element_groups import Deformations, ElementGroup, Parameters
from .integration_points import (
    FibreDeformation,
    IntegrationPoints,
    RankOneStiffness,
    Stress,
)


@dataclass(frozen=True, eq=False)
class TensionKernel:
    """The kernel of `tension`."""

    fabric: Fabric

    def takes(self, basis: CellBasis) -> bool:
        """Accept bases whose functions have their own gradients."""
        return not isinstance(_scalar(basis), ElementQuad1Fluctuation)

    def energy(self, group: ElementGroup, fibres: Deformations, w: Parameters) -> float:
        """∫ Σ_α ψ(ε_α) dΩ."""
        pairs = zip(group.points, _tensions("energies", group, fibres), strict=True)
        return sum(float((p.dx * psi).sum()) for p, psi in pairs)

    def stresses(
        self, group: ElementGroup, fibres: Deformations, w: Parameters
    ) -> list[Stress]:
        """Tension and its slope."""
        T = _given_tension(self.fabric, group, w)
        T = T or _tensions("value", group, fibres)
        slopes = _slopes_at_points(group, fibres)
        return [
            Stress(tension=p.dx * T_p, slope=p.dx * _own_less_cross(s))
            for p, T_p, s in zip(group.points, T, slopes, strict=True)
        ]

    def rank_one_stiffnesses(
        self, group: ElementGroup, fibres: Deformations, w: Parameters
    ) -> list[RankOneStiffness]:
        """None, but where a tension takes both strains that of ε₁ + ε₂."""
        if isinstance(self.fabric.tensions, TwoLaws):
            return []
        slopes = _slopes_at_points(group, fibres)
        return [
            RankOneStiffness(p.dx * s.cross, partial(_sum_gradients, p, f))
            for p, f, s in zip(group.points, fibres, slopes, strict=True)
        ]

    def predicted_tension(
        self,
        group: ElementGroup,
        before: Deformations,
        after: Deformations,
        w: Parameters,
    ) -> list[ndarray]:
        """T(ε) + ∂T/∂ε Δε, shape (2, P, n) each."""
        T, slopes = _tensions("value", group, before), _slopes_at_points(group, before)
        return [
            T_p + s.times(f.change(g))
            for T_p, s, f, g in zip(T, slopes, before, after, strict=True)
        ]


@dataclass(frozen=True, eq=False)
class ShearKernel:
    """The kernel of `shear`."""

    fabric: Fabric

    def takes(self, basis: CellBasis) -> bool:
        """Accept bases whose functions have their own gradients."""
        return not isinstance(_scalar(basis), ElementQuad1Fluctuation)

    def energy(self, group: ElementGroup, fibres: Deformations, w: Parameters) -> float:
        """∫ w(Γ) dΩ."""
        pairs = zip(group.points, _moments("energy", group, fibres), strict=True)
        return sum(float((p.dx * w_p).sum()) for p, w_p in pairs)

    def stresses(
        self, group: ElementGroup, fibres: Deformations, w: Parameters
    ) -> list[Stress]:
        """Shear moment."""
        pairs = zip(group.points, _moments("value", group, fibres), strict=True)
        return [Stress(moment=p.dx * M_p) for p, M_p in pairs]

    def rank_one_stiffnesses(
        self, group: ElementGroup, fibres: Deformations, w: Parameters
    ) -> list[RankOneStiffness]:
        """The slope of the shear law, along the gradient of the shear angle."""
        G = _moments("tangent", group, fibres)
        return [
            RankOneStiffness(p.dx * G_p, partial(_angle_gradients, p, f))
            for p, f, G_p in zip(group.points, fibres, G, strict=True)
        ]


@dataclass(frozen=True, eq=False)
class HourglassKernel:
    """The kernel of `hourglass`: points at the centre, then at the corners."""

    fabric: Fabric
    C_s: float | None = None

    def takes(self, basis: CellBasis) -> bool:
        """Accept `HourglassBasis`."""
        return isinstance(basis, HourglassBasis)

    def energy(self, group: ElementGroup, fibres: Deformations, w: Parameters) -> float:
        """½ C_s Σ_k A/4 (Γ(ξ_k) − Γ(0))²."""
        return 0.5 * float((self._stiffness(group, w) * _difference(fibres) ** 2).sum())

    def stresses(
        self, group: ElementGroup, fibres: Deformations, w: Parameters
    ) -> list[Stress]:
        """Moments at the points, and their opposites at the centre."""
        moment = self._stiffness(group, w) * _difference(fibres)
        one_centre = len(fibres[0].shear_angle) == 1
        opposite = moment.sum(axis=0, keepdims=True) if one_centre else moment
        return [Stress(moment=-opposite), Stress(moment=moment)]

    def rank_one_stiffnesses(
        self, group: ElementGroup, fibres: Deformations, w: Parameters
    ) -> list[RankOneStiffness]:
        """C_s, along the gradient of Γ(ξ_k) − Γ(0)."""
        (centre, corners), (at_centre, at_corners) = group.points, fibres

        def gradients(block: slice) -> ndarray:
            return _angle_gradients(corners, at_corners, block) - _angle_gradients(
                centre, at_centre, block
            )

        return [RankOneStiffness(self._stiffness(group, w), gradients)]

    def _stiffness(self, group: ElementGroup, w: Parameters) -> ndarray:
        _, corners = group.points
        if self.C_s is not None:
            return self.C_s * corners.dx
        return corners.dx * np.broadcast_to(w["C_s"], corners.dx.T.shape).T


@dataclass(frozen=True, eq=False)
class MeanTensionKernel:
    """The kernel of `mean_tension`."""

    fabric: Fabric

    def takes(self, basis: CellBasis) -> bool:
        """Accept `MeanBasis`."""
        return isinstance(basis, MeanBasis)

    def energy(self, group: ElementGroup, fibres: Deformations, w: Parameters) -> float:
        """∫ Σ_α ψ(ln λ̄_α) + ½ E_d (λ_α − λ̄_α)² dΩ."""
        stretches, means = _stretches(group, fibres)
        density = _laws(group.fabric, "energies", np.log(means))
        E_d = self._deviation_stiffness(group, w)
        return sum(
            float((p.dx * (density + 0.5 * E_d * (stretch - means) ** 2)).sum())
            for p, stretch in zip(group.points, stretches, strict=True)
        )

    def stresses(
        self, group: ElementGroup, fibres: Deformations, w: Parameters
    ) -> list[Stress]:
        """Tension λ ∂ψ/∂λ, and its slope λ² E_d + T in a strain that deviates."""
        stretches, means = _stretches(group, fibres)
        E_d = self._deviation_stiffness(group, w)
        T = _given_tension(self.fabric, group, w)
        if not T:
            N = _laws(group.fabric, "value", np.log(means)) / means
            T = [stretch * (N + E_d * (stretch - means)) for stretch in stretches]
        return [
            Stress(tension=p.dx * T_p, slope=p.dx * (E_d * stretch**2 + T_p))
            for p, T_p, stretch in zip(group.points, T, stretches, strict=True)
        ]

    def rank_one_stiffnesses(
        self, group: ElementGroup, fibres: Deformations, w: Parameters
    ) -> list[RankOneStiffness]:
        """The rest of the slope of the laws, along the gradient of the mean stretch."""
        stretches, means = _stretches(group, fibres)
        T, slopes = _of_strains(group.fabric, np.log(means))
        slope = (slopes.own - T) / means**2 - self._deviation_stiffness(group, w)
        if slopes.cross is not None:
            cross = slopes.cross / (means[0] * means[1])
            slope = np.array([*(slope - cross), cross])

        def gradients(block: slice) -> ndarray:
            g = np.zeros((2, group.n_modes, group.dimension, group.area[block].size))
            for p, f, stretch in zip(group.points, fibres, stretches, strict=True):
                share = (p.dx * stretch)[:, :, None, block] / group.area[block]
                g += p.strain_gradients(share * f.v[..., block], block)
            return g if slopes.cross is None else np.array([*g, g[0] + g[1]])

        return [RankOneStiffness((group.area * slope)[:, 0], gradients)]

    def predicted_tension(
        self,
        group: ElementGroup,
        before: Deformations,
        after: Deformations,
        w: Parameters,
    ) -> list[ndarray]:
        """Tension over stretch to first order, times the new stretch; (2, P, n) each.

        The force N works on the stretch, so that N is what follows the increment.  The
        tension λ N does not: where fibres turn the stretch grows to second order.
        """
        stretches, means = _stretches(group, before)
        new_stretches, _ = _stretches(group, after)
        changes = [
            stretch * f.change(g)
            for stretch, f, g in zip(stretches, before, after, strict=True)
        ]
        mean_change = _mean(group, changes)
        T, slopes = _of_strains(group.fabric, np.log(means))
        N = T / means + (slopes.own - T) / means**2 * mean_change
        if slopes.cross is not None:
            N += slopes.cross * (mean_change / means)[::-1] / means
        E_d, mean_after = self._deviation_stiffness(group, w), means + mean_change
        return [
            new_stretch * (N + E_d * (stretch + change - mean_after))
            for new_stretch, stretch, change in zip(
                new_stretches, stretches, changes, strict=True
            )
        ]

    def _deviation_stiffness(self, group: ElementGroup, w: Parameters) -> ndarray:
        """E_d of warp and weft, shape (2, 1, n); 0 without a law."""
        E_d = np.asarray(w["E_d"])[:, group.elements, 0]
        return _resisting(self.fabric) * E_d[:, None]


def _scalar(basis: CellBasis) -> Any:
    vector: Any = basis.elem
    return vector.elem


def _angle_gradients(
    points: IntegrationPoints, fibres: FibreDeformation, block: slice
) -> ndarray:
    return points.gradients(*fibres.angle_derivatives(block), block)


def _sum_gradients(
    points: IntegrationPoints, fibres: FibreDeformation, block: slice
) -> ndarray:
    """∂(ε₁ + ε₂)/∂u_a."""
    warp, weft = fibres.v[..., block]
    return points.gradients(warp, weft, block)


def _difference(fibres: Deformations) -> ndarray:
    """Γ(ξ_k) − Γ(0)."""
    centre, corners = fibres
    return corners.shear_angle - centre.shear_angle


def _stretches(
    group: ElementGroup, fibres: Deformations
) -> tuple[list[ndarray], ndarray]:
    """Stretches at the points, (2, P, n) each, and their means, (2, 1, n)."""
    stretches = [np.sqrt(f.squared_stretch) for f in fibres]
    return stretches, _mean(group, stretches)


def _mean(group: ElementGroup, values: list[ndarray]) -> ndarray:
    """Mean over each element of values at its points, shape (2, 1, n)."""
    pairs = zip(group.points, values, strict=True)
    return sum((p.dx * x).sum(axis=1, keepdims=True) for p, x in pairs) / group.area


def _resisting(fabric: Fabric) -> ndarray:
    """1 for a family that has a tension law, 0 for one that has none; (2, 1, 1)."""
    resists = [not is_zero(family.tension) for family in fabric.families]
    return np.array(resists, dtype=float)[:, None, None]


def _given_tension(fabric: Fabric, group: ElementGroup, w: Parameters) -> list[ndarray]:
    """Tensions at the points that stand for those of the laws; none if not given."""
    if "tension" not in w:
        return []
    return [_resisting(fabric) * T for T in group.values_at_points(w["tension"])]


def _tensions(part: str, group: ElementGroup, fibres: Deformations) -> list[ndarray]:
    """Energies or values of warp and weft at the points, shape (2, P, n) each."""
    pairs = zip(group.fabrics, fibres, strict=True)
    return [_laws(fabric, part, f.strain) for fabric, f in pairs]


def _slopes_at_points(group: ElementGroup, fibres: Deformations) -> list[Slopes]:
    """Slopes of the tensions at the points."""
    pairs = zip(group.fabrics, fibres, strict=True)
    return [_slopes(fabric, f.strain) for fabric, f in pairs]


def _own_less_cross(slopes: Slopes) -> ndarray:
    """What is left of the slopes beside the rank-one stiffness of ε₁ + ε₂."""
    return slopes.own if slopes.cross is None else slopes.own - slopes.cross


def _moments(part: str, group: ElementGroup, fibres: Deformations) -> list[ndarray]:
    """One part of the shear law at the points, shape (P, n) each."""
    pairs = zip(group.fabrics, fibres, strict=True)
    return [_law(getattr(fabric.shear_law, part), f.shear_angle) for fabric, f in pairs]


def _of_strains(fabric: Fabric, strain: ndarray) -> tuple[ndarray, Slopes]:
    """Tensions of warp and weft, and their slopes."""
    return _laws(fabric, "value", strain), _slopes(fabric, strain)


def _laws(fabric: Fabric, part: str, strain: ndarray) -> ndarray:
    """Energies or values of warp and weft, shape (2, P, n); laws take (2, n, P)."""
    both = getattr(fabric.tensions, part)(strain.swapaxes(1, 2))
    return np.array([x.T for x in both])


def _slopes(fabric: Fabric, strain: ndarray) -> Slopes:
    """Slopes of the tensions, arrays of shape (2, P, n) and (P, n)."""
    own, cross = fabric.tensions.slopes(strain.swapaxes(1, 2))
    return Slopes(np.array([x.T for x in own]), None if cross is None else cross.T)


def _law(law: Callable[[ndarray], ndarray], x: ndarray) -> ndarray:
    """A law at points, shape (P, n); the law itself takes and returns (n, P)."""
    return np.broadcast_to(law(x.T), x.T.shape).T
