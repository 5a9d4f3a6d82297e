"""Polynomial law, in the argument or in its sine."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy import ndarray
from numpy.polynomial.polynomial import polyval

from ... import declarations as declared
from ..law import ScalarLaw, keep


@dataclass(frozen=True)
class Polynomial(declared.Polynomial, ScalarLaw):
    """Law Σ cₖ sᵏ of s = x, or of s = sin x.

    Parameters
    ----------
    coefficients
        c₁, c₂, ... in N/mm.
    sine
        True if it is a polynomial in the sine of the argument.
    odd
        True if the polynomial is continued as an odd function for negative arguments,
        as intended for even powers in a fit to a shear test.

    Raises
    ------
    ValueError
        If there is no coefficient, or one is not finite.

    Examples
    --------
    >>> law = Polynomial((0.1, 0.0, 0.6))
    >>> law.value(np.array([0.5]))
    array([0.125])
    """

    domain: ClassVar[tuple[float, float]] = (-np.inf, np.inf)

    def __post_init__(self) -> None:
        try:
            coefficients = tuple(float(one) for one in self.coefficients)
        except (TypeError, ValueError):
            coefficients = ()
        if not (coefficients and np.isfinite(coefficients).all()):
            raise ValueError(
                f"coefficients must be finite numbers, got {self.coefficients!r}"
            )
        sine, odd = bool(self.sine), bool(self.odd)
        keep(self, coefficients=coefficients, sine=sine, odd=odd)

    def energy(self, x: ndarray) -> ndarray:
        """Integral of the value from 0."""
        a = self._side(x)[0]
        if self.sine:
            powers = _integrals(a, len(self.coefficients))
            return sum(
                (c * p for c, p in zip(self.coefficients, powers, strict=True)),
                np.zeros(np.shape(x)),
            )
        return polyval(a, [0, 0, *(c / k for k, c in enumerate(self.coefficients, 2))])

    def value(self, x: ndarray) -> ndarray:
        """The polynomial."""
        a, sign = self._side(x)
        return sign * polyval(np.sin(a) if self.sine else a, [0, *self.coefficients])

    def tangent(self, x: ndarray) -> ndarray:
        """Derivative of the polynomial."""
        a = self._side(x)[0]
        dc = [k * c for k, c in enumerate(self.coefficients, 1)]
        return polyval(np.sin(a), dc) * np.cos(a) if self.sine else polyval(a, dc)

    def _side(self, x: ndarray) -> tuple[ndarray, ndarray | float]:
        """Argument of the polynomial, and the sign of its value."""
        x = np.asarray(x, dtype=float)
        return (np.abs(x), np.sign(x)) if self.odd else (x, 1.0)


def _integrals(x: ndarray, n: int) -> list[ndarray]:
    """∫ sinᵏ from 0 to x for k = 1 to n: by parts, from the integral for k − 2."""
    s, c = np.sin(x), np.cos(x)
    integrals = [x, 2 * np.sin(x / 2) ** 2]
    for k in range(2, n + 1):
        integrals.append(((k - 1) * integrals[k - 2] - s ** (k - 1) * c) / k)
    return integrals[1 : n + 1]
