"""Tabulated law through measured points."""

import csv
import logging
import os
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any, Literal, NamedTuple, Self

import numpy as np
from numpy import ndarray
from numpy.typing import ArrayLike

from ...mesh.user_input import (
    errors_in,
    excerpt,
    number_of_text,
    printable,
    real_numbers,
)
from ..law import Resistance, ScalarLaw, keep, refuse_other_units

# Names of the columns, and factors of their units to radians, strain, 1/mm, N/mm or
# N·mm/mm.  A moment per area in N·mm/mm² equals N/mm, one per width in N·mm/mm a force.
_DEGREE = np.pi / 180
#: Factors of angle units to radians.
ANGLE = {"deg": _DEGREE, "°": _DEGREE, "degrees": _DEGREE, "rad": 1.0, "radians": 1.0}
_MOMENT = dict.fromkeys(("N mm/mm2", "N mm/mm²", "N·mm/mm²", "N/mm"), 1.0)
#: Factors of the units of curvatures to 1/mm, and of moments per width to N·mm/mm.
CURVATURE = {
    **{"1/mm": 1.0, "mm-1": 1.0, "1/cm": 0.1, "cm-1": 0.1, "1/m": 1e-3, "m-1": 1e-3}
}
_GRAM = 9.80665e-3
BENDING_MOMENT = {
    **dict.fromkeys(("N mm/mm", "N·mm/mm", "N m/m", "N·m/m", "N"), 1.0),
    **dict.fromkeys(("mN mm/mm", "mN·mm/mm", "mN"), 1e-3),
    **dict.fromkeys(("gf cm/cm", "gf·cm/cm"), _GRAM),
}
# Shear force per side length of the frame; the moment is this times cos γ.
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
    "bending": (
        {"curvature": CURVATURE},
        {"moment": BENDING_MOMENT, "bending moment": BENDING_MOMENT},
    ),
}
_LIKE: dict[Resistance, str] = {
    "shear": "shear angle (deg),moment (N mm/mm2)",
    "tension": "fibre strain (-),tension (N/mm)",
    "bending": "curvature (1/mm),moment (N mm/mm)",
}

#: Header of a column: its name, and its unit in round or square brackets.
HEADING = re.compile(r"\s*(.*?)\s*[(\[]\s*(.*?)\s*[)\]]\s*")

# Separators of columns besides commas; numbers between them may have decimal commas.
_SEPARATORS = (";", "\t")


def refuse_bad_points(
    arguments: Sequence[float] | ndarray,
    values: Sequence[float] | ndarray,
    rows: Sequence[int],
    row: str = "row",
) -> None:
    """Refuse points that do not define a law.

    Parameters
    ----------
    arguments, values
        The points.
    rows
        Number of each point, for the message.
    row
        Name of a point in the message.

    Raises
    ------
    ValueError
        If there are fewer than two, one is not finite, or an argument does not exceed
        the previous one.
    """
    if len(rows) < 2:
        raise ValueError(f"a table requires at least two points, got {len(rows)}")
    for number, x, y in zip(rows, arguments, values, strict=True):
        if not (np.isfinite(x) and np.isfinite(y)):
            raise ValueError(
                f"{row} {number}: both numbers must be finite, got {x:g}, {y:g}"
            )
    falls = np.flatnonzero(np.diff(np.asarray(arguments)) <= 0)
    if falls.size:
        i = int(falls[0])
        raise ValueError(
            f"{row} {rows[i + 1]}: the argument {arguments[i + 1]:g} must be larger "
            f"than the previous one, {arguments[i]:g}"
        )


def read_table(
    path: str | os.PathLike[str], of: Resistance | None = None
) -> tuple[ndarray, ndarray]:
    """Arguments and values of a law in a two-column CSV file.

    The first row names them, with their units in brackets: ``shear angle (deg),moment
    (N mm/mm2)``, the angle in ``deg`` or ``rad``; or ``fibre strain (-),tension
    (N/mm)``, the strain as a number or in ``%``; or ``curvature (1/mm),moment (N
    mm/mm)``, of bending, also in ``1/cm``, ``1/m``, ``N``, ``mN`` or ``gf cm/cm``.  A
    ``normalised shear force (N/mm)`` F_n is converted to the moment F_n cos γ (Cao et
    al.  2008).

    Parameters
    ----------
    path
        The file, in UTF-8.
    of
        Required quantity; by default any.

    Returns
    -------
    tuple of ndarray
        Radians, strains or curvatures in 1/mm, and N/mm or N·mm/mm.

    Raises
    ------
    ValueError
        If the file is not valid; one line names the file and the row.
    OSError
        If it cannot be read.
    """
    file, lines = read_lines(path)
    (x_unit, y_unit), normalised, of = _units(file, lines[0][1], of)
    numbers = [_numbers(file, *line) for line in lines[1:]]
    x, y = np.reshape(numbers, (-1, 2)).T
    with errors_in(f"{file}, "):
        refuse_bad_points(x, y, [line for line, _ in lines[1:]])
    x, y = x * x_unit, y * y_unit
    for (line, _), argument in zip(lines[1:], x, strict=True):
        refuse_other_units(f"{file}, row {line}", argument, of, x_unit == 1)
    return x, y * np.cos(x) if normalised else y


