"""Scalar and biaxial laws, and the stiffnesses that are read off them."""

import math
from collections.abc import Callable
from functools import cache
from typing import NamedTuple

import numpy as np


class Law(NamedTuple):
    """A scalar law: its energy, the derivative of that, and the second one at rest."""

    energy: Callable
    value: Callable
    at_rest: float


class Biaxial(NamedTuple):
    """A law of both fibre strains: its energy, tensions, and their slope at rest."""

    energy: Callable
    value: Callable
    at_rest: float


def laws_of_families(cloth, strains):
    """The law of each family, while the other keeps its strain."""
    if not isinstance(cloth.tension, Biaxial):
        return cloth.tension
    (e_1, e_2), (_, value, at_rest) = strains, cloth.tension
    warp = Law(None, lambda x: value(x, e_2)[0], at_rest)
    return warp, Law(None, lambda x: value(e_1, x)[1], at_rest)


def interchange(E, c, K, e_0, k):
    """Tensions of a saw-tooth of two yarns: min_w Σ φ(e_α) + ½ K w² + ½ k Σ ε_α².

    e₁ = ε₁ + ½ (η₁ − w)² − c₁ and e₂ = ε₂ + ½ (η₂ + w)² − c₂ with η² = 2 c.  The least
    w is found on real parts, by halving: there the energy has no slope along w.
    """
    eta = [math.sqrt(2 * c_i) for c_i in c]

    def yarn_strains(strains, w):
        shapes = (eta[0] - w) ** 2 / 2 - c[0], (eta[1] + w) ** 2 / 2 - c[1]
        return [eps + shape for eps, shape in zip(strains, shapes, strict=True)]

    def taut(E, e, exp=np.exp):
        return E * (e - e_0 * (1 - exp(-e / e_0)))

    def tension(E, e):
        return np.where(e.real > 0, taut(E, e), 0)

    def yarn_energy(E, e):
        toe = e_0 * e - e_0**2 * (1 - np.exp(-e / e_0))
        return np.where(e.real > 0, E * (e**2 / 2 - toe), 0)

    @np.vectorize
    @cache
    def least(*strains):
        strains, low, high = [float(eps) for eps in strains], -eta[1], eta[0]
        for _ in range(55):
            w = (low + high) / 2
            yarns = zip(E, yarn_strains(strains, w), strict=True)
            T_1, T_2 = (taut(E_i, max(e, 0.0), math.exp) for E_i, e in yarns)
            slope = -T_1 * (eta[0] - w) + T_2 * (eta[1] + w) + K * w
            low, high = (w, high) if slope < 0 else (low, w)
        return w

    def energy(*strains):
        w = least(*map(np.real, strains))
        yarns = map(yarn_energy, E, yarn_strains(strains, w))
        return sum(yarns) + K * w**2 / 2 + k * sum(eps**2 for eps in strains) / 2

    def value(*strains):
        yarns = map(tension, E, yarn_strains(strains, least(*strains)))
        return [T + k * eps for T, eps in zip(yarns, strains, strict=True)]

    return Biaxial(energy, value, k)


def at_rest(law):
    return 0.0 if law is None else law.at_rest


def secant_of(law, gamma):
    """M_s(Γ)/Γ, at least a tenth of what it is at rest."""
    if law is None:
        return 0.0
    secant = law.value(gamma) / gamma if abs(gamma) > 1e-6 else law.at_rest
    return max(secant, 0.1 * law.at_rest)


def further_shear(law, gamma):
    """The larger of `secant_of` and the tangent."""
    tangent = 0.0 if law is None else law.value(gamma + 1e-20j).imag / 1e-20
    return max(secant_of(law, gamma), tangent)


def slope_within(law, eps=0.0):
    """Mean slope of a tension law within a percent of strain, or of rest if slack."""
    if law is None:
        return 0.0
    eps = max(eps, 0.0)
    return max((law.value(eps + 0.01) - law.value(eps - 0.01)) / 0.02, 0.0)
