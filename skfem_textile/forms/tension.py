"""Fibre tension."""

import numpy as np

from ..fabric import Fabric
from ..fabric import kinematics as kin
from .form import (
    Forms,
    deformation,
    directions,
    elements,
    families_with_law,
    of_density,
    outer,
)


def tension(fabric: Fabric) -> Forms:
    """Fibre tension: virtual work ∫ Σ_α T_α δε_α dΩ.

    A tension may take both strains; the tangent then couples warp and weft.

    The tangent takes an optional parameter ``tension``, shape (2, n_elements,
    n_points): fibre tensions (warp, weft) to use in its geometric part instead
    of T(ε).

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
        raise ValueError("the fabric has no tension stiffness: leave this term out")

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
