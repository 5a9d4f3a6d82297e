"""What keeps the corners of elements open: an energy of det F where it is near zero.

A bilinear quadrilateral is unfolded if and only if det F is positive at its corners. No
point at which fibres or stabilisation are evaluated lies there, so corners resist:

    κ Σ_corners A/n b(det F),   b(J) = ln³(J₀/J) where J < J₀, and 0 elsewhere,

an energy that is C², and exactly zero while every corner is open.  Below J₁ = J₀/4 its
parabola goes on, so that an iteration may pass through folded states; none of these
counts as an answer.
"""

import numpy as np
from numpy import ndarray
from skfem import BilinearForm, Functional, LinearForm
from skfem.helpers import ddot, grad

from .. import kinematics as kin
from .form import Forms, deformation, once

#: J₀, the area ratio det F below which a corner resists: that of fibres at right angles
#: which do not stretch and are sheared by 85.4°.
RESISTING = 0.08

# J₁, below which b goes on as a parabola.
_PARABOLA = RESISTING / 4


def resistance(J: ndarray) -> tuple[ndarray, ndarray, ndarray]:
    """b(J) and its first and second derivative, for area ratios J of any sign."""
    J_in = np.clip(J, _PARABOLA, RESISTING)
    log, past = np.log(RESISTING / J_in), np.minimum(J - _PARABOLA, 0.0)
    b, d, dd = log**3, -3 * log**2 / J_in, (6 * log + 3 * log**2) / J_in**2
    return b + d * past + 0.5 * dd * past**2, d + dd * past, dd


def corner_resistance(stiffness: float) -> Forms:
    """Resistance of corners with the energy κ Σ A/n b(det F).

    The forms go with `CornerBasis`.

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
        return stiffness * d * ddot(kin.cofactor(deformation(w)), grad(v))

    @BilinearForm
    def tangent(u, v, w):
        _, d, dd = once(w, derivatives)
        C = kin.cofactor(deformation(w))
        square = ddot(C, grad(u)) * ddot(C, grad(v))
        return stiffness * (dd * square + d * ddot(kin.cofactor(grad(u)), grad(v)))

    return Forms(energy, residual, tangent)
