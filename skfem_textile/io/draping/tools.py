"""Tools from STL files, and others that meshio reads: elements, smooth surfaces."""

import os
from pathlib import Path

import numpy as np

from ...drape import ToolMesh, TriangleMesh
from ...mesh.checks import MeshError
from ...mesh.user_input import printable
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
    path = Path(path)
    try:
        raw, _ = read_raw(path)
        if np.shape(raw.points)[1:] != (3,):
            raise MeshError("its points must have three coordinates")
        cells = tuple(
            np.asarray(block.data, dtype=int).T
            for block in raw.cells
            if block.type in ("triangle", "quad")
        )
        return ToolMesh(raw.points.T, cells)
    except MeshError as error:
        raise MeshError(f"{printable(path)}: {error}") from None


def read_surface(path: str | os.PathLike[str]) -> TriangleMesh:
    """Read a tool's surface, smoothed: STL, and what else meshio reads.

    Quadrilaterals are cut in two.  Other cells are left out.

    Parameters
    ----------
    path
        The file.

    Raises
    ------
    MeshError
        If the file cannot be read, or holds no surface.
    """
    mesh = read_tool_mesh(path)
    try:
        return TriangleMesh(mesh.points, mesh.triangles())
    except MeshError as error:
        raise MeshError(f"{printable(path)}: {error}") from None
