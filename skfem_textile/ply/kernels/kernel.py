"""The numbers of the forms for all elements at once, with no formula per function.

A kernel knows, at the points of a `Stencil`, the tension T and the shear moment M times
area, and how these change with the strains of the fibres.  Then

    f_a  = Σ b_a (T v + M Jv),
    K_ac = Σ b_a b_c (E v vᵀ + T ∂²ε + M ∂²θ) + Σ s g_a g_cᵀ,

where ∂²(ε + iθ) = −(δz/z)², and the squares are of strains that several fibres or
points share: shear angles, their differences, and means.
"""

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial
from typing import Any, NamedTuple, Protocol, TypeAlias
from weakref import WeakKeyDictionary

import numpy as np
from numpy import ndarray
from skfem import CellBasis

from ...fabric import Fabric, is_zero
from ...forms.deviation import deviation_stiffness
from ...mesh.bases import ElementQuad1Fluctuation, HourglassBasis, MeanBasis
from .points import Motion, Points
from .stencils import Stencil

#: Parameters of a form: numbers, or arrays over elements and points.
Parameters: TypeAlias = dict[str, Any]


class Stress(NamedTuple):
    """Tension and its slope, (2, P, n), and shear moment, (P, n), times area.

    None where there is none.
    """

    tension: ndarray | None = None
    moment: ndarray | None = None
    slope: ndarray | None = None

    def plus(self, other: "Stress") -> "Stress":
        """The sum of both."""
        pairs = zip(self, other, strict=True)
        return Stress(
            *(y if x is None else x if y is None else x + y for x, y in pairs)
        )

    def on(self, some: slice) -> "Stress":
        """The stress of some elements."""
        return Stress(*(None if x is None else x[..., some] for x in self))


class Square(NamedTuple):
    """Strains that meet a stiffness, shape (P, n); P in each element.

    ``gradients`` gives their gradients in some of the elements, shape (P, n_nodes, 2,
    n_some).
    """

    stiffness: ndarray
    gradients: Callable[[slice], ndarray]


class Kernel(Protocol):
    """Energy of a term and its derivatives with respect to strains of fibres."""

    @property
    def fabric(self) -> Fabric:
        """Gives directions and laws."""
        ...

    def takes(self, basis: CellBasis) -> bool:
        """Whether a basis of the displacement is one that the kernel knows."""
        ...

    def energy(self, at: Stencil, motions: list[Motion], w: Parameters) -> float:
        """Energy in N·mm."""
        ...

    def stresses(
        self, at: Stencil, motions: list[Motion], w: Parameters
    ) -> list[Stress]:
        """Stresses at the points."""
        ...

    def squares(
        self, at: Stencil, motions: list[Motion], w: Parameters
    ) -> list[Square]:
        """What couples several fibres or points."""
        ...


@dataclass(frozen=True, eq=False)
class TensionKernel:
    """The kernel of `tension`."""

    fabric: Fabric

    def takes(self, basis: CellBasis) -> bool:
        """Any whose functions have gradients of their own."""
        return not isinstance(_scalar(basis), ElementQuad1Fluctuation)

    def energy(self, at: Stencil, motions: list[Motion], w: Parameters) -> float:
        """∫ Σ_α ψ(ε_α) dΩ."""
        pairs = zip(at.points, _tensions("energy", at, motions), strict=True)
        return sum(float((p.dx * psi).sum()) for p, psi in pairs)

    def stresses(
        self, at: Stencil, motions: list[Motion], w: Parameters
    ) -> list[Stress]:
        """Tension and its slope."""
        if "tension" in w:
            T = [_resisting(self.fabric) * T_p for T_p in at.given(w["tension"])]
        else:
            T = _tensions("value", at, motions)
        E = _tensions("tangent", at, motions)
        return [
            Stress(tension=p.dx * T_p, slope=p.dx * E_p)
            for p, T_p, E_p in zip(at.points, T, E, strict=True)
        ]

    def squares(
        self, at: Stencil, motions: list[Motion], w: Parameters
    ) -> list[Square]:
        """None."""
        return []

    def predicted_tension(
        self, at: Stencil, before: list[Motion], after: list[Motion]
    ) -> list[ndarray]:
        """T(ε) + T′ Δε, shape (2, P, n) each."""
        T, E = (_tensions(part, at, before) for part in ("value", "tangent"))
        return [
            T_p + E_p * m.change(n)
            for T_p, E_p, m, n in zip(T, E, before, after, strict=True)
        ]


