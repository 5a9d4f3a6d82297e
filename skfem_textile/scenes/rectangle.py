"""Meshes of a rectangle: along the fibres, or with randomly moved nodes."""

from collections.abc import Iterable
from typing import Literal, TypeAlias, get_args

import numpy as np
from numpy import ndarray
from skfem import Mesh, MeshQuad, MeshTri

from ..declarations.scenes import OnRectangle
from ..mesh.checks import check_mesh, with_edges
from ..mesh.selection import named_nodes

Kind: TypeAlias = Literal["aligned", "irregular", "horizontal", "vertical", "delaunay"]

KINDS: tuple[str, ...] = get_args(Kind)

# Tolerance of an edge on a side, relative to the rectangle.
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
    if kind not in KINDS:
        raise ValueError(f"unknown mesh {kind!r}: choose one of {', '.join(KINDS)}")
    if not (0 < width < np.inf and 0 < height < np.inf):
        raise ValueError(f"the sides must be positive, got {width} mm and {height} mm")
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
        return with_edges(_delaunay(points))

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


def _delaunay(points: ndarray) -> MeshTri:
    from scipy.spatial import Delaunay

    return MeshTri(points, np.ascontiguousarray(Delaunay(points.T).simplices.T))
