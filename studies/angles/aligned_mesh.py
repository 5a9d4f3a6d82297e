"""Meshes of the bias extension along its fibres, fine where fibres are stretched.

The fibres that start at the corners of the clamps divide a ply of the height 2W tan θ
into equal rhombi and halves of them.  The shear angle jumps at these fibres, and they
carry forces that stretch spreads over narrow layers.
"""

import numpy as np
from numpy import ndarray
from skfem import Mesh, MeshTri

from skfem_textile.fabric.meshing import cells_of_net
from skfem_textile.mesh.checks import with_edges

# A point that is nearer to a side than this share of a rhombus is on it.  Chosen: far
# above rounding, 2e-16, and far below the narrowest cells, 1e-3.
_NEAR = 1e-9


def graded_mesh(theta: float, width: float, cells: int, grading: float) -> Mesh:
    """Triangles along the fibres, graded towards those that start at the corners.

    Parameters
    ----------
    theta
        Inclination of the fibres in radians.
    width
        Width of the ply in mm.
    cells
        Number of cells along a side of a rhombus, even.
    grading
        The widest cell is about cosh of this times as wide as the narrowest.
    """
    lines = np.concatenate([i + _graded(cells, grading) for i in range(3)] + [[3.0]])
    outline = np.array([[0.0, 1.0, 3.0, 2.0], [0.0, -1.0, 1.0, 2.0]])
    s, triangles = cells_of_net(outline, lines, lines - 1, _NEAR)
    c, t = width / 2, width / 2 * np.tan(theta)
    return with_edges(MeshTri(np.array([[c, -c], [t, t]]) @ s, triangles))


def _graded(cells: int, grading: float) -> ndarray:
    """Points from 0 on, below 1, that are denser at both ends."""
    share = np.arange(cells) / cells
    from_end = np.minimum(share, 1 - share)
    moved = np.sinh(2 * grading * from_end) / np.sinh(grading) / 2
    return np.where(share <= 0.5, moved, 1 - moved)
