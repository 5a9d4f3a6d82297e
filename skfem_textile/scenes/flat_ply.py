"""Flat ply of a scene in space: its mesh, fibres and planes of symmetry."""

from typing import NamedTuple, Unpack

import numpy as np
from numpy import ndarray
from skfem import Mesh

from ..declarations.scenes import OnTool, PlyOptions
from ..mesh.checks import MeshError, check_mesh, with_edges
from ..solve.conditions import Condition
from .rectangle import rectangle

#: Sides in planes of symmetry, and their normals.
_SYMMETRY = {"left": (0.0, None, None), "bottom": (None, 0.0, None)}

# Tolerances of angles in radians, and of lengths relative to the ply.
_OFF = 1e-6


class FlatPly(NamedTuple):
    """Undeformed ply.

    Attributes
    ----------
    mesh
        Mesh with named edges.
    angles
        Inclination of warp and weft in radians.
    tension
        Edge tension in N/mm.
    held
        Names of the sides in planes of symmetry.
    """

    mesh: Mesh
    angles: tuple[float, float]
    tension: float
    held: tuple[str, ...]


def flat_ply(
    name: str,
    mesh: str | Mesh,
    **ply: Unpack[PlyOptions],
) -> FlatPly:
    """Flat ply of a scene with planes of symmetry.

    Parameters
    ----------
    name
        Name of the scene, for messages.
    mesh
        A mesh of the ply centred at the origin, or of its quarter with the lower left
        corner there; or the kind of `rectangle` to generate.
    size, jitter, seed
        See `rectangle`; they apply to the computed part.
    fibres
        Inclination of the warp in radians; the weft is normal to it.
    width, height
        Sides of the whole ply in mm, if its mesh is generated.
    tension
        Tension in N/mm on free edges along the fibres.
    part
        Computed part; by default a quarter if the fibres permit it.

    Raises
    ------
    ValueError
        If the mesh is not valid, a number is not positive, or the part does not match
        the fibres.
    """
    given = OnTool(**ply)
    fibres, part, width, height = given.fibres, given.part, given.width, given.height
    _refuse_numbers(name, given)
    symmetric = abs(fibres / (np.pi / 4) - round(fibres / (np.pi / 4))) < _OFF
    if part == "quarter" and not symmetric:
        raise ValueError(
            f"{name}: fibres at {np.degrees(fibres):g} degrees have no planes of "
            "symmetry: use the whole ply"
        )
    part = part or ("quarter" if symmetric else "whole")
    share, held = (0.5, tuple(_SYMMETRY)) if part == "quarter" else (1.0, ())
    angles = fibres, fibres + np.pi / 2
    if isinstance(mesh, str):
        sides = share * width, share * height
        flat = rectangle(*sides, given.size, mesh, given.jitter, given.seed, *angles)
        if part == "whole":
            flat = flat.translated((-0.5 * width, -0.5 * height))
    else:
        check_mesh(mesh)
        flat = with_edges(mesh)
    return FlatPly(flat, angles, given.tension, held)


def in_planes(name: str, mesh: Mesh) -> dict[str, Condition]:
    """Conditions of a quarter on its planes of symmetry.

    Raises
    ------
    MeshError
        If the mesh has no edges there.
    """
    for side in _SYMMETRY:
        if side not in mesh.boundaries:
            raise MeshError(
                f"{name}: the mesh of a quarter has no straight {side} edge: name a "
                f"boundary {side!r}"
            )
    if np.abs(mesh.p.min(axis=1)).max() > _OFF * np.ptp(mesh.p):
        raise MeshError(
            f"{name}: the lower left corner of the mesh of a quarter must be at the "
            "origin: for a whole ply set part to 'whole'"
        )
    return {side: Condition(side, value) for side, value in _SYMMETRY.items()}


def free_edges(mesh: Mesh, held: tuple[str, ...]) -> ndarray:
    """Numbers of the edges of a ply on none of the held boundaries."""
    fixed = [mesh.boundaries[name] for name in held]
    free = np.setdiff1d(mesh.boundary_facets(), np.concatenate([[], *fixed]))
    return free.astype(int)


def _refuse_numbers(name: str, ply: OnTool) -> None:
    for what, side in (("width", ply.width), ("height", ply.height)):
        if not 0 < side < np.inf:
            raise ValueError(f"{name}: the {what} must be positive, got {side:g} mm")
    if not 0 <= ply.tension < np.inf:
        raise ValueError(
            f"{name}: the edge tension must be 0 or positive, got {ply.tension:g} N/mm"
        )
    if not np.isfinite(ply.fibres):
        raise ValueError(
            f"{name}: the angle of the fibres must be finite, got {ply.fibres:g}"
        )
