"""Resistance of corners to folding: an energy of det F where it is near zero.

A bilinear quadrilateral is not folded if and only if det F is positive at its corners.
Fibre and stabilisation terms are not evaluated at corners, so that corners need a
separate resistance:

    κ Σ_corners A/n b(det F),   b(J) = ln³(J₀/J) where J < J₀, and 0 elsewhere,

an energy that is C² and exactly zero while every corner is open.  Below J₁ = J₀/4, b is
replaced by its osculating parabola, so that iterates may be folded; the acceptance
checks reject folded states.  In space det F is replaced by the area ratio, which has no
sign.
"""

import numpy as np
from numpy import ndarray
from skfem import BilinearForm, Functional, LinearForm

from ..fabric import kinematics as kin
from .form import Forms, builds_forms, deformation, gradient, once

#: J₀, the area ratio det F below which a corner resists.  Inextensible orthogonal
#: fibres reach it at a shear angle of 85.4° (cos 85.4° = 0.08), beyond the locking
#: angles of fabrics.
RESISTING = 0.08

# J₁, the area ratio below which b is a parabola.  There b″ is 3·10⁴, compared with 1
# for a shear law (docs/theory/plane.md).
_PARABOLA = RESISTING / 4


def resistance(J: ndarray) -> tuple[ndarray, ndarray, ndarray]:
    """b(J) and its first and second derivative, for area ratios J of any sign."""
    J_in = np.clip(J, _PARABOLA, RESISTING)
    log, beyond = np.log(RESISTING / J_in), np.minimum(J - _PARABOLA, 0.0)
    b, d, dd = log**3, -3 * log**2 / J_in, (6 * log + 3 * log**2) / J_in**2
    return b + d * beyond + 0.5 * dd * beyond**2, d + dd * beyond, dd


@builds_forms()
def corner_resistance(stiffness: float) -> Forms:
    """Resistance of corners with the energy κ Σ A/n b(det F).

    The forms require a `CornerBasis`.

    Parameters
    ----------
    stiffness
        κ in N/mm.
    """

    def derivatives(w):
        return resistance(kin.area_ratio(deformation(w)))

    @Functional
    def energy(w):
        b, _, _ = derivatives(w)
        return stiffness * b

    @LinearForm
    def residual(v, w):
        _, d, _ = once(w, derivatives)
        return stiffness * d * kin.area_ratio_d(deformation(w), gradient(v))

    @BilinearForm
    def tangent(u, v, w):
        _, d, dd = once(w, derivatives)
        F = deformation(w)
        square = kin.area_ratio_d(F, gradient(u)) * kin.area_ratio_d(F, gradient(v))
        return stiffness * (
            dd * square + d * kin.area_ratio_dd(F, gradient(u), gradient(v))
        )

    return Forms(energy, residual, tangent)
