"""Fibre tension of the mean strain of an element, which avoids tension locking.

Each point at which nearly inextensible fibres must not stretch adds a constraint.  With
one point in every quadrilateral there are as many constraints as unknowns, with three
in a quadratic triangle more: where the shear angle jumps along fibres as stiff as those
of real fabrics, both lock.  Here the fibre law holds for the mean ε̄ of the strains at
the points of an element, and deviations from it meet a stiffness E_d that does not grow
with that of the fibres,

    ψ(ε̄) + ½ E_d (ε − ε̄)².

It is consistent: deviations vanish as elements become smaller, and E_d grows.
"""

from typing import Any

import numpy as np
from numpy import ndarray
from skfem import BilinearForm, Functional, LinearForm
from skfem.helpers import ddot, grad

from .. import kinematics as kin
from ..fabric import Fabric
from ..mesh.bases import MeanBasis
from .deviation import deviation_stiffness
from .form import Forms, contract, deformation, directions, elements, once
from .tension import families_with_law, fibre_tension


def mean_tension(fabric: Fabric, deviation: float | ndarray) -> Forms:
    """Fibre tension with the energy ψ(ε̄) + ½ E_d (ε − ε̄)².

    The forms go with `MeanBasis`.  The tangent takes an optional parameter ``tension``,
    shape (2, n_elements, n_points), as that of `tension` does.

    Parameters
    ----------
    fabric, deviation
        As for `deviation_stiffness`.
    """
    families = families_with_law(fabric)

    def laws(w):
        """Tension laws T(ε) of the means."""
        return of_elements(fabric, elements(w)).laws

    def E_d(w):
        elementwise = of_elements(fabric, elements(w))
        return deviation_stiffness(elementwise, deviation, w["fineness"])

    def strain(w):
        F, A = deformation(w), directions(fabric, w)
        return [kin.fibre_strain(F, a) for a in A]

    def variation(w):
        F, A = deformation(w), directions(fabric, w)
        return [kin.fibre_strain_d(F, a) for a in A]

    def tension(w):
        eps, E = once(w, strain), once(w, E_d)
        means, T = [mean(w, e) for e in eps], laws(w)
        return {i: T[i].value(means[i]) + E[i] * (eps[i] - means[i]) for i in families}

    def stress(w):
        T, d_eps = tension(w), once(w, variation)
        return sum(T[i] * d_eps[i] for i in families)

    def local_stiffness(w):
        """Stiffness of each point on its own."""
        F, A = deformation(w), directions(fabric, w)
        d_eps, E = once(w, variation), once(w, E_d)
        geometric = w["tension"] if "tension" in w else tension(w)
        return sum(
            E[i] * np.einsum("iJ...,kL...->iJkL...", d_eps[i], d_eps[i])
            + geometric[i] * kin.fibre_strain_dd(F, A[i])
            for i in families
        )

    def mean_stiffness(w):
        eps, E, T = once(w, strain), once(w, E_d), laws(w)
        return {i: T[i].tangent(mean(w, eps[i])) - E[i] for i in families}

    @Functional
    def energy(w):
        eps, E = once(w, strain), once(w, E_d)
        means, T = [mean(w, e) for e in eps], laws(w)
        return sum(
            T[i].energy(means[i]) + 0.5 * E[i] * (eps[i] - means[i]) ** 2
            for i in families
        )

    @LinearForm
    def residual(v, w):
        return ddot(once(w, stress), grad(v))

    @BilinearForm
    def tangent(u, v, w):
        d_eps, E_m = once(w, variation), once(w, mean_stiffness)
        means = (
            E_m[i] * mean(w, ddot(d_eps[i], grad(u))) * mean(w, ddot(d_eps[i], grad(v)))
            for i in families
        )
        return sum(means) + contract(grad(v), once(w, local_stiffness), grad(u))

    return Forms(energy, residual, tangent)


def mean_fibre_tension(
    fabric: Fabric,
    deviation: float | ndarray,
    basis: MeanBasis,
    strain: ndarray,
    change: ndarray | float = 0.0,
) -> ndarray:
    """Tensions T(ε̄) + E_d (ε − ε̄) of warp and weft after a change of the strains.

    Parameters
    ----------
    fabric, deviation
        As for `deviation_stiffness`.
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
    means, d_means = mean(w, eps), mean(w, d_eps)
    elementwise = of_elements(fabric, w.get("element"))
    E_d = np.array(deviation_stiffness(elementwise, deviation, w["fineness"]))
    deviations = eps + d_eps - means - d_means
    tension = fibre_tension(elementwise, means, d_means) + E_d * deviations
    return basis.to_ply_points(tension)


def of_elements(fabric: Fabric, element: ndarray | None) -> Fabric:
    """The fabric with one law per element, that of its first point."""
    return fabric.at(None if element is None else element[:, :1])


def mean_strain(basis: MeanBasis, strain: ndarray) -> ndarray:
    """Mean ε̄ of the fibre strains of each element, at every one of its points.

    Parameters
    ----------
    basis
        That of the forms.
    strain
        Fibre strains at the ply's own points, shape (2, n_elements, n_points); the
        means have the same shape.
    """
    eps = basis.from_ply_points(strain)
    means = mean(basis.default_parameters(), eps)
    return basis.to_ply_points(np.broadcast_to(means, eps.shape))


def mean(w: Any, x: ndarray) -> ndarray:
    """Mean over each element of values at its points, shape (..., n_elements, 1)."""
    return (w["share"] * x).sum(axis=-1, keepdims=True)
