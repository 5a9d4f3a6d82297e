"""Curves of tests in CSV files."""

import csv
import os
from pathlib import Path

import numpy as np
from numpy import ndarray

from ...mesh.user_input import excerpt, printable

#: Headings of the columns.
DISPLACEMENT, FORCE = "displacement (mm)", "force (N)"
ANGLE, NORMALISED = "angle (deg)", "normalised shear force (N/mm)"

#: Every heading that is known.
HEADINGS = DISPLACEMENT, FORCE, ANGLE, NORMALISED


def read_test_curve(path: str | os.PathLike[str]) -> dict[str, ndarray]:
    """Columns of the curve of a test by their headings.

    The first row names the columns, of `HEADINGS` in any order: at least a
    displacement or an angle, and at least one force.  Cells may be empty.

    Parameters
    ----------
    path
        The file, in UTF-8.

    Returns
    -------
    dict
        For each column that is there its numbers, shape (n,); NaN for empty cells.

    Raises
    ------
    ValueError
        If it is no such file; one line names the file and the row.
    OSError
        If it cannot be read.
    """
    file = printable(Path(path))
    try:
        with open(path, newline="", encoding="utf-8-sig") as opened:
            reader = csv.reader(opened)
            rows = [
                (reader.line_num, row) for row in reader if any(map(str.strip, row))
            ]
    except (UnicodeDecodeError, csv.Error):
        raise ValueError(f"{file}: no CSV file in UTF-8") from None
    headings = [cell.strip().lower() for cell in rows[0][1]] if rows else []
    known = {heading.lower(): heading for heading in HEADINGS}
    x, y = {DISPLACEMENT.lower(), ANGLE.lower()}, {FORCE.lower(), NORMALISED.lower()}
    sound = set(headings) <= set(known) and len(set(headings)) == len(headings)
    if not (sound and x & set(headings) and y & set(headings)):
        said = excerpt(",".join(rows[0][1])) if rows else ""
        raise ValueError(
            f"{file}, row 1: the header must name a displacement or an angle, and a "
            f"force, of {', '.join(map(repr, HEADINGS))}; got '{said}'"
        )
    numbers = [_numbers(file, line, row, len(headings)) for line, row in rows[1:]]
    if len(numbers) < 2:
        raise ValueError(f"{file}: a curve needs at least two rows of numbers")
    columns = np.array(numbers).T
    return {known[head]: column for head, column in zip(headings, columns, strict=True)}


def _numbers(file: str, line: int, row: list[str], n: int) -> list[float]:
    try:
        found = [float(cell) if cell.strip() else np.nan for cell in row]
    except ValueError:
        found = []
    named = [x for x, cell in zip(found, row, strict=False) if cell.strip()]
    if len(found) != n or not np.isfinite(named).all():
        raise ValueError(
            f"{file}, row {line}: '{excerpt(','.join(row))}' is not {n} finite numbers"
        )
    return found
