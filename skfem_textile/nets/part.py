"""Parts of a tool, or of a net, inside a trimming curve and outside of holes."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy import ndarray
from numpy.typing import ArrayLike

from ..mesh.graph import boundary_edges
from ..mesh.requirements import require
from ..surfaces.holes import laplacian, parts_of
from ..surfaces.tool_mesh import closest_on_triangles, loops
from ..surfaces.triangle_mesh import TriangleMesh
from .crossings import Net
from .flat_pattern import FlatPattern, flat_pattern, shares_inside, spaced_curve
from .sheet import Sheet

# Ability that requires shapely.
_PART = "a part of a tool"


def points_of_part(
    tool: TriangleMesh, curve: ArrayLike, holes: Sequence[ArrayLike] = ()
) -> ndarray:
    """Vertices of a tool inside a closed curve and outside of holes, and the curve.

    The tool is mapped to a disk (Tutte 1963, How to draw a graph, Proc. London Math.
    Soc. 13:743), in which the inside of a curve is the inside of a polygon: also on
    vertical walls and undercuts.

    Parameters
    ----------
    tool
        The tool, whose holes are spanned, see `TriangleMesh.without_holes`.  On a
        closed one, the place furthest from the curve is outside.
    curve, holes
        Points of closed curves on the tool in mm, shape (3, n).

    Returns
    -------
    ndarray
        Positions in mm, shape (3, n).

    Raises
    ------
    ValueError
        If a curve is not valid, or no vertex is inside.

    Examples
    --------
    >>> import numpy as np
    >>> from skfem_textile import drape
    >>> x, y = (a.ravel() for a in np.meshgrid(*2 * [np.linspace(-50, 50, 21)]))
    >>> k = np.add.outer(21 * np.arange(20), np.arange(20)).ravel()
    >>> t = np.hstack([[k, k + 1, k + 22], [k, k + 22, k + 21]])
    >>> tool = drape.TriangleMesh(np.array([x, y, x**2 / 200]), t)
    >>> square = np.array([[-22, 22, 22, -22], [-22, -22, 22, 22], 4 * [2.42]])
    >>> points = drape.points_of_part(tool, square)
    >>> bool(np.abs(points[:2]).max() == 22)
    True
    """
    require(_PART, "outlines", "shapely")
    outline, x = _spaced(tool, curve), tool.facets.points
    disk = _on_disk(x, tool.facets.triangles(), outline)
    inside = _inside(tool, disk, (outline, *holes), disk, "vertex")
    return np.hstack([x[:, inside], outline])


def triangles_of_part(
    tool: TriangleMesh, curve: ArrayLike, holes: Sequence[ArrayLike] = ()
) -> ndarray:
    """Mask of the triangles whose centres are in a part of a tool, shape (n,).

    Parameters
    ----------
    tool, curve, holes
        See `points_of_part`.

    Raises
    ------
    ValueError
        If a curve is not valid, or no centre is inside.
    """
    require(_PART, "outlines", "shapely")
    triangles = tool.facets.triangles()
    disk = _on_disk(tool.facets.points, triangles, np.asarray(curve))
    centres = disk[:, triangles].mean(axis=1)
    return _inside(tool, disk, (curve, *holes), centres, "triangle")


def first_layer(net: Net) -> ndarray:
    """Mask of the cells that do not lie on cells closer to the start of the net.

    A net around a tube meets itself.  Distances are in the flat ply.

    Parameters
    ----------
    net
        The net.

    Returns
    -------
    ndarray
        Shape (n_warp, n_weft).
    """
    sheet, cells = Sheet.of_net(net), net.cells
    away = np.linalg.norm(net.centres()[:, cells] - net.touch[:, None], axis=0)
    rank = np.argsort(np.argsort(away, kind="stable"))
    corners = sheet.positions[:, sheet.elements]
    covered = np.arange(len(rank))
    for k in (0, 2):
        point = 0.5 * (corners[:, k, covered] + corners[..., covered].mean(axis=1))
        found = sheet.at(point, rank=rank).element
        covered = covered[rank[found] < rank[covered]]
    first = cells.copy()
    first[cells] = ~np.isin(np.arange(len(rank)), covered)
    return first


def _spaced(tool: TriangleMesh, curve: ArrayLike) -> ndarray:
    """Closed curve with points at most a mean edge of the triangles apart."""
    return spaced_curve(curve, float(tool.facets.longest_edges().mean()))


def _inside(
    tool: TriangleMesh,
    disk: ndarray,
    curves: Sequence[ArrayLike],
    places: ndarray,
    what: str,
) -> ndarray:
    """Mask of places on the disk, (2, n), inside the first curve and not in others.

    Raises an error if there is none, or if the end of a tube is inside.
    """
    import shapely

    x, triangles = tool.facets.points, tool.facets.triangles()
    outer, *inner = (
        shapely.Polygon(_mapped(x, triangles, disk, _spaced(tool, one)).T).buffer(0)
        for one in curves
    )
    for hole in inner:
        outer = outer.difference(hole)
    ends = loops(x, [triangles])[1:]
    if any(shapely.contains_xy(outer, *disk[:, end]).any() for end in ends):
        raise ValueError(
            "part: the curve runs around the tool and bounds no part of it: specify a "
            "curve around a part"
        )
    inside = np.asarray(shapely.contains_xy(outer, *places))
    if not inside.any():
        how = "the outline first, then its holes" if inner else "a curve around a part"
        raise ValueError(
            f"part: no {what} of the tool is inside the curve: specify {how}, or "
            "smaller triangles"
        )
    return inside


def _mapped(x: ndarray, triangles: ndarray, disk: ndarray, points: ndarray) -> ndarray:
    """Points of a tool on the disk, shape (2, n)."""
    triangle, shares = closest_on_triangles(x, triangles, points)
    return np.asarray((shares * disk[:, triangles[:, triangle]]).sum(axis=1))


def _on_disk(x: ndarray, triangles: ndarray, curve: ndarray) -> ndarray:
    """Vertices on the unit disk, shape (2, n); NaN in smaller parts of the tool.

    A closed tool is opened at the triangle that is furthest from the curve.
    """
    from scipy.sparse.linalg import spsolve
    from scipy.spatial import KDTree

    if not boundary_edges([triangles]).size:
        centres = x[:, triangles].mean(axis=1)
        away, _ = KDTree(curve.T).query(centres.T)
        triangles = np.delete(triangles, away.argmax(), axis=1)
    rim = loops(x, [triangles])[0]
    parts = parts_of(x.shape[1], triangles)
    own = np.flatnonzero(parts == parts[rim[0]])
    steps = np.linalg.norm(np.roll(x[:, rim], -1, axis=1) - x[:, rim], axis=0)
    around = 2 * np.pi * (np.cumsum(steps) - steps) / steps.sum()
    disk = np.full((2, x.shape[1]), np.nan)
    disk[:, rim] = np.cos(around), np.sin(around)
    free = np.setdiff1d(own, rim)
    if free.size:
        matrix, _ = laplacian(x.T, triangles, cotangents=False)
        right = matrix[free][:, rim] @ disk[:, rim].T
        disk[:, free] = -spsolve(matrix[free][:, free].tocsc(), right).T
    return disk


@dataclass(frozen=True, eq=False)
class TrimmedNet:
    """Net with its flat pattern, and the share of each cell inside it.

    Attributes
    ----------
    net
        The whole net.
    pattern
        Outlines in the flat ply.
    shares
        Share of the area of each cell inside the outline and outside the holes, shape
        (n_warp, n_weft); 0 for cells that were not laid.
    """

    net: Net
    pattern: FlatPattern
    shares: ndarray

    @property
    def area(self) -> float:
        """Area on the tool in mm²."""
        inside = self.shares > 0
        return float((self.net.areas()[inside] * self.shares[inside]).sum())

    def shear_angle(self) -> ndarray:
        """Shear angle of the cells inside in radians, NaN outside."""
        return np.where(self.shares > 0, self.net.shear_angle(), np.nan)


def trimmed(
    net: Net,
    curve: ArrayLike,
    holes: Sequence[ArrayLike] = (),
    spacing: float | None = None,
) -> TrimmedNet:
    """Trim a net along curves on the tool.

    Parameters
    ----------
    net
        The net, which covers the curves.
    curve, holes, spacing
        See `flat_pattern`.

    Raises
    ------
    ValueError
        See `flat_pattern`.
    """
    require("a trimmed net", "outlines", "shapely")
    pattern = flat_pattern(Sheet.of_net(net), curve, spacing, holes)
    return TrimmedNet(net, pattern, shares_inside(net, pattern))
