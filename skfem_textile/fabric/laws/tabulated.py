"""A law through measured points."""

import csv
import logging
import os
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, Literal, NamedTuple, Self

import numpy as np
from numpy import ndarray
from numpy.typing import ArrayLike

from ...mesh.user_input import excerpt, number_of_text, printable, real_numbers
from ..law import Resistance, ScalarLaw, refuse_other_units

# What each column is called, and its units: how much a unit is in radians, strain, or
# N/mm.  A moment per area in N·mm/mm² is a number of N/mm.
_DEGREE = np.pi / 180
#: How much units of an angle are in radians.
ANGLE = {"deg": _DEGREE, "°": _DEGREE, "degrees": _DEGREE, "rad": 1.0, "radians": 1.0}
_MOMENT = dict.fromkeys(("N mm/mm2", "N mm/mm²", "N·mm/mm²", "N/mm"), 1.0)
# The shear force over the side of the frame, from which the moment is had by cos γ.
_NORMALISED = "normalised shear force"
_COLUMNS: dict[Resistance, tuple[dict[str, dict[str, float]], ...]] = {
    "shear": (
        {"shear angle": ANGLE},
        {"moment": _MOMENT, "shear moment": _MOMENT, _NORMALISED: {"N/mm": 1.0}},
    ),
    "tension": (
        {"fibre strain": {"-": 1.0, "1": 1.0, "%": 0.01}},
        {"tension": {"N/mm": 1.0, "kN/m": 1.0}},
    ),
}
_LIKE: dict[Resistance, str] = {
    "shear": "shear angle (deg),moment (N mm/mm2)",
    "tension": "fibre strain (-),tension (N/mm)",
}

#: The heading of a column: what it is, and its unit in round or square brackets.
HEADING = re.compile(r"\s*(.*?)\s*[(\[]\s*(.*?)\s*[)\]]\s*")

# What files of columns have that are no commas.
_NO_COMMAS = {";": "semicolons", "\t": "tabs"}


def refuse_bad_points(
    arguments: Sequence[float] | ndarray,
    values: Sequence[float] | ndarray,
    rows: Sequence[int],
    row: str = "row",
) -> None:
    """Refuse points through which no law goes.

    Parameters
    ----------
    arguments, values
        The points.
    rows
        The number of each, for the message.
    row
        What a point is called there.

    Raises
    ------
    ValueError
        If there are fewer than two, or one is not finite, or an argument is not larger
        than the one before.
    """
    if len(rows) < 2:
        raise ValueError(f"a table needs at least two points, got {len(rows)}")
    for number, x, y in zip(rows, arguments, values, strict=True):
        if not (np.isfinite(x) and np.isfinite(y)):
            raise ValueError(f"{row} {number}: {x:g}, {y:g} are not finite numbers")
    falls = np.flatnonzero(np.diff(np.asarray(arguments)) <= 0)
    if falls.size:
        i = int(falls[0])
        raise ValueError(
            f"{row} {rows[i + 1]}: {arguments[i + 1]:g} comes after {arguments[i]:g}; "
            "the first column must increase"
        )


def read_table(
    path: str | os.PathLike[str], of: Resistance | None = None
) -> tuple[ndarray, ndarray]:
    """Arguments and values of the law in a CSV file of two columns.

    The first row names them, with their units in brackets: ``shear angle (deg),moment
    (N mm/mm2)``, the angle in ``deg`` or ``rad``; or ``fibre strain (-),tension
    (N/mm)``, the strain as a number or in ``%``.  A ``normalised shear force (N/mm)``
    F_n is read as the moment F_n cos γ (Cao et al. 2008).

    Parameters
    ----------
    path
        The file, in UTF-8.
    of
        Which of the two it must be; either if not given.

    Returns
    -------
    tuple of ndarray
        Radians or strains, and N/mm.

    Raises
    ------
    ValueError
        If it is no such file; one line names the file and the row.
    OSError
        If it cannot be read.
    """
    file, lines = read_lines(path)
    (x_unit, y_unit), normalised, of = _units(file, lines[0][1], of)
    numbers = [_numbers(file, *line) for line in lines[1:]]
    x, y = np.reshape(numbers, (-1, 2)).T
    try:
        refuse_bad_points(x, y, [line for line, _ in lines[1:]])
    except ValueError as error:
        raise ValueError(f"{file}, {error}") from None
    x, y = x * x_unit, y * y_unit
    for (line, _), argument in zip(lines[1:], x, strict=True):
        refuse_other_units(f"{file}, row {line}", argument, of, x_unit == 1)
    return x, y * np.cos(x) if normalised else y


def read_lines(path: str | os.PathLike[str]) -> tuple[str, list[tuple[int, list[str]]]]:
    """The lines of a CSV file that are not empty.

    Returns
    -------
    tuple
        What to call the file in a message, and of each line its number and cells.

    Raises
    ------
    ValueError
        If it is no CSV file in UTF-8, it is empty, or its columns are not separated by
        commas; one line names the file.
    OSError
        If it cannot be read.
    """
    file = printable(Path(path))
    try:
        with open(path, newline="", encoding="utf-8-sig") as opened:
            reader = csv.reader(opened)
            rows = [(reader.line_num, row) for row in reader]
    except (UnicodeDecodeError, csv.Error):
        raise ValueError(f"{file}: no CSV file in UTF-8") from None
    lines = [(line, row) for line, row in rows if any(map(str.strip, row))]
    if not lines:
        raise ValueError(f"{file}: the file is empty")
    (_, header), *_ = lines
    for sign, name in _NO_COMMAS.items():
        if len(header) == 1 and sign in header[0]:
            raise ValueError(
                f"{file}: columns are separated by {name}: separate them by commas, "
                "and write numbers with decimal points"
            )
    return file, lines


def _units(
    file: str, header: list[str], of: Resistance | None
) -> tuple[tuple[float, float], bool, Resistance]:
    """Factors of both columns, whether the force is normalised, and which law it is."""
    headings = [HEADING.fullmatch(cell) for cell in header]
    for kind in _COLUMNS if of is None else (of,):
        if len(headings) != 2:
            break
        found = [
            heading and names.get(heading[1].lower(), {}).get(heading[2])
            for heading, names in zip(headings, _COLUMNS[kind], strict=True)
        ]
        if all(found):
            normalised = headings[1][1].lower() == _NORMALISED  # type: ignore[index]
            units: Any = found
            return (units[0], units[1]), normalised, kind
    expected = " or ".join(repr(_LIKE[kind]) for kind in ([of] if of else _LIKE))
    raise ValueError(
        f"{file}, row 1: the header must be like {expected}, got "
        f"'{excerpt(','.join(header))}'"
    )


def _numbers(file: str, line: int, row: list[str]) -> tuple[float, float]:
    try:
        x, y = map(number_of_text, row)
    except ValueError:
        raise ValueError(
            f"{file}, row {line}: '{excerpt(','.join(row))}' is not two numbers"
        ) from None
    return x, y


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
        rise, the table is not extrapolated and goes beyond a right angle or leaves out
        0, or an odd law has negative arguments or does not vanish at 0.

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
        if self.extrapolation == "refuse":  # decks extrapolate from anywhere
            refuse_other_units("the table", x, None)
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
