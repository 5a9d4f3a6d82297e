"""Scene `simple_shear`: a ply sheared between parallel clamps.

The lower clamp is fixed and the upper one moves along itself by H sin tγ, where H is
the distance between them.  Inextensible fibres along the sides then have the shear
angle tγ everywhere: the warp keeps its direction and the weft is inclined by tγ.  With
the area W H, the shear moment M(γ) per area and the tension T per length of the clamp,
the virtual work of a rotation δγ of the weft is

    F H cos γ δγ − T W H sin γ δγ = W H M δγ,    F = W (M + T sin γ)/cos γ.

If the upper clamp follows the circle of the unstretched weft instead, T is a reaction
that inextensible fibres do not determine, and F cos γ − T W sin γ = W M is the force
along the motion.
"""

from functools import partial
from typing import Any

import numpy as np
from numpy import ndarray

from ..declarations import scenes as declared
from ..fabric import Law
from ..mesh.user_input import errors_in, refuse_unknown
from ..ply.loads import Traction
from ..solve.conditions import Condition
from ..solve.quantities import Quantity
from ..solve.result import Result
from .rectangle import (
    given_or_rectangle,
    misfit,
    refuse_unless_positive,
    require_edges,
)
from .scene import Scene, with_parameters

# Name of the tension, which differs from the term of the fibre tension.
_NAME = "tension across"

# Figure of a clamp on the circle that is printed first.
_FIRST = (
    Quantity("Load along the motion", "load_along_motion_N", "N", has_interval=True),
)

# Inclination of fibres in radians that counts as zero.
_ALONG = 1e-9


@with_parameters(declared.SimpleShear)
def simple_shear(given: declared.SimpleShear) -> Scene:
    """A ply sheared between parallel clamps, in equal steps of γ.

    Parameters
    ----------
    mesh
        A mesh whose boundaries ``bottom`` and ``top`` are the clamps, parallel to x;
        or the kind of `rectangle` to generate.  The exact solution is valid if the mesh
        fills a rectangle.
    size, jitter, seed
        See `rectangle`.
    warp, weft
        Inclination of the fibres in radians.
    shear_angle
        Shear angle γ at the end in radians, of fibres along the sides: the upper clamp
        moves along itself by H sin γ.
    width, height
        Length W of the clamps and distance H between them in mm, of a generated mesh.
    across
        Motion of the upper clamp across itself: ``tension``, free under a constant
        tension, without rotation; ``circle``, on the circle of the unstretched weft;
        ``gap``, none.
    tension
        Tension T in N/mm of the clamp, by default 0.1 with ``tension``.

    Raises
    ------
    ValueError
        If the mesh is not valid, γ is not between 0 and a right angle, the tension is
        negative, or given without ``tension``.
    """
    gamma, across = given.shear_angle, given.across
    if not 0 < gamma < np.pi / 2:
        raise ValueError(
            "simple_shear: the shear angle must be between 0 and 90 degrees, got "
            f"{np.degrees(gamma):g} degrees"
        )
    with errors_in("simple_shear: "):
        refuse_unknown("motion across the clamps", across, declared.ACROSS)
    tension = _tension(across, given.tension)
    mesh = given_or_rectangle(given, given.width, given.height, given.warp, given.weft)
    require_edges("simple_shear", mesh, ("bottom", "top"))
    height = float(np.ptp(mesh.p[1]))
    if across == "tension":
        slide = partial(_slide, gamma=gamma, height=height)
        top = Condition("top", slide, direction=(1.0, 0.0), together=True)
    else:
        falls = across == "circle"
        motion = partial(_motion, gamma=gamma, height=height, falls=falls)
        top = Condition("top", motion)
    reason = _misfit(given, across) or misfit(mesh, ("bottom", "top"))
    width = float(np.ptp(mesh.p[0]))
    of_circle: dict[str, Any] = {}
    if across == "circle":
        of_circle = {"measured": partial(_along_motion, gamma=gamma), "first": _FIRST}
    exact = partial(_force, gamma=gamma, width=width, tension=tension)
    return Scene(
        name="simple_shear",
        mesh=mesh,
        warp=(float(np.cos(given.warp)), float(np.sin(given.warp))),
        weft=(float(np.cos(given.weft)), float(np.sin(given.weft))),
        conditions={"bottom": Condition("bottom"), "top": top},
        driven="top",
        displacement=partial(_sheared, gamma=gamma, bottom=float(mesh.p[1].min())),
        shear_angle=partial(_angle, gamma=gamma),
        load=exact if across == "tension" else None,
        load_axis=0,
        misfit=reason,
        loads=(Traction("top", (0.0, tension), 1.0, _NAME),) if tension else (),
        **of_circle,
    )


def _tension(across: str, tension: float | None) -> float:
    """Tension in N/mm; an error if it is not valid."""
    if across != "tension":
        if tension is not None:
            raise ValueError(
                f"simple_shear: a tension requires a clamp that moves freely: use the "
                f"motion tension instead of {across}, or omit the tension"
            )
        return 0.0
    tension = declared.SHEAR_TENSION if tension is None else tension
    refuse_unless_positive("simple_shear: the tension", tension, " N/mm", "0 or ")
    return tension


def _misfit(given: declared.SimpleShear, across: str) -> str:
    """Reason why the fibres have no exact solution; empty if they have one."""
    if across == "gap":
        return "a constant gap stretches the fibres"
    off = abs(np.sin(given.warp)) + abs(np.cos(given.weft))
    return "the fibres are not along the sides" if off > _ALONG else ""


def _force(law: Law, t: float, gamma: float, width: float, tension: float) -> float:
    """Force of the upper clamp along itself in N, see above."""
    moment = float(law.value(np.asarray(t * gamma)))
    return width * (moment + tension * np.sin(t * gamma)) / float(np.cos(t * gamma))


def _slide(X: ndarray, t: float, gamma: float, height: float) -> ndarray:
    return np.full(X.shape[1:], height * np.sin(t * gamma))


def _motion(X: ndarray, t: float, gamma: float, height: float, falls: bool) -> ndarray:
    rise = height * (np.cos(t * gamma) - 1) if falls else 0.0
    return np.stack([_slide(X, t, gamma, height), np.full(X.shape[1:], rise)])


def _along_motion(result: Result, gamma: float) -> dict[str, float | str]:
    """Force along the motion on the circle, which is W M, and its half-width in N."""
    state, error = result.states[-1], result.error
    half = 0.5 * state.load_factor * gamma
    c, s, chord = np.cos(half), np.sin(half), state.displacements["top"]
    along = np.array([[c, s], [-s, c]]) @ chord / max(np.hypot(*chord), 1e-300)
    force = float(along @ state.reactions["top"])
    figures: dict[str, float | str] = {"load_along_motion_N": force}
    if error.load is not None:
        figures["load_along_motion_N_half_width"] = error.load * abs(force)
    return figures


def _sheared(X: ndarray, t: float, gamma: float, bottom: float) -> ndarray:
    y = X[1] - bottom
    return np.stack([y * np.sin(t * gamma), y * (np.cos(t * gamma) - 1)])


def _angle(X: ndarray, t: float, gamma: float) -> ndarray:
    return np.full(X.shape[1:], t * gamma)
