"""Resistance of corners that close."""

import numpy as np

from .elements import CORNERS, SIX_NODES, area, point, shape
from .kinematics import deformation_gradient
from .laws import at_rest, laws_of_families


def corner_stiffness(cloth):
    """κ: the shear stiffness at rest, or 10⁻⁵ of the mean of the fibres' if larger."""
    laws = laws_of_families(cloth, (0.0, 0.0))
    return max(at_rest(cloth.shear), 1e-5 * sum(map(at_rest, laws)) / 2)


def corner_energy(J):
    """ln³(0.08/J) below J = 0.08, and below J = 0.02 its parabola there."""
    J1 = 0.02
    log = np.log(0.08 / J1)
    b, d, dd = log**3, -3 * log**2 / J1, (6 * log + 3 * log**2) / J1**2
    parabola = b + d * (J - J1) + dd * (J - J1) ** 2 / 2
    with np.errstate(all="ignore"):  # of what is not chosen
        cubic = np.log(0.08 / J) ** 3
    return np.where(J.real >= 0.08, 0, np.where(J.real < J1, parabola, cubic))


def corners(cloth, x):
    """κ Σ A/n b(det F) over the n nodes of each element; its area is A.

    Corners at which the element is flat or reflex at rest are left out.
    """
    total = np.zeros(x.shape[-1], dtype=x.dtype)
    for e, nodes in enumerate(cloth.elements):
        places = CORNERS if len(nodes) == 4 else SIX_NODES
        at_rest = [
            np.linalg.det(cloth.X[:, nodes] @ shape(nodes, at)[1]) for at in places
        ]
        for at, J in zip(places, at_rest, strict=True):
            if J * np.sign(sum(at_rest)) > 1e-9 * np.abs(at_rest).max():
                F = deformation_gradient(x, point(cloth, e, at))
                det = F[0, 0] * F[1, 1] - F[0, 1] * F[1, 0]
                total = total + area(cloth, e) / len(nodes) * corner_energy(det)
    return corner_stiffness(cloth) * total
