"""Tension and shear: the scikit-fem forms that define this library.

The internal energy of a ply is

    Ψ(u) = ∫ Σ_α ψ(ε_α) dΩ + ∫ w(Γ) dΩ + stabilisation.

Each function here returns energy, residual (first derivative) and tangent (second
derivative) of one of these terms, as forms that take the displacement as their
parameter ``u``: ``asm(tension(fabric).residual, basis, u=u)``.  They go with any
basis of the displacement.
"""

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy import ndarray
from skfem import BilinearForm, Functional, LinearForm
from skfem.assembly.form.form import FormExtraParams
from skfem.helpers import ddot, grad

from . import kinematics as kin
from .fabric import Fabric, is_zero
from .fused import FusedEnergy, FusedResidual, FusedTangent
from .kernels import Kernel, ShearKernel, TensionKernel


class Forms(NamedTuple):
    """Energy, residual and tangent of one term, all taking the parameter ``u``."""

    energy: Functional
    residual: LinearForm
    tangent: BilinearForm


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
    >>> from skfem_textile import Fabric
    >>> from skfem_textile.elements import CENTRE, quad_basis
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
        F, A = _F(w), directions(fabric, w)
        return sum(T.energy(kin.fibre_strain(F, A[i])) for i, T in families)

    def stress(w):
        F, A = _F(w), directions(fabric, w)
        return sum(
            T.value(kin.fibre_strain(F, A[i])) * kin.fibre_strain_d(F, A[i])
            for i, T in families
        )

    def stiffness(w):
        F, A = _F(w), directions(fabric, w)
        C = np.zeros(1)
        for i, T in families:
            eps, d_eps = kin.fibre_strain(F, A[i]), kin.fibre_strain_d(F, A[i])
            geometric = w["tension"][i] if "tension" in w else T.value(eps)
            C = C + T.tangent(eps) * _outer(d_eps, d_eps)
            C = C + geometric * kin.fibre_strain_dd(F, A[i])
        return C

    return fused(_forms(energy, stress, stiffness), TensionKernel(fabric))


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


def shear(fabric: Fabric) -> Forms:
    """In-plane shear: virtual work ∫ M_s δΓ dΩ."""
    M_s = fabric.shear_law

    def energy(w):
        return M_s.energy(kin.shear_angle(_F(w), *directions(fabric, w)))

    def stress(w):
        F, A = _F(w), directions(fabric, w)
        return M_s.value(kin.shear_angle(F, *A)) * kin.shear_angle_d(F, *A)

    def stiffness(w):
        F, A = _F(w), directions(fabric, w)
        angle, d_angle = kin.shear_angle(F, *A), kin.shear_angle_d(F, *A)
        return M_s.tangent(angle) * _outer(d_angle, d_angle) + M_s.value(
            angle
        ) * kin.shear_angle_dd(F, *A)

    return fused(_forms(energy, stress, stiffness), ShearKernel(fabric))


def fused(forms: Forms, kernel: Kernel) -> Forms:
    """The same forms, with their numbers from a kernel."""
    energy, residual, tangent = forms
    return Forms(
        FusedEnergy(energy, kernel=kernel),
        FusedResidual(residual, kernel=kernel),
        FusedTangent(tangent, kernel=kernel),
    )


def _forms(energy: Callable, stress: Callable, stiffness: Callable) -> Forms:
    """Forms of an energy density, given its derivatives with respect to F."""

    @Functional
    def energy_form(w):
        return energy(w)

    @LinearForm
    def residual(v, w):
        return ddot(once(w, stress), grad(v))

    @BilinearForm
    def tangent(u, v, w):
        return contract(grad(v), once(w, stiffness), grad(u))

    return Forms(energy_form, residual, tangent)


def once(w: FormExtraParams, function: Callable) -> Any:
    """``function(w)``, evaluated once per assembly and not once per basis function."""
    if function not in w:
        w[function] = function(w)
    return w[function]


def _F(w: FormExtraParams) -> ndarray:
    """Deformation gradient of the parameter ``u``."""
    return kin.deformation_gradient(grad(w["u"]))


def directions(fabric: Fabric, w: FormExtraParams) -> tuple[ndarray, ndarray]:
    """Unit reference directions of warp and weft."""
    return fabric.directions(np.asarray(w["x"]), w.get("element"))


def _outer(S: ndarray, T: ndarray) -> ndarray:
    return np.einsum("iJ...,kL...->iJkL...", S, T)


def contract(S: ndarray, C: ndarray, T: ndarray) -> ndarray:
    """S : C : T."""
    return np.einsum("iJ...,iJkL...,kL...->...", S, C, T)
