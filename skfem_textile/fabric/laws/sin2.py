"""The shear law of sin²Γ."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy import ndarray

from ...registration import LawRegistration, Resistance
from ..law import OneStiffness
from .linear import STIFFNESS


@dataclass(frozen=True)
class Sin2(OneStiffness):
    """The shear law w = ½ G sin²Γ, M_s = ½ G sin 2Γ, convex up to 45°.

    Raises
    ------
    ValueError
        If the initial stiffness G is negative or not finite.
    """

    of: ClassVar[Resistance] = "shear"

    def energy(self, x: ndarray) -> ndarray:
        """½ G sin²Γ."""
        return 0.5 * self.stiffness * np.sin(x) ** 2

    def value(self, x: ndarray) -> ndarray:
        """½ G sin 2Γ."""
        return 0.5 * self.stiffness * np.sin(2 * x)

    def tangent(self, x: ndarray) -> ndarray:
        """G cos 2Γ."""
        return self.stiffness * np.cos(2 * x)


REGISTRATION = LawRegistration(
    name="sin2",
    description="w = G sin^2 gamma / 2",
    build=Sin2,
    options=(STIFFNESS,),
    resists=("shear",),
)
