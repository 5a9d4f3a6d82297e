"""In-plane shear."""

from .. import kinematics as kin
from ..fabric import Fabric
from .form import Forms, deformation, directions, of_density, outer


def shear(fabric: Fabric) -> Forms:
    """In-plane shear: virtual work ∫ M_s δΓ dΩ."""
    M_s = fabric.shear_law

    def energy(w):
        return M_s.energy(kin.shear_angle(deformation(w), *directions(fabric, w)))

    def stress(w):
        F, A = deformation(w), directions(fabric, w)
        return M_s.value(kin.shear_angle(F, *A)) * kin.shear_angle_d(F, *A)

    def stiffness(w):
        F, A = deformation(w), directions(fabric, w)
        angle, d_angle = kin.shear_angle(F, *A), kin.shear_angle_d(F, *A)
        return M_s.tangent(angle) * outer(d_angle, d_angle) + M_s.value(
            angle
        ) * kin.shear_angle_dd(F, *A)

    return of_density(energy, stress, stiffness)
