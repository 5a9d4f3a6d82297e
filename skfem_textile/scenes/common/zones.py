"""Zones of a bias extension whose fibres do not stretch: what carries the force."""

from typing import TypeVar

import numpy as np
from numpy import ndarray

Angle = TypeVar("Angle", float, ndarray)


def force_of_moments(
    gamma: Angle, width: float, height: float, inclination: float = np.pi / 4
) -> tuple[Angle, Angle]:
    """What C(γ) and C(γ/2) are multiplied by in the force at the clamps, in mm.

    These are the areas of the zones over the rate dδ/dγ of the elongation.

    Parameters
    ----------
    gamma
        Shear angle of the middle in radians, a number or an array.
    width, height
        Sides W and H of the ply in mm, H ≥ 2W tan θ.
    inclination
        Angle θ between warp and clamps in radians.
    """
    W, H, tan = width, height, np.tan(inclination)
    rate = free_length(W, H, inclination) * np.cos(inclination + gamma / 2)
    return W * (H - 1.5 * W * tan) / rate, 0.5 * W**2 * tan / rate


def free_length(width: float, height: float, inclination: float) -> float:
    """Length L in mm of the fibres that meet no clamp."""
    return float((height / np.sin(inclination) - width / np.cos(inclination)) / 2)
