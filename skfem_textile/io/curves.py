"""Curves in space from files: outlines, trimming curves and first threads."""

import os
from pathlib import Path

import numpy as np
from numpy import ndarray
from scipy.spatial import KDTree

from ..fabric.laws.tabulated import HEADING, read_lines, with_decimal_points
from ..mesh.user_input import IN_MM, excerpt, number_of_text, printable
from .file_numbers import errors_about

# Distance in mm between a curve of a DXF file and its chords, as of an outline.
_TOLERANCE = 0.01


def read_curve(path: str | os.PathLike[str], least: int = 2) -> ndarray:
    """Read a curve in space.

    Parameters
    ----------
    path
        A .dxf file with one visible curve, or a table in UTF-8 with the columns ``x``,
        ``y`` and ``z``, separated by commas, semicolons, tabs or spaces, the numbers
        with decimal points or commas.  Its first row names the columns, possibly after
        ``#``, with a unit in brackets if it is not mm, as ``x (m)``; other columns are
        ignored.  A table of three columns needs no names.
    least
        Least number of different points: three for a closed curve.

    Returns
    -------
    ndarray
        Points in mm, shape (3, n).

    Raises
    ------
    ValueError
        If the file is not valid; one line names the file and the row.
    ModuleNotFoundError
        If a .dxf is to be read and ezdxf is not installed.
    OSError
        If it cannot be read.
    """
    what = printable(Path(path))
    points = _of_dxf(path) if Path(path).suffix.lower() == ".dxf" else _of_table(path)
    if (n := len(np.unique(points, axis=0))) < least:
        raise ValueError(
            f"{what}: the curve has {n} different points, but at least {least} are "
            "required"
        )
    return points.T


def _of_table(path: str | os.PathLike[str]) -> ndarray:
    """Points in a table in mm, shape (n, 3)."""
    file, lines = read_lines(path)
    first = lines[0][1]
    is_heading = first[0].lstrip().startswith("#")
    first[0] = first[0].lstrip().removeprefix("#")
    words = ",".join(lines[0][1]).split()
    if len(lines[0][1]) == 1 or (len(words) == 3 and all(map(_is_number, words))):
        lines = _split_at_spaces(file, lines)
    columns, scale, (number, head) = [0, 1, 2], np.ones(3), lines[0]
    if len(head) == 3 and all(map(_is_number, head)) and not is_heading:
        lines[0] = number, [cell.replace(",", ".") for cell in head]
    else:
        columns, scale = _columns(file, head)
        del lines[0]
    points = []
    for number, row in lines:
        try:
            points.append([number_of_text(row[column]) for column in columns])
            if not np.isfinite(points[-1]).all():
                raise ValueError
        except (ValueError, IndexError):
            shown = excerpt(",".join(row))
            raise ValueError(
                f"{file}, row {number}: expected three finite coordinates, got "
                f"'{shown}'"
            ) from None
    return scale * np.reshape(points, (-1, 3))


def _split_at_spaces(
    file: str, lines: list[tuple[int, list[str]]]
) -> list[tuple[int, list[str]]]:
    """Rows with spaces between the columns, numbers with decimal points."""
    (first, head), *others = [(k, ",".join(row).split()) for k, row in lines]
    if not all(map(_is_number, head := _joined_units(head))):
        _columns(file, head)
    with errors_about(file):
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


def _columns(file: str, header: list[str]) -> tuple[list[int], ndarray]:
    """Columns of x, y and z, and their units in mm."""
    found = [HEADING.fullmatch(cell) for cell in header]
    names = [
        (one[1] if one else cell).strip().lower()
        for one, cell in zip(found, header, strict=True)
    ]
    if any(names.count(axis) != 1 for axis in "xyz"):
        raise ValueError(f"{file}, row 1: the header must name the columns x, y and z")
    columns = [names.index(axis) for axis in "xyz"]
    units = [one[2].lower() if (one := found[column]) else "mm" for column in columns]
    for unit in units:
        if unit not in IN_MM:
            raise ValueError(
                f"{file}, row 1: the unit must be one of {', '.join(IN_MM)}, got "
                f"'{excerpt(unit)}'"
            )
    return columns, np.array([IN_MM[unit] for unit in units])


def _of_dxf(path: str | os.PathLike[str]) -> ndarray:
    """Points of the only visible curve of a DXF file in mm, shape (n, 3)."""
    from ..outlines.drawings.dxf import curves_of_dxf
    from ..outlines.rings import JOINED

    curves = curves_of_dxf(path, _TOLERANCE, in_space=True)
    parts = [curve.points.T for curve in curves]
    meet = JOINED * float(np.ptp(np.vstack(parts), axis=0).max())
    layers = ", ".join(sorted({curve.where for curve in curves}))
    return _chain(f"{printable(path)} has several curves on {layers}", parts, meet)


def _chain(problem: str, parts: list[ndarray], meet: float) -> ndarray:
    """Points of curves of which each continues another one, shape (n, 3).

    Curve i has the ends 2 i and 2 i + 1.
    """
    ends = np.vstack([part[[0, -1]] for part in parts])
    pairs = KDTree(ends).query_pairs(meet, output_type="ndarray")
    meeting = np.vstack([pairs, pairs[:, ::-1]])
    next_end = dict(meeting.tolist())
    lines: dict[int, ndarray] = {}
    end = next((i for i in range(len(ends)) if i not in next_end), 0)
    while end >= 0 and end // 2 not in lines:
        lines[end // 2] = parts[end // 2][:: -1 if end % 2 else 1]
        end = next_end.get(end ^ 1, -1)
    if len(lines) < len(parts) or len(next_end) < len(meeting):
        raise ValueError(
            f"{problem} that do not continue one another: write one to each file, or "
            "switch the layers of the others off"
        )
    first, *others = lines.values()
    return np.vstack([first, *(line[1:] for line in others)])
