"""Scene `buckling`: a strip in space whose ends are pushed together.

A strip [0, L] × [0, W], warp along x, has hinges at its left and right edges.  The
right one moves to the left by a share of the length.  The strip stays flat up to the
force D (π/L)² per width.  Then it is an elastica (Euler).
"""

from functools import partial

import numpy as np
from skfem import Mesh

from ...ply.loads import BodyForce
from ...solve.conditions import Condition
from ...solve.result import Result
from ..common.elastica import buckled
from ..rectangle import misfit
from ..scene import Scene
from .strip_with_ends import ENDS, strip_with_ends

#: Length and width of the strip in mm.
LENGTH, WIDTH = 100.0, 25.0


def buckling(
    mesh: str | Mesh = "irregular",
    size: tuple[int, int] = (16, 2),
    jitter: float = 0.0,
    seed: int = 1,
    shortening: float = 0.2,
    push: float = 1e-8,
) -> Scene:
    """A hinged strip that is pushed together, and buckles.

    Parameters
    ----------
    mesh
        A mesh of the strip, or the kind of `rectangle` to make.  The exact answer holds
        if the mesh fills a rectangle of which ``left`` and ``right`` are whole sides.
    size, jitter, seed
        As for `rectangle`.
    shortening
        Share of the length by which the ends are nearer at the end.
    push
        Load across the strip in N/mm² that is there from the start and tells to which
        side it buckles.  It must be small against D (π/L)⁴ times a height.

    Raises
    ------
    ValueError
        If the mesh is not valid or does not fit, the shortening is not between 0 and 1,
        or the push is not finite.
    """
    if not 0 < shortening < 1:
        raise ValueError(f"the shortening must be between 0 and 1, got {shortening:g}")
    if not np.isfinite(push):
        raise ValueError(f"the push must be a finite number, got {push:g}")
    mesh = strip_with_ends("buckling", mesh, (LENGTH, WIDTH), size, jitter, seed)
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
        figures=partial(figures, length=length, width=width, shortening=shortening),
        misfit=misfit(mesh, ENDS),
    )


def figures(
    result: Result, length: float, width: float, shortening: float
) -> dict[str, float]:
    """Force at the ends and height of the middle, beside those of the elastica.

    Parameters
    ----------
    result
        Of a run of the scene.
    length, width
        Sides of the strip in mm.
    shortening
        As of `buckling`.
    """
    ply, state = result.ply, result.states[-1]
    bending, t = ply.fabric.bending[0], state.load_factor
    if np.size(bending) > 1 or t == 0:
        return {}
    D = np.asarray(bending).item()
    force = -float(state.reactions["right"][0]) / width
    height = float(np.abs(ply.nodal(result.u)[2]).max())
    found = {"force_N_per_mm": force, "height_mm": height}
    if not D:
        return found
    exact = buckled(t * shortening)
    return found | {
        "buckling_force_N_per_mm": float(D * (np.pi / length) ** 2),
        "exact_force_N_per_mm": float(D / length**2 * exact.force),
        "exact_height_mm": length * exact.height,
        "force_over_exact": force / (D / length**2 * exact.force),
        "height_over_exact": height / (length * exact.height),
    }
