"""Stiffness against deviations of the strains in an element from their mean."""

import numpy as np
from numpy import ndarray

from ..fabric import Fabric

# E_d as a share of the fibre stiffness, where there is no shear stiffness.  Chosen,
# not measured.
_SHARE_WITHOUT_SHEAR = 0.5


def deviation_stiffness(
    fabric: Fabric, deviation: float | ndarray, fineness: ndarray
) -> tuple[ndarray, ndarray]:
    """E_d of warp and weft in N/mm, at most the fibre stiffness at rest, if any.

    Fibres of the stiffness E spread a jump of the shear angle over a width of L√(G/E)
    along their length L: a finer mesh can represent stiffer fibres.  The multiple and
    the exponent of the fineness are measured.  E_d depends on the area of the whole
    mesh, and is not continuous where the shear stiffness vanishes.

    Parameters
    ----------
    fabric
        Gives the laws, at the elements (`Fabric.at`).
    deviation
        E_d over the product of shear stiffness at rest and fineness: one, or one per
        element, shape (n_elements, 1).  Without shear stiffness E_d is half of the
        fibre stiffness.
    fineness
        √(A/A_e), shape (n_elements, 1).

    Returns
    -------
    tuple of ndarray
        Each of shape (n_elements, 1).
    """
    at_rest = np.zeros((1, 1))
    warp, weft, G = (law.tangent(at_rest) for law in fabric.laws)
    E_d = deviation * G * fineness
    first, second = (
        np.where(
            G > 0,
            np.minimum(E_d, np.where(E > 0, E, np.inf)),
            _SHARE_WITHOUT_SHEAR * E + 0 * fineness,
        )
        for E in (warp, weft)
    )
    return first, second
