"""Scene `bias_extension`: a rectangle pulled along the bisector of its fibres.

A ply [0, W] × [0, H], H ≥ 2W, with warp (1, 1)/√2 and weft (−1, 1)/√2, is held at its
bottom and pulled at its top, and its sides are free.  If no fibre stretches, three
kinds of zones form: at the clamps no shear, in the middle the shear angle γ, and half
of it between them.  At the elongation δ, with D = H − W,
γ = π/2 − 2 acos((D + δ)/(√2 D)).  For a convex shear energy w this field is the
minimiser, and the force at the top is that of `force`.
"""

from functools import partial

import numpy as np
from numpy import ndarray
from skfem import Mesh

from ..conditions import Condition
from ..fabric import Law
from ..meshes import MeshError, check_mesh, with_edges
from .rectangle import rectangle
from .scene import Scene
from .trellis import Motion

#: Sides of the ply in mm.
WIDTH, HEIGHT = 50.0, 100.0


def bias_extension(
    mesh: str | Mesh = "irregular",
    size: tuple[int, int] = (16, 32),
    jitter: float = 0.25,
    seed: int = 1,
    shear_angle: float = np.radians(40.0),
) -> Scene:
    """A rectangle pulled along the bisector of its fibres, in steps equal in γ.

    Parameters
    ----------
    mesh
        A mesh of a rectangle at least twice as high as wide, its lower left corner at
        the origin, or the kind of `rectangle` to make, `WIDTH` × `HEIGHT`.
    size, jitter, seed
        Of the mesh to make.
    shear_angle
        Shear angle γ of the middle at the end, in radians.

    Raises
    ------
    ValueError
        If the mesh is not valid or does not fit, or γ is not between 0° and 90°.
    """
    if not 0 < shear_angle < np.pi / 2:
        raise ValueError(
            "the shear angle must be between 0 and 90 degrees, got "
            f"{np.degrees(shear_angle):g}"
        )
    if isinstance(mesh, str):
        mesh = rectangle(WIDTH, HEIGHT, size, mesh, jitter, seed)
    else:
        check_mesh(mesh)
        mesh = with_edges(mesh)
    W, H = _sides(mesh)

    def turn(s: ndarray, t: float, low: float, high: float) -> ndarray:
        return np.where((s > low) & (s < high), 0.5 * t * shear_angle, 0.0)

    # Fibres that meet no clamp turn towards the direction of the pull.
    warp = W / np.sqrt(2), H / np.sqrt(2)
    weft = 0.0, (H - W) / np.sqrt(2)
    motion = Motion(
        (np.pi / 4, 3 * np.pi / 4),
        (
            partial(turn, low=warp[0], high=warp[1]),
            lambda s, t: -turn(s, t, *weft),
        ),
        kinks=(warp, weft),
    )
    return Scene(
        name="bias_extension",
        mesh=mesh,
        warp=(1.0, 1.0),
        weft=(-1.0, 1.0),
        conditions={
            "bottom": Condition("bottom"),
            "top": Condition("top", motion.displacement),
        },
        driven="top",
        displacement=motion.displacement,
        shear_angle=motion.shear_angle,
        load=lambda law, t: force(law, t * shear_angle, W, H),
    )


def force(law: Law, gamma: float, width: float, height: float) -> float:
    """Force at the top in N, of fibres that do not stretch.

    F = [W(2H − 3W) C(γ) + W² C(γ/2)] / ((H − W)(cos(γ/2) − sin(γ/2))), C = w′.

    Parameters
    ----------
    law
        Shear law C.
    gamma
        Shear angle of the middle in radians.
    width, height
        Sides W and H of the ply in mm, H ≥ 2W.
    """
    W, H = width, height
    C, C_half = law.value(np.array([gamma, gamma / 2]))
    work = W * (2 * H - 3 * W) * C + W**2 * C_half
    return float(work / ((H - W) * (np.cos(gamma / 2) - np.sin(gamma / 2))))


def _sides(mesh: Mesh) -> tuple[float, float]:
    """Width and height of a mesh that fits the scene."""
    for name in ("bottom", "top"):
        if name not in mesh.boundaries:
            raise MeshError(f"bias_extension: the mesh has no straight {name} edge")
    W, H = np.ptp(mesh.p, axis=1).tolist()
    if np.abs(mesh.p.min(axis=1)).max() > 1e-6 * H:
        raise MeshError("bias_extension: the lower left corner must be at the origin")
    if H < 2 * W * (1 - 1e-9):
        raise MeshError(
            f"bias_extension: the mesh is {W:g} mm wide and {H:g} mm high; it must be "
            "at least twice as high as wide"
        )
    return W, H
