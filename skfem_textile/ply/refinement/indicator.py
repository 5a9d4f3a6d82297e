"""Which elements of a ply are too large for its shear angle."""

from typing import TYPE_CHECKING

import numpy as np
from numpy import ndarray

if TYPE_CHECKING:
    from ..ply import Ply


def shear_angle_jumps(ply: "Ply", u: ndarray) -> ndarray:
    """Jumps of the shear angle between each of the user's elements and its neighbours.

    η² = Σ h² [Γ]², summed over the edges of the element that it shares: h is the length
    of the edge, and [Γ] the difference of the mean shear angles on both sides.  Where
    the angle is smooth η falls with the square of the element size, and at a kink with
    the size alone.

    Parameters
    ----------
    ply
        The ply, not on a mesh that was split before.
    u
        Displacement.

    Returns
    -------
    ndarray
        η in mm, shape (n_users_elements,).
    """
    mesh = ply.users_mesh
    angle = ply.on_users_elements(ply.shear_angle(u).mean(axis=1))
    inner = np.flatnonzero(mesh.f2t[1] >= 0)
    ends, sides = mesh.p[:, mesh.facets[:, inner]], mesh.f2t[:, inner]
    length = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=0)
    square = (length * (angle[sides[1]] - angle[sides[0]])) ** 2
    total = np.bincount(sides.ravel(), np.tile(square, 2), minlength=mesh.nelements)
    return np.sqrt(total)


def marked(indicator: ndarray, share: float = 0.3) -> ndarray:
    """The fewest elements that carry a share of the squares of an indicator.

    Parameters
    ----------
    indicator
        A value for each element, such as `shear_angle_jumps`.
    share
        Above 0 and at most 1 (Dörfler 1996).

    Returns
    -------
    ndarray
        Numbers of elements, those of the largest values first.

    Examples
    --------
    >>> marked(np.array([1.0, 0.0, 3.0, 2.0]), 0.7)
    array([2, 3])
    """
    if not 0 < share <= 1:
        raise ValueError(f"share must be above 0 and at most 1, got {share}")
    order = np.argsort(-indicator, kind="stable")
    carried = np.cumsum(indicator[order] ** 2)
    enough = np.searchsorted(carried, share * carried[-1] * (1 - 1e-12)) + 1
    return order[:enough] if carried[-1] > 0 else order[:0]
