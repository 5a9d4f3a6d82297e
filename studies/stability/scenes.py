"""Scenes of the stability study: distorted, turned, moved and split."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
from numpy import ndarray
from skfem import Mesh, MeshQuad

from skfem_textile.mesh.checks import with_edges
from skfem_textile.mesh.splitting import split
from skfem_textile.scenes import Scene, picture_frame, strip, trellis
from skfem_textile.scenes.rectangle import rectangle
from skfem_textile.scenes.strip import HEIGHT, WIDTH
from skfem_textile.scenes.trellis import sheared
from skfem_textile.solve.conditions import Condition

#: Elements along the sides of a square, unless something else is said.
SIZE = (8, 8)


def on_split_mesh(make: Callable[..., Scene], **options: Any) -> Scene:
    """A scene on the mesh of the same scene, split."""
    return make(**options | {"mesh": split(make(**options).mesh)})


def net_of(
    warp: float = 0,
    crossing: float = 90,
    shear: float = 0,
    bend: float = 0,
    size: tuple[int, int] = SIZE,
    mesh: str | Mesh = "irregular",
) -> Scene:
    """A trellis, of angles in degrees."""
    warp, weft = np.radians([warp, warp + crossing])
    turns = sheared(*np.radians([shear, bend]))
    return trellis(mesh, size, warp=warp, weft=weft, turns=turns)


def placed_strip(scale: float, shift: float, **options: Any) -> Scene:
    """The strip, larger and moved along x and y."""
    scene = on_split_mesh(strip, **options) if options else strip()

    def unplaced(X: ndarray) -> ndarray:
        return (X - shift) / scale

    def moved(condition: Condition) -> Condition:
        def value(X: ndarray, t: float) -> ndarray:
            values = scale * condition.values("", unplaced(X), t)
            return values if condition.direction is None else values[0]

        return Condition(condition.where, value, condition.direction)

    return replace(
        scene,
        mesh=scene.mesh.scaled(scale).translated((shift, shift)),
        conditions={
            name: moved(c)
            for name, c in scene.conditions.items()
            if isinstance(c, Condition)
        },
        displacement=lambda X, t: scale * scene.displacement(unplaced(X), t),
        shear_angle=lambda X, t: scene.shear_angle(unplaced(X), t),
    )


def strip_with_flat_angles(mesh: Mesh | None = None) -> Scene:
    """The strip on elements with angles of 179°, or on parts of such elements."""
    return strip(mesh or _with_flat_angles(WIDTH, HEIGHT, (10, 16)))


def frame_with_flat_angles() -> Scene:
    """The picture frame on elements with angles of 179°."""
    return picture_frame(_with_flat_angles(100.0, 100.0, SIZE))


def _with_flat_angles(width: float, height: float, size: tuple[int, int]) -> MeshQuad:
    """Move every other node until it opens an element to an angle of 179°.

    In an element with sides a, b the corner at (a, b) comes to c·(a, b), where the
    edges to (a, 0) and (0, b) make that angle.
    """
    mesh = rectangle(width, height, size, "aligned")
    a, b = width / size[0], height / size[1]
    node = np.arange(mesh.p.shape[1]).reshape(size[1] + 1, size[0] + 1)
    moved = node[1:-1:2, 1:-1:2].ravel()
    points = mesh.p.copy()
    points[:, moved] -= (1 - _opened(a, b)) * np.array([[a], [b]])
    return with_edges(MeshQuad(points, mesh.t))


def _opened(a: float, b: float) -> float:
    """Share c of the diagonal at which the angle is 179°, by bisection."""
    low, high = 0.5, 1.0
    for _ in range(60):
        c = 0.5 * (low + high)
        p, q = np.array([a - c * a, -c * b]), np.array([-c * a, b - c * b])
        cosine = p @ q / (np.linalg.norm(p) * np.linalg.norm(q))
        low, high = (low, c) if np.degrees(np.arccos(cosine)) < 179 else (c, high)
    return c
