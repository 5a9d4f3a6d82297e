"""Fibre tension of the mean stretch of an element, which avoids tension locking.

Each point at which nearly inextensible fibres must not stretch adds a constraint.  With
one point in every quadrilateral there are as many constraints as unknowns, with three
in a quadratic triangle more: where the shear angle jumps along fibres as stiff as those
of real fabrics, both lock.  Here the fibre law holds for the mean λ̄ of the stretches at
the points of an element, and deviations from it meet a stiffness E_d that does not grow
with that of the fibres,

    ψ(ln λ̄) + ½ E_d (λ − λ̄)².

The mean is that of the stretch, and not of its logarithm: a stretch has no second
derivative along its fibre, so that a deviation meets E_d however large the tension,
where a logarithm would leave E_d − T.  It is consistent: deviations vanish as elements
become smaller.
"""

from typing import Any

import numpy as np
from numpy import ndarray
from skfem import BilinearForm, Functional, LinearForm
from skfem.helpers import ddot, grad

from .. import kinematics as kin
from ..fabric import Fabric
from ..mesh.bases import MeanBasis
from .form import (
    Forms,
    contract,
    deformation,
    directions,
    elements,
    families_with_law,
    fibre_tension,
    once,
    outer,
)


def mean_tension(fabric: Fabric) -> Forms:
    """Fibre tension with the energy ψ(ln λ̄) + ½ E_d (λ − λ̄)².

    The forms go with `MeanBasis` and take the parameter ``E_d`` in N/mm, shape (2,
    n_elements, 1).  The tangent takes an optional parameter ``tension``, shape (2,
    n_elements, n_points), as that of `tension` does.

    Parameters
    ----------
    fabric
        Fibre directions and tension laws.
    """
    families = families_with_law(fabric)

    def laws(w):
        """Tension laws T(ε) of the means."""
        return of_elements(fabric, elements(w)).laws

    def variation(w):
        """∂λ/∂F."""
        F, A = deformation(w), directions(fabric, w)
        return [kin.stretch_d(F, a) for a in A]

    def force(w):
        """∂ψ/∂λ: the tension over the stretch."""
        lam, E_d, T = once(w, stretches), w["E_d"], laws(w)
        means = [mean(w, x) for x in lam]
        return {
            i: T[i].value(np.log(means[i])) / means[i] + E_d[i] * (lam[i] - means[i])
            for i in families
        }

    def stress(w):
        N, d_lam = force(w), once(w, variation)
        return sum(N[i] * d_lam[i] for i in families)

    def local_stiffness(w):
        """What couples the motion at one point with itself."""
        F, A = deformation(w), directions(fabric, w)
        lam, d_lam, E_d = once(w, stretches), once(w, variation), w["E_d"]
        if "tension" in w:
            N = {i: w["tension"][i] / lam[i] for i in families}
        else:
            N = force(w)
        return sum(
            E_d[i] * outer(d_lam[i], d_lam[i]) + N[i] * kin.stretch_dd(F, A[i])
            for i in families
        )

    def mean_stiffness(w):
        lam, E_d, T = once(w, stretches), w["E_d"], laws(w)
        means = [mean(w, x) for x in lam]
        eps = np.log(means)
        return {
            i: (T[i].tangent(eps[i]) - T[i].value(eps[i])) / means[i] ** 2 - E_d[i]
            for i in families
        }

    def stretches(w):
        F, A = deformation(w), directions(fabric, w)
        return [kin.stretch(F, a) for a in A]

    @Functional
    def energy(w):
        T = laws(w)
        means = [mean(w, x) for x in once(w, stretches)]
        of_means = sum(T[i].energy(np.log(means[i])) for i in families)
        return of_means + _of_deviations(fabric, w, once(w, stretches))

    @LinearForm
    def residual(v, w):
        return ddot(once(w, stress), grad(v))

    @BilinearForm
    def tangent(u, v, w):
        d_lam, E_m = once(w, variation), once(w, mean_stiffness)
        means = (
            E_m[i] * mean(w, ddot(d_lam[i], grad(u))) * mean(w, ddot(d_lam[i], grad(v)))
            for i in families
        )
        return sum(means) + contract(grad(v), once(w, local_stiffness), grad(u))

    return Forms(energy, residual, tangent)


def deviation_energy(fabric: Fabric) -> Functional:
    """½ E_d (λ − λ̄)², the part of the energy of `mean_tension` that E_d scales."""

    @Functional
    def energy(w):
        F, A = deformation(w), directions(fabric, w)
        return _of_deviations(fabric, w, [kin.stretch(F, a) for a in A])

    return energy


def _of_deviations(fabric: Fabric, w: Any, stretches: list[ndarray]) -> ndarray:
    return sum(
        0.5 * w["E_d"][i] * (stretches[i] - mean(w, stretches[i])) ** 2
        for i in families_with_law(fabric)
    )


def mean_fibre_tension(
    fabric: Fabric,
    deviation_stiffness: ndarray,
    basis: MeanBasis,
    strain: ndarray,
    change: ndarray | float = 0.0,
) -> ndarray:
    """Tensions λ (T(ln λ̄)/λ̄ + E_d (λ − λ̄)) of warp and weft after a change of strains.

    Parameters
    ----------
    fabric
        As for `mean_tension`.
    deviation_stiffness
        E_d, shape (2, n_elements, 1).
    basis
        That of the forms.
    strain, change
        Fibre strains at the ply's own points, and their change, to first order;
        shape (2, n_elements, n_points).
    """
    w = basis.default_parameters()
    eps, d_eps = (
        basis.from_ply_points(x + np.zeros_like(strain)) for x in (strain, change)
    )
    lam, E_d = np.exp(eps), deviation_stiffness
    d_lam = lam * d_eps
    means, d_means = mean(w, lam), mean(w, d_lam)
    elementwise = of_elements(fabric, w.get("element"))
    T = fibre_tension(elementwise, np.log(means))
    T_and_slope = fibre_tension(elementwise, np.log(means), 1.0)
    N = T / means + E_d * (lam - means)
    d_N = (T_and_slope - 2 * T) / means**2 * d_means + E_d * (d_lam - d_means)
    return basis.to_ply_points(lam * (N + d_N) + d_lam * N)


def of_elements(fabric: Fabric, element: ndarray | None) -> Fabric:
    """The fabric with one law per element, that of its first point."""
    return fabric.at(None if element is None else element[:, :1])


def mean_strain(basis: MeanBasis, strain: ndarray) -> ndarray:
    """Strain ln λ̄ of the mean stretch of each element, at every one of its points.

    Parameters
    ----------
    basis
        That of the forms.
    strain
        Fibre strains at the ply's own points, shape (2, n_elements, n_points); the
        means have the same shape.
    """
    lam = np.exp(basis.from_ply_points(strain))
    means = mean(basis.default_parameters(), lam)
    return basis.to_ply_points(np.broadcast_to(np.log(means), lam.shape))


def mean(w: Any, x: ndarray) -> ndarray:
    """Mean over each element of values at its points, shape (..., n_elements, 1)."""
    return (w["share"] * x).sum(axis=-1, keepdims=True)
