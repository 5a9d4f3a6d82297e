"""Tension laws: crimp toe, different behaviour in compression, and pretension."""

from dataclasses import dataclass
from functools import cached_property
from typing import Any, ClassVar, NamedTuple

import numpy as np
from numpy import ndarray
from numpy.polynomial.polynomial import polyval

from ... import declarations as declared
from ..law import (
    Law,
    Resistance,
    ScalarLaw,
    domain_of,
    inner_law,
    keep,
    number,
    refuse_force_at_rest,
    refuse_other_units,
)

# Argument below which the series of the exponential is used, and its last power:
# z^15/15!  is 10⁻²⁷ there, and differences of numbers near z lose no digits.
_SERIES_BELOW, _POWERS = 0.1, 15

# Coefficients of e^(-z) - 1 + z from z², and of z²/2 minus this series from z³.
_SIGNS = (-1.0) ** np.arange(_POWERS)
_SERIES = _SIGNS / np.cumprod([1.0, *range(1, _POWERS)])
_VALUE_SERIES = np.where(np.arange(_POWERS) < 2, 0.0, _SERIES)
_ENERGY_SERIES = np.where(np.arange(_POWERS) < 3, 0.0, -_SERIES)


@dataclass(frozen=True)
class CrimpToe(declared.CrimpToe, ScalarLaw):
    """Tension T = E (ε − e₀ (1 − exp(−ε/e₀))) + k ε of crimped fibres.

    The stiffness is k at rest and tends to E + k over a toe of width e₀, for ε >= 0.
    In compression T = k ε, because the exponential would grow without bound.  Value and
    tangent are continuous at 0, and the energy is convex.

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
        If E or e₀ is not a positive finite number, k is not a finite number >= 0, or e₀
        exceeds 1.

    Examples
    --------
    >>> law = CrimpToe(1e5, toe=0.004, initial_stiffness=10.0)
    >>> law.tangent(np.array([-0.01, 0.0, 0.001])).astype(int)
    array([   10,    10, 22129])
    """

    domain: ClassVar[tuple[float, float]] = (-np.inf, np.inf)
    of: ClassVar[Resistance] = "tension"

    def __post_init__(self) -> None:
        E = number("stiffness", self.stiffness, above=0)
        e_0 = number("toe", self.toe, above=0)
        refuse_other_units("toe", e_0, "tension")
        k = number("initial stiffness", self.initial_stiffness)
        keep(self, stiffness=E, toe=e_0, initial_stiffness=k)

    @property
    def shown(self) -> tuple[float, float]:
        """Range of practical interest: from moderate compression to beyond the toe."""
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


# Strain over which one law changes into another. A wider transition softens the law
# over more of the small strains.  A narrower one changes the tangent faster, so that an
# iteration is more likely to step across it.
_WIDTH = 1e-4


class _Switched(ScalarLaw):
    """Laws for one or both signs of the strain, added, with smooth transitions."""

    of: ClassVar[Resistance] = "tension"
    width: float

    @property
    def _sides(self) -> tuple[tuple[Law, int], ...]:
        """Each law, and the sign of the strains for which it is given."""
        raise NotImplementedError

    def _check(self, *names: str) -> None:
        """Check the width, and the laws, whose names are for messages."""
        keep(self, width=number("width", self.width, above=0))
        for name, (law, sign) in zip(names, self._sides, strict=True):
            refuse_force_at_rest(name, inner_law(name, law), sign * self.width)

    def energy(self, x: ndarray) -> ndarray:
        """Sum of the energies, each at its strain r, less the energy at rest."""
        return self._energy(x) - self._energy(np.zeros(1))[0]

    def _energy(self, x: ndarray) -> Any:
        return sum(law.energy(sign * r.strain) for law, sign, r in self._ramps(x))

    def value(self, x: ndarray) -> ndarray:
        """Sum of T(r) r′."""
        return sum(
            law.value(sign * r.strain) * r.slope for law, sign, r in self._ramps(x)
        )

    def tangent(self, x: ndarray) -> ndarray:
        """Sum of T′(r) r′² + T(r) r″."""
        return sum(
            law.tangent(sign * r.strain) * r.slope**2
            + sign * law.value(sign * r.strain) * r.bend
            for law, sign, r in self._ramps(x)
        )

    def _ramps(self, x: ndarray) -> list[tuple[Law, int, "_Ramp"]]:
        return [(law, sign, _ramp(sign * x, self.width)) for law, sign in self._sides]


class _Ramp(NamedTuple):
    """Smoothed positive part of the strain, and its first two derivatives."""

    strain: ndarray
    slope: ndarray
    bend: ndarray


def _ramp(x: ndarray, width: float) -> _Ramp:
    s = np.clip((x + width) / (2 * width), 0.0, 1.0)
    curved = 2 * width * s**4 * (s * (s - 3) + 2.5)
    slope = s**3 * (s * (6 * s - 15) + 10)
    bend = 15 / width * (s * (1 - s)) ** 2
    return _Ramp(np.where(x >= width, x, curved), slope, bend)


