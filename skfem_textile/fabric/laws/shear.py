"""Shear laws: sin²Γ, a pole at a locking angle, and the tangent of Γ."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy import ndarray

from ... import declarations as declared
from ..law import (
    OneStiffness,
    Resistance,
    ScalarLaw,
    keep,
    number,
    refuse_other_units,
)


@dataclass(frozen=True)
class Sin2(OneStiffness):
    """Shear law w = ½ G sin²Γ, M_s = ½ G sin 2Γ, convex up to 45°.

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


# End of the shown range, as a share of the locking angle.
_SHOWN = 0.95


@dataclass(frozen=True)
class Locking(declared.Locking, ScalarLaw):
    """Shear law M_s = G Γ/(1 − (Γ/a)²) with a pole at the locking angle a.

    Its energy, −½ G a² ln(1 − (Γ/a)²), is also unbounded: no state reaches the pole.

    Parameters
    ----------
    stiffness
        G in N/mm, the shear stiffness at rest.
    angle
        a in radians.

    Raises
    ------
    ValueError
        If a parameter is not a positive finite number, or the angle exceeds π/2.

    Examples
    --------
    >>> Locking(0.5, np.radians(60)).value(np.radians([30.0, 59.0])).round(2)
    array([ 0.35, 15.58])
    """

    of: ClassVar[Resistance] = "shear"

    def __post_init__(self) -> None:
        G = number("stiffness", self.stiffness, above=0)
        a = number("locking angle", self.angle, above=0)
        refuse_other_units("locking angle", a, "shear")
        keep(self, stiffness=G, angle=a)

    @property
    def domain(self) -> tuple[float, float]:
        """From pole to pole."""
        return -self.angle, self.angle

    @property
    def shown(self) -> tuple[float, float]:
        """Range of plots: nearly the whole interval between the poles."""
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


# Angle at which the tangent is infinite and the fibres of both families coincide.
_CLOSED = 0.5 * np.pi


@dataclass(frozen=True)
class TangentShear(ScalarLaw):
    """Shear law M_s = G₀ tan Γ, with a different slope beyond a locking angle.

    For Γ beyond a it is G_L tan Γ + (G₀ − G_L) tan a, and odd, as in OpenRadioss's
    ``/MAT/LAW58``.  The tangent jumps at a.

    Parameters
    ----------
    stiffness, locked_stiffness
        G₀ and G_L in N/mm.
    angle
        a in radians, below a right angle.

    Raises
    ------
    ValueError
        If a parameter is not a finite number in its range.

    Examples
    --------
    >>> law = TangentShear(1.0, 5.0, np.radians(45))
    >>> law.value(np.arctan([0.5, 2.0])).round(12).tolist()
    [0.5, 6.0]
    """

    stiffness: float
    locked_stiffness: float
    angle: float
    of: ClassVar[Resistance] = "shear"
    domain: ClassVar[tuple[float, float]] = (-_CLOSED, _CLOSED)

    def __post_init__(self) -> None:
        for name in ("stiffness", "locked_stiffness"):
            keep(self, **{name: number(name, getattr(self, name))})
        a = number("locking angle", self.angle, above=0)
        if a >= _CLOSED:
            question = ": is the value in degrees?" if a > 2 * _CLOSED else ""
            raise ValueError(
                f"locking angle must be below 90°, got {np.degrees(a):g}°{question}"
            )
        keep(self, angle=a)

    @property
    def shown(self) -> tuple[float, float]:
        """A third beyond the locking angle, within the domain."""
        end = min(4 / 3 * self.angle, 0.9 * _CLOSED)
        return -end, end

    def energy(self, x: ndarray) -> ndarray:
        """Integral of the value from 0."""
        a, locked = self._side(x)
        at_lock = np.minimum(a, self.angle)
        with np.errstate(divide="ignore", invalid="ignore"):
            free = -self.stiffness * np.log(np.cos(at_lock))
            past = -self.locked_stiffness * np.log(np.cos(a) / np.cos(at_lock))
        return free + np.where(locked, past + self._step * (a - at_lock), 0.0)

    def value(self, x: ndarray) -> ndarray:
        """G₀ tan Γ, or its continuation beyond the locking angle."""
        a, locked = self._side(x)
        past = self.locked_stiffness * np.tan(a) + self._step
        return np.sign(x) * np.where(locked, past, self.stiffness * np.tan(a))

    def tangent(self, x: ndarray) -> ndarray:
        """Stiffness times 1 + tan² Γ."""
        a, locked = self._side(x)
        G = np.where(locked, self.locked_stiffness, self.stiffness)
        return G * (1 + np.tan(a) ** 2)

    @property
    def _step(self) -> float:
        return (self.stiffness - self.locked_stiffness) * float(np.tan(self.angle))

    def _side(self, x: ndarray) -> tuple[ndarray, ndarray]:
        """Magnitude of Γ, NaN beyond a right angle, and mask of locking."""
        a = np.abs(np.asarray(x, dtype=float))
        a = np.where(a < _CLOSED, a, np.nan)
        return a, a > self.angle
