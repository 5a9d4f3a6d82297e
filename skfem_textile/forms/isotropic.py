"""Isotropic hourglass control, to compare with the stabilisation of shear alone.

Flanagan & Belytschko (1981) resist all hourglass modes equally, Hamila & Boisse (2013)
only as far as they change the shear angle.
"""

from skfem import BilinearForm, Functional, LinearForm
from skfem.helpers import ddot, grad

from .form import Forms


def isotropic_hourglass(stiffness: float) -> Forms:
    """Stabilisation with the energy ½ κ Σ_k A/4 ‖∇u(ξ_k) − ∇u(0)‖².

    It vanishes for homogeneous motions and does not change with rotations of the ply.
    The forms go with `HourglassBasis`.

    Parameters
    ----------
    stiffness
        κ in N/mm.
    """

    @Functional
    def energy(w):
        return 0.5 * stiffness * ddot(grad(w["u"]), grad(w["u"]))

    @LinearForm
    def residual(v, w):
        return stiffness * ddot(grad(w["u"]), grad(v))

    @BilinearForm
    def tangent(u, v, w):
        return stiffness * ddot(grad(u), grad(v))

    return Forms(energy, residual, tangent)
