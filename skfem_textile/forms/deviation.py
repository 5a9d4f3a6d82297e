"""The stiffness that meets what the strains in an element deviate from their mean."""

import numpy as np
from numpy import ndarray

from ..fabric import Fabric

# E_d as a share of the fibre stiffness, where there is no shear stiffness.
_OF_FIBRES = 0.5


def deviation_stiffness(
    fabric: Fabric, deviation: float | ndarray, fineness: ndarray
) -> tuple[ndarray, ndarray]:
    """E_d of warp and weft in N/mm, at most the fibre stiffness at rest, if any.

    Fibres of the stiffness E spread a jump of the shear angle over a width of L√(G/E)
    along their length L: the finer a mesh, the stiffer the fibres that it can take.
    The multiple and the exponent of the fineness are measured.  E_d depends on the area
    of the whole mesh, and jumps where the shear stiffness vanishes.

    Parameters
    ----------
    fabric
        Gives the laws.
    deviation
        E_d as a multiple of the shear stiffness at rest times the fineness: one, or
        one per element, shape (n_elements, 1).  Where there is no shear stiffness E_d
        is half of the fibre stiffness.
    fineness
        √(A/A_e), shape (n_elements, 1).

    Returns
    -------
    tuple of ndarray
        Each of shape (n_elements, 1).
    """
    rest = np.zeros(1)
    G = fabric.shear_law.tangent(rest)
    warp, weft = (family.tension.tangent(rest) for family in fabric.families)
    if G == 0:
        return _OF_FIBRES * warp + 0 * fineness, _OF_FIBRES * weft + 0 * fineness
    E_d = deviation * G * fineness
    return (
        np.minimum(E_d, np.where(warp > 0, warp, np.inf)),
        np.minimum(E_d, np.where(weft > 0, weft, np.inf)),
    )
