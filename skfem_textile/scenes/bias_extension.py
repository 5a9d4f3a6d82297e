"""Scene `bias_extension`: a rectangle stretched along the bisector of its fibres.

A ply [0, W] × [0, H] with warp (cos θ, sin θ) and weft (−cos θ, sin θ), H ≥ 2W tan θ,
is fixed at its bottom and displaced at its top, with free sides.  For inextensible
fibres there are three kinds of zones: no shear at the clamps, the shear angle γ in the
middle, and γ/2 between them.  The fibres with both ends free have the length L = (H/sin
θ − W/cos θ)/2.  They rotate by γ/2, and the ply becomes longer by δ = 2L(sin(θ + γ/2) −
sin θ).  For a convex shear energy w and H = 2W tan θ this field minimises the energy,
and `force` is the force at the top.  A longer ply has another minimum with a slightly
smaller force.
"""

from collections.abc import Callable
from functools import partial
from typing import cast

import numpy as np
from numpy import ndarray
from skfem import Mesh

from ..declarations import scenes as declared
from ..fabric import Fabric, Law
from ..fabric.law import mean_slope
from ..mesh.checks import MeshError
from ..mesh.user_input import refuse_unknown
from ..solve.conditions import Condition
from .rectangle import given_or_rectangle, misfit, require_edges
from .scene import Scene, with_parameters
from .shear_test import Angle, BiasTest, force_of_moments, free_length
from .trellis import Motion

#: Width of the ply in mm.
WIDTH = declared.BiasExtension.width

PARTS = "whole", "half"


@with_parameters(declared.BiasExtension)
def bias_extension(given: declared.BiasExtension) -> Scene:
    """A rectangle stretched along the bisector of its fibres, in equal steps of γ.

    Parameters
    ----------
    mesh
        A mesh of the ply or of its left half, with the lower left corner at the origin;
        or the kind of `rectangle` to generate, or the left half of it.  The exact
        solution is valid if the mesh fills a rectangle of which the boundaries
        ``bottom`` and ``top`` are whole sides, and for the half also ``right``.
    size, jitter, seed
        See `rectangle`.
    warp, weft
        Inclination of the fibres in radians, θ and π − θ.
    shear_angle
        Shear angle γ of the middle at the end, in radians.
    part
        ``half``: the left half, on a roller along the axis of symmetry, with half the
        force.
    width, height
        Sides W and H of a generated mesh in mm; by default H = 2W tan θ, the least.

    Raises
    ------
    ValueError
        If the mesh is not valid or does not fit, the fibres are not symmetric about the
        loading direction, γ is not between 0 and π − 2θ, or the part is unknown.
    """
    part, shear_angle = given.part, given.shear_angle
    refuse_unknown("part", part, PARTS)
    theta = _inclination(given.warp, given.weft)
    if not 0 < shear_angle < np.pi - 2 * theta:
        raise ValueError(
            f"the shear angle must be between 0 and {180 - 2 * np.degrees(theta):g} "
            f"degrees, got {np.degrees(shear_angle):g} degrees"
        )
    share = 0.5 if part == "half" else 1.0
    width, height = given.width, given.height
    high = 2 * width * np.tan(theta) if height is None else height
    mesh = given_or_rectangle(given, share * width, high, theta, np.pi - theta)
    W, H = _sides(mesh, theta, share)
    motion = _motion(theta, shear_angle, W, H)
    conditions = {
        "bottom": Condition("bottom"),
        "top": Condition("top", motion.displacement),
    }
    if part == "half":
        conditions["axis"] = Condition("right", direction=(1.0, 0.0))
    return Scene(
        name="bias_extension",
        mesh=mesh,
        warp=(float(np.cos(theta)), float(np.sin(theta))),
        weft=(float(-np.cos(theta)), float(np.sin(theta))),
        conditions=conditions,
        driven="top",
        displacement=motion.displacement,
        shear_angle=motion.shear_angle,
        load=partial(_scaled, force, shear_angle, (W, H, theta), share),
        load_lost=partial(_scaled, lost_to_stretch, shear_angle, (W, H, theta), 1.0),
        misfit=misfit(mesh, _fixed_sides(share)),
        shear_test=BiasTest(W, H, theta, share),
    )


def force(
    law: Law,
    gamma: Angle,
    width: float,
    height: float,
    inclination: float = np.pi / 4,
) -> Angle:
    """Force at the top in N for inextensible fibres.

    F = [W(H − 3/2 W tan θ) C(γ) + 1/2 W² tan θ C(γ/2)] / (L cos(θ + γ/2)), with C = w′,
    is the derivative of the energy of the zones with respect to the elongation.

    Parameters
    ----------
    law
        Shear law C.
    gamma
        Shear angle of the middle in radians, a number or an array.
    width, height
        Sides W and H of the ply in mm, H ≥ 2W tan θ.
    inclination
        Angle θ between warp and clamps in radians.
    """
    middle, between = force_of_moments(gamma, width, height, inclination)
    C, C_half = (law.value(np.asarray(angle)) for angle in (gamma, gamma / 2))
    return cast("Angle", middle * C + between * C_half)


