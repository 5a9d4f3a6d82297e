"""In-plane shear."""

from ..fabric import Fabric
from ..fabric import kinematics as kin
from .form import Forms, deformation, directions, elements, of_density, outer


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
