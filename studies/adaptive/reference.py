"""Loads of the bias extension on aligned meshes that are graded towards the kinks."""

from functools import cache

import numpy as np
from numpy import ndarray
from skfem import Mesh

from skfem_textile import Fabric, LoadStepper, Ply, Quadratic
from skfem_textile.scenes import bias_extension
from skfem_textile.scenes.bias_extension import WIDTH
from skfem_textile.scenes.rectangle import rectangle

#: Shear stiffness in N/mm.
G = 0.5

# Elements between two lines at which fibres bend, and how much smaller they are there.
# Chosen: `Full` in place of `Quadratic` changes the load by 0.2 % at most.
_PARTS, _GRADING = 16, 6.0


def graded(theta: float) -> Mesh:
    """The rectangle of the scene, its elements small along the fibres from corners."""
    height = 2 * WIDTH * np.tan(theta)
    size, fibres = (_PARTS, _PARTS), (theta, np.pi - theta)
    mesh = rectangle(WIDTH, height, size, "aligned", warp=fibres[0], weft=fibres[1])
    lines = rectangle(WIDTH, height, (1, 1), "aligned", warp=fibres[0], weft=fibres[1])
    A = np.array([[np.cos(x) for x in fibres], [np.sin(x) for x in fibres]])
    nodes, corners = np.linalg.solve(A, mesh.p), np.linalg.solve(A, lines.p)
    moved = [
        _moved(s, np.unique(at.round(9))) for s, at in zip(nodes, corners, strict=True)
    ]
    return type(mesh)(A @ np.array(moved), mesh.t, mesh.boundaries)


def _moved(s: ndarray, lines: ndarray) -> ndarray:
    """Coordinates moved towards the ends of the intervals between lines."""
    i = np.clip(np.searchsorted(lines, s, "right") - 1, 0, len(lines) - 2)
    low, length = lines[i], np.diff(lines)[i]
    share = (s - low) / length
    half = np.minimum(share, 1 - share)
    near = 0.5 * np.sinh(2 * _GRADING * half) / np.sinh(_GRADING)
    return low + length * np.where(share <= 0.5, near, 1 - near)


@cache
def reference(degrees: float, E: float, gamma: float) -> float:
    """The load in N at a shear angle of 20 or 40 degrees."""
    theta = np.radians(degrees)
    scene = bias_extension(
        graded(theta), warp=theta, weft=np.pi - theta, shear_angle=np.radians(40.0)
    )
    ply = Ply(scene.mesh, Fabric(E, G, scene.warp, scene.weft), Quadratic())
    for state in LoadStepper(ply, scene.conditions, 8).run().states:
        if np.isclose(40 * state.load_factor, gamma):
            return float(state.reactions["top"][1])
    raise ValueError(f"no state at {gamma:g} degrees")
