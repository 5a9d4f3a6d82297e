"""Scene `double_dome`: a ply on two domes with a waist between them."""

from typing import Unpack

from skfem import Mesh

from ...drape import double_dome as tool
from ...registration import SceneRegistration
from ..scene import Scene
from .laid import DEFAULTS, LaidPly, from_options, laid, options

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


REGISTRATION = SceneRegistration(
    name="double_dome",
    description="a ply on two domes with a waist between them",
    build=from_options(double_dome),
    size=(32, 18),
    jitter=0.0,
    defaults=DEFAULTS,
    options=options(WIDTH, HEIGHT),
    dimension=3,
    on_tool=True,
    rank=10,
)
