"""Bending law with two stiffnesses."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy import ndarray

from ... import declarations as declared
from ..law import Resistance, ScalarLaw, keep, number, refuse_other_units


@dataclass(frozen=True)
class Bilinear(declared.Bilinear, ScalarLaw):
    """Moment M(κ) with two stiffnesses, the same for both signs of the curvature.

    The slope is D up to a curvature κ₁ and D₁ beyond it: M = D κ and M = D κ₁ + D₁ (κ −
    κ₁).  The slope changes linearly between (1 − r) κ₁ and (1 + r) κ₁, so that the
    tangent is continuous.

    Parameters
    ----------
    stiffness
        D per width of ply in N·mm, up to the knee.
    knee
        κ₁ in 1/mm.
    further_stiffness
        D₁ in N·mm, beyond the knee.
    rounding
        r, half of the transition relative to κ₁, above 0 and at most 1.

    Raises
    ------
    ValueError
        If D or κ₁ is not a positive finite number, κ₁ is of a radius below 1 mm, D₁ is
        not a finite number >= 0, or r is not above 0 and at most 1.

    Examples
    --------
    >>> law = Bilinear(100.0, knee=1e-3, further_stiffness=20.0)
    >>> law.value(np.array([-0.5e-3, 1e-3, 2e-3])).round(6)
    array([-0.05 ,  0.098,  0.12 ])
    """

    domain: ClassVar[tuple[float, float]] = (-np.inf, np.inf)
    of: ClassVar[Resistance] = "bending"

    def __post_init__(self) -> None:
        D = number("stiffness", self.stiffness, above=0)
        knee = number("knee", self.knee, above=0)
        refuse_other_units("knee", knee, "bending")
        further = number("further stiffness", self.further_stiffness)
        rounding = number("rounding", self.rounding, above=0)
        if rounding > 1:
            raise ValueError(f"rounding must be at most 1, got {rounding:g}")
        keep(self, stiffness=D, knee=knee, further_stiffness=further, rounding=rounding)

    @property
    def shown(self) -> tuple[float, float]:
        """Range of practical interest: to three times the knee, a radius >= 1 mm."""
        most = min(3 * self.knee, 1.0)
        return -most, most

    def energy(self, x: ndarray) -> ndarray:
        """Integral of the moment from 0."""
        size, s, past, width = self._transition(x)
        change = 2 / 3 * width**2 * s**3 + (width + 0.5 * past) * past
        return 0.5 * self.stiffness * size**2 + self._less * change

    def value(self, x: ndarray) -> ndarray:
        """The moment."""
        size, s, past, width = self._transition(x)
        value = self.stiffness * size + self._less * (width * s**2 + past)
        return np.copysign(value, x)

    def tangent(self, x: ndarray) -> ndarray:
        """The slope."""
        return self.stiffness + self._less * self._transition(x)[1]

    @property
    def _less(self) -> float:
        return self.further_stiffness - self.stiffness

    def _transition(self, x: ndarray) -> tuple[ndarray, ndarray, ndarray, float]:
        """|κ|, position in the transition from 0 to 1, distance beyond it, and r κ₁."""
        size, width = np.abs(np.asarray(x, dtype=float)), self.rounding * self.knee
        s = np.clip((size - self.knee + width) / (2 * width), 0.0, 1.0)
        return size, s, np.maximum(size - self.knee - width, 0.0), width
