"""Curves in space from files: outlines, trimming curves and first threads."""

import os
from pathlib import Path
from typing import Any

import numpy as np
from numpy import ndarray

from ..fabric.laws.tabulated import HEADING, read_lines
from ..mesh.user_input import IN_MM, error_text, excerpt, number_of_text, printable

# Distance between a curve of a DXF file and its chords, and between ends that meet,
# relative to the extent.
_FLAT, _MEET = 1e-4, 1e-6

# Millimetres in a unit of a DXF file ($INSUNITS); none is mm.
_DXF_MM = {0: 1.0, 1: 25.4, 2: 304.8, 4: 1.0, 5: 10.0, 6: 1000.0}


def read_curve(path: str | os.PathLike[str], least: int = 2) -> ndarray:
    """Read a curve in space.

    Parameters
    ----------
    path
        A .dxf file with one curve, or a table in UTF-8 with the columns ``x``, ``y``
        and ``z``, separated by commas, semicolons, tabs or spaces, the numbers with
        decimal points or commas.  Its first row names the columns, with a unit in
        brackets if it is not mm, as ``x (m)``; other columns are ignored.  A table of
        three columns needs no names.
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
    ImportError
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
    words = ",".join(lines[0][1]).split()
    if len(lines[0][1]) == 1 or (len(words) == 3 and all(map(_is_number, words))):
        lines = _spaced(file, lines)
    columns, scale, (number, head) = [0, 1, 2], np.ones(3), lines[0]
    if len(head) == 3 and all(map(_is_number, head)):
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


def _spaced(
    file: str, lines: list[tuple[int, list[str]]]
) -> list[tuple[int, list[str]]]:
    """Rows with spaces between the columns, numbers with decimal points."""
    (first, head), *others = [(k, ",".join(row).split()) for k, row in lines]
    if not all(map(_is_number, head := _joined_units(head))):
        _columns(file, head)
    marks = {mark for _, row in others for mark in ".," if mark in "".join(row)}
    if len(marks) == 2:
        raise ValueError(f"{file}: numbers have both decimal points and commas")
    points = [(k, [cell.replace(",", ".") for cell in row]) for k, row in others]
    return [(first, head), *points]


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
    units = [one[2] if (one := found[column]) else "mm" for column in columns]
    for unit in units:
        if unit not in IN_MM:
            raise ValueError(
                f"{file}, row 1: the unit must be one of {', '.join(IN_MM)}, got "
                f"'{excerpt(unit)}'"
            )
    return columns, np.array([IN_MM[unit] for unit in units])


def _of_dxf(path: str | os.PathLike[str]) -> ndarray:
    """Points of the only curve of a DXF file in mm, shape (n, 3)."""
    what = printable(Path(path))
    try:
        import ezdxf
        from ezdxf.disassemble import recursive_decompose
        from ezdxf.path import make_path
    except ImportError:
        raise ImportError(
            "reading a .dxf file requires ezdxf: pip install 'skfem-textile[dxf]'"
        ) from None
    try:
        drawing: Any = ezdxf.readfile(path)
        entities = recursive_decompose(drawing.modelspace())
        kinds = ("LINE", "ARC", "CIRCLE", "ELLIPSE", "SPLINE", "LWPOLYLINE", "POLYLINE")
        curves = [make_path(one) for one in entities if one.dxftype() in kinds]
        corners = [np.array([tuple(x) for x in c.control_vertices()]) for c in curves]
        extent = float(np.ptp(np.vstack(corners), axis=0).max()) if curves else 0.0
        parts = [
            np.array([tuple(x) for x in c.flattening(_FLAT * extent)]) for c in curves
        ]
    except OSError as error:
        if error.errno is not None:
            raise
        raise ValueError(f"{what} is not a DXF file") from None
    except Exception as error:  # a damaged file raises errors of any type
        raise ValueError(f"{what}: {printable(error_text(error))}") from None
    unit = drawing.header.get("$INSUNITS", 0)
    if unit not in _DXF_MM:
        raise ValueError(f"{what}: its unit ($INSUNITS {unit}) must be mm, cm, m or in")
    return _DXF_MM[unit] * _chain(what, parts, _MEET * extent)


def _chain(what: str, parts: list[ndarray], meet: float) -> ndarray:
    """Points of curves that continue one another, shape (n, 3)."""
    if not parts:
        raise ValueError(f"{what} has no curve")
    line, *others = parts
    while others:
        pairs = [
            (k, turned, at_end)
            for k, one in enumerate(others)
            for turned in (False, True)
            for at_end in (True, False)
            if np.linalg.norm(
                one[-1 if turned == at_end else 0] - line[-1 if at_end else 0]
            )
            <= meet
        ]
        if not pairs:
            raise ValueError(f"{what} has several curves: write one to each file")
        k, turned, at_end = pairs[0]
        one = others.pop(k)[:: -1 if turned else 1]
        line = np.vstack([line, one[1:]] if at_end else [one[:-1], line])
    return line
