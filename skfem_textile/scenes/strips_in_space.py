"""Scenes `cantilever` and `buckling`: strips in space, whose warp is an elastica."""

from functools import partial
from typing import Any

import numpy as np

from ..declarations import scenes as declared
from ..fabric.fabric import is_law
from ..fabric.law import law_at
from ..ply.loads import BodyForce
from ..solve.conditions import Condition
from ..solve.quantities import Quantity
from ..solve.result import Result
from .elastica import buckled, drooping, hanging, peirce
from .rectangle import (
    given_or_rectangle,
    misfit,
    refuse_unless_positive,
    require_edges,
)
from .scene import Scene, with_parameters

#: Names of the ends of a strip.
ENDS = ("left", "right")


# Figures of a cantilever that are printed first.
_FIRST_OF_CANTILEVER = (
    Quantity("Chord angle", "chord_angle_deg", "°"),
    Quantity("Tip, along x", "tip_x_mm", "mm"),
    Quantity("Tip, along z", "tip_z_mm", "mm"),
)

#: Width of strips in mm (ASTM D1388).
WIDTH = 25.0


@with_parameters(declared.Cantilever)
def cantilever(given: declared.Cantilever) -> Scene:
    """Strip clamped at its left edge that bends under its weight.

    Parameters
    ----------
    mesh
        A mesh of the strip with its left edge on x = 0, or the kind of `rectangle` to
        generate. The exact solution is valid if the mesh fills a rectangle with
        ``left`` and ``right`` as whole sides.
    size, jitter, seed
        As for `rectangle`.
    length
        Length L of a generated strip in mm.
    weight
        Weight per area in N/mm².

    Raises
    ------
    ValueError
        If the mesh is not valid or does not fit, or a number is not positive.
    """
    weight = given.weight
    refuse_unless_positive("the length", given.length)
    refuse_unless_positive("the weight", weight)
    mesh = given_or_rectangle(given, given.length, WIDTH)
    require_edges("cantilever", mesh, ENDS)
    overhang = float(np.ptp(mesh.p[0]))
    return Scene(
        name="cantilever",
        mesh=mesh,
        warp=(1.0, 0.0),
        weft=(0.0, 1.0),
        conditions={
            "clamp": Condition("left"),
            "tip": Condition("right", (None, 0.0, None)),
        },
        driven="tip",
        reacting="clamp",
        dimension=3,
        fibre_ends={"left": "clamped"},
        loads=(BodyForce((0.0, 0.0, -weight), name="weight"),),
        first=_FIRST_OF_CANTILEVER,
        figures=partial(_cantilever_figures, length=overhang, weight=weight),
        misfit=misfit(mesh, ENDS),
    )


def _cantilever_figures(
    result: Result, length: float, weight: float
) -> dict[str, float]:
    """Position of the tip, computed and of the elastica."""
    ply, t = result.ply, result.states[-1].load_factor
    exact = _exact_tip(result.ply.fabric.bending[0], length, t * weight)
    if exact is None or t == 0:
        return {}
    (x, _, z), right = ply.nodal(result.u), ply.nodes[0] > ply.nodes[0].max() - 1e-9
    tip_x, tip_z = length + float(x[right].mean()), float(z[right].mean())
    angle = float(np.arctan2(-tip_z, tip_x))
    figures = {
        "tip_x_mm": tip_x,
        "tip_z_mm": tip_z,
        "chord_angle_deg": float(np.degrees(angle)),
    }
    if angle > 0:
        figures["bending_by_peirce_N_mm"] = float(peirce(length, t * weight, angle))
    if not exact:
        return figures
    exact_x, exact_z = exact
    off = np.hypot(tip_x - exact_x, tip_z - exact_z)
    return figures | {
        "exact_tip_x_mm": exact_x,
        "exact_tip_z_mm": exact_z,
        "exact_chord_angle_deg": float(np.degrees(np.arctan2(-exact_z, exact_x))),
        "tip_error_over_length": float(off / length),
    }