@dataclass(frozen=True, eq=False)
class ShearKernel:
    """The kernel of `shear`."""

    fabric: Fabric

    def takes(self, basis: CellBasis) -> bool:
        """Any whose functions have gradients of their own."""
        return not isinstance(_scalar(basis), ElementQuad1Fluctuation)

    def energy(self, at: Stencil, motions: list[Motion], w: Parameters) -> float:
        """∫ w(Γ) dΩ."""
        pairs = zip(at.points, _moments("energy", at, motions), strict=True)
        return sum(float((p.dx * w_p).sum()) for p, w_p in pairs)

    def stresses(
        self, at: Stencil, motions: list[Motion], w: Parameters
    ) -> list[Stress]:
        """Shear moment."""
        pairs = zip(at.points, _moments("value", at, motions), strict=True)
        return [Stress(moment=p.dx * M_p) for p, M_p in pairs]

    def squares(
        self, at: Stencil, motions: list[Motion], w: Parameters
    ) -> list[Square]:
        """Its slope, along the gradient of the shear angle."""
        G = _moments("tangent", at, motions)
        return [
            Square(p.dx * G_p, partial(_turning, p, m))
            for p, m, G_p in zip(at.points, motions, G, strict=True)
        ]


@dataclass(frozen=True, eq=False)
class HourglassKernel:
    """The kernel of `hourglass`: points at the centre, then at the corners."""

    fabric: Fabric
    C_s: float | None = None

    def takes(self, basis: CellBasis) -> bool:
        """`HourglassBasis`."""
        return isinstance(basis, HourglassBasis)

    def energy(self, at: Stencil, motions: list[Motion], w: Parameters) -> float:
        """½ C_s Σ_k A/4 (Γ(ξ_k) − Γ(0))²."""
        return 0.5 * float((self._stiffness(at, w) * _difference(motions) ** 2).sum())

    def stresses(
        self, at: Stencil, motions: list[Motion], w: Parameters
    ) -> list[Stress]:
        """Moments at the points, and what balances them at the centre."""
        moment = self._stiffness(at, w) * _difference(motions)
        once = len(motions[0].angle) == 1
        opposite = moment.sum(axis=0, keepdims=True) if once else moment
        return [Stress(moment=-opposite), Stress(moment=moment)]

    def squares(
        self, at: Stencil, motions: list[Motion], w: Parameters
    ) -> list[Square]:
        """C_s, along the gradient of Γ(ξ_k) − Γ(0)."""
        (middle, corners), (still, turned) = at.points, motions

        def gradients(some: slice) -> ndarray:
            return _turning(corners, turned, some) - _turning(middle, still, some)

        return [Square(self._stiffness(at, w), gradients)]

    def _stiffness(self, at: Stencil, w: Parameters) -> ndarray:
        _, corners = at.points
        if self.C_s is not None:
            return self.C_s * corners.dx
        return corners.dx * np.broadcast_to(w["C_s"], corners.dx.T.shape).T


