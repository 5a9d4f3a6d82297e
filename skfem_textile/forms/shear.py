"""Forms of the shear resistance and of shear angle jumps between elements.

Stabilisation by the jump of the shear angle across interior edges.  It vanishes for a
continuous shear angle, including a linear one, and couples neighbouring elements.
"""

import numpy as np
from numpy import ndarray
from skfem import BilinearForm, Functional, LinearForm
from skfem.helpers import ddot

from ..fabric import Fabric
from ..fabric import kinematics as kin
from ..mesh.bases import JumpBasis
from .form import (
    Forms,
    builds_forms,
    contract,
    deformation,
    directions,
    elements,
    gradient,
    of_density,
    once,
    outer,
)


@builds_forms("ShearKernel")
def shear(fabric: Fabric) -> Forms:
    """In-plane shear: virtual work ∫ M_s δΓ dΩ."""

    def law(w):
        return fabric.at(elements(w)).shear_law

    def energy(w):
        M_s = law(w)
        return M_s.energy(kin.shear_angle(deformation(w), *directions(fabric, w)))

    def stress(w):
        F, A, M_s = deformation(w), directions(fabric, w), law(w)
        return M_s.value(kin.shear_angle(F, *A)) * kin.shear_angle_d(F, *A)

    def stiffness(w):
        F, A, M_s = deformation(w), directions(fabric, w), law(w)
        angle, d_angle = kin.shear_angle(F, *A), kin.shear_angle_d(F, *A)
        return M_s.tangent(angle) * outer(d_angle, d_angle) + M_s.value(
            angle
        ) * kin.shear_angle_dd(F, *A)

    return of_density(energy, stress, stiffness)


@builds_forms(basis=JumpBasis)
def shear_continuity(fabric: Fabric, C_j: float) -> Forms:
    """Stabilisation with the energy ½ C_j Σ_edges (A⁺ + A⁻)/4 [[Γ]]².

    The forms require a `JumpBasis`.

    Parameters
    ----------
    fabric
        Fibre directions; the stiffnesses are not used.
    C_j
        Stabilisation stiffness in N/mm.
    """

    def jump(w):
        return _jump(kin.shear_angle(deformation(w), *directions(fabric, w)))

    def variation(w):
        return kin.shear_angle_d(deformation(w), *directions(fabric, w))

    def curvature(w):
        return kin.shear_angle_dd(deformation(w), *directions(fabric, w))

    @Functional
    def energy(w):
        return 0.5 * C_j * jump(w) ** 2

    @LinearForm
    def residual(v, w):
        return C_j * once(w, jump) * _jump(ddot(once(w, variation), gradient(v)))

    @BilinearForm
    def tangent(u, v, w):
        d = once(w, variation)
        second = contract(gradient(v), once(w, curvature), gradient(u))
        return C_j * (
            _jump(ddot(d, gradient(u))) * _jump(ddot(d, gradient(v)))
            + once(w, jump) * _jump(second)
        )

    return Forms(energy, residual, tangent)


def _jump(x: ndarray) -> ndarray:
    """[[x]], equal at both points of an edge."""
    return np.repeat(x[..., :1] - x[..., 1:], 2, axis=-1)
