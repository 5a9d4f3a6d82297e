"""Contact of the boundary of a mesh with itself: seams, cuts and overlaps.

`check_mesh` has excluded inverted cells, and neighbours on the same side of their edge.
Cells then overlap if and only if the boundary, traversed with the mesh on its left,
crosses itself or winds around a point twice.
"""

from dataclasses import dataclass
from itertools import product

import numpy as np
from numpy import ndarray
from skfem import Mesh

from .graph import components

# Share of the shorter edge below which nodes coincide.  Chosen: above the rounding of
# coordinates with seven digits.
_COINCIDENT = 1e-6

# Maximum number of pairs of close edges.  Measured: 2.5 µs per pair, so that the limit
# takes 25 s; a valid mesh has a few pairs per edge.
_MOST_PAIRS = 10_000_000

# Number of pairs of points and edges per block.  Chosen: about ten arrays of 8 bytes
# each, 100 MB.
_PAIRS_AT_A_TIME = 1_000_000

# Distance of an interior point of a cell from an edge, relative to the area of the cell
# over the length of the edge.  Chosen: inside the cell, and far above rounding.
_INSIDE = 1e-3

# Turn of a convex boundary to the right that is rounding, and the sharpest turn to the
# left at which its edges do not coincide within `_COINCIDENT`, in radians.
_STRAIGHT, _SHARPEST = 1e-9, 2.5


class Boundary:
    """Boundary edges of a mesh, each with the mesh on its left.

    Attributes
    ----------
    p
        Positions of the nodes of the mesh, shape (2, n_nodes).
    ends
        Nodes at the start and at the end of each edge, shape (2, n).
    cell
        Cell of each edge, shape (n,).
    area
        Area of this cell, shape (n,).
    along, length
        Vector from start to end of each edge, shape (2, n), and its length, (n,).
    size
        Exponent of the smallest power of two not below the length, shape (n,).
    """

    def __init__(self, p: ndarray, ends: ndarray, cell: ndarray, area: ndarray) -> None:
        self.p, self.ends, self.cell, self.area = p, ends, cell, area
        self.along = p[:, ends[1]] - p[:, ends[0]]
        self.length = np.linalg.norm(self.along, axis=0)
        self.size = np.ceil(np.log2(self.length)).astype(int)

    def inside(self, edges: ndarray) -> ndarray:
        """Points inside the mesh, near the middles of edges, shape (2, m)."""
        x, y = self.along[:, edges]
        height = self.area[edges] / self.length[edges] ** 2
        middle = self.p[:, self.ends[:, edges]].mean(axis=1)
        return middle + _INSIDE * height * np.stack([-y, x])


def signed_areas(x: ndarray, y: ndarray) -> ndarray:
    """Areas of polygons by their corners, (k, n), positive where anticlockwise."""
    return 0.5 * (x * np.roll(y, -1, axis=0) - y * np.roll(x, -1, axis=0)).sum(axis=0)


def boundary_of(mesh: Mesh) -> Boundary:
    """Boundary of a mesh; no edge may belong to more than two cells."""
    x, y = mesh.p[:, mesh.t] - mesh.p[:, mesh.t[:1]]
    area = signed_areas(x, y)
    single = np.bincount(mesh.t2f.ravel()) == 1
    side, cell = np.nonzero(single[mesh.t2f])
    ends = np.stack([mesh.t[side, cell], np.roll(mesh.t, -1, axis=0)[side, cell]])
    ends = np.where(area[cell] > 0, ends, ends[::-1])
    return Boundary(mesh.p, ends, cell, np.abs(area[cell]))


@dataclass(frozen=True, eq=False)
class Overlap:
    """Edges and nodes at which a boundary touches or crosses itself.

    Attributes
    ----------
    layered
        Cells with an edge that coincides with an edge of another cell, on the same
        side.
    crossing
        Cells with an edge that crosses an edge of another cell.
    hanging
        Nodes in the interior of an edge.
    doubled
        Nodes that coincide with others, except along cuts with single nodes as ends.
    """

    layered: ndarray
    crossing: ndarray
    hanging: ndarray
    doubled: ndarray


