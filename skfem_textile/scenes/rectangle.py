"""Meshes of a rectangle, and flat plies with their planes of symmetry."""

from collections.abc import Iterable, Sequence
from typing import NamedTuple, Unpack

import numpy as np
from numpy import ndarray
from skfem import Mesh, MeshQuad, MeshTri

from ..declarations.scenes import OnRectangle, OnTool, PlyOptions
from ..mesh.checks import MeshError, check_mesh, with_edges
from ..mesh.selection import named_nodes
from ..mesh.user_input import refuse_unknown
from ..solve.conditions import Condition

KINDS = "aligned", "irregular", "horizontal", "vertical", "delaunay"

# Tolerances of angles in radians, and of lengths relative to the rectangle.
_OFF = 1e-6


def rectangle(
    width: float,
    height: float,
    size: tuple[int, int],
    kind: str = "irregular",
    jitter: float = 0.3,
    seed: int = 1,
    warp: float = 0.0,
    weft: float = np.pi / 2,
) -> Mesh:
    """Mesh of [0, width] × [0, height] with edges named left, bottom, right, top.

    Parameters
    ----------
    width, height
        Sides in mm.
    size
        Number of intervals along x and y.
    kind
        ``aligned`` with the fibres (`mesh_along_fibres`); ``irregular``, with all nodes
        moved; ``horizontal``, with nodes moved along x only, so that horizontal element
        edges stay aligned; ``vertical``, along y only.  Boundary nodes slide along
        their edges.  ``delaunay``, the Delaunay triangulation of the nodes of
        ``irregular``.
    jitter
        Largest displacement of a node, relative to the spacing.
    seed
        Seed of the random displacements.
    warp, weft
        Inclination of the fibres in radians, for ``aligned``.

    Raises
    ------
    ValueError
        If the kind is unknown, a side or the size is not positive, the jitter is not in
        [0, 1), the seed is negative, or warp and weft of ``aligned`` are parallel.

    Examples
    --------
    >>> rectangle(40, 60, (10, 15)).nelements
    150
    """
    nx, ny = size
    refuse_unknown("mesh", kind, KINDS)
    refuse_unless_positive("the width", width, " mm")
    refuse_unless_positive("the height", height, " mm")
    if nx < 1 or ny < 1:
        raise ValueError(f"the mesh requires at least 1x1 elements, got {nx}x{ny}")
    if not 0 <= jitter < 1:
        raise ValueError(f"jitter must be at least 0 and below 1, got {jitter}")
    if seed < 0:
        raise ValueError(f"seed must be at least 0, got {seed}")

    if kind == "aligned":
        from ..outlines import mesh_along_fibres

        outline = [[0.0, width, width, 0.0], [0.0, 0.0, height, height]]
        A1, A2 = ((np.cos(angle), np.sin(angle)) for angle in (warp, weft))
        return mesh_along_fibres(outline, A1, A2, (width / nx, height / ny))

    x, y = np.meshgrid(np.linspace(0, width, nx + 1), np.linspace(0, height, ny + 1))
    rng = np.random.default_rng(seed)
    dx = (2 * rng.random(x.shape) - 1) * jitter * width / nx
    dy = (2 * rng.random(y.shape) - 1) * jitter * height / ny
    if kind in ("irregular", "horizontal", "delaunay"):
        x[:, 1:-1] += dx[:, 1:-1]
    if kind in ("irregular", "vertical", "delaunay"):
        y[1:-1] += dy[1:-1]
    points = np.stack([x.ravel(), y.ravel()])
    if kind == "delaunay":
        from scipy.spatial import Delaunay

        triangles = np.ascontiguousarray(Delaunay(points.T).simplices.T)
        return with_edges(MeshTri(points, triangles))

    node = np.arange(x.size).reshape(x.shape)
    corners = node[:-1, :-1], node[:-1, 1:], node[1:, 1:], node[1:, :-1]
    return with_edges(MeshQuad(points, np.stack([c.ravel() for c in corners])))


def given_or_rectangle(
    given: OnRectangle, width: float, height: float, *fibres: float
) -> Mesh:
    """The given mesh, with named edges, or a `rectangle` with the given parameters.

    Parameters
    ----------
    given
        Parameters of the scene.
    width, height
        Sides in mm.
    *fibres
        Inclination of warp and weft in radians, for ``aligned``.

    Raises
    ------
    ValueError
        If the mesh is not valid; see also `rectangle`.
    """
    if not isinstance(given.mesh, str):
        check_mesh(given.mesh)
        return with_edges(given.mesh)
    grid = given.size, given.mesh, given.jitter, given.seed
    return rectangle(width, height, *grid, *fibres)