@dataclass(frozen=True, eq=False)
class MeanTensionKernel:
    """The kernel of `mean_tension`."""

    fabric: Fabric
    deviation: float | ndarray
    _known: WeakKeyDictionary = field(default_factory=WeakKeyDictionary, init=False)

    def takes(self, basis: CellBasis) -> bool:
        """`MeanBasis`."""
        return isinstance(basis, MeanBasis)

    def energy(self, at: Stencil, motions: list[Motion], w: Parameters) -> float:
        """∫ Σ_α ψ(ε̄_α) + ½ E_d (ε_α − ε̄_α)² dΩ."""
        means, E_d = self._means(at, motions), self._deviation_stiffness(at)
        density = _laws(at.fabric, "energy", means)
        return sum(
            float((p.dx * (density + 0.5 * E_d * (m.strain - means) ** 2)).sum())
            for p, m in zip(at.points, motions, strict=True)
        )

    def stresses(
        self, at: Stencil, motions: list[Motion], w: Parameters
    ) -> list[Stress]:
        """Tension, and the slope of what deviates from the mean."""
        means, E_d = self._means(at, motions), self._deviation_stiffness(at)
        if "tension" in w:
            T = [_resisting(self.fabric) * T_p for T_p in at.given(w["tension"])]
        else:
            T_mean = _laws(at.fabric, "value", means)
            T = [T_mean + E_d * (m.strain - means) for m in motions]
        return [
            Stress(tension=p.dx * T_p, slope=p.dx * E_d)
            for p, T_p in zip(at.points, T, strict=True)
        ]

    def squares(
        self, at: Stencil, motions: list[Motion], w: Parameters
    ) -> list[Square]:
        """The rest of the slope of the laws, along the gradient of the mean."""
        slope = _laws(at.fabric, "tangent", self._means(at, motions))
        rest = at.area * (slope - self._deviation_stiffness(at))

        def gradients(some: slice) -> ndarray:
            g = np.zeros((2, at.n_motions, 2, at.area[some].size))
            for p, m in zip(at.points, motions, strict=True):
                share = p.dx[:, None, some] / at.area[some]
                g += p.stretching(share * m.v[..., some], some)
            return g

        return [Square(rest[:, 0], gradients)]

    def predicted_tension(
        self, at: Stencil, before: list[Motion], after: list[Motion]
    ) -> list[ndarray]:
        """T(ε̄) + E_d (ε − ε̄) after a change of the strains, shape (2, P, n) each."""
        changes = [m.change(n) for m, n in zip(before, after, strict=True)]
        mean, mean_change = self._means(at, before), _mean(at, changes)
        E_d = self._deviation_stiffness(at)
        of_mean = _laws(at.fabric, "value", mean)
        of_mean = of_mean + _laws(at.fabric, "tangent", mean) * mean_change
        return [
            of_mean + E_d * (m.strain - mean + change - mean_change)
            for m, change in zip(before, changes, strict=True)
        ]

    def _means(self, at: Stencil, motions: list[Motion]) -> ndarray:
        """Mean strain of warp and weft, shape (2, 1, n)."""
        return _mean(at, [motion.strain for motion in motions])

    def _deviation_stiffness(self, at: Stencil) -> ndarray:
        """E_d of warp and weft, shape (2, 1, n); none without a law."""
        if at not in self._known:
            c = self.deviation
            c = c[at.elements] if isinstance(c, ndarray) else c
            fineness = np.sqrt(at.whole / at.area)[:, None]
            E_d = deviation_stiffness(at.fabric, c, fineness)
            self._known[at] = _resisting(self.fabric) * np.array([E.T for E in E_d])
        return self._known[at]


def _scalar(basis: CellBasis) -> Any:
    vector: Any = basis.elem
    return vector.elem


def _turning(points: Points, motion: Motion, some: slice) -> ndarray:
    return points.turning(motion.v[..., some], some)


def _difference(motions: list[Motion]) -> ndarray:
    """Γ(ξ_k) − Γ(0)."""
    middle, corners = motions
    return corners.angle - middle.angle


def _mean(at: Stencil, values: list[ndarray]) -> ndarray:
    """Mean over each element of values at its points, shape (2, 1, n)."""
    pairs = zip(at.points, values, strict=True)
    return sum((p.dx * x).sum(axis=1, keepdims=True) for p, x in pairs) / at.area


def _resisting(fabric: Fabric) -> ndarray:
    """1 for a family that has a tension law, 0 for one that has none; (2, 1, 1)."""
    has = [not is_zero(family.tension) for family in fabric.families]
    return np.array(has, dtype=float)[:, None, None]


def _tensions(part: str, at: Stencil, motions: list[Motion]) -> list[ndarray]:
    """One part of the tension laws of warp and weft at the points, (2, P, n) each."""
    pairs = zip(at.fabrics, motions, strict=True)
    return [_laws(fabric, part, motion.strain) for fabric, motion in pairs]


def _moments(part: str, at: Stencil, motions: list[Motion]) -> list[ndarray]:
    """One part of the shear law at the points, shape (P, n) each."""
    pairs = zip(at.fabrics, motions, strict=True)
    return [_law(getattr(fabric.shear_law, part), m.angle) for fabric, m in pairs]


def _laws(fabric: Fabric, part: str, strain: ndarray) -> ndarray:
    """One part of the tension laws of warp and weft, shape (2, P, n)."""
    laws = [getattr(law, part) for law in fabric.laws[:2]]
    return np.array([_law(law, x) for law, x in zip(laws, strain, strict=True)])


def _law(law: Callable[[ndarray], ndarray], x: ndarray) -> ndarray:
    """A law at points, shape (P, n), which it takes in the order of the forms."""
    return np.broadcast_to(law(x.T), x.T.shape).T
