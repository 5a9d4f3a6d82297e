"""Tools from STL files, and others that meshio reads, and curves on them."""

import os
from pathlib import Path

import numpy as np
from numpy import ndarray

from ...drape import ToolMesh, TriangleMesh
from ...drape.tool_mesh import cut_in_two
from ...fabric.files.table_file import read_lines
from ...mesh.checks import MeshError
from ...mesh.user_input import excerpt, number_of_text, printable
from ..reading import read_raw


def read_tool_mesh(path: str | os.PathLike[str]) -> ToolMesh:
    """Read the triangles and quadrilaterals of a tool, in the order of the file.

    Other cells are left out.

    Parameters
    ----------
    path
        The file: STL, and what else meshio reads.

    Raises
    ------
    MeshError
        If the file cannot be read, or holds no surface in space.
    """
    try:
        return ToolMesh(*_points_and_cells(path))
    except MeshError as error:
        raise MeshError(f"{printable(path)}: {error}") from None


def _points_and_cells(
    path: str | os.PathLike[str],
) -> tuple[ndarray, tuple[ndarray, ...]]:
    """What a `ToolMesh` is made of, as it stands in a file."""
    raw, _ = read_raw(Path(path))
    cells = tuple(
        np.asarray(block.data, dtype=int).T
        for block in raw.cells
        if block.type in ("triangle", "quad")
    )
    if not any(map(np.size, cells)):
        raise MeshError("it has no triangles or quadrilaterals")
    if np.shape(raw.points)[1:] != (3,):
        raise MeshError("its points must have three coordinates")
    return np.asarray(raw.points).T, cells


def read_surface(path: str | os.PathLike[str]) -> TriangleMesh:
    """Read a tool's surface, smoothed: STL, and what else meshio reads.

    Quadrilaterals are cut in two.  Other cells are left out, and triangles whose
    corners coincide, as at the pole of a sphere.

    Parameters
    ----------
    path
        The file.

    Raises
    ------
    MeshError
        If the file cannot be read, or holds no surface.
    """
    try:
        points, cells = _points_and_cells(path)
        return TriangleMesh(points, cut_in_two(cells))
    except MeshError as error:
        raise MeshError(f"{printable(path)}: {error}") from None


def read_trimming_curve(path: str | os.PathLike[str]) -> ndarray:
    """Read a closed curve: the columns ``x``, ``y`` and ``z`` of a CSV file, in mm.

    Parameters
    ----------
    path
        The file, in UTF-8.  Its first row names the columns, and others are left out.

    Returns
    -------
    ndarray
        Shape (3, n).

    Raises
    ------
    ValueError
        If it is no such file; one line names the file and the row.
    OSError
        If it cannot be read.
    """
    file, ((_, header), *lines) = read_lines(path)
    names = [cell.strip().lower().removesuffix("(mm)").strip() for cell in header]
    if any(names.count(axis) != 1 for axis in "xyz"):
        raise ValueError(f"{file}, row 1: the header must name the columns x, y and z")
    columns, points = [names.index(axis) for axis in "xyz"], []
    for number, row in lines:
        try:
            points.append([number_of_text(row[column]) for column in columns])
            if not np.isfinite(points[-1]).all():
                raise ValueError
        except (ValueError, IndexError):
            shown = excerpt(",".join(row))
            raise ValueError(f"{file}, row {number}: '{shown}' is no point") from None
    if len(np.unique(points, axis=0)) < 3:
        raise ValueError(f"{file}: a closed curve needs three points at least")
    return np.transpose(points)
