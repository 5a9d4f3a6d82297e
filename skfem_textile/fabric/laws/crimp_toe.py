"""The tension of crimped fibres."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy import ndarray
from numpy.polynomial.polynomial import polyval

from ...registration import LawRegistration, Option, Resistance
from ..law import ScalarLaw, number, refuse_other_units
from .linear import STIFFNESS

# Below this share of the toe the series of the exponential is taken, to this power:
# z^15/15! is 10⁻²⁷ there, and differences of numbers near z lose no digits.
_SERIES_BELOW, _POWERS = 0.1, 15

# e^(-z) - 1 + z from z², and z²/2 less that from z³.
_SIGNS = (-1.0) ** np.arange(_POWERS)
_SERIES = _SIGNS / np.cumprod([1.0, *range(1, _POWERS)])
_VALUE_SERIES = np.where(np.arange(_POWERS) < 2, 0.0, _SERIES)
_ENERGY_SERIES = np.where(np.arange(_POWERS) < 3, 0.0, -_SERIES)


@dataclass(frozen=True)
class CrimpToe(ScalarLaw):
    """The tension T = E (ε − e₀ (1 − exp(−ε/e₀))) + k ε of fibres with crimp.

    The stiffness is k at rest and tends to E + k, with a toe as wide as e₀.  That
    holds for ε >= 0.  In compression T = k ε: the exponential would grow there
    without bound.  Value and tangent are continuous at 0, and the energy is convex.

    Parameters
    ----------
    stiffness
        E in N/mm.
    toe
        e₀, a strain.
    initial_stiffness
        k in N/mm, at rest and in compression.

    Raises
    ------
    ValueError
        If E or e₀ is not a positive finite number, or k not one >= 0, or
        e₀ is above 1.

    Examples
    --------
    >>> law = CrimpToe(1e5, toe=0.004, initial_stiffness=10.0)
    >>> law.tangent(np.array([-0.01, 0.0, 0.001])).astype(int)
    array([   10,    10, 22129])
    """

    stiffness: float
    toe: float
    initial_stiffness: float
    domain: ClassVar[tuple[float, float]] = (-np.inf, np.inf)
    of: ClassVar[Resistance] = "tension"

    def __post_init__(self) -> None:
        E = number("stiffness", self.stiffness, above=0)
        e_0 = number("toe", self.toe, above=0)
        refuse_other_units("toe", e_0, "tension")
        k = number("initial stiffness", self.initial_stiffness)
        object.__setattr__(self, "stiffness", E)
        object.__setattr__(self, "toe", e_0)
        object.__setattr__(self, "initial_stiffness", k)

    @property
    def shown(self) -> tuple[float, float]:
        """From some compression to where the toe is past."""
        return -self.toe, 4 * self.toe

    def energy(self, x: ndarray) -> ndarray:
        """E (ε²/2 − e₀ ε + e₀² (1 − exp(−ε/e₀))) + ½ k ε²."""
        z, k = self._toes(x), self.initial_stiffness
        toe = np.where(
            z < _SERIES_BELOW,
            polyval(np.minimum(z, _SERIES_BELOW), _ENERGY_SERIES),
            0.5 * z**2 - (np.expm1(-z) + z),
        )
        return self.stiffness * self.toe**2 * toe + 0.5 * k * np.square(x)

    def value(self, x: ndarray) -> ndarray:
        """E (ε − e₀ (1 − exp(−ε/e₀))) + k ε."""
        z = self._toes(x)
        toe = np.where(
            z < _SERIES_BELOW,
            polyval(np.minimum(z, _SERIES_BELOW), _VALUE_SERIES),
            np.expm1(-z) + z,
        )
        return self.stiffness * self.toe * toe + self.initial_stiffness * x

    def tangent(self, x: ndarray) -> ndarray:
        """E (1 − exp(−ε/e₀)) + k."""
        return self.initial_stiffness - self.stiffness * np.expm1(-self._toes(x))

    def _toes(self, x: ndarray) -> ndarray:
        """ε/e₀, and 0 in compression."""
        return np.maximum(x, 0.0) / self.toe


#: Parameters of laws of crimped fibres.
TOE = Option(name="toe", help="e0, a strain", read=float, metavar="E0")
INITIAL_STIFFNESS = Option(
    name="initial-stiffness",
    help="k in N/mm, at rest and in compression",
    read=float,
    metavar="K",
    unit="N_per_mm",
)

REGISTRATION = LawRegistration(
    name="crimp-toe",
    description="T = E (eps - e0 (1 - exp(-eps/e0))) + k eps, k eps in compression",
    build=CrimpToe,
    options=(STIFFNESS, TOE, INITIAL_STIFFNESS),
    resists=("tension",),
    rank=1,
)
