"""The elements of a mesh as they were before it was split or cut."""

import numpy as np
from numpy import ndarray
from skfem import Mesh

from .quadrilaterals import was_split
from .triangles import was_cut


def original_elements(mesh: Mesh) -> tuple[tuple[ndarray, ...], ndarray]:
    """Elements that a mesh was split or cut from, and of which each of its own is part.

    They are the elements of the mesh itself if it was neither split nor cut.

    Returns
    -------
    tuple
        Original elements as node numbers, arrays of shape (3, n) and (4, n); and for
        each element of the mesh its original one, counted through them, shape
        (n_elements,).

    Examples
    --------
    >>> from skfem import MeshTri
    >>> from skfem_textile import split
    >>> cells, parent = original_elements(split(MeshTri()))
    >>> [cell.shape for cell in cells], parent
    ([(3, 2)], array([0, 1, 0, 1, 0, 1]))
    """
    if was_split(mesh):
        return mesh.originals, mesh.origin[mesh.parent]
    if was_cut(mesh):
        return (mesh.quads,), mesh.parent
    return (mesh.t,), np.arange(mesh.nelements)
