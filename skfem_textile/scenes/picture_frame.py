"""Scene `picture_frame`: a square ply sheared by a hinged frame."""

from dataclasses import replace

import numpy as np
from numpy import ndarray
from skfem import Mesh

from .scene import Scene
from .shear_test import FrameTest
from .trellis import trellis


def picture_frame(
    mesh: str | Mesh = "irregular",
    size: tuple[int, int] = (10, 10),
    jitter: float = 0.3,
    seed: int = 1,
    shear_angle: float = np.pi / 4,
) -> Scene:
    """A square ply in a hinged frame, fibres along its sides.

    The bottom bar stays where it is and the side bars turn: at the load factor t the
    shear angle is γ = t·shear_angle everywhere.  With sides of length L the force on
    the top bar is L·C(γ)·(cos γ, −sin γ), where C is the shear moment per area; a
    machine that pulls two corners apart would need F = L·C(γ)/sin(π/4 − γ/2).  The
    nodes at the ends of the top bar also carry half an element of each side bar.  These
    two parts cancel if the elements are equally high.

    Parameters
    ----------
    mesh, size, jitter, seed
        As for `trellis`.
    shear_angle
        Shear angle at the end in radians.

    Raises
    ------
    ValueError
        If the mesh is not valid, or the frame would close.
    """
    turns = (_straight, lambda s, t: np.full(s.shape, -t * shear_angle))
    scene = trellis(mesh, size, jitter, seed, turns=turns)
    side = float(np.ptp(scene.mesh.p[1]))
    return replace(scene, name="picture_frame", shear_test=FrameTest(side, side))


def _straight(s: ndarray, t: float) -> ndarray:
    return np.zeros(s.shape)
