"""Stiffnesses of the discretisation, from laws at a state.

C_s meets the non-constant shear of an element, and E_d what the stretches in it deviate
from their mean.  Neither is of the fabric: they are as large as keeps the element from
moving without resistance, and no larger.  Both follow the laws to where these are, and
are local: no size of the mesh is in them.
"""

import numpy as np
from numpy import ndarray

from ..fabric.law import Law

# C_s over the shear stiffness: measured, `python -m studies formulations`.
_C_S_OF_SHEAR = 8.0

# C_s and E_d over the fibre stiffness where there is no shear stiffness: on the strip
# and the trellis of the same study.
_C_S_OF_FIBRES, _E_D_OF_FIBRES = 1e-4, 0.5

# What tension adds to E_d over what shear stiffness adds: `python -m studies
# formulations`, bias extension at 45 degrees.
_TENSION_OVER_SHEAR = 0.25

# Shear stiffness over fibre stiffness at which these have fallen to a third.  Chosen:
# far beyond the 1e-8 of the stiffest cases that are studied, so that it changes none.
_NO_SHEAR = 1e-11

# Share of the shear stiffness at rest below which a softening law is not followed.
_LEAST_OF_REST = 0.1

# Below this shear angle (radians) the secant is the tangent at rest.
_SMALL_ANGLE = 1e-6


def stabilisation_stiffness(G: ndarray, E: ndarray) -> ndarray:
    """C_s in N/mm: 8 G, and 10⁻⁴ E where there is no shear stiffness.

    Parameters
    ----------
    G, E
        Stiffness of shear and of fibres, in N/mm, where the element is.
    """
    return _C_S_OF_SHEAR * G + _C_S_OF_FIBRES * E * _without_shear(G, E)


def deviation_stiffness(
    multiple: float | ndarray, G: ndarray, E: ndarray, T: ndarray
) -> ndarray:
    """E_d in N/mm: a multiple of G + T/4, ½ E without shear stiffness, at most E.

    A jump of the shear angle lies along fibres that carry a force of their own.  The
    smaller the elements, the larger is its tension T in them, and the more of the force
    would be lost to stretches that deviate.  Where there is no such fibre, E_d is of
    the order of G and elements do not lock.

    Parameters
    ----------
    multiple
        Measured, see `Macro` and `Quadratic`.
    G, E
        As for `stabilisation_stiffness`; of G what resists further shear,
        `further_shear_stiffness`.
    T
        Fibre tension in N/mm; compression counts as none.
    """
    without_shear = _without_shear(G, E)
    of_resistance = multiple * (G + _TENSION_OVER_SHEAR * np.maximum(T, 0.0))
    of_fibres = _E_D_OF_FIBRES * E
    return np.minimum(
        E, (1.0 - without_shear) * of_resistance + without_shear * of_fibres
    )


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
