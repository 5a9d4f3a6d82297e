"""Scene `saddle`: a ply on the saddle z = (x² − y²)/(2R)."""

from typing import Unpack

import numpy as np
from numpy import ndarray
from skfem import Mesh

from ...drape import Height, HeightField
from ..scene import Scene
from .laid import LaidPly, laid

#: Radius of curvature in the middle and sides of the ply in mm.
RADIUS, WIDTH, HEIGHT = 150.0, 180.0, 180.0


def saddle(
    mesh: str | Mesh = "irregular",
    radius: float = RADIUS,
    **ply: Unpack[LaidPly],
) -> Scene:
    """A ply on a saddle that is hollow along x and bulges along y.

    Parameters
    ----------
    radius
        Radius R of both curvatures in the middle, in mm.
    mesh, **ply
        As of `laid`.

    Raises
    ------
    ValueError
        As from `laid`, or if the radius is not positive.
    """
    if not 0 < radius < np.inf:
        raise ValueError(f"saddle: the radius must be positive, got {radius:g}")

    def height(x: ndarray, y: ndarray) -> Height:
        curved, zero = np.full_like(x, 1 / radius), np.zeros_like(x)
        h = 0.5 * (x * x - y * y) / radius
        return Height(h, x / radius, -y / radius, curved, zero, -curved)

    return laid("saddle", HeightField(height), mesh, **ply)