@dataclass(frozen=True)
class TensionOnly(_Switched):
    """Law that is zero in compression, with a smooth transition.

    The tension is T(r) r′ of a strain r(ε): r = 0 below −width, r = ε above width, and
    r′ is a polynomial of degree five in between.  The tension equals the given law
    above the width and is exactly zero below −width. Value and tangent are continuous,
    and so is the second derivative of the value if it is for the given law. The value
    increases if the given law does. The tangent at rest is 0.40 times the tangent of
    the given law.

    Parameters
    ----------
    law
        Law in tension, zero at rest.  It is evaluated for r >= 0 only.
    width
        Strain at which the transition ends.

    Raises
    ------
    ValueError
        If the law is not zero at rest, ends before the width, or varies by element; or
        if the width is not a positive finite number.

    Examples
    --------
    >>> from skfem_textile import Linear
    >>> TensionOnly(Linear(1e4)).value(np.array([-0.01, 0.01]))
    array([  0., 100.])
    """

    law: Law
    width: float = _WIDTH

    def __post_init__(self) -> None:
        self._check("law")

    @property
    def _sides(self) -> tuple[tuple[Law, int], ...]:
        return ((self.law, 1),)

    @property
    def domain(self) -> tuple[float, float]:
        """The upper end of the law, and unbounded compression."""
        return -np.inf, domain_of(self.law)[1]

    @property
    def shown(self) -> tuple[float, float] | None:
        """Shown range of the law in tension, and a tenth of it in compression."""
        shown = getattr(self.law, "shown", None)
        return None if shown is None else (-0.1 * shown[1], shown[1])


@dataclass(frozen=True)
class Asymmetric(_Switched):
    """Different laws in tension and in compression, with a smooth transition.

    Each has a transition as in `TensionOnly`, and their tensions are added.  The
    tension equals the first law above the width and the second law below −width. For
    two laws of the same stiffness the tangent at rest is 0.79 times this stiffness.

    Parameters
    ----------
    tension, compression
        Laws for positive and for negative strain, each zero at rest.
    width
        Strain at which the transition ends on either side.

    Raises
    ------
    ValueError
        See `TensionOnly`, for either law.

    Examples
    --------
    >>> from skfem_textile import Linear
    >>> Asymmetric(Linear(1e4), Linear(10.0)).value(np.array([-0.01, 0.01]))
    array([ -0.1, 100. ])
    """

    tension: Law
    compression: Law
    width: float = _WIDTH

    def __post_init__(self) -> None:
        self._check("tension", "compression")

    @property
    def _sides(self) -> tuple[tuple[Law, int], ...]:
        return (self.tension, 1), (self.compression, -1)

    @property
    def domain(self) -> tuple[float, float]:
        """From the end of the law in compression to the end in tension."""
        return domain_of(self.compression)[0], domain_of(self.tension)[1]

    @property
    def shown(self) -> tuple[float, float] | None:
        """Shown range of each law on its side, if both are defined."""
        below, above = (
            getattr(law, "shown", None) for law in (self.compression, self.tension)
        )
        if below is None or above is None:
            return None
        return below[0], above[1]


# Upper bound and initial value of the strain in the search for the pretension.
_LARGEST, _FIRST = 10.0, 1e-6


@dataclass(frozen=True)
class Pretensioned(ScalarLaw):
    """Law of fibres with a pretension.

    The tension is T(ε + ε₀), where T(ε₀) is the pretension.  It reduces the toe of
    crimped fibres, and fibres with `TensionOnly` become slack after shortening by ε₀.
    For a linear law it is T₀ + E ε.

    Parameters
    ----------
    law
        Law of the fibres without pretension; it must increase.
    tension
        T₀ in N/mm.

    Raises
    ------
    ValueError
        If the tension is not a finite number >= 0, or the law does not reach it or
        varies by element.

    Examples
    --------
    >>> from skfem_textile import Linear
    >>> Pretensioned(Linear(1e3), 5.0).value(np.array([-0.005, 0.0, 0.001])).round(9)
    array([0., 5., 6.])
    """

    law: Law
    tension: float
    of: ClassVar[Resistance] = "tension"

    def __post_init__(self) -> None:
        keep(self, tension=number("pretension", self.tension))
        inner_law("law", self.law)
        _ = self.strain_before

    @cached_property
    def strain_before(self) -> float:
        """ε₀, by bisection to adjacent floating-point numbers."""
        low, high = 0.0, _FIRST
        if (at_rest := self._at(low)) > self.tension:
            raise ValueError(
                f"the law has a tension of {at_rest:.4g} N/mm at zero strain, more "
                f"than the pretension of {self.tension:g} N/mm"
            )
        if at_rest == self.tension:
            return low
        end = min(float(domain_of(self.law)[1]), _LARGEST)
        while self._at(min(high, end)) < self.tension:
            if high >= end:
                raise ValueError(
                    f"the law reaches only {self._at(end):.4g} N/mm at a strain of "
                    f"{end:.4g}, less than the pretension of {self.tension:g} N/mm"
                )
            low, high = high, 2 * high
        high = min(high, end)
        while low < (middle := 0.5 * (low + high)) < high:
            if self._at(middle) < self.tension:
                low = middle
            else:
                high = middle
        return high

    @property
    def domain(self) -> tuple[float, float]:
        """Domain of the law, shifted by the pre-strain."""
        low, high = domain_of(self.law)
        return low - self.strain_before, high - self.strain_before

    @property
    def shown(self) -> tuple[float, float] | None:
        """Shown range of the law."""
        shown = getattr(self.law, "shown", None)
        if shown is None:
            return None
        return shown[0] - self.strain_before, shown[1] - self.strain_before

    def energy(self, x: ndarray) -> ndarray:
        """Energy of the law, minus its energy at rest."""
        at_rest = self.law.energy(np.array([self.strain_before]))[0]
        return self.law.energy(x + self.strain_before) - at_rest

    def value(self, x: ndarray) -> ndarray:
        """T(ε + ε₀)."""
        return self.law.value(x + self.strain_before)

    def tangent(self, x: ndarray) -> ndarray:
        """T′(ε + ε₀)."""
        return self.law.tangent(x + self.strain_before)

    def _at(self, strain: float) -> float:
        return float(self.law.value(np.array([strain]))[0])
