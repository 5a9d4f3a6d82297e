"""Where the boundary of a mesh touches or crosses itself: seams, cuts and overlaps.

No cell is inverted, and cells that share an edge are on either side of it
(`check_mesh`).  Then cells overlap exactly where the boundary, walked with the mesh on
its left, crosses itself or runs around the same place twice.
"""

from dataclasses import dataclass
from functools import cached_property
from itertools import product

import numpy as np
from numpy import ndarray
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components
from scipy.spatial import KDTree
from skfem import Mesh

# Nodes are at one place if they are closer than this share of the edges at them.
_SAME = 1e-6

# So many pairs of edges near one another are not looked at.
_CROWDED = 10_000_000

# Pairs of points and edges that are looked at together.
_TOGETHER = 1_000_000


@dataclass(frozen=True, eq=False)
class Boundary:
    """The boundary edges of a mesh, each with the mesh on its left.

    Attributes
    ----------
    p
        Positions of the nodes of the mesh, shape (2, n_nodes).
    ends
        Nodes at the start and at the end of each edge, shape (2, n).
    cell
        The cell of each edge, shape (n,).
    area
        The area of this cell, shape (n,).
    """

    p: ndarray
    ends: ndarray
    cell: ndarray
    area: ndarray

    @cached_property
    def along(self) -> ndarray:
        """From start to end, shape (2, n)."""
        return self.p[:, self.ends[1]] - self.p[:, self.ends[0]]

    @cached_property
    def length(self) -> ndarray:
        """Length, shape (n,)."""
        return np.linalg.norm(self.along, axis=0)

    @cached_property
    def size(self) -> ndarray:
        """Exponent of the power of two that is no less than the length, shape (n,)."""
        return np.ceil(np.log2(self.length)).astype(int)

    def inside(self, edges: ndarray) -> ndarray:
        """Points just inside the mesh beside the middles of edges, shape (2, m)."""
        x, y = self.along[:, edges]
        height = self.area[edges] / self.length[edges] ** 2
        middle = self.p[:, self.ends[:, edges]].mean(axis=1)
        return middle + 1e-3 * height * np.stack([-y, x])


def boundary_of(mesh: Mesh) -> Boundary:
    """The boundary of a mesh of which no edge belongs to more than two cells."""
    x, y = mesh.p[:, mesh.t] - mesh.p[:, mesh.t[:1]]
    area = 0.5 * (x * np.roll(y, -1, axis=0) - y * np.roll(x, -1, axis=0)).sum(axis=0)
    single = np.bincount(mesh.t2f.ravel()) == 1
    side, cell = np.nonzero(single[mesh.t2f])
    ends = np.stack([mesh.t[side, cell], np.roll(mesh.t, -1, axis=0)[side, cell]])
    ends = np.where(area[cell] > 0, ends, ends[::-1])
    return Boundary(mesh.p, ends, cell, np.abs(area[cell]))


@dataclass(frozen=True, eq=False)
class Contact:
    """Where a boundary touches or crosses itself.

    Attributes
    ----------
    layered
        Cells with an edge that runs along that of another cell, on the same side of it.
    crossing
        Cells with an edge that crosses that of another cell.
    hanging
        Nodes that lie on an edge of which they are no end.
    doubled
        Nodes at the place of others, but for those along a cut: the ends of a cut are
        single nodes.
    """

    layered: ndarray
    crossing: ndarray
    hanging: ndarray
    doubled: ndarray


def contact_of(boundary: Boundary) -> Contact | None:
    """Look for edges of a boundary that touch or cross others.

    None where so many lie near one another that it would take too long.
    """
    near = _near(boundary)
    if near is None:
        return None
    p, ends = boundary.p, boundary.ends
    i, j = near
    tolerance = _SAME * np.minimum(boundary.length[i], boundary.length[j])
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
        for node, met in zip(ends[:, other], at_end, strict=True):
            distance, share = _beside(boundary, edge, p[:, node])
            on = np.abs(distance) <= tolerance
            hanging.append(node[on & ~met & (share > 0) & (share < 1)])
            beyond.append(np.where(on, 0.0, np.sign(distance)))
        crossing &= beyond[0] * beyond[1] < 0
    cells, layered = boundary.cell[np.stack([i, j])], meet[0, 0] & meet[1, 1]
    seam = ends[:, i[meet[0, 1] & meet[1, 0]]]
    return Contact(
        np.unique(cells[:, layered]),
        np.unique(cells[:, crossing]),
        np.unique(np.concatenate(hanging)),
        _no_cut(np.concatenate(joined, axis=1), seam, p.shape[1]),
    )


def _near(boundary: Boundary) -> ndarray | None:
    """Pairs of edges that may touch, shape (2, n); None if there are too many."""
    middle = (boundary.p[:, boundary.ends].mean(axis=1)).T
    found, total, size = [], 0, boundary.size
    for exponent in np.unique(size):
        own, rest = np.flatnonzero(size == exponent), np.flatnonzero(size <= exponent)
        one, other = KDTree(middle[own]), KDTree(middle[rest])
        reach = 2.0**exponent * (1 + 2 * _SAME)
        total += one.count_neighbors(other, reach)
        if total > _CROWDED:
            return None
        pairs = one.sparse_distance_matrix(other, reach, output_type="ndarray")
        i, j = own[pairs["i"]], rest[pairs["j"]]
        found.append(np.stack([i, j])[:, (size[j] < exponent) | (i < j)])
    return np.concatenate(found, axis=1)


