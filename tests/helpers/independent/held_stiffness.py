"""Stiffnesses of the discretisation, which follow the last converged state."""

from typing import NamedTuple

import numpy as np

from .elements import points_of
from .kinematics import deformation_gradient, shear_angle, strain
from .laws import further_shear, laws_of_families, secant_of, slope_within


def share_without_shear(G, E):
    """1 without shear stiffness, 0 with any that is more than some 10⁻¹⁰ E."""
    return np.exp(-G / (1e-11 * E)) if E > 0 else 0.0


class StateOfGroup(NamedTuple):
    """Means over a group of points: what stiffnesses of the discretisation follow.

    Secant of shear, the larger of it and the tangent, slope of the tension law and
    tension of the mean stretch of both families, and |cos| of the angle between them.
    """

    secant: float
    further: float
    E: np.ndarray
    T: np.ndarray
    cosine: float


def state_of_group(cloth, x, group):
    """The means over a group of points at a displaced state."""
    whole = sum(p.area for p in group)
    secant = further = cosine = 0.0
    E, stretch = np.zeros(2), np.zeros(2)
    for p in group:
        share, F = p.area / whole, deformation_gradient(x, p)
        gamma = shear_angle(F, p.A)[0]
        strains = [strain(F, A)[0] for A in p.A]
        laws = laws_of_families(cloth, strains)
        a_1, a_2 = (F[..., 0] @ A for A in p.A)
        secant += share * secant_of(cloth.shear, gamma)
        further += share * further_shear(cloth.shear, gamma)
        cosine += share * abs(a_1 @ a_2) / np.sqrt((a_1 @ a_1) * (a_2 @ a_2))
        E += share * np.array(list(map(slope_within, laws, strains)))
        stretch += share * np.exp(strains)
    laws = laws_of_families(cloth, np.log(stretch))
    pairs = zip(laws, np.log(stretch), strict=True)
    T = np.array([0.0 if law is None else law.value(eps) for law, eps in pairs])
    return StateOfGroup(secant, further, E, T, cosine)


def effective_tension(G, E, T):
    """τ = |T|/(1 + 80 √(G/E))."""
    return abs(T) / (1 + 80 * np.sqrt(G / E)) if E > 0 else abs(T)


def deviation_stiffnesses(cloth, x, groups, multiples):
    """E_d of both families of each group of points at a converged state.

    c (G + 0.7 τ) in series with E, ½ E without shear stiffness.  ``multiples`` has the
    c of each group.
    """
    stiffnesses = []
    for group, c in zip(groups, multiples, strict=True):
        state, pair = state_of_group(cloth, x, group), []
        for E, T in zip(state.E, state.T, strict=True):
            tau = effective_tension(state.further, E, T)
            resistance = c * (state.further + 0.7 * tau)
            series = resistance * E / (resistance + E) if resistance + E > 0 else 0.0
            chi = share_without_shear(state.further, E)
            pair.append((1 - chi) * series + chi * E / 2)
        stiffnesses.append(pair)
    return stiffnesses


def automatic_stiffness(cloth, x, macros):
    """C_s of each element at a converged state.

    (4 G + 3.2 τ)/(1 − |cos ω|)^1.5, and without shear stiffness 10⁻⁴ E; G, E and τ are
    means of both families, at the centre of an element or over those of the parts of a
    macro-element.  τ is none of single elements.
    """
    C_s = np.zeros(len(cloth.elements))
    for parts in macros or [[e] for e in range(len(cloth.elements))]:
        centres = [points_of(cloth, e, "centre")[0] for e in parts]
        state = state_of_group(cloth, x, centres)
        G, E = state.secant, state.E.mean()
        tau = effective_tension(G, E, abs(state.T).mean()) if macros else 0.0
        chi = share_without_shear(G, E)
        resistance = (4 * G + 3.2 * tau) / max(1 - state.cosine, 0.01) ** 1.5
        C_s[parts] = (1 - chi) * resistance + chi * 1e-4 * E
    return C_s
