"""Stiffnesses of the discretisation, from laws at a state.

C_s meets the non-constant shear of an element, and E_d what the stretches in it deviate
from their mean.  Neither is of the fabric: they are as large as keeps the element from
moving without resistance, and no larger.  Both follow the laws to where these are, and
are local: no size of the mesh is in them.
"""

import numpy as np
from numpy import ndarray

from ..fabric.law import Law

# C_s over shear stiffness and over tension, and the power of the grip; of E_d, what
# tension adds over what shear stiffness adds; how fast tension loses weight where
# fibres are soft: `python -m studies angles --part choosing`.
_C_S_OF_SHEAR, _C_S_OF_TENSION, _POWER_OF_GRIP = 4.0, 3.2, 1.5
_TENSION_OVER_SHEAR, _SOFTNESS = 0.7, 80.0

# C_s and E_d over the fibre stiffness where there is no shear stiffness: strip and
# trellis, `python -m studies formulations`.
_C_S_OF_FIBRES, _E_D_OF_FIBRES = 1e-4, 0.5

# The least grip.  Chosen: fibres that cross at 8 degrees, less than fabrics let them.
_LEAST_GRIP = 0.01

# Shear stiffness over fibre stiffness at which these have fallen to a third.  Chosen:
# far beyond the 1e-8 of the stiffest cases that are studied, so that it changes none.
_NO_SHEAR = 1e-11

# Share of the shear stiffness at rest below which a softening law is not followed.
_LEAST_OF_REST = 0.1

# Below this shear angle (radians) the secant is the tangent at rest.
_SMALL_ANGLE = 1e-6


def stabilisation_stiffness(
    G: ndarray, E: ndarray, T: ndarray, cos_angle: ndarray
) -> ndarray:
    """C_s in N/mm: grows with G and tension, and where fibres close up.

    ``C_s = (4 G + 3.2 τ)/(1 − |cos ω|)^1.5`` with τ of `effective_tension` and the
    angle ω between the families, and 10⁻⁴ E without shear stiffness.  Where the
    families are nearly parallel, the shear angle hardly grips motions across both: of
    the squares of motions across either, ``1 − |cos ω|`` is the least share.

    Parameters
    ----------
    G, E, T
        Stiffness of shear and of fibres, and fibre tension, in N/mm, where the element
        is.
    cos_angle
        ``|cos ω|``.
    """
    grip = np.maximum(1.0 - cos_angle, _LEAST_GRIP) ** _POWER_OF_GRIP
    without_shear = _without_shear(G, E)
    resistance = _C_S_OF_SHEAR * G + _C_S_OF_TENSION * effective_tension(G, E, T)
    of_fibres = _C_S_OF_FIBRES * E
    return (1.0 - without_shear) * resistance / grip + without_shear * of_fibres


def deviation_stiffness(
    multiple: float | ndarray, G: ndarray, E: ndarray, T: ndarray
) -> ndarray:
    """E_d in N/mm: a multiple of G + 0.7 τ, in series with E.

    It is ½ E without shear stiffness.  A jump of the shear angle lies along fibres that
    carry a force of their own.  The smaller the elements, the larger is its tension T
    in them, and the more of the force would be lost to stretches that deviate.  Where
    there is no such fibre, E_d is of the order of G and elements do not lock.

    Parameters
    ----------
    multiple
        Measured, see `Macro` and `Quadratic`.
    G, E, T
        As for `stabilisation_stiffness`; of G what resists further shear,
        `further_shear_stiffness`.
    """
    without_shear = _without_shear(G, E)
    resistance = multiple * (G + _TENSION_OVER_SHEAR * effective_tension(G, E, T))
    both = resistance + E
    in_series = resistance / np.where(both > 0, both, 1.0) * E
    return (1.0 - without_shear) * in_series + without_shear * _E_D_OF_FIBRES * E


def effective_tension(G: ndarray, E: ndarray, T: ndarray) -> ndarray:
    """``τ = |T|/(1 + 80 √(G/E))`` in N/mm.

    The force of a fibre at a jump spreads over a layer whose width goes with √(G/E).
    Where the layer is wide, elements resolve more of it by themselves.  Fibres in
    compression count as much as those in tension: elements at a free edge would fold
    along them.

    Parameters
    ----------
    G, E, T
        As for `stabilisation_stiffness`.
    """
    softness = np.sqrt(G / np.where(E > 0, E, 1.0))
    return np.abs(T) / (1.0 + _SOFTNESS * softness)


def shear_stiffness(law: Law, angle: ndarray) -> ndarray:
    """Secant M_s/Γ in N/mm, at least a tenth of what it is at rest."""
    at_rest = law.tangent(np.zeros_like(angle))
    sheared = np.abs(angle) > _SMALL_ANGLE
    divisor = np.where(sheared, angle, 1.0)
    secant = np.where(sheared, law.value(angle) / divisor, at_rest)
    return np.maximum(secant, _LEAST_OF_REST * at_rest)


def further_shear_stiffness(law: Law, angle: ndarray) -> ndarray:
    """The tangent in N/mm where the law stiffens, and the secant where it softens."""
    return np.maximum(shear_stiffness(law, angle), law.tangent(angle))


def _without_shear(G: ndarray, E: ndarray) -> ndarray:
    """1 where there is no shear stiffness, 0 where there is; no jump between them."""
    return np.exp(-G / np.where(E > 0, _NO_SHEAR * E, 1.0))