# Steps along a strip with a bending law: with the kinks of tables within 10⁻⁵ L.
_STEPS = 200


def _exact_tip(bending: Any, length: float, weight: float) -> tuple[float, ...] | None:
    """Tip of a cantilever along x and z; empty without stiffness or weight.

    None if the stiffness or the law of the warp is not the same everywhere.
    """
    if law_at(bending, None) is not bending or np.ndim(bending):
        return None
    if weight == 0:
        return ()
    if is_law(bending):  # the strip bends away from +z
        tip = drooping(lambda x: bending.tangent(-x), [length], weight, _STEPS)
        return float(tip.x[0]), -float(tip.drop[0])
    if not bending:
        return ()
    exact = hanging(weight * length**3 / bending)
    return float(length * exact.x[-1]), float(length * exact.z[-1])


def _stiffness(result: Result) -> float | None:
    """Bending stiffness of the warp in N mm; None for a law, or if it varies."""
    bending: Any = result.ply.fabric.bending[0]
    return None if is_law(bending) or np.ndim(bending) else float(bending)


@with_parameters(declared.Buckling)
def buckling(given: declared.Buckling) -> Scene:
    """Hinged strip that is compressed along its length and buckles.

    Parameters
    ----------
    mesh
        A mesh of the strip, or the kind of `rectangle` to generate. The exact solution
        is valid if the mesh fills a rectangle, with ``left`` and ``right`` whole sides.
    size, jitter, seed
        As for `rectangle`.
    shortening
        Final approach of the ends relative to the length.
    push
        Constant transverse load in N/mm², which determines the side to which the strip
        buckles. It must be small compared with D (π/L)⁴ times the height of the buckle.

    Raises
    ------
    ValueError
        If the mesh is not valid or does not fit, the shortening is not between 0 and 1,
        or the push is not finite.
    """
    shortening, push = given.shortening, given.push
    if not 0 < shortening < 1:
        raise ValueError(f"the shortening must be between 0 and 1, got {shortening:g}")
    if not np.isfinite(push):
        raise ValueError(f"the push must be a finite number, got {push:g} N/mm2")
    mesh = given_or_rectangle(given, 100.0, WIDTH)
    require_edges("buckling", mesh, ENDS)
    length, width = np.ptp(mesh.p, axis=1).tolist()
    return Scene(
        name="buckling",
        mesh=mesh,
        warp=(1.0, 0.0),
        weft=(0.0, 1.0),
        conditions={
            "left": Condition("left"),
            "right": Condition("right", (-shortening * length, 0.0, 0.0)),
        },
        driven="right",
        dimension=3,
        loads=(BodyForce((0.0, 0.0, push), factor=1.0, name="push"),) if push else (),
        first=(Quantity("Height of the buckle", "height_mm", "mm"),),
        figures=partial(
            _buckling_figures, length=length, width=width, shortening=shortening
        ),
        misfit=misfit(mesh, ENDS),
    )


def _buckling_figures(
    result: Result, length: float, width: float, shortening: float
) -> dict[str, float]:
    """Force at the ends and height of the middle, computed and of the elastica."""
    ply, state = result.ply, result.states[-1]
    D, t = _stiffness(result), state.load_factor
    if D is None or t == 0:
        return {}
    force = -float(state.reactions["right"][0]) / width
    height = float(np.abs(ply.nodal(result.u)[2]).max())
    figures = {"force_N_per_mm": force, "height_mm": height}
    if not D:
        return figures
    exact = buckled(t * shortening)
    return figures | {
        "buckling_force_N_per_mm": float(D * (np.pi / length) ** 2),
        "exact_force_N_per_mm": float(D / length**2 * exact.force),
        "exact_height_mm": length * exact.height,
        "force_over_exact": force / (D / length**2 * exact.force),
        "height_over_exact": height / (length * exact.height),
    }
