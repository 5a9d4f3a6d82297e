"""Nets of lines along straight fibres, cut at the outline.

Lines of both families pass through the whole outline, which cuts their cells.  Nodes
that would cause slivers are moved onto it.
"""

from typing import NamedTuple

import numpy as np
import shapely
from numpy import ndarray
from scipy.spatial import KDTree

from .lines import Lines, nearest
from .rings import NEAR

# Edges shorter than this share of a cell are collapsed, a guard against slivers: it
# bounds the distortion of the neighbours.
_SHORTEST = 0.25

# Area of a triangle relative to its cell below which a collapse is not accepted, unless
# a triangle before was smaller.
_SMALLEST = 0.05


def net(
    shape: shapely.Polygon, A: ndarray, a: Lines, b: Lines
) -> tuple[ndarray, ndarray]:
    """Triangles of the cells between lines s₁ = a and s₂ = b within an outline.

    Parameters
    ----------
    shape
        The outline.  Its corners are nodes.
    A
        Directions of the families, the columns of a matrix.
    a, b
        Lines, of which the first and last are on or outside the outline.

    Returns
    -------
    tuple of ndarray
        Nodes, shape (2, n_nodes), and triangles as node numbers, shape (3, n).
    """
    s, near = _along_lines(shape, A, a.at, b.at)
    points, t = _triangles(s, s, a.at, b.at, near, A)
    return _in_plane(points, _Collapse(points, t, s, a, b, near).triangles(), A)


def cut_cells(
    shape: shapely.Polygon, A: ndarray, a: ndarray, b: ndarray
) -> tuple[ndarray, ndarray]:
    """Cells between lines s₁ = a and s₂ = b within an outline, as cut by it.

    Lines of both families pass through each corner of the outline.

    Parameters
    ----------
    shape, A
        See `net`.
    a, b
        Lines in ascending order.

    Returns
    -------
    tuple of ndarray
        Nodes, shape (2, n_nodes), and elements as node numbers: the cells, shape (4,
        n), if all sides follow the lines; else triangles, shape (3, n).
    """
    s, near = _along_lines(shape, A, a, b)
    rings = map(shapely.get_coordinates, shapely.get_rings(s))
    sides = np.concatenate([np.diff(ring, axis=0) for ring in rings])
    if (sides != 0).all(axis=1).any():
        outer = shapely.buffer(s, near, join_style="mitre")
        return _in_plane(*_triangles(s, outer, a, b, near, A), A)
    x, y = np.meshgrid(a, b)
    node = np.arange(x.size).reshape(x.shape)
    corners = node[:-1, :-1], node[:-1, 1:], node[1:, 1:], node[1:, :-1]
    t = np.stack(corners).reshape(4, -1)
    points = np.stack([x, y], axis=-1).reshape(-1, 2)
    inside = shapely.contains_xy(s, points[t].mean(axis=0))
    return _in_plane(points, t[:, inside], A)


def _in_plane(points: ndarray, t: ndarray, A: ndarray) -> tuple[ndarray, ndarray]:
    """Nodes of elements, shape (2, n_nodes), and the elements as their numbers."""
    used, of = np.unique(t, return_inverse=True)
    return np.ascontiguousarray((points[used] @ A.T).T), of.reshape(t.shape)


def _along_lines(
    shape: shapely.Polygon, A: ndarray, a: ndarray, b: ndarray
) -> tuple[shapely.Polygon, float]:
    """Outline in coordinates along the fibres, and the distance of coincident points.

    Its corners are moved onto lines that are near.
    """
    to_fibres = np.linalg.inv(A)
    near = NEAR * max(np.ptp(a), np.ptp(b))
    return shapely.transform(
        shape, lambda x: _on_lines(x @ to_fibres.T, a, b, near)
    ), near


def _on_lines(s: ndarray, a: ndarray, b: ndarray, near: float) -> ndarray:
    """Points, shape (n, 2), moved onto lines that are near."""
    s = s.copy()
    for axis, lines in enumerate((a, b)):
        k = nearest(lines, s[:, axis])
        s[:, axis] = np.where(
            np.abs(lines[k] - s[:, axis]) <= near, lines[k], s[:, axis]
        )
    return s


