"""Surfaces of triangles from STL files, and others that meshio reads."""

import os
from pathlib import Path

import numpy as np

from ..drape import TriangleMesh
from ..mesh.checks import MeshError
from ..mesh.user_input import printable
from .reading import read_raw

# Kinds of cells, and the corners of the triangles that they are cut into.
_CUTS = ("triangle", [0, 1, 2]), ("quad", [0, 1, 2]), ("quad", [0, 2, 3])


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
    path = Path(path)
    try:
        raw, _ = read_raw(path)
        cells = [
            np.asarray(block.data, dtype=int)[:, corners]
            for block in raw.cells
            for kind, corners in _CUTS
            if block.type == kind
        ]
        if not cells:
            raise MeshError("it has no triangles")
        if np.shape(raw.points)[1:] != (3,):
            raise MeshError("its points must have three coordinates")
        return TriangleMesh(raw.points.T, np.concatenate(cells).T)
    except MeshError as error:
        raise MeshError(f"{printable(path)}: {error}") from None
