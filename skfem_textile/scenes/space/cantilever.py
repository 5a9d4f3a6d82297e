"""Scene `cantilever`: a strip that bends under its own weight (Peirce 1930).

A strip [0, L] × [0, W], warp along x, lies on a table, where its left edge is clamped,
and hangs over the table's edge.  Its warp bends without stretch: it is an elastica
under the weight w L³/D.  Peirce reads the bending stiffness from the angle θ of the
chord below the table, D = w L³/8 · cos(θ/2)/tan θ.
"""

from functools import partial

import numpy as np
from skfem import Mesh

from ...ply.loads import BodyForce
from ...solve.conditions import Condition
from ...solve.result import Result
from ..common.elastica import hanging, peirce
from ..rectangle import misfit
from ..scene import Scene
from .strip_with_ends import ENDS, strip_with_ends

#: Width of the strip in mm, that of ASTM D1388.
WIDTH = 25.0


def cantilever(
    mesh: str | Mesh = "irregular",
    size: tuple[int, int] = (16, 2),
    jitter: float = 0.0,
    seed: int = 1,
    length: float = 200.0,
    weight: float = 6e-6,
) -> Scene:
    """A strip that is clamped at its left edge and bends under its own weight.

    Parameters
    ----------
    mesh
        A mesh of the strip with its left edge on x = 0, or the kind of `rectangle` to
        make.  The exact answer holds if the mesh fills a rectangle of which ``left``
        and ``right`` are whole sides.
    size, jitter, seed
        As for `rectangle`.
    length
        Length L of the strip in mm, where its mesh is made.
    weight
        Weight per area in N/mm².

    Raises
    ------
    ValueError
        If the mesh is not valid or does not fit, or a number is not positive.
    """
    for name, number in (("length", length), ("weight", weight)):
        if not 0 < number < np.inf:
            raise ValueError(f"the {name} must be positive, got {number:g}")
    mesh = strip_with_ends("cantilever", mesh, (length, WIDTH), size, jitter, seed)
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
        figures=partial(figures, length=overhang, weight=weight),
        misfit=misfit(mesh, ENDS),
    )


def figures(result: Result, length: float, weight: float) -> dict[str, float]:
    """Where the tip is, and where that of the elastica is.

    Parameters
    ----------
    result
        Of a run of the scene.
    length
        Length L in mm.
    weight
        Weight per area in N/mm².
    """
    bending, t = result.ply.fabric.bending[0], result.states[-1].load_factor
    if np.size(bending) > 1 or t == 0:
        return {}
    D = np.asarray(bending).item()
    ply = result.ply
    (x, _, z), right = ply.nodal(result.u), ply.nodes[0] > ply.nodes[0].max() - 1e-9
    tip_x, tip_z = length + float(x[right].mean()), float(z[right].mean())
    angle = float(np.arctan2(-tip_z, tip_x))
    found = {
        "tip_x_mm": tip_x,
        "tip_z_mm": tip_z,
        "chord_angle_deg": float(np.degrees(angle)),
    }
    if angle > 0:
        found["bending_by_peirce_N_mm"] = float(peirce(length, t * weight, angle))
    if not D:
        return found
    exact = hanging(t * weight * length**3 / D)
    off = np.hypot(tip_x - length * exact.x[-1], tip_z - length * exact.z[-1])
    return found | {
        "exact_tip_x_mm": float(length * exact.x[-1]),
        "exact_tip_z_mm": float(length * exact.z[-1]),
        "exact_chord_angle_deg": float(np.degrees(exact.chord_angle)),
        "tip_error_over_length": float(off / length),
    }
