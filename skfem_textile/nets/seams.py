"""Seams of darts: lines on a tool at which nets end, and their paths."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy import ndarray

from ..mesh.graph import boundary_edges
from ..surfaces.surface import OffSurfaceError, onto
from ..surfaces.tool_mesh import unit
from ..surfaces.triangle_mesh import TriangleMesh

# Radius of a disc relative to the length of a seam, at least a cell, and the Gauss
# curvature of a disc in radians above which it is concentrated there.  It is the shear
# that a net would carry along the seam, 11°, above the noise of triangles.
_DISC, _CONCENTRATED = 0.05, 0.2

# Distance of concentrated curvature from the seam up to which it belongs to the seam,
# relative to the length of the seam.
_BESIDE = 0.25


@dataclass(frozen=True, eq=False)
class Seam:
    """Polyline on a tool along which a net is cut.

    Attributes
    ----------
    points
        Points in mm from the tip of the dart to the edge of the part, shape (3, n).
    left
        Unit vectors tangent to the tool and normal to the segments, towards the left,
        shape (3, n − 1).
    """

    points: ndarray
    left: ndarray

    @property
    def length(self) -> float:
        """Length in mm."""
        return float(np.linalg.norm(np.diff(self.points), axis=0).sum())

    def nearest(self, x: ndarray) -> tuple[ndarray, ndarray, ndarray]:
        """Distances from the seam, and distances to its left, in mm, shape (n,).

        Also the mask of points that are behind the tip.
        """
        begin, along = self.points[:, :-1, None], np.diff(self.points)[:, :, None]
        off = x[:, None] - begin  # (3, segment, point)
        share = (off * along).sum(axis=0) / (along**2).sum(axis=0)
        away = off - np.clip(share, 0.0, 1.0) * along
        distance = np.sqrt((away * away).sum(axis=0))
        k, n = distance.argmin(axis=0), np.arange(x.shape[1])
        left = (away[:, k, n] * self.left[:, k]).sum(axis=0)
        return distance[k, n], left, (k > 0) | (share[0] > 0)


class Seams:
    """Seams of darts, numbered from 1 on.

    A net cannot lie unsheared where the curvature of the tool is concentrated.  These
    spots next to seams are left out when it is laid, and filled from all sides.
    """

    def __init__(self, seams: Sequence[Seam], tool: TriangleMesh, cell: float) -> None:
        self.seams, self._tool, self._cell = tuple(seams), tool, cell

    def nearest(self, x: ndarray) -> tuple[ndarray, ndarray, ndarray]:
        """Number of the nearest seam of each point, shape (n,).

        Also the distances to its left in mm, and the mask of points behind its tip.
        """
        found = [seam.nearest(x) for seam in self.seams]
        distance, left, behind = np.array(found).swapaxes(0, 1)
        k, n = distance.argmin(axis=0), np.arange(x.shape[1])
        return k + 1, left[k, n], behind[k, n] > 0

    def in_spots(self, x: ndarray) -> ndarray:
        """Mask of points at tips, or where curvature is concentrated at seams, (n,)."""
        mask = np.zeros(x.shape[1], dtype=bool)
        for seam in self.seams:
            mask |= np.linalg.norm(x - seam.points[:, :1], axis=0) < self._cell
            distance, *_ = seam.nearest(x)
            near = np.flatnonzero(~mask & (distance < _BESIDE * seam.length))
            if near.size:
                radius = max(_DISC * seam.length, self._cell)
                within = self._tool.curvature_within(x[:, near], radius)
                mask[near] = np.abs(within) > _CONCENTRATED
        return mask

    def labels(self, x: ndarray, before: ndarray) -> tuple[ndarray, ndarray]:
        """Numbers of the nearest seams, negative on their right.

        A crossing is on the side of the crossings from which it follows, also if it is
        beyond the seam.

        Parameters
        ----------
        x
            Crossings in mm, shape (3, n).
        before
            Numbers of seams of the crossings from which they follow, shape (2, n).

        Returns
        -------
        tuple
            Numbers, 0 before the tips, and the mask of those beyond the seams, (n,).
        """
        number, left, known = self.nearest(x)
        side = np.where(left >= 0, 1, -1)
        for label in before:
            follows = np.abs(label) == number
            side = np.where(follows, np.sign(label), side)
        return np.where(known, side * number, 0), known & (side * left < 0)


# Step of a seam relative to a cell.
_STEP = 0.5

# Half of the width over which the turning of the surface on both sides is compared: the
# first in cells, and the largest relative to the distance of the tip from the edge.
_FIRST, _LAST = 1.0, 0.2

# Turning relative to that over half of the width at which an edge has ended.
_ENDED = 1.2

# Turning of the surface over this width in radians above which a seam follows an edge.
_TURNS = 0.2

# Length in cells of the shortest way that is the direction at the tip.
_BEGIN = 4.0

# Share of a seam that is the direct way from the tip.
_DIRECT = 0.1

# Number of steps over which the direction of a seam is averaged.
_MEAN = 4


def seam_from(
    tool: TriangleMesh, tip: ndarray, along: ndarray | None, cell: float
) -> Seam:
    """Seam from a tip to the edge of a tool.

    It is a geodesic in a given direction, by default along the shortest path to the
    edge.  Its points are shifted sideways to where the normal turns equally on both
    sides: onto the edge between two walls.

    Parameters
    ----------
    tool
        The tool.
    tip
        Position in mm, shape (3,).
    along
        Direction at the tip, shape (3,); None for the shortest way.
    cell
        Length of the rods in mm.
    """
    step = _STEP * cell
    shortest, distance = _to_edge(tool, tip, _BEGIN * cell)
    along = shortest if along is None else along
    widths = _FIRST * cell, _LAST * distance
    begin = onto(tool, tip[:, None])[:, 0]
    for _ in range(_MEAN):
        begin = _moved(tool, begin, along, widths, step)
    chain = [begin]
    limit = int(np.ceil(np.ptp(tool.facets.points, axis=1).sum() / step))
    for _ in range(limit):
        if len(chain) > _MEAN:
            along = chain[-1] - chain[-1 - _MEAN]
        along = _in_plane(tool, chain[-1], along)
        try:
            ahead = onto(tool, (chain[-1] + step * along)[:, None])[:, 0]
            chain.append(_moved(tool, ahead, along, widths, step))
        except OffSurfaceError:
            break
        if tool.beyond_edges(chain[-1][:, None])[0] > 0:
            break
    points = np.array(chain).T
    # Around the tip, where the surface turns in all directions, the direct way.
    last = max(round(_DIRECT * points.shape[1]), 1)
    shares = np.linspace(0.0, 1.0, last + 1)
    direct = points[:, :1] * (1 - shares) + points[:, [last]] * shares
    points[:, : last + 1] = onto(tool, direct)
    normal = unit(tool.gradient(points))
    mean = normal[:, 1:] + normal[:, :-1]
    return Seam(points, unit(np.cross(mean, np.diff(points), axis=0)))


def _to_edge(tool: TriangleMesh, x: ndarray, reach: float) -> tuple[ndarray, float]:
    """Shortest way along triangles to the edge of a tool.

    Its direction up to a reach in mm, shape (3,), and its length in mm.
    """
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import dijkstra

    points, triangles = tool.facets.points, tool.facets.triangles()
    ends = np.hstack([triangles[:2], triangles[1:], triangles[::2]])
    lengths = np.linalg.norm(points[:, ends[0]] - points[:, ends[1]], axis=0)
    n = points.shape[1]
    graph = coo_array((lengths, tuple(ends)), shape=(n, n)).tocsr()
    graph = graph.maximum(graph.T)
    rim = np.unique(boundary_edges([triangles]))
    distance, before, _ = dijkstra(
        graph, directed=False, indices=rim, min_only=True, return_predecessors=True
    )
    near = np.linalg.norm(points - x[:, None], axis=0)
    at = int(near.argmin())
    length, end = float(distance[at]), distance[at] - reach
    while before[at] >= 0 and distance[at] > end:
        at = int(before[at])
    return np.asarray(points[:, at] - x), length


def _moved(
    tool: TriangleMesh,
    x: ndarray,
    along: ndarray,
    widths: tuple[float, float],
    most: float,
) -> ndarray:
    """Point moved to the middle of an edge, by at most a distance in mm."""
    shift = _to_middle(tool, x, _in_plane(tool, x, along), widths)
    shift *= min(1.0, most / max(float(np.linalg.norm(shift)), 1e-12))
    return np.asarray(onto(tool, (x + shift)[:, None])[:, 0])


def _in_plane(tool: TriangleMesh, x: ndarray, along: ndarray) -> ndarray:
    """Unit vector in the tangent plane of a tool, shape (3,)."""
    normal = unit(tool.gradient(x[:, None]))[:, 0]
    return np.asarray(unit(along - normal * (normal @ along)))


def _to_middle(
    tool: TriangleMesh, x: ndarray, along: ndarray, widths: tuple[float, float]
) -> ndarray:
    """Shift in mm, (3,), to where the normal turns equally on both sides."""
    left = np.cross(unit(tool.gradient(x[:, None]))[:, 0], along)
    width, most = widths
    turns = _turns(tool, x, width * left)
    while 2 * width <= most:
        wider = _turns(tool, x, 2 * width * left)
        if _TURNS < wider.sum() < _ENDED * turns.sum():
            break
        width, turns = 2 * width, wider
    if not turns.sum() > _TURNS:
        return np.zeros(3)
    return np.asarray(0.5 * width * left * (turns[0] - turns[1]) / turns.sum())


def _turns(tool: TriangleMesh, x: ndarray, aside: ndarray) -> ndarray:
    """Angles of the normal on both sides to the normal at a point, shape (2,)."""
    beside = onto(tool, x[:, None] + np.outer(aside, [1.0, -1.0]))
    normals = unit(tool.gradient(np.column_stack([beside, x])))
    return np.arccos(np.clip(normals[:, :2].T @ normals[:, 2], -1.0, 1.0))
