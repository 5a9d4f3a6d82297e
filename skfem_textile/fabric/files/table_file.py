"""Points of a measured law: which are refused, and the CSV file they come from."""

import csv
import os
import re
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy import ndarray

from ...mesh.user_input import excerpt, number_of_text, printable
from ...registration import Resistance

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
    (x_unit, y_unit), normalised = _units(file, lines[0][1], of)
    numbers = [_numbers(file, *line) for line in lines[1:]]
    x, y = np.reshape(numbers, (-1, 2)).T
    try:
        refuse_bad_points(x, y, [line for line, _ in lines[1:]])
    except ValueError as error:
        raise ValueError(f"{file}, {error}") from None
    x, y = x * x_unit, y * y_unit
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
) -> tuple[tuple[float, float], bool]:
    """How much the units of the two columns are; whether the force is normalised."""
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
            return (found[0], found[1]), normalised  # type: ignore[return-value]
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
