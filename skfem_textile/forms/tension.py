"""Fibre tension."""

import numpy as np

from .. import kinematics as kin
from ..fabric import Fabric
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

    def families(w):
        """Index and tension law T(ε) of each family that has one."""
        laws = fabric.at(elements(w)).laws
        return [(i, laws[i]) for i in families_with_law(fabric)]

    def energy(w):
        F, A = deformation(w), directions(fabric, w)
        return sum(T.energy(kin.fibre_strain(F, A[i])) for i, T in families(w))

    def stress(w):
        F, A = deformation(w), directions(fabric, w)
        return sum(
            T.value(kin.fibre_strain(F, A[i])) * kin.fibre_strain_d(F, A[i])
            for i, T in families(w)
        )

    def stiffness(w):
        F, A = deformation(w), directions(fabric, w)
        C = np.zeros(1)
        for i, T in families(w):
            eps, d_eps = kin.fibre_strain(F, A[i]), kin.fibre_strain_d(F, A[i])
            geometric = w["tension"][i] if "tension" in w else T.value(eps)
            C = C + T.tangent(eps) * outer(d_eps, d_eps)
            C = C + geometric * kin.fibre_strain_dd(F, A[i])
        return C

    return of_density(energy, stress, stiffness)
