"""Energies of tension and shear."""

import numpy as np

from .elements import points, points_of
from .held_stiffness import deviation_stiffnesses
from .kinematics import deformation_gradient, shear_angle, strain
from .laws import Biaxial


def tension(cloth, x, rule):
    """∫ Σ_α ψ(ε_α) dΩ."""
    return sum(
        p.area * of_strains([strain(deformation_gradient(x, p), A) for A in p.A], cloth)
        for p in points(cloth, rule)
    )


def of_strains(strains, cloth):
    """ψ of the strains of warp and weft."""
    if isinstance(cloth.tension, Biaxial):
        return cloth.tension.energy(*strains)
    pairs = zip(cloth.tension, strains, strict=True)
    return sum(law.energy(eps) for law, eps in pairs if law is not None)


def shear(cloth, x, rule):
    """∫ w(Γ) dΩ."""
    return sum(
        p.area * cloth.shear.energy(shear_angle(deformation_gradient(x, p), p.A))
        for p in points(cloth, rule)
    )


def mean_tension(cloth, x, groups, multiples, converged=()):
    """∫ Σ_α ψ(ln λ̄_α) + ½ E_d (λ_α − λ̄_α)² dΩ, λ̄ the mean over a group of points.

    E_d is that of the last converged state.
    """
    last = converged[-1] if converged else cloth.X[..., None]
    stiffnesses, whole = deviation_stiffnesses(cloth, last, groups, multiples), 0.0
    for group, pair in zip(groups, stiffnesses, strict=True):
        A_e, means = sum(p.area for p in group), []
        for i, E_d_i in enumerate(pair):
            stretches = [
                np.exp(strain(deformation_gradient(x, p), p.A[i])) for p in group
            ]
            pairs = list(zip(group, stretches, strict=True))
            mean = sum(p.area * stretch for p, stretch in pairs) / A_e
            means.append(mean)
            whole = whole + sum(
                p.area * E_d_i / 2 * (stretch - mean) ** 2 for p, stretch in pairs
            )
        whole = whole + A_e * of_strains(np.log(means), cloth)
    return whole


def macro_tension(cloth, x, macros, multiples, converged=()):
    """`mean_tension` at the centres of the quadrilaterals of each macro-element.

    ``multiples`` is the pair c of what was a triangle and what was a quadrilateral.
    """
    groups = [[points_of(cloth, e, "centre")[0] for e in parts] for parts in macros]
    of_parts = dict(zip((3, 4), multiples, strict=True))
    chosen = [of_parts[len(parts)] for parts in macros]
    return mean_tension(cloth, x, groups, chosen, converged)


def quadratic_mean_tension(cloth, x, c):
    """`mean_tension` at the three points of each triangle."""
    groups = [points_of(cloth, e, "three") for e in range(len(cloth.elements))]
    return mean_tension(cloth, x, groups, [c] * len(groups))
