"""Scene `double_dome`: a ply on two domes with a waist between them."""

from typing import Unpack

from skfem import Mesh

from ...drape import double_dome as tool
from ..scene import Scene
from .laid import LaidPly, laid

#: Sides of the ply in mm.
WIDTH, HEIGHT = 470.0, 270.0


def double_dome(mesh: str | Mesh = "irregular", **ply: Unpack[LaidPly]) -> Scene:
    """A ply on `skfem_textile.drape.double_dome`, its long side along x.

    Parameters
    ----------
    mesh, **ply
        As of `laid`.

    Raises
    ------
    ValueError
        As from `laid`.
    """
    given: LaidPly = {"size": (32, 18), "width": WIDTH, "height": HEIGHT, **ply}
    return laid("double_dome", tool(), mesh, **given)
