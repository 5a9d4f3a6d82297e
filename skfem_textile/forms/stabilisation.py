"""The stabilisation stiffness C_s, where none is given."""

import numpy as np
from numpy import ndarray

from ..fabric import Fabric

# C_s as a share of the secant shear stiffness, or of the fibre stiffness where there is
# no shear stiffness; and its least value as a share of that at rest.
_OF_SHEAR, _OF_FIBRES, _LEAST = 8.0, 1e-4, 0.1

# Below this shear angle (radians) the secant is the tangent at rest.
_SMALL_ANGLE = 1e-6


def default_stabilisation(fabric: Fabric, angle: ndarray | None = None) -> ndarray:
    """C_s in N/mm: eight times the secant shear stiffness M_s/Γ.

    At least a tenth of what it is at rest.  Without shear stiffness at rest it is
    10⁻⁴ of the fibre stiffness at rest, the mean of warp and weft, or more where the
    secant is.

    Parameters
    ----------
    fabric
        Gives the laws, at the elements (`Fabric.at`).
    angle
        Shear angles Γ in radians, shape (n_elements, 1); at rest if not given.

    Returns
    -------
    ndarray
        Of the shape of the angles, or (1, 1) at rest where the laws are uniform.
    """
    rest = np.zeros((1, 1))
    E_1, E_2, G = (law.tangent(rest) for law in fabric.laws)
    least = np.where(G > 0, _LEAST * _OF_SHEAR * G, _OF_FIBRES * (E_1 + E_2) / 2)
    angle, law = rest if angle is None else angle, fabric.shear_law
    sheared = np.abs(angle) > _SMALL_ANGLE
    divisor = np.where(sheared, angle, 1.0)
    secant = np.where(sheared, law.value(angle) / divisor, G)
    return np.maximum(_OF_SHEAR * secant, least)
