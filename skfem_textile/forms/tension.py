"""Forms of the fibre tension, local or at the mean stretch of an element.

Fibre tension at the mean stretch of an element avoids tension locking.

Each integration point with nearly inextensible fibres adds a constraint.  With one
point per quadrilateral there are as many constraints as unknowns, with three points per
quadratic triangle there are more: both lock for realistic fibre stiffnesses where the
shear angle jumps along fibres.  Here the fibre law is evaluated at the mean λ̄ of the
stretches at the points of an element, and deviations from it have a stiffness E_d that
is independent of the fibre stiffness,

    ψ(ln λ̄) + ½ E_d (λ − λ̄)²,

where ψ depends on each family separately, or on the means of both.

The mean is taken of the stretch and not of its logarithm: the stretch has no second
derivative along the fibre, so that the stiffness of a deviation is E_d at any tension,
whereas with the logarithm it would be E_d − T.  The formulation is consistent:
deviations vanish under mesh refinement.
"""

import numpy as np
from skfem import BilinearForm, Functional, LinearForm
from skfem.helpers import ddot

from ..fabric import Fabric
from ..fabric import kinematics as kin
from ..mesh.user_input import parameter
from .form import (
    Forms,
    builds_forms,
    contract,
    deformation,
    directions,
    elements,
    families_with_law,
    gradient,
    mean,
    of_density,
    once,
    outer,
)


@builds_forms("TensionKernel")
def tension(fabric: Fabric) -> Forms:
    """Fibre tension: virtual work ∫ Σ_α T_α δε_α dΩ.

    A tension may depend on both strains; the tangent then couples warp and weft.

    The tangent has an optional parameter ``tension``, shape (2, n_elements, n_points):
    fibre tensions (warp, weft) for its geometric part instead of T(ε).

    Raises
    ------
    ValueError
        If the fabric has no tension stiffness.

    Examples
    --------
    >>> import numpy as np
    >>> from skfem import MeshQuad, asm
    >>> from skfem_textile import CENTRE, Fabric, quad_basis
    >>> mesh = MeshQuad().refined(2)
    >>> u = 0.01 * mesh.p.T.ravel()  # both families stretched by 1 %
    >>> energy = asm(tension(Fabric(1e4)).energy, quad_basis(mesh, CENTRE), u=u)
    >>> bool(np.isclose(energy, 1e4 * np.log(1.01) ** 2))
    True
    """
    if not families_with_law(fabric):
        raise ValueError("the fabric has no tension stiffness: omit this term")

    families = families_with_law(fabric)

    def law(w):
        """Tensions T(ε₁, ε₂)."""
        return fabric.at(elements(w)).tensions

    def strains(w):
        F, A = deformation(w), directions(fabric, w)
        return np.array([kin.fibre_strain(F, a) for a in A])

    def energy(w):
        return sum(law(w).energies(strains(w)))

    def stress(w):
        F, A = deformation(w), directions(fabric, w)
        T = law(w).value(strains(w))
        return sum(T[i] * kin.fibre_strain_d(F, A[i]) for i in families)

    def stiffness(w):
        F, A = deformation(w), directions(fabric, w)
        slopes, d_eps = law(w).slopes(strains(w)), [kin.fibre_strain_d(F, a) for a in A]
        T = w["tension"] if "tension" in w else law(w).value(strains(w))
        C = np.zeros(1)
        for i in families:
            C = C + slopes.own[i] * outer(d_eps[i], d_eps[i])
            C = C + T[i] * kin.fibre_strain_dd(F, A[i])
        if slopes.cross is not None:
            C = C + slopes.cross * (outer(*d_eps) + outer(*d_eps[::-1]))
        return C

    return of_density(energy, stress, stiffness)


@builds_forms("MeanTensionKernel")
def mean_tension(fabric: Fabric) -> Forms:
    """Fibre tension with the energy ψ(ln λ̄) + ½ E_d (λ − λ̄)².

    The forms require a `MeanBasis` and have the parameter ``E_d`` in N/mm, shape (2,
    n_elements, 1).  The tangent has an optional parameter ``tension``, shape (2,
    n_elements, n_points), see `tension`.

    Parameters
    ----------
    fabric
        Fibre directions and tension laws.
    """
    families = families_with_law(fabric)

    def law(w):
        """Tensions T(ε₁, ε₂) of the means, from the laws at the first points."""
        element = elements(w)
        return fabric.at(None if element is None else element[:, :1]).tensions

    def stretches(w):
        F, A = deformation(w), directions(fabric, w)
        return [kin.stretch(F, a) for a in A]

    def mean_stretches(w):
        return np.array([mean(w, lam) for lam in once(w, stretches)])

    def variation(w):
        """∂λ/∂F."""
        F, A = deformation(w), directions(fabric, w)
        return [kin.stretch_d(F, a) for a in A]

    def force(w):
        """∂ψ/∂λ: the tension over the stretch."""
        lam, E_d, means = (
            once(w, stretches),
            parameter(w, "E_d"),
            once(w, mean_stretches),
        )
        T = law(w).value(np.log(means))
        return {i: T[i] / means[i] + E_d[i] * (lam[i] - means[i]) for i in families}

    def stress(w):
        N, d_lam = force(w), once(w, variation)
        return sum(N[i] * d_lam[i] for i in families)

    def local_stiffness(w):
        """Local part of the tangent at one point."""
        F, A = deformation(w), directions(fabric, w)
        lam, d_lam, E_d = once(w, stretches), once(w, variation), parameter(w, "E_d")
        if "tension" in w:
            N = {i: w["tension"][i] / lam[i] for i in families}
        else:
            N = force(w)
        return sum(
            E_d[i] * outer(d_lam[i], d_lam[i]) + N[i] * kin.stretch_dd(F, A[i])
            for i in families
        )

    def mean_stiffness(w):
        """Stiffness of the mean of each family, and coupling of the two means."""
        means, E_d = once(w, mean_stretches), parameter(w, "E_d")
        T, slopes = law(w).value(np.log(means)), law(w).slopes(np.log(means))
        direct = {i: (slopes.own[i] - T[i]) / means[i] ** 2 - E_d[i] for i in families}
        if slopes.cross is None:
            return direct, None
        return direct, slopes.cross / (means[0] * means[1])

    @Functional
    def energy(w):
        lam, E_d, means = (
            once(w, stretches),
            parameter(w, "E_d"),
            once(w, mean_stretches),
        )
        return sum(law(w).energies(np.log(means))) + sum(
            0.5 * E_d[i] * (lam[i] - means[i]) ** 2 for i in families
        )

    @LinearForm
    def residual(v, w):
        return ddot(once(w, stress), gradient(v))

    @BilinearForm
    def tangent(u, v, w):
        d_lam, (direct, cross) = once(w, variation), once(w, mean_stiffness)
        of_u, of_v = ([mean(w, ddot(d, gradient(x))) for d in d_lam] for x in (u, v))
        means = sum(direct[i] * of_u[i] * of_v[i] for i in families)
        if cross is not None:
            means = means + cross * (of_u[0] * of_v[1] + of_u[1] * of_v[0])
        return means + contract(gradient(v), once(w, local_stiffness), gradient(u))

    return Forms(energy, residual, tangent)