def require_edges(
    name: str, mesh: Mesh, sides: Iterable[str], what: str = "the mesh"
) -> None:
    """Refuse a mesh of a scene without straight edges of these names."""
    for side in sides:
        if side not in mesh.boundaries:
            raise MeshError(
                f"{name}: {what} has no straight {side} edge: name a boundary {side!r}"
            )


def misfit(mesh: Mesh, sides: Iterable[str]) -> str:
    """Reason why a mesh does not fill its bounding rectangle; empty if it does.

    It does if every boundary edge lies on one of the four sides, to a millionth of the
    rectangle, as in files with seven digits.

    Parameters
    ----------
    mesh
        A mesh with named boundaries, its sides along the axes.
    sides
        Names among ``left``, ``bottom``, ``right`` and ``top``.  Each boundary so named
        must be the whole side.
    """
    low, high = mesh.p.min(axis=1), mesh.p.max(axis=1)
    boundary = mesh.boundary_facets()
    ends, off = mesh.p[:, mesh.facets[:, boundary]], _OFF * (high - low)
    on = {
        side: (np.abs(ends[axis] - at[axis]) <= off[axis]).all(axis=0)
        for side, axis, at in (
            *(("left", 0, low), ("bottom", 1, low)),
            *(("right", 0, high), ("top", 1, high)),
        )
    }
    inside = ~np.any(list(on.values()), axis=0)
    if inside.any():
        return (
            f"{inside.sum()} boundary edge(s) of the mesh do not lie on a side of its "
            "bounding rectangle"
        )
    for side in sides:
        whole = np.setxor1d(mesh.boundaries[side], boundary[on[side]]).size == 0
        if not whole or side in named_nodes(mesh):
            return (
                f"the boundary {side!r} of the mesh does not consist of the whole "
                f"{side} side"
            )
    return ""


#: Sides in planes of symmetry, and their normals.
_SYMMETRY = {"left": (0.0, None, None), "bottom": (None, 0.0, None)}


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

    @property
    def fibres(self) -> tuple[tuple[float, float], tuple[float, float]]:
        """Directions of warp and weft."""
        c, s = float(np.cos(self.angles[0])), float(np.sin(self.angles[0]))
        return (c, s), (-s, c)


def flat_ply(
    name: str,
    mesh: str | Mesh,
    turned_deg: Sequence[float] = (),
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
    turned_deg
        Angle in degrees by which the fibres of each ply are turned.
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
    inclined = fibres + np.radians([0.0, *turned_deg])
    skew = np.abs(inclined / (np.pi / 4) - np.rint(inclined / (np.pi / 4))) >= _OFF
    if part == "quarter" and skew.any():
        raise ValueError(
            f"{name}: fibres at {np.degrees(inclined[skew][0]):g} degrees have no "
            "planes of symmetry: use the whole ply"
        )
    part = part or ("whole" if skew.any() else "quarter")
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
    require_edges(name, mesh, _SYMMETRY, "the mesh of a quarter")
    if np.abs(mesh.p.min(axis=1)).max() > _OFF * np.ptp(mesh.p):
        raise MeshError(
            f"{name}: the lower left corner of the mesh of a quarter must be at the "
            "origin: for a whole ply set part to 'whole'"
        )
    return {side: Condition(side, value) for side, value in _SYMMETRY.items()}


def half_way(name: str, mesh: Mesh) -> ndarray:
    """Point of the x axis halfway between the origin and the end of a whole ply.

    Raises
    ------
    MeshError
        If the origin is not inside the mesh.
    """
    low, high = mesh.p.min(axis=1), mesh.p.max(axis=1)
    if (low >= 0).any() or (high <= 0).any():
        raise MeshError(
            f"{name}: the origin must be inside the mesh of a whole ply: move the mesh"
        )
    return np.array([0.5 * float(high[0]), 0.0])


def free_edges(mesh: Mesh, held: tuple[str, ...]) -> ndarray:
    """Numbers of the edges of a ply on none of the held boundaries."""
    fixed = [mesh.boundaries[name] for name in held]
    free = np.setdiff1d(mesh.boundary_facets(), np.concatenate([[], *fixed]))
    return free.astype(int)


def refuse_unless_positive(
    what: str, number: float, unit: str = "", also: str = ""
) -> None:
    """Refuse a number that is not positive and finite, or ``also`` "0 or "."""
    if not (0 < number < np.inf or (also and number == 0)):
        raise ValueError(f"{what} must be {also}positive, got {number:g}{unit}")


def _refuse_numbers(name: str, ply: OnTool) -> None:
    refuse_unless_positive(f"{name}: the width", ply.width, " mm")
    refuse_unless_positive(f"{name}: the height", ply.height, " mm")
    refuse_unless_positive(f"{name}: the edge tension", ply.tension, " N/mm", "0 or ")
    if not np.isfinite(ply.fibres):
        raise ValueError(
            f"{name}: the angle of the fibres must be finite, got {ply.fibres:g}"
        )
