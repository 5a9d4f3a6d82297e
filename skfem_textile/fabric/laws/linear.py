"""The linear law."""

from dataclasses import dataclass

import numpy as np
from numpy import ndarray

from ..law import LawRegistration
from .one_stiffness import STIFFNESS, OneStiffness


@dataclass(frozen=True)
class Linear(OneStiffness):
    """The law ``value = stiffness · x``.

    Raises
    ------
    ValueError
        If the stiffness is negative or not finite.
    """

    def energy(self, x: ndarray) -> ndarray:
        """½ stiffness x²."""
        return 0.5 * self.stiffness * x**2

    def value(self, x: ndarray) -> ndarray:
        """Stiffness times x."""
        return self.stiffness * x

    def tangent(self, x: ndarray) -> ndarray:
        """The stiffness."""
        return self.stiffness + np.zeros(np.shape(x))


REGISTRATION = LawRegistration(
    name="linear",
    description="M_s = G gamma",
    build=Linear,
    options=(STIFFNESS,),
    rank=1,
)
