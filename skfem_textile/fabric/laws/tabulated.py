"""A law through measured points."""

import logging
import os
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Literal, NamedTuple, Self

import numpy as np
from numpy import ndarray
from numpy.typing import ArrayLike

from ...mesh.user_input import real_numbers
from ...registration import LawRegistration, Option, Resistance
from ..files.table_file import read_table, refuse_bad_points
from ..law import ScalarLaw
from .polynomial import CONTINUATION

log = logging.getLogger(__name__)

_EXTRAPOLATIONS = ("refuse", "linear")


class _Curve(NamedTuple):
    """A cubic between each two points: its ends, its integral, itself, its slope."""

    low: float
    high: float
    energy: Callable[[ndarray], ndarray]
    value: Callable[[ndarray], ndarray]
    tangent: Callable[[ndarray], ndarray]


@dataclass(frozen=True)
class Tabulated(ScalarLaw):
    """A law through points: a cubic between each two, C¹ and monotone where they are.

    The interpolation is PCHIP of scipy.  A table whose points lie on a straight line is
    the linear law.

    Parameters
    ----------
    arguments
        Fibre strains, or shear angles in radians, in rising order.
    values
        Tension or shear moment in N/mm at each of them.
    extrapolation
        ``refuse``: the domain ends where the table does, and no state beyond is an
        answer.  ``linear``: the law goes on as a straight line, with one warning in the
        log.  It comes with the first energy beyond the table: the load stepper asks
        the energy of what it has found, and only the force of what it tries.
    odd
        Whether the law of a table for arguments >= 0 holds for negative ones with the
        sign of the value turned.  The law then vanishes at 0.

    Raises
    ------
    ValueError
        If there are fewer than two points, a point is not finite, the arguments do not
        rise, the table leaves out 0 and is not extrapolated, or an odd law has negative
        arguments or does not vanish at 0.

    Examples
    --------
    >>> law = Tabulated([0, 0.5, 1.0], [0, 0.1, 2.0], odd=True)
    >>> law.value(np.array([-1.0, 0.5])), law.domain
    (array([-2. ,  0.1]), (-1.0, 1.0))
    """

    arguments: ArrayLike
    values: ArrayLike
    extrapolation: Literal["refuse", "linear"] = "refuse"
    odd: bool = False

    def __post_init__(self) -> None:
        x, y = (
            real_numbers(name, given)
            for name, given in (("arguments", self.arguments), ("values", self.values))
        )
        if x.ndim != 1 or x.shape != y.shape:
            raise ValueError(
                "arguments and values must be two rows of as many numbers, got shapes "
                f"{x.shape} and {y.shape}"
            )
        refuse_bad_points(x, y, range(1, len(x) + 1), "point")
        if self.extrapolation not in _EXTRAPOLATIONS:
            raise ValueError(
                f"extrapolation must be {' or '.join(_EXTRAPOLATIONS)}, got "
                f"{self.extrapolation!r}"
            )
        if self.odd and (x[0] < 0 or (x[0] == 0 and y[0] != 0)):
            raise ValueError(
                "an odd law is given for arguments >= 0 and vanishes at 0, but point 1 "
                f"is {x[0]:g}, {y[0]:g}"
            )
        object.__setattr__(self, "arguments", tuple(x.tolist()))
        object.__setattr__(self, "values", tuple(y.tolist()))
        object.__setattr__(self, "odd", bool(self.odd))
        low, high = self.domain
        if not low <= 0 <= high:
            raise ValueError(
                f"the table goes from {low:g} to {high:g} and leaves out 0, where the "
                "ply is at rest: add a point, or extrapolate"
            )
        _ = self._curve

    @classmethod
    def from_csv(
        cls,
        path: str | os.PathLike[str],
        extrapolation: Literal["refuse", "linear"] = "refuse",
        odd: bool = False,
        of: Resistance | None = None,
    ) -> Self:
        """The law of a CSV file of two columns, which `read_table` describes.

        Parameters
        ----------
        path
            The file.
        extrapolation, odd
            As of the law.
        of
            Whether it must be a law of ``tension`` or ``shear``; either if not given.

        Raises
        ------
        ValueError
            If the file is refused, or the law; one line names the file.
        """
        x, y = read_table(path, of)
        try:
            return cls(x, y, extrapolation, odd)
        except ValueError as error:
            raise ValueError(f"{os.fspath(path)}: {error}") from None

    @property
    def domain(self) -> tuple[float, float]:
        """The ends of the table, or no ends with extrapolation."""
        return self.shown if self.extrapolation == "refuse" else (-np.inf, np.inf)

    @property
    def shown(self) -> tuple[float, float]:
        """The ends of the table, turned to both sides if the law is odd."""
        x, _ = self.points
        return float(x[0]), float(x[-1])

    @cached_property
    def points(self) -> tuple[ndarray, ndarray]:
        """Arguments and values, those of both signs if the law is odd."""
        x, y = np.array(self.arguments), np.array(self.values)
        if not self.odd:
            return x, y
        at_rest = x[0] == 0
        x, y = (part[1:] if at_rest else part for part in (x, y))
        x, y = (np.concatenate([-part[::-1], [0.0], part]) for part in (x, y))
        return x, y

    @cached_property
    def _curve(self) -> _Curve:
        from scipy.interpolate import PchipInterpolator  # not imported for other laws

        x, y = self.points
        with np.errstate(all="ignore"):
            steep = not np.isfinite(np.diff(y) / np.diff(x)).all()
        if steep:
            raise ValueError("the table rises faster than numbers go")
        with np.errstate(over="ignore", invalid="ignore"):  # of slopes that are none
            value = PchipInterpolator(x, y)
        if not np.isfinite(value(x)).all():
            raise ValueError("the table has values larger than a cubic can go through")
        energy = value.antiderivative()
        return _Curve(*self.shown, energy, value, value.derivative())

    @cached_property
    def _energy_at_rest(self) -> float:
        return float(self._energy(np.zeros(()))[()])

    def energy(self, x: ndarray) -> ndarray:
        """The integral of the value from 0."""
        if self.extrapolation == "linear":
            self._tell_extrapolation(x)
        return self._energy(x) - self._energy_at_rest

    def _energy(self, x: ndarray) -> ndarray:
        within, past = self._split(x)
        energy = self._curve.energy(within)
        if past.any():
            slope = self._curve.tangent(within)
            energy += (self._curve.value(within) + 0.5 * slope * past) * past
        return energy

    def value(self, x: ndarray) -> ndarray:
        """The cubic between the points on either side."""
        within, past = self._split(x)
        value = self._curve.value(within)
        if past.any():
            value += self._curve.tangent(within) * past
        return value

    def tangent(self, x: ndarray) -> ndarray:
        """The derivative of the cubic."""
        within, past = self._split(x)
        return self._curve.tangent(within) + 0.0 * past

    def _split(self, x: ndarray) -> tuple[ndarray, ndarray]:
        """The nearest argument of the table, and how far it is: NaN if refused."""
        low, high, *_ = self._curve
        within = np.clip(x, low, high)
        past = x - within
        if self.extrapolation == "refuse":
            past = np.where(past == 0, 0.0, np.nan)
        return within, past

    def _tell_extrapolation(self, x: ndarray) -> None:
        low, high = self.shown
        if "_told" in vars(self) or not np.any((x < low) | (x > high)):
            return
        vars(self)["_told"] = True
        log.warning(
            "a tabulated law of %g to %g is extrapolated in a straight line, as an "
            "argument is %g",
            low,
            high,
            np.min(x) if np.min(x) < low else np.max(x),
        )


def _from_file(path: str, of: Resistance, continuation: str, **other: Any) -> Tabulated:
    return Tabulated.from_csv(path, of=of, odd=continuation == "odd", **other)


REGISTRATION = LawRegistration(
    name="FILE.csv",
    description="a measured law, two columns under a header with units",
    build=_from_file,
    options=(
        Option(
            name="extrapolation",
            help="beyond the table: refuse every state, or go on in a straight line",
            default="refuse",
            choices=_EXTRAPOLATIONS,
        ),
        CONTINUATION,
    ),
    suffix=".csv",
    rank=1,
)
