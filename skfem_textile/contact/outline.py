"""Outlines of tools in the plane."""

from typing import TYPE_CHECKING

import numpy as np
from numpy import ndarray
from numpy.typing import ArrayLike
from skfem import Mesh

from ..mesh.requirements import require
from ..mesh.user_input import real_numbers

if TYPE_CHECKING:
    from shapely import Geometry

# Ability that requires shapely.
_OUTLINE = "the outline of a tool"

#: Length, area, load or deviation of a rotation, relative to the largest of its kind,
#: that is round-off: far above one rounded operation, far below the sizes of a ply.
ROUND_OFF = 1e-9


def inside(corners: ndarray, x: ndarray) -> ndarray:
    """True for points inside a polygon, by the number of edges to their right.

    An edge that the polygon follows in both directions has no effect.

    Parameters
    ----------
    corners
        Corners of the polygon in order, shape (2, n_corners).
    x
        Points, shape (2, n).
    """
    ends = np.array([corners, np.roll(corners, -1, axis=1)])
    order = np.argsort(ends[:, 1], axis=0)  # the same rounding in both directions
    begin, end = np.take_along_axis(ends, order[:, None], axis=0)[..., None]
    crosses = (begin[1] > x[1]) != (end[1] > x[1])
    rise = np.where(crosses, end[1] - begin[1], 1.0)
    at = begin[0] + (x[1] - begin[1]) / rise * (end[0] - begin[0])
    return (crosses & (x[0] < at)).sum(axis=0) % 2 == 1


def nearest(corners: ndarray, x: ndarray) -> ndarray:
    """Nearest points on the edges of a polygon, shape (2, n); arguments as `inside`."""
    import shapely

    ring = shapely.LinearRing(corners.T)
    lines = shapely.shortest_line(ring, shapely.points(x.T))
    return shapely.get_coordinates(shapely.get_point(lines, 0)).T


def region(corners: ndarray) -> "Geometry":
    """Points inside a polygon as a geometry, by the rule of `inside`."""
    require(_OUTLINE, "outlines", "shapely")
    import shapely

    return shapely.make_valid(shapely.Polygon(_rounded(corners).T))


def is_flat(corners: ndarray) -> bool:
    """True if a polygon encloses no area."""
    return bool(region(corners).area <= ROUND_OFF * np.ptp(corners, axis=1).max() ** 2)


def crossing_edges(corners: ndarray) -> tuple[int, int] | None:
    """First corners of two crossing edges of a polygon; None if none cross."""
    require(_OUTLINE, "outlines", "shapely")
    import shapely

    x = _rounded(corners).T
    edges = shapely.linestrings(np.stack([x, np.roll(x, -1, axis=0)], axis=1))
    tree = shapely.STRtree(edges)
    first, second = tree.query(edges, predicate="crosses")
    return (int(first[0]), int(second[0])) if first.size else None


def _rounded(corners: ndarray) -> ndarray:
    """Corners without round-off, so that edges followed twice coincide."""
    unit = ROUND_OFF * np.ptp(corners, axis=1).max()
    return np.round(corners / unit) * unit if unit else corners


def shares_inside(corners: ndarray, mesh: Mesh, x: ndarray) -> ndarray:
    """Share of the area of each element that is inside a polygon, shape (n_elements,).

    An element consists of triangles between its corners, each of which is deformed
    affinely.

    Parameters
    ----------
    corners
        See `inside`.
    mesh
        The undeformed mesh.
    x
        Positions of its vertices, shape (2, n_vertices).
    """
    import shapely

    t = mesh.t
    fan = np.array([t[[0, i, i + 1]] for i in range(1, len(t) - 1)])
    triangles = shapely.polygons(x[:, fan].transpose(1, 3, 2, 0))
    within = region(corners)
    shapely.prepare(within)
    shares = shapely.contains_properly(within, triangles).astype(float)
    crossed = shapely.intersects(within, triangles) & (shares == 0.0)
    whole = shapely.area(triangles)
    flat = crossed & (whole <= ROUND_OFF * whole.max())
    shares[flat] = shapely.contains(within, shapely.centroid(triangles[flat]))
    crossed &= ~flat
    parts = shapely.intersection(within, triangles[crossed])
    shares[crossed] = shapely.area(parts) / whole[crossed]
    areas = shapely.area(shapely.polygons(mesh.p[:, fan].transpose(1, 3, 2, 0)))
    return np.asarray((areas * shares).sum(axis=0) / areas.sum(axis=0))


def corners_of(what: str, outline: ArrayLike | None) -> ndarray | None:
    """Validated corners of an outline."""
    if outline is None:
        return None
    corners = real_numbers(f"{what}: outline", outline)
    if corners.ndim != 2 or corners.shape[0] != 2 or corners.shape[1] < 3:
        raise ValueError(
            f"{what}: outline must have the shape (2, n) with at least three corners, "
            f"not {corners.shape}"
        )
    if not np.isfinite(corners).all():
        raise ValueError(f"{what}: outline must be finite")
    if (crossing := crossing_edges(corners)) is not None:
        first, second = (f"from corner {i}" for i in crossing)
        raise ValueError(f"{what}: the edges of the outline {first} and {second} cross")
    if is_flat(corners):
        raise ValueError(f"{what}: the outline encloses no area")
    return corners