def _beside(boundary: Boundary, edge: ndarray, x: ndarray) -> tuple[ndarray, ndarray]:
    """Distance of points from edges, positive on the left, and share of the length."""
    length = boundary.length[edge]
    ex, ey = boundary.along[:, edge] / length
    dx, dy = x - boundary.p[:, boundary.ends[0, edge]]
    return ex * dy - ey * dx, (ex * dx + ey * dy) / length


def _no_cut(joined: ndarray, seam: ndarray, n_nodes: int) -> ndarray:
    """Nodes at the place of others that do not lie along a cut.

    Parameters
    ----------
    joined
        Pairs of nodes at the same place, shape (2, n).
    seam
        Edges that run back along another, their nodes, shape (2, n).
    n_nodes
        Number of nodes of the mesh.
    """
    place = _groups(joined, n_nodes)
    crowd = np.bincount(place)
    doubled = np.flatnonzero(crowd[place] > 1)
    if not doubled.size:
        return doubled
    sides = np.unique(np.sort(place[seam], axis=0), axis=1)
    line = _groups(sides, len(crowd))
    is_end = np.bincount(sides.ravel(), minlength=len(crowd)) == 1
    has_end, has_open_end = (
        np.bincount(line[ends], minlength=line.max() + 1) > 0
        for ends in (is_end, is_end & (crowd > 1))
    )
    return doubled[~(has_end & ~has_open_end)[line[place[doubled]]]]


def _groups(pairs: ndarray, n: int) -> ndarray:
    """The group of each of n things that pairs join, numbered from 0 on."""
    joined = coo_matrix((np.ones(pairs.shape[1]), tuple(pairs)), shape=(n, n))
    return connected_components(joined, directed=False)[1]


def cells_within(boundary: Boundary) -> ndarray:
    """Cells beside the boundary that lie in others, where no edge crosses another.

    Either a piece of the mesh lies in another, or cells that share no more than a node
    overlap there.
    """
    ends = boundary.ends
    piece = _groups(ends, boundary.p.shape[1])[ends[0]]
    x, y = boundary.p[:, ends] - boundary.p[:, :1, None]
    area = np.bincount(piece, x[0] * y[1] - x[1] * y[0])
    _, first = np.unique(piece, return_index=True)
    outline = first[area[piece[first]] > 0]
    within = _pinched(boundary)
    if len(outline) > 1:
        inner = outline[_turns(boundary, boundary.inside(outline)) > 1]
        within = np.concatenate([within, inner])
    return np.unique(boundary.cell[within])


def _pinched(boundary: Boundary) -> ndarray:
    """Edges at nodes around which fans of cells overlap.

    Anticlockwise around a node an edge that leaves it begins a fan, and the next one
    must be the edge that arrives there and ends the fan.
    """
    ends, n = boundary.ends, boundary.ends.shape[1]
    node = ends.ravel()
    edge, arrives = np.tile(np.arange(n), 2), np.repeat([False, True], n)
    some = np.flatnonzero(np.bincount(node)[node] > 2)
    node, edge, arrives = node[some], edge[some], arrives[some]
    x, y = np.where(arrives, -1, 1) * boundary.along[:, edge]
    angle = np.arctan2(y, x) - _SAME * arrives  # the sides of a cut: ends come first
    nodes, first, inverse = np.unique(node, return_index=True, return_inverse=True)
    angle = (angle - angle[first][inverse]) % (2 * np.pi)
    order = np.lexsort([angle, node])
    turn = np.arange(len(order)) - np.searchsorted(node[order], nodes)[inverse[order]]
    return edge[order][arrives[order] != (turn % 2 == 1)]


def _turns(boundary: Boundary, x: ndarray) -> ndarray:
    """How often the boundary runs around each point anticlockwise, shape (n,).

    That is how often it crosses the line from the point to the right, upwards.
    """
    turns = np.zeros(x.shape[1])
    y = boundary.p[1, boundary.ends]
    low, size = y.min(axis=0), boundary.size
    for exponent in np.unique(size):
        own = np.flatnonzero(size == exponent)
        own = own[np.argsort(low[own])]
        # Edges at the height of a point begin below it, by their length at most.
        first = np.searchsorted(low[own], x[1] - 2.0**exponent * (1 + _SAME))
        last = np.searchsorted(low[own], x[1], side="right")
        parts = np.cumsum(last - first) // _TOGETHER
        for some in np.split(np.arange(len(parts)), np.flatnonzero(np.diff(parts)) + 1):
            number = (last - first)[some]
            point = np.repeat(some, number)
            rank = np.arange(len(point)) - np.repeat(np.cumsum(number) - number, number)
            edge = own[first[point] + rank]
            up = (y[1, edge] > x[1, point]).astype(float) - (y[0, edge] > x[1, point])
            point, edge, up = (z[up != 0] for z in (point, edge, up))
            distance, _ = _beside(boundary, edge, x[:, point])
            right = distance * up > 0
            turns += np.bincount(point[right], up[right], minlength=len(turns))
    return turns