def is_convex(boundary: Boundary) -> bool:
    """True if the boundary is one convex loop, which does not touch itself.

    Followed around, it turns left at each node, once around altogether.
    """
    start, end = boundary.ends
    order = np.argsort(start)
    following = order[np.searchsorted(start[order], end)]
    (x, y), (dx, dy) = boundary.along, boundary.along[:, following]
    turn = np.arctan2(x * dy - y * dx, x * dx + y * dy)
    single = len(np.unique(start)) == len(start)
    once = turn.min() >= -_STRAIGHT and turn.max() <= _SHARPEST
    return single and bool(once and turn.sum() < 3 * np.pi)


def overlap_of(boundary: Boundary) -> Overlap | None:
    """Edges of a boundary that touch or cross others.

    None if more than `_MOST_PAIRS` pairs are close.
    """
    pairs = _close_pairs(boundary)
    if pairs is None:
        return None
    p, ends = boundary.p, boundary.ends
    i, j = pairs
    tolerance = _COINCIDENT * np.minimum(boundary.length[i], boundary.length[j])
    meet, joined = {}, []
    for k, m in product((0, 1), repeat=2):
        a, b = ends[k, i], ends[m, j]
        meet[k, m] = np.linalg.norm(p[:, a] - p[:, b], axis=0) <= tolerance
        joined.append(np.stack([a, b])[:, meet[k, m] & (a != b)])
    hanging, crossing = [], np.ones(len(i), dtype=bool)
    for edge, other, at_end in (
        (i, j, [meet[0, m] | meet[1, m] for m in (0, 1)]),
        (j, i, [meet[k, 0] | meet[k, 1] for k in (0, 1)]),
    ):
        beyond = []
        for node, at_node in zip(ends[:, other], at_end, strict=True):
            distance, share = _distance_and_share(boundary, edge, p[:, node])
            on = np.abs(distance) <= tolerance
            hanging.append(node[on & ~at_node & (share > 0) & (share < 1)])
            beyond.append(np.where(on, 0.0, np.sign(distance)))
        crossing &= beyond[0] * beyond[1] < 0
    cells, layered = boundary.cell[np.stack([i, j])], meet[0, 0] & meet[1, 1]
    seam = ends[:, i[meet[0, 1] & meet[1, 0]]]
    return Overlap(
        np.unique(cells[:, layered]),
        np.unique(cells[:, crossing]),
        np.unique(np.concatenate(hanging)),
        _coincident_off_cuts(np.concatenate(joined, axis=1), seam, p.shape[1]),
    )


def _close_pairs(boundary: Boundary) -> ndarray | None:
    """Pairs of edges that may touch, shape (2, n); None if there are too many."""
    from scipy.spatial import KDTree  # at the first mesh, not at import

    middle = (boundary.p[:, boundary.ends].mean(axis=1)).T
    close, total, size = [], 0, boundary.size
    for exponent in np.unique(size):
        same = np.flatnonzero(size == exponent)
        not_longer = np.flatnonzero(size <= exponent)
        one, other = KDTree(middle[same]), KDTree(middle[not_longer])
        reach = 2.0**exponent * (1 + 2 * _COINCIDENT)
        total += one.count_neighbors(other, reach)
        if total > _MOST_PAIRS:
            return None
        pairs = one.sparse_distance_matrix(other, reach, output_type="ndarray")
        i, j = same[pairs["i"]], not_longer[pairs["j"]]
        close.append(np.stack([i, j])[:, (size[j] < exponent) | (i < j)])
    return np.concatenate(close, axis=1)


def _distance_and_share(
    boundary: Boundary, edge: ndarray, x: ndarray
) -> tuple[ndarray, ndarray]:
    """Signed distance of points from edges, and relative position along them.

    The position is 0 at the start and 1 at the end.
    """
    length = boundary.length[edge]
    ex, ey = boundary.along[:, edge] / length
    dx, dy = x - boundary.p[:, boundary.ends[0, edge]]
    return ex * dy - ey * dx, (ex * dx + ey * dy) / length


