"""Curves in space from files: outlines, trimming curves and first threads."""

import os
from pathlib import Path

import numpy as np
from numpy import ndarray
from scipy.spatial import KDTree

from ..mesh.user_input import coords, printable
from ..outlines.drawings.table import points_of_table

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
        Least number of different points: three for a closed curve, which must be
        closed in a .dxf file.  The first point of a table may be repeated at its end.

    Returns
    -------
    ndarray
        Points in mm, shape (3, n).

    Raises
    ------
    ValueError
        If the file is not valid, or a closed curve is open; one line names the file
        and the row.
    ModuleNotFoundError
        If a .dxf is to be read and ezdxf is not installed.
    OSError
        If it cannot be read.
    """
    what = printable(Path(path))
    if Path(path).suffix.lower() == ".dxf":
        points = _of_dxf(path, least > 2)
    else:
        points, _ = points_of_table(path, "xyz")
    if (n := len(np.unique(points, axis=0))) < least:
        raise ValueError(
            f"{what}: the curve has {n} different points, but at least {least} are "
            "required"
        )
    return points.T


def _of_dxf(path: str | os.PathLike[str], is_closed: bool) -> ndarray:
    """Points of the only visible curve of a DXF file in mm, shape (n, 3)."""
    from ..outlines.drawings.dxf import curves_of_dxf
    from ..outlines.rings import JOINED

    curves = curves_of_dxf(path, _TOLERANCE, in_space=True)
    parts = [curve.points.T for curve in curves]
    meet = JOINED * float(np.ptp(np.vstack(parts), axis=0).max())
    layers = ", ".join(sorted({curve.where for curve in curves}))
    what = printable(path)
    points = _chain(f"{what} has several curves on {layers}", parts, meet)
    gap = float(np.linalg.norm(points[-1] - points[0]))
    if is_closed and gap > meet:
        raise ValueError(
            f"{what}: the curve on {layers} is open: its ends at {coords(points[0])} "
            f"and {coords(points[-1])} are {gap:.3g} mm apart; close it"
        )
    return points


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
