"""Directions of a fabric in each element of a mesh."""

import numpy as np
from skfem import Mesh

from ...mesh.splitting import original_elements
from ..fabric import Fabric, unit_vectors
from ..regions import fabric_on
from .per_element import FibreDirections


def directions_of(mesh: Mesh, fabric: Fabric) -> FibreDirections:
    """Directions of a fabric at the mean of the corners of each element.

    Parameters
    ----------
    mesh
        The mesh; of a split or cut mesh the user's elements count.
    fabric
        The fabric, with directions of any kind.

    Raises
    ------
    ValueError
        If it has directions for fewer or more elements.

    Examples
    --------
    >>> from skfem import MeshQuad
    >>> directions_of(MeshQuad(), Fabric(warp=(1, 1), weft=(-1, 1))).angles_deg()
    (array([45.]), array([135.]))
    """
    cells, _ = original_elements(mesh)
    centres = np.hstack([mesh.p[:, cell].mean(axis=1) for cell in cells])
    every = np.arange(centres.shape[1])
    fabric = fabric_on(every, fabric)
    x = centres[:, :, None]
    families = fabric.families
    found = (unit_vectors(f.name, f.direction, x, every[:, None]) for f in families)
    warp, weft = (np.broadcast_to(A, x.shape)[..., 0] for A in found)
    return FibreDirections(warp, weft)