def _coincident_off_cuts(joined: ndarray, seam: ndarray, n_nodes: int) -> ndarray:
    """Nodes that coincide with others and do not lie along a cut.

    ``joined`` are pairs of coincident nodes, and ``seam`` nodes of coincident edges of
    opposite direction, shape (2, n) each.
    """
    group = components(n_nodes, joined)
    group_size = np.bincount(group)
    doubled = np.flatnonzero(group_size[group] > 1)
    if not doubled.size:
        return doubled
    sides = np.unique(np.sort(group[seam], axis=0), axis=1)
    line = components(len(group_size), sides)
    is_end = np.bincount(sides.ravel(), minlength=len(group_size)) == 1
    closed = np.setdiff1d(line[is_end], line[is_end & (group_size > 1)])
    return doubled[~np.isin(line[group[doubled]], closed)]


def cells_within(boundary: Boundary) -> ndarray:
    """Boundary cells that lie in other cells without crossing edges.

    Either one part of the mesh lies in another, or cells that share one node overlap.
    """
    ends = boundary.ends
    piece = components(boundary.p.shape[1], ends)[ends[0]]
    x, y = boundary.p[:, ends] - boundary.p[:, :1, None]
    area = np.bincount(piece, x[0] * y[1] - x[1] * y[0])
    _, first = np.unique(piece, return_index=True)
    outline = first[area[piece[first]] > 0]
    within = _pinched(boundary)
    if len(outline) > 1:
        inner = outline[_winding_numbers(boundary, boundary.inside(outline)) > 1]
        within = np.concatenate([within, inner])
    return np.unique(boundary.cell[within])


def _pinched(boundary: Boundary) -> ndarray:
    """Boundary edges at nodes around which fans of cells overlap.

    In anticlockwise order around a node, an outgoing edge begins a fan of cells and an
    incoming edge ends it.  Without overlap they alternate.
    """
    ends, n = boundary.ends, boundary.ends.shape[1]
    node = ends.ravel()
    edge, arrives = np.tile(np.arange(n), 2), np.repeat([False, True], n)
    shared = np.flatnonzero(np.bincount(node)[node] > 2)
    node, edge, arrives = node[shared], edge[shared], arrives[shared]
    x, y = np.where(arrives, -1, 1) * boundary.along[:, edge]
    angle = np.arctan2(y, x) - _COINCIDENT * arrives  # along a cut, ends come first
    nodes, first, inverse = np.unique(node, return_index=True, return_inverse=True)
    angle = (angle - angle[first][inverse]) % (2 * np.pi)
    order = np.lexsort([angle, node])
    turn = np.arange(len(order)) - np.searchsorted(node[order], nodes)[inverse[order]]
    return edge[order][arrives[order] != (turn % 2 == 1)]


def _winding_numbers(boundary: Boundary, x: ndarray) -> ndarray:
    """Winding number of the boundary around each point, shape (n,).

    Counts the upward crossings of the ray from the point to the right.
    """
    turns = np.zeros(x.shape[1])
    y = boundary.p[1, boundary.ends]
    low, size = y.min(axis=0), boundary.size
    for exponent in np.unique(size):
        edges = np.flatnonzero(size == exponent)
        edges = edges[np.argsort(low[edges])]
        # Edges at the height of a point begin below it, by at most their length.
        first = np.searchsorted(low[edges], x[1] - 2.0**exponent * (1 + _COINCIDENT))
        last = np.searchsorted(low[edges], x[1], side="right")
        batch = np.cumsum(last - first) // _PAIRS_AT_A_TIME
        breaks = np.flatnonzero(np.diff(batch)) + 1
        for points in np.split(np.arange(len(batch)), breaks):
            count = (last - first)[points]
            point = np.repeat(points, count)
            rank = np.arange(len(point)) - np.repeat(np.cumsum(count) - count, count)
            edge = edges[first[point] + rank]
            up = (y[1, edge] > x[1, point]).astype(float) - (y[0, edge] > x[1, point])
            point, edge, up = (values[up != 0] for values in (point, edge, up))
            distance, _ = _distance_and_share(boundary, edge, x[:, point])
            right = distance * up > 0
            turns += np.bincount(point[right], up[right], minlength=len(turns))
    return turns
