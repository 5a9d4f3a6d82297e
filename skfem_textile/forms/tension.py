"""Fibre tension."""

import numpy as np
from numpy import ndarray

from .. import kinematics as kin
from ..fabric import Fabric, is_zero
from .form import Forms, deformation, directions, of_density, outer


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
    # Index and tension law T(ε) of each family that has one.
    families = [
        (i, family.tension)
        for i, family in enumerate(fabric.families)
        if not is_zero(family.tension)
    ]
    if not families:
        raise ValueError("the fabric has no tension stiffness: leave this term out")

    def energy(w):
        F, A = deformation(w), directions(fabric, w)
        return sum(T.energy(kin.fibre_strain(F, A[i])) for i, T in families)

    def stress(w):
        F, A = deformation(w), directions(fabric, w)
        return sum(
            T.value(kin.fibre_strain(F, A[i])) * kin.fibre_strain_d(F, A[i])
            for i, T in families
        )

    def stiffness(w):
        F, A = deformation(w), directions(fabric, w)
        C = np.zeros(1)
        for i, T in families:
            eps, d_eps = kin.fibre_strain(F, A[i]), kin.fibre_strain_d(F, A[i])
            geometric = w["tension"][i] if "tension" in w else T.value(eps)
            C = C + T.tangent(eps) * outer(d_eps, d_eps)
            C = C + geometric * kin.fibre_strain_dd(F, A[i])
        return C

    return of_density(energy, stress, stiffness)


def fibre_tension(
    fabric: Fabric, strain: ndarray, change: ndarray | float = 0.0
) -> ndarray:
    """Tensions T(ε) + T′(ε) Δε of warp and weft in N/mm.

    Parameters
    ----------
    fabric
        Gives the tension laws.
    strain, change
        Fibre strains and a change of them, of warp and weft, shape (2, ...).
    """
    laws = [family.tension for family in fabric.families]
    value = np.array([T.value(e) for T, e in zip(laws, strain, strict=True)])
    slope = np.array([T.tangent(e) for T, e in zip(laws, strain, strict=True)])
    return value + slope * change