def lost_to_stretch(
    fabric: Fabric,
    gamma: Angle,
    width: float,
    height: float,
    inclination: float = np.pi / 4,
) -> Angle:
    """Estimated relative reduction of `force` due to fibre stretch.

    For inextensible fibres, the four fibres from the corners of the clamps to the sides
    carry most of the load.  Fibre stretch spreads each load over a layer.  A layer
    lowers the energy by Φ = ln 4/(2π) N²/(sin 2θ √(E K)), where N is the force of the
    fibre at the corner and K the resistance of the crossing fibres to rotation.  The
    four layers lower the load by x F, the sum of their dΦ/dδ.  The relative reduction
    is x/(1 + x), which is x to first order and below one.

    Parameters
    ----------
    fabric
        Fibre stiffnesses E, averaged over strains up to one percent (`mean_slope`), and
        shear law.
    gamma, width, height, inclination
        See `force`.
    """
    sides = width, height, inclination
    law, end = fabric.shear_law, np.pi - 2 * inclination
    h = 1e-4 * np.minimum(gamma, end - gamma)
    E = np.array([mean_slope(f.tension, np.zeros(1))[0] for f in fabric.families])
    L = free_length(*sides)
    with np.errstate(divide="ignore", invalid="ignore"):
        after, before = (_layer(law, gamma + d, *sides) for d in (h, -h))
        rate = np.sum(2 / np.sqrt(E)) * (after - before) / (2 * h)
        x = rate / (L * np.cos(inclination + gamma / 2) * force(law, gamma, *sides))
        share = x / (1 + np.abs(x))
    return np.nan_to_num(share, nan=1.0)  # all, if there is no tension stiffness


def _layer(law: Law, gamma: Angle, width: float, height: float, theta: float) -> Angle:
    """Φ √E of one fibre that starts at a corner of a clamp."""
    half = np.asarray(gamma) / 2
    C, tangent = law.value(half), law.tangent(half)
    F = force(law, gamma, width, height, theta)
    N = F / (2 * np.sin(theta)) - width * C / (2 * np.cos(theta))
    crossing = np.pi - 2 * theta - gamma / 2
    K = (tangent + C / np.tan(crossing / 2)) / np.sin(crossing) ** 2
    return np.log(4) / (2 * np.pi) * N**2 / (np.sin(2 * theta) * np.sqrt(K))


def _inclination(warp: float, weft: float) -> float:
    """θ; an error if the fibres are not symmetric about the loading direction."""
    theta = float(warp) % np.pi
    mirrored = abs(theta + float(weft) % np.pi - np.pi) < 1e-9
    if not (mirrored and 1e-6 < theta < np.pi / 2 - 1e-6):
        raise ValueError(
            "bias_extension: warp and weft must be symmetric about the loading "
            "direction, at D and 180 - D degrees with D between 0 and 90, got "
            f"{np.degrees(warp):g} and {np.degrees(weft):g}"
        )
    return theta


def _motion(theta: float, gamma: float, width: float, height: float) -> Motion:
    """Exact displacement; unclamped fibres rotate towards the load."""
    across, along = width / np.cos(theta) / 2, height / np.sin(theta) / 2
    warp, weft = (across, along), (0.0, along - across)
    half = 0.5 * gamma
    turns = (
        partial(_turn, angle=half, ends=warp),
        partial(_turn, angle=-half, ends=weft),
    )
    return Motion((theta, np.pi - theta), turns, kinks=(warp, weft))


def _turn(s: ndarray, t: float, angle: float, ends: tuple[float, float]) -> ndarray:
    return np.where((s > ends[0]) & (s < ends[1]), t * angle, 0.0)


def _scaled(
    of: Callable[..., Angle],
    gamma: float,
    sides: tuple[float, float, float],
    share: float,
    subject: Law | Fabric,
    t: float,
) -> float:
    """Share of a function of law or fabric at the load factor t."""
    return share * float(of(subject, t * gamma, *sides))


def _fixed_sides(share: float) -> tuple[str, ...]:
    """Fixed sides: both clamps, and the axis of a half."""
    return ("bottom", "top") if share == 1 else ("bottom", "top", "right")


def _sides(mesh: Mesh, theta: float, share: float) -> tuple[float, float]:
    """Width and height of the whole ply; an error if the mesh does not fit."""
    require_edges("bias_extension", mesh, _fixed_sides(share))
    width, H = np.ptp(mesh.p, axis=1).tolist()
    W = width / share
    if np.abs(mesh.p.min(axis=1)).max() > 1e-6 * H:
        raise MeshError(
            "bias_extension: the lower left corner of the mesh must be at the origin"
        )
    low = 2 * W * float(np.tan(theta))
    if H / low < 1 - 1e-6:  # files round coordinates
        raise MeshError(
            f"bias_extension: a ply {W:g} mm wide with fibres at "
            f"{np.degrees(theta):g} degrees to its clamps must be at least {low:g} mm "
            f"high, not {H:g} mm"
        )
    return W, H