def read_lines(path: str | os.PathLike[str]) -> tuple[str, list[tuple[int, list[str]]]]:
    """Non-empty lines of a CSV file with commas, semicolons or tabs.

    Decimal commas of the rows below the header are replaced by points.

    Returns
    -------
    tuple
        Name of the file for messages, and number and cells of each line.

    Raises
    ------
    ValueError
        If it is not a CSV file in UTF-8, is empty, or has both decimal points and
        commas; one line names the file.
    OSError
        If it cannot be read.
    """
    file = printable(Path(path))
    with errors_in(f"{file}: "):
        return file, lines_of(Path(path).read_bytes())


def lines_of(content: bytes) -> list[tuple[int, list[str]]]:
    """Number and cells of the lines of a CSV file; see `read_lines`."""
    try:
        text = content.decode("utf-8-sig")
        first = next(filter(str.strip, text.splitlines()), "")
        separator = next((sign for sign in _SEPARATORS if sign in first), ",")
        reader = csv.reader(text.splitlines(), delimiter=separator, strict=True)
        rows = [(reader.line_num, row) for row in reader]
    except (UnicodeDecodeError, csv.Error):
        raise ValueError("the file is not a CSV file in UTF-8") from None
    lines = [(line, row) for line, row in rows if any(map(str.strip, row))]
    if not lines:
        raise ValueError("the file is empty")
    if separator != ",":
        lines[1:] = with_decimal_points(lines[1:])
    return lines


def with_decimal_points(
    lines: list[tuple[int, list[str]]],
) -> list[tuple[int, list[str]]]:
    """Rows of numbers with decimal points instead of commas."""
    marks = {mark for _, row in lines for mark in ".," if mark in "".join(row)}
    if len(marks) == 2:
        raise ValueError("numbers have both decimal points and commas")
    return [(line, [cell.replace(",", ".") for cell in row]) for line, row in lines]


def _units(
    file: str, header: list[str], of: Resistance | None
) -> tuple[tuple[float, float], bool, Resistance]:
    """Factors of both columns, whether the force is normalised, and the quantity."""
    headings = [HEADING.fullmatch(cell) for cell in header]
    for kind in _COLUMNS if of is None else (of,):
        if len(headings) != 2:
            break
        matching = [
            heading and names.get(heading[1].lower(), {}).get(heading[2])
            for heading, names in zip(headings, _COLUMNS[kind], strict=True)
        ]
        if all(matching):
            normalised = headings[1][1].lower() == _NORMALISED  # type: ignore[index]
            units: Any = matching
            return (units[0], units[1]), normalised, kind
    expected = " or ".join(repr(_LIKE[kind]) for kind in ([of] if of else _LIKE))
    raise ValueError(
        f"{file}, row 1: the header must be of the form {expected}, got "
        f"'{excerpt(','.join(header))}'"
    )


def _numbers(file: str, line: int, row: list[str]) -> tuple[float, float]:
    try:
        x, y = map(number_of_text, row)
    except ValueError:
        raise ValueError(
            f"{file}, row {line}: two numbers are required, got "
            f"'{excerpt(','.join(row))}'"
        ) from None
    return x, y


log = logging.getLogger(__name__)

_EXTRAPOLATIONS = ("refuse", "linear")


class _Curve(NamedTuple):
    """Piecewise cubic: integral, value and slope."""

    energy: Callable[[ndarray], ndarray]
    value: Callable[[ndarray], ndarray]
    tangent: Callable[[ndarray], ndarray]


