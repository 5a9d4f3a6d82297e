"""Curves of tests, read from CSV files whose columns have units."""

import os
import re
from collections.abc import Iterable, Mapping

import numpy as np
from numpy import ndarray

from ..fabric.files.table_file import ANGLE, HEADING, read_lines
from ..mesh.user_input import excerpt, number_of_text

_LENGTH = {"mm": 1.0, "cm": 10.0, "m": 1000.0, "in": 25.4}
_FORCE = {"N": 1.0, "kN": 1000.0, "cN": 0.01, "lbf": 4.4482216152605}
_STRAIN = {"-": 1.0, "1": 1.0, "%": 0.01}
_FORCE_PER_LENGTH = {"N/mm": 1.0, "kN/m": 1.0}

#: Columns of a test by name: how much their units are in mm, N, radians, strain and
#: N/mm.
COLUMNS: dict[str, dict[str, float]] = {
    "displacement": _LENGTH,
    "force": _FORCE,
    "shear angle": ANGLE,
    "normalised shear force": _FORCE_PER_LENGTH,
    "warp strain": _STRAIN,
    "weft strain": _STRAIN,
    "warp force": _FORCE,
    "weft force": _FORCE,
}

# Other names of the columns.
_ALSO = {"angle": "shear angle", "extension": "displacement", "load": "force"}

# Numbers beyond are none of a test, and smaller ones are zero: squares are taken.
_LARGEST, _SMALLEST = 1e50, 1e-50

_SPACES = re.compile(r"[\s_]+")


def read_curve(
    path: str | os.PathLike[str],
    units: Mapping[str, str] | None = None,
    gaps: bool = False,
) -> dict[str, ndarray]:
    """The columns of a test, in mm, N, radians, N/mm, and strains as numbers.

    The first row names the columns, with their units in round or square brackets:
    ``displacement (mm),force (N)``, in any order.  Names are those of `COLUMNS`; other
    columns are passed over.

    Parameters
    ----------
    path
        The file, in UTF-8.
    units
        Units of columns by their names; they count more than those of the first row.
    gaps
        Whether cells may be empty; they are nan then.

    Returns
    -------
    dict of ndarray
        By name, each of shape (n_points,).

    Raises
    ------
    ValueError
        If it is no such file; one line names the file and the row or column.
    OSError
        If it cannot be read.
    """
    file, lines = read_lines(path)
    header = lines[0][1]
    found: dict[str, tuple[int, float]] = {}
    for i, cell in enumerate(header):
        name, unit = _heading(cell)
        if name not in COLUMNS:
            continue
        if name in found:
            raise ValueError(f"{file}, row 1: there are two columns {name!r}")
        found[name] = i, _factor(file, name, (units or {}).get(name, unit))
    if not found:
        raise ValueError(
            f"{file}, row 1: the first row must name columns, and none is one of "
            f"{', '.join(COLUMNS)}: got '{excerpt(','.join(header))}'"
        )
    if len(lines) < 2:
        raise ValueError(f"{file}: there are no points")
    rows = [_numbers(file, *line, found.values(), gaps) for line in lines[1:]]
    return dict(zip(found, np.transpose(rows), strict=True))


def column_named(word: str) -> str:
    """The name of a column, or what it is also called, as `COLUMNS` has it."""
    name = _SPACES.sub(" ", word.strip().lower())
    return _ALSO.get(name, name)


def _heading(cell: str) -> tuple[str, str]:
    """Name and unit of a column; the unit is empty where none is given."""
    heading = HEADING.fullmatch(cell)
    name, unit = (heading[1], heading[2]) if heading else (cell, "")
    return column_named(name), unit


def _factor(file: str, name: str, unit: str) -> float:
    allowed = COLUMNS[name]
    if unit in allowed:
        return allowed[unit]
    said = (
        f"the unit '{excerpt(unit)}', which is none"
        if unit
        else "no unit, which is one"
    )
    if unit in {u for other, units in COLUMNS.items() if other != name for u in units}:
        raise ValueError(
            f"{file}: the column {name!r} has the unit '{unit}', which is none of "
            f"{', '.join(allowed)}: look whether columns are swapped"
        )
    raise ValueError(
        f"{file}: the column {name!r} has {said} of {', '.join(allowed)}: name it in "
        f"the first row, like '{name} ({next(iter(allowed))})', or by an option"
    )


def _numbers(
    file: str,
    line: int,
    row: list[str],
    columns: Iterable[tuple[int, float]],
    gaps: bool,
) -> list[float]:
    try:
        numbers = [
            np.nan if gaps and not row[i].strip() else _finite(row[i], factor)
            for i, factor in columns
        ]
    except (ValueError, IndexError):
        raise ValueError(
            f"{file}, row {line}: '{excerpt(','.join(row))}' lacks a finite number "
            f"below {_LARGEST:g}"
        ) from None
    return numbers


def _finite(cell: str, factor: float) -> float:
    number = number_of_text(cell) * factor
    if not abs(number) < _LARGEST:
        raise ValueError
    return number if abs(number) > _SMALLEST else 0.0
