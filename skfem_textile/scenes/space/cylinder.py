"""Scene `cylinder`: a ply on a cylinder, which shears no ply."""

from typing import Unpack

import numpy as np
from skfem import Mesh

from ...drape import Cylinder
from ..scene import Scene
from .laid import LaidPly, laid

#: Radius of the cylinder and sides of the ply in mm.
RADIUS, WIDTH, HEIGHT = 100.0, 180.0, 180.0


def cylinder(
    mesh: str | Mesh = "irregular",
    radius: float = RADIUS,
    **ply: Unpack[LaidPly],
) -> Scene:
    """A ply on a cylinder, its axis along y below the origin.

    The exact answer, for fibres at any angle: nothing shears.

    Parameters
    ----------
    radius
        Radius in mm.
    mesh, **ply
        As of `laid`.

    Raises
    ------
    ValueError
        As from `laid`, or if the radius is not positive.
    """
    return laid(
        "cylinder",
        Cylinder(radius, (0.0, 0.0, -radius)),
        mesh,
        **ply,
        exact=lambda X, t: np.zeros(X.shape[1]),
        off_exact=lambda X: "",
    )
