"""A shear law with a locking angle."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy import ndarray

from ...registration import LawRegistration, Resistance, angle
from ..law import ScalarLaw, number, refuse_other_units
from .linear import STIFFNESS

# End of the shown range, as a share of the locking angle.
_SHOWN = 0.95


@dataclass(frozen=True)
class Locking(ScalarLaw):
    """The shear law M_s = G Γ/(1 − (Γ/a)²), which has a pole at the locking angle a.

    Its energy, −½ G a² ln(1 − (Γ/a)²), has no bound either: no state reaches the pole.

    Parameters
    ----------
    stiffness
        G in N/mm, the shear stiffness at rest.
    angle
        a in radians.

    Raises
    ------
    ValueError
        If one of them is not a positive finite number, or the angle above π/2.

    Examples
    --------
    >>> Locking(0.5, np.radians(60)).value(np.radians([30.0, 59.0])).round(2)
    array([ 0.35, 15.58])
    """

    stiffness: float
    angle: float
    of: ClassVar[Resistance] = "shear"

    def __post_init__(self) -> None:
        G = number("stiffness", self.stiffness, above=0)
        a = number("locking angle", self.angle, above=0)
        refuse_other_units("locking angle", a, "shear")
        object.__setattr__(self, "stiffness", G)
        object.__setattr__(self, "angle", a)

    @property
    def domain(self) -> tuple[float, float]:
        """From pole to pole."""
        return -self.angle, self.angle

    @property
    def shown(self) -> tuple[float, float]:
        """Nearly from pole to pole."""
        return -_SHOWN * self.angle, _SHOWN * self.angle

    def energy(self, x: ndarray) -> ndarray:
        """−½ G a² ln(1 − (Γ/a)²)."""
        share = self._share(x)
        with np.errstate(divide="ignore"):  # infinite at the pole
            return -0.5 * self.stiffness * self.angle**2 * np.log1p(-(share**2))

    def value(self, x: ndarray) -> ndarray:
        """G Γ/(1 − (Γ/a)²)."""
        share = self._share(x)
        with np.errstate(divide="ignore"):
            return self.stiffness * x / ((1 - share) * (1 + share))

    def tangent(self, x: ndarray) -> ndarray:
        """G (1 + (Γ/a)²)/(1 − (Γ/a)²)²."""
        share = self._share(x)
        with np.errstate(divide="ignore"):
            left = (1 - share) * (1 + share)
            return self.stiffness * (1 + share**2) / left**2

    def _share(self, x: ndarray) -> ndarray:
        """Γ/a, and NaN beyond the pole."""
        share = np.asarray(x) / self.angle
        return np.where(np.abs(share) <= 1, share, np.nan)


def _of_degrees(stiffness: float, locking_angle: float) -> Locking:
    return Locking(stiffness, float(np.radians(locking_angle)))


REGISTRATION = LawRegistration(
    name="locking",
    description="M_s = G gamma / (1 - (gamma/a)^2)",
    build=_of_degrees,
    options=(STIFFNESS, angle("locking-angle", None, "a, where the law has a pole")),
    resists=("shear",),
    rank=1,
)