@dataclass(frozen=True)
class Tabulated(ScalarLaw):
    """Law through points: piecewise cubic, C¹, and monotone where the points are.

    The interpolation is PCHIP of SciPy.  A table whose points lie on a straight line is
    the linear law.

    Parameters
    ----------
    arguments
        Fibre strains, shear angles in radians, or curvatures in 1/mm, in ascending
        order.
    values
        Tension or shear moment in N/mm, or bending moment in N·mm/mm, at each of them.
    extrapolation
        ``refuse``: the domain ends with the table, and states beyond it are refused.
        ``linear``: the law is continued as a straight line, with one warning in the log
        at the first energy evaluated beyond the table: the load stepper evaluates
        energies only at converged states.
    odd
        True if a table for arguments >= 0 is continued as an odd function for negative
        ones.  The law is then zero at 0.

    Raises
    ------
    ValueError
        If there are fewer than two points, a point is not finite, the arguments do not
        increase, the table is not extrapolated and exceeds a right angle or excludes 0,
        or an odd law has negative arguments or is not zero at 0.

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
            real_numbers(name, values)
            for name, values in (("arguments", self.arguments), ("values", self.values))
        )
        if x.ndim != 1 or x.shape != y.shape:
            raise ValueError(
                "arguments and values must have the same number of values, got shapes "
                f"{x.shape} and {y.shape}"
            )
        refuse_bad_points(x, y, range(1, len(x) + 1), "point")
        if self.extrapolation == "refuse":  # decks extrapolate from any range
            refuse_other_units("the table", x, None)
        if self.extrapolation not in _EXTRAPOLATIONS:
            raise ValueError(
                f"extrapolation must be {' or '.join(_EXTRAPOLATIONS)}, got "
                f"{self.extrapolation!r}"
            )
        if self.odd and (x[0] < 0 or (x[0] == 0 and y[0] != 0)):
            raise ValueError(
                "an odd law must have arguments >= 0 and the value 0 at 0, but point "
                f"1 is {x[0]:g}, {y[0]:g}"
            )
        arguments, values = tuple(x.tolist()), tuple(y.tolist())
        keep(self, arguments=arguments, values=values, odd=bool(self.odd))
        low, high = self.domain
        if not low <= 0 <= high:
            raise ValueError(
                f"the table covers {low:g} to {high:g}, which excludes 0, the state "
                "at rest: add a point, or extrapolate"
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
        """Law of a two-column CSV file, see `read_table`.

        Parameters
        ----------
        path
            The file.
        extrapolation, odd
            See `Tabulated`.
        of
            Required quantity, ``tension``, ``shear`` or ``bending``; by default any.

        Raises
        ------
        ValueError
            If the file or the law is not valid; one line names the file.
        """
        x, y = read_table(path, of)
        with errors_in(f"{os.fspath(path)}: "):
            return cls(x, y, extrapolation, odd)

    @property
    def domain(self) -> tuple[float, float]:
        """Ends of the table; unbounded with extrapolation."""
        return self.shown if self.extrapolation == "refuse" else (-np.inf, np.inf)

    @property
    def shown(self) -> tuple[float, float]:
        """Ends of the table, symmetric if the law is odd."""
        x, _ = self.points
        return float(x[0]), float(x[-1])

    @cached_property
    def points(self) -> tuple[ndarray, ndarray]:
        """Arguments and values, of both signs if the law is odd."""
        x, y = np.array(self.arguments), np.array(self.values)
        if not self.odd:
            return x, y
        at_rest = x[0] == 0
        x, y = (part[1:] if at_rest else part for part in (x, y))
        x, y = (np.concatenate([-part[::-1], [0.0], part]) for part in (x, y))
        return x, y

    @cached_property
    def extrapolated(self) -> Self:
        """The law, continued beyond the table as a straight line."""
        return replace(self, extrapolation="linear")

    @cached_property
    def _curve(self) -> _Curve:
        from scipy.interpolate import PchipInterpolator  # not imported for other laws

        x, y = self.points
        with np.errstate(all="ignore"):
            steep = not np.isfinite(np.diff(y) / np.diff(x)).all()
        if steep:
            raise ValueError("the table overflows double precision")
        with np.errstate(over="ignore", invalid="ignore"):  # for undefined slopes
            value = PchipInterpolator(x, y)
        if not np.isfinite(value(x)).all():
            raise ValueError(
                "the values of the table are too large for cubic interpolation"
            )
        energy = value.antiderivative()
        return _Curve(energy, value, value.derivative())

    @cached_property
    def _energy_at_rest(self) -> float:
        return float(self._energy(np.zeros(()))[()])

    def energy(self, x: ndarray) -> ndarray:
        """Integral of the value from 0."""
        if self.extrapolation == "linear":
            self._warn_of_extrapolation(x)
        return self._energy(x) - self._energy_at_rest

    def _energy(self, x: ndarray) -> ndarray:
        within, past = self._split(x)
        energy = self._curve.energy(within)
        if past.any():
            slope = self._curve.tangent(within)
            energy += (self._curve.value(within) + 0.5 * slope * past) * past
        return energy

    def value(self, x: ndarray) -> ndarray:
        """Cubic between the neighbouring points."""
        within, past = self._split(x)
        value = self._curve.value(within)
        if past.any():
            value += self._curve.tangent(within) * past
        return value

    def tangent(self, x: ndarray) -> ndarray:
        """Derivative of the cubic."""
        within, past = self._split(x)
        return self._curve.tangent(within) + 0.0 * past

    def _split(self, x: ndarray) -> tuple[ndarray, ndarray]:
        """Nearest argument within the table, and distance; NaN if refused."""
        within = np.clip(x, *self.shown)
        past = x - within
        if self.extrapolation == "refuse":
            past = np.where(past == 0, 0.0, np.nan)
        return within, past

    def _warn_of_extrapolation(self, x: ndarray) -> None:
        low, high = self.shown
        if "_told" in vars(self) or not np.any((x < low) | (x > high)):
            return
        vars(self)["_told"] = True
        log.warning(
            "a law tabulated from %g to %g is extrapolated linearly to the argument %g",
            low,
            high,
            np.min(x) if np.min(x) < low else np.max(x),
        )