def _triangles(
    s: shapely.Polygon,
    outer: shapely.Polygon,
    a: ndarray,
    b: ndarray,
    near: float,
    A: ndarray,
) -> tuple[ndarray, ndarray]:
    """Nodes (n, 2) along the fibres and triangles (3, n) of all cells, as cut.

    Cells within the polygon ``outer`` are not cut.
    """
    shapely.prepare([s, outer])
    i, j = np.indices((len(a) - 1, len(b) - 1)).reshape(2, -1)
    boxes = shapely.box(a[i], b[j], a[i + 1], b[j + 1])
    whole = shapely.covers(outer, boxes)
    cut = boxes[~whole & shapely.intersects(s, boxes)]
    parts = shapely.get_parts(shapely.intersection(s, cut))
    parts = parts[shapely.get_type_id(parts) == shapely.GeometryType.POLYGON]
    rings, of_part = shapely.get_rings(parts, return_index=True)
    x, of_ring = shapely.get_coordinates(rings, return_index=True)
    repeated = np.diff(of_ring, append=len(rings)) != 0  # the first corner, at the end
    x, of_ring = x[~repeated], of_ring[~repeated]
    i, j = i[whole], j[whole]
    corners = [(i + k) * len(b) + j + m for k, m in ((0, 0), (1, 0), (1, 1), (0, 1))]
    grid, quads = np.unique(corners, return_inverse=True)
    x = np.concatenate([np.stack([a[grid // len(b)], b[grid % len(b)]], axis=-1), x])
    number, points = _joined(_on_lines(x, a, b, near), near)
    quads, nodes = number[quads.reshape(4, -1)], number[len(grid) :]

    # Nodes in the interior of an edge, where the outline touches a line.
    used = np.unique(number)
    inside = [_between(points, used, quads[k - 1], quads[k]) for k in range(4)]
    split = np.any([np.diff(hits.first) > 0 for hits in inside], axis=0)
    of_quads = _halved(quads[:, ~split], (i + j)[~split] % 2 == 1)
    n_split = np.count_nonzero(split)
    nodes = np.concatenate([nodes, quads[:, split].T.ravel()])
    of_ring = np.append(of_ring, len(rings) + np.repeat(np.arange(n_split), 4))
    of_part = np.append(of_part, len(parts) + np.arange(n_split))
    following = nodes[_next(of_ring)]
    hits = _between(points, used, nodes, following)
    counts = np.diff(hits.first)
    place = np.repeat(np.arange(len(nodes)) + 1, counts)
    nodes = np.insert(nodes, place, hits.nodes)
    of_ring = np.repeat(of_ring, 1 + counts)
    of_pieces = _triangulated(points @ A.T, nodes, of_ring, of_part)
    t = np.hstack([of_quads, of_pieces])
    u, v = points[t[1]] - points[t[0]], points[t[2]] - points[t[0]]
    turned = u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0] < 0
    t[:, turned] = t[:, turned][[0, 2, 1]]
    return points, t


def _joined(points: ndarray, near: float) -> tuple[ndarray, ndarray]:
    """Merge equal points: index of each point, and the distinct points."""
    _, first, number = np.unique(
        np.round(points / near), axis=0, return_index=True, return_inverse=True
    )
    distinct, same = points[first], np.arange(len(first))
    pairs = KDTree(distinct).query_pairs(4 * near, output_type="ndarray")
    for p, q in np.sort(pairs, axis=1):
        same[q] = same[p]
    return same[number.ravel()], distinct


class _Hits(NamedTuple):
    """Nodes in the interior of edges, in order, and the first of each edge."""

    nodes: ndarray
    first: ndarray


def _between(points: ndarray, used: ndarray, start: ndarray, end: ndarray) -> _Hits:
    """Used nodes in the interior of edges along a line of either family."""
    found = [np.empty(0, dtype=int)] * 2
    edges = [np.empty(0, dtype=int)] * 2
    for axis in range(2):
        same = points[start, axis] == points[end, axis]
        which = np.flatnonzero(same & (start != end))
        order = used[np.lexsort((points[used, 1 - axis], points[used, axis]))]
        rank = np.empty(len(points), dtype=int)
        rank[order] = np.arange(len(order))
        low, high = np.sort([rank[start[which]], rank[end[which]]], axis=0)
        n = high - low - 1
        edges[axis] = np.repeat(which, n)
        offset = np.arange(n.sum()) - np.repeat(np.cumsum(n) - n, n)
        up = np.repeat(rank[start[which]] < rank[end[which]], n)
        at = np.where(
            up, np.repeat(low, n) + 1 + offset, np.repeat(high, n) - 1 - offset
        )
        found[axis] = order[at]
    edge, nodes = np.concatenate(edges), np.concatenate(found)
    order = np.argsort(edge, kind="stable")
    first = np.searchsorted(edge[order], np.arange(len(start) + 1))
    return _Hits(nodes[order], first)


def _next(of_ring: ndarray) -> ndarray:
    """Index of the next corner in each ring; the corners of a ring are contiguous."""
    following = np.arange(1, len(of_ring) + 1)
    if not len(of_ring):
        return following
    start = np.flatnonzero(np.diff(of_ring, prepend=-1))
    following[np.append(start[1:], len(of_ring)) - 1] = start
    return following


def _halved(quads: ndarray, other: ndarray) -> ndarray:
    """Triangles of cells, along alternating diagonals."""
    quads = np.where(other, np.roll(quads, 1, axis=0), quads)
    return np.hstack([quads[[0, 1, 2]], quads[[0, 2, 3]]])


def _triangulated(
    X: ndarray, nodes: ndarray, of_ring: ndarray, of_part: ndarray
) -> ndarray:
    """Triangles of pieces, polygons of one or more rings; thin ones vanish."""
    kept = nodes != nodes[_next(of_ring)]
    nodes, of_ring = nodes[kept], of_ring[kept]
    enough = np.bincount(of_ring, minlength=len(of_part))[of_ring] >= 3
    nodes, of_ring = nodes[enough], of_ring[enough]
    if not len(nodes):
        return np.empty((3, 0), dtype=int)
    ring, of = np.unique(of_ring, return_inverse=True)
    rings = shapely.linearrings(X[nodes], indices=of)
    _, part = np.unique(of_part[ring], return_inverse=True)
    polygons = (
        shapely.polygons(rings) if len(part) == part[-1] + 1 else _nested(rings, part)
    )
    pieces = shapely.get_parts(shapely.constrained_delaunay_triangles(polygons))
    corners = shapely.get_coordinates(pieces).reshape(-1, 4, 2)[:, :3].reshape(-1, 2)
    at = np.unique(nodes)
    t = at[KDTree(X[at]).query(corners)[1]].reshape(-1, 3).T
    return t[:, (t[0] != t[1]) & (t[1] != t[2]) & (t[2] != t[0])]


def _nested(rings: ndarray, part: ndarray) -> ndarray:
    """Polygons of rings, the first of each part around the others."""
    groups = np.split(rings, np.flatnonzero(np.diff(part)) + 1)
    return np.array([shapely.Polygon(group[0], group[1:]) for group in groups])


class _Collapse:
    """Collapse of edges that are short relative to the cells.

    A node moves to the other end of its edge.  Corners of the outline stay, other nodes
    of the outline move along it, and nodes on singular fibres along these.
    """

    def __init__(
        self,
        points: ndarray,
        t: ndarray,
        s: shapely.Polygon,
        a: Lines,
        b: Lines,
        near: float,
    ) -> None:
        self._points, self._t = points, t.T.copy()
        self._a, self._b = a.at, b.at
        self._alive = np.ones(t.shape[1], dtype=bool)
        corner = KDTree(points).query(shapely.get_coordinates(s))[1]
        self._fixed = np.zeros(len(points), dtype=bool)
        self._fixed[corner] = True
        # Singular fibre of each family on which a node lies, or −1.
        self._fibre = [
            np.where((x.at[k] == points[:, axis]) & x.strong[k], k, -1)
            for axis, x in enumerate((a, b))
            for k in [nearest(x.at, points[:, axis])]
        ]
        edges = np.sort(np.concatenate([t[[0, 1]], t[[1, 2]], t[[2, 0]]], axis=1).T)
        edges, count = np.unique(edges, axis=0, return_counts=True)
        self._beside: dict[int, set[int]] = {}  # neighbours along the boundary
        for p, q in edges[count == 1].tolist():
            self._beside.setdefault(p, set()).add(q)
            self._beside.setdefault(q, set()).add(p)
        order = np.argsort(t.ravel(), kind="stable")
        self._of_node = order % t.shape[1]
        self._first = np.searchsorted(t.ravel()[order], np.arange(len(points) + 1))
        self._stars: dict[int, set[int]] = {}

    def triangles(self) -> ndarray:
        """Triangles after all collapses, shape (3, n)."""
        for _ in range(5):
            t = self._t[self._alive]
            edges = np.sort(np.concatenate([t[:, [0, 1]], t[:, [1, 2]], t[:, [2, 0]]]))
            edges = np.unique(edges, axis=0)
            length = self._length(edges)
            short = np.flatnonzero(length < _SHORTEST)
            short = short[np.argsort(length[short], kind="stable")]
            done = [self._collapse(p, q) for p, q in edges[short].tolist()]
            if not any(done):
                break
        return self._t[self._alive].T

    def _cell(self, x: ndarray) -> ndarray:
        """Extents of the cells of points, shape (n, 2)."""
        sizes = [
            np.diff(lines)[
                (np.searchsorted(lines, x[:, axis]) - 1).clip(0, len(lines) - 2)
            ]
            for axis, lines in enumerate((self._a, self._b))
        ]
        return np.stack(sizes, axis=-1)

    def _length(self, edges: ndarray) -> ndarray:
        """Lengths of edges relative to the cells of their centres."""
        p, q = self._points[edges[:, 0]], self._points[edges[:, 1]]
        return np.linalg.norm((p - q) / self._cell((p + q) / 2), axis=1)

    def _star(self, node: int) -> set[int]:
        """Triangles of a node."""
        if node not in self._stars:
            low, high = self._first[node : node + 2]
            self._stars[node] = set(self._of_node[low:high].tolist())
        return self._stars[node]

    def _collapse(self, p: int, q: int) -> bool:
        """Move q to p or p to q, if one of them may move; True if so."""
        order = (p, q) if p in self._beside or q not in self._beside else (q, p)
        return self._move(order[1], order[0]) or self._move(order[0], order[1])

    def _move(self, q: int, p: int) -> bool:
        both = self._star(p) & self._star(q)
        if not both or not self._may_move(q, p):
            return False
        star = list(self._star(q) - both)
        before = self._areas(self._t[[*star, *both]])
        moved = self._t[star]
        moved[moved == q] = p
        after = self._areas(moved)
        if after.min(initial=np.inf) < min(_SMALLEST, before.min()):
            return False
        around = [set(self._t[list(self._star(k))].ravel().tolist()) for k in (p, q)]
        if len(around[0] & around[1]) != 2 + len(both):
            return False
        for k in both:
            self._alive[k] = False
            for node in self._t[k].tolist():
                self._star(node).discard(k)
        self._t[star] = moved
        self._star(p).update(star)
        self._stars[q] = set()
        if q in self._beside:
            for node in self._beside.pop(q):
                self._beside[node].discard(q)
                if node != p:
                    self._beside[node].add(p)
                    self._beside[p].add(node)
        return True

    def _may_move(self, q: int, p: int) -> bool:
        """True if the outline and singular fibres remain."""
        if self._fixed[q]:
            return False
        if q in self._beside and p not in self._beside[q]:
            return False
        return all(f[q] in (-1, f[p]) for f in self._fibre)

    def _areas(self, t: ndarray) -> ndarray:
        """Areas of triangles relative to their cells."""
        x = self._points[t]
        u, v = x[:, 1] - x[:, 0], x[:, 2] - x[:, 0]
        area = (u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0]) / 2
        return area / self._cell(x.mean(axis=1)).prod(axis=1)
