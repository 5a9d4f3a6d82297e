"""Points and closed curves in tables."""

import os

import numpy as np
from numpy import ndarray

from ...fabric.laws.tabulated import HEADING, read_lines, with_decimal_points
from ...mesh.user_input import IN_MM, errors_in, excerpt, number_of_text, refuse_unit
from ..rings import Curve


def curves_of_table(
    path: str | os.PathLike[str], unit: str | None = None
) -> list[Curve]:
    """Closed curves of a table with the columns x and y.

    Rows with different values in a column ``curve`` belong to different curves.  Tables
    of `skfem_textile.io.write_pattern` are such tables.

    Parameters
    ----------
    path
        The file; see `points_of_table`.
    unit
        Unit of columns that name none.

    Raises
    ------
    ValueError
        See `points_of_table`; also if the unit is unknown.
    OSError
        If the file cannot be read.
    """
    refuse_unit(unit)
    points, numbers = points_of_table(path, "xy", unit)
    curves = []
    for number in dict.fromkeys(numbers):
        one = points[[own == number for own in numbers]].T
        where = f"curve {excerpt(number)}" if number else "its rows"
        curves.append(Curve(np.hstack([one, one[:, :1]]), "", where, ()))
    return curves


def points_of_table(
    path: str | os.PathLike[str], axes: str, unit: str | None = None
) -> tuple[ndarray, list[str]]:
    """Points in a table in mm, shape (n, n_axes), and their cells of a column curve.

    Parameters
    ----------
    path
        A table with a column for each axis, in UTF-8; the columns are separated by
        commas, semicolons, tabs or spaces.  Without a header it has these columns only.
    axes
        Names of the columns, such as ``xyz``.
    unit
        Unit of columns that name none, mm by default.

    Raises
    ------
    ValueError
        If the table is not valid; one line names the file and the row.
    OSError
        If it cannot be read.
    """
    file, lines = read_lines(path)
    first = lines[0][1]
    is_heading = first[0].lstrip().startswith("#")
    first[0] = first[0].lstrip().removeprefix("#")
    words = ",".join(lines[0][1]).split()
    if len(first) == 1 or (len(words) == len(axes) and all(map(_is_number, words))):
        lines = _split_at_spaces(file, lines, axes)
    number, head = lines[0]
    if len(head) == len(axes) and all(map(_is_number, head)) and not is_heading:
        lines[0] = number, [cell.replace(",", ".") for cell in head]
        columns, scale = [*range(len(axes))], np.full(len(axes), IN_MM[unit or "mm"])
        of_curve = -1
    else:
        columns, scale, of_curve = _columns(file, head, axes, unit)
        del lines[0]
    points, curves = [], []
    for number, row in lines:
        try:
            points.append([number_of_text(row[column]) for column in columns])
            curves.append(row[of_curve].strip() if of_curve >= 0 else "")
            if not np.isfinite(points[-1]).all():
                raise ValueError
        except (ValueError, IndexError):
            shown = excerpt(",".join(row))
            count = {2: "two", 3: "three"}[len(axes)]
            raise ValueError(
                f"{file}, row {number}: expected {count} finite coordinates, got "
                f"'{shown}'"
            ) from None
    return scale * np.reshape(points, (-1, len(axes))), curves


def _split_at_spaces(
    file: str, lines: list[tuple[int, list[str]]], axes: str
) -> list[tuple[int, list[str]]]:
    """Rows with spaces between the columns, numbers with decimal points."""
    (first, head), *others = [(k, ",".join(row).split()) for k, row in lines]
    if not all(map(_is_number, head := _joined_units(head))):
        _columns(file, head, axes)
    with errors_in(f"{file}: "):
        return [(first, head), *with_decimal_points(others)]


def _joined_units(words: list[str]) -> list[str]:
    """Headings of a row of words, of which those in brackets are units."""
    joined: list[str] = []
    for word in words:
        if joined and word[0] in "([":
            joined[-1] += f" {word}"
        else:
            joined.append(word)
    return joined


def _is_number(cell: str) -> bool:
    try:
        number_of_text(cell.replace(",", "."))
    except ValueError:
        return False
    return True


def _columns(
    file: str, header: list[str], axes: str, given: str | None = None
) -> tuple[list[int], ndarray, int]:
    """Columns of the axes, their units in mm, and the column of curves or −1."""
    found = [HEADING.fullmatch(cell) for cell in header]
    names = [
        (one[1] if one else cell).strip().lower()
        for one, cell in zip(found, header, strict=True)
    ]
    if any(names.count(axis) != 1 for axis in axes):
        raise ValueError(
            f"{file}, row 1: the header must name the columns {', '.join(axes[:-1])} "
            f"and {axes[-1]}"
        )
    columns = [names.index(axis) for axis in axes]
    in_mm = np.full(len(axes), IN_MM[given or "mm"])
    for i, column in enumerate(columns):
        if (one := found[column]) is None:
            continue
        if (unit := one[2].lower()) not in IN_MM:
            raise ValueError(
                f"{file}, row 1: the unit must be one of {', '.join(IN_MM)}, got "
                f"'{excerpt(unit)}'"
            )
        if given not in (None, unit):
            raise ValueError(
                f"{file}, row 1: the table is in {unit}, and the given unit is "
                f"{given}: omit one of them"
            )
        in_mm[i] = IN_MM[unit]
    return columns, in_mm, names.index("curve") if "curve" in names else -1
