"""Nets of lines along straight fibres, graded or equally spaced, cut at the outline.

In coordinates along the fibres, X = s₁ A₁ + s₂ A₂, they are s₁ = a and s₂ = b.  A
motion without fibre stretch is x = f(s₁) + g(s₂).  If f and g have kinks only at lines
of the net, the motion is linear in every cell and in every part of a cell, and elements
that are cells or parts of them represent it exactly.

Lines of both families pass through the whole outline, which cuts their cells.  Nodes
that would cause slivers are moved onto it.
"""

import logging
from itertools import pairwise
from typing import NamedTuple

import numpy as np
import shapely
from numpy import ndarray
from scipy.spatial import KDTree

from ..mesh.graph import boundary_edges, components, edges_of
from .rings import NEAR

log = logging.getLogger(__name__)

# Maximum number of cells of equally spaced lines.  They take half a minute.
_MOST_CELLS = 4e6

# Largest number of graded lines between two given ones: a bound on the memory.
_MOST_LINES = 1e5

# Smallest gap between lines that are added so that the families meet at the sides,
# relative to the spacing: a guard against small elements.
_NARROWEST = 0.2


class Lines(NamedTuple):
    """Lines of a family in ascending order, and which of them stay edges of a net."""

    at: ndarray
    strong: ndarray


def nearest(lines: ndarray, x: ndarray) -> ndarray:
    """Index of the nearest line."""
    return np.searchsorted((lines[1:] + lines[:-1]) / 2, x)


def graded(
    keys: ndarray,
    strong: ndarray,
    finest: float,
    largest: float,
    growth: float,
    density: float = 1.0,
) -> ndarray:
    """Add lines between given ones, graded towards the strong ones.

    Parameters
    ----------
    keys
        Lines in ascending order.
    strong
        One bool per line.
    finest, largest, growth
        Distance of lines at the strong ones, its limit, and its derivative with respect
        to the distance from them.
    density
        Factor of the number of lines.

    Raises
    ------
    ValueError
        If there would be too many lines.
    """
    lines = [keys[:1]]
    for (low, high), ends in zip(pairwise(keys), pairwise(strong), strict=True):
        x = (high - low) * _SAMPLES
        size = np.full_like(x, largest)
        for is_strong, distance in zip(ends, (x, x[::-1]), strict=True):
            if is_strong:
                size = np.minimum(size, finest + growth * distance)
        # Number of lines up to each distance: the integral of 1/size.
        between = np.diff(x) * (1 / size[1:] + 1 / size[:-1]) / 2
        count = density * np.append(0.0, np.cumsum(between))
        if count[-1] > _MOST_LINES:
            raise ValueError(
                f"the density {density:g} would give about {count[-1]:.1g} lines of a "
                "family: choose a smaller one"
            )
        n = max(1, int(np.ceil(count[-1] - 1e-6)))
        shares = np.arange(1, n + 1) / n * count[-1]
        lines.append(np.append(low + np.interp(shares[:-1], count, x), high))
    return np.concatenate(lines)


# Positions in a gap between two lines, from 0 to 1, dense and symmetric at both ends.
_SAMPLES = np.geomspace(1e-6, 0.5, 200)
_SAMPLES = np.concatenate([[0.0], _SAMPLES, 1 - _SAMPLES[-2::-1], [1.0]])


def even(
    corners: ndarray, sides: ndarray, in_spacings: ndarray
) -> tuple[ndarray, ndarray]:
    """Equally spaced lines between those through given points.

    If possible, lines of both families meet wherever one meets a side; otherwise this
    is logged.

    Parameters
    ----------
    corners
        Points through which lines of both families pass, shape (2, n).
    sides
        Starts and ends of the sides, which are among the corners, shape (2, 2,
        n_sides).
    in_spacings
        Matrix that converts a difference of coordinates to multiples of the largest
        distances along x and y between lines at the sides.

    Returns
    -------
    tuple of ndarray
        Lines a and b, in ascending order.

    Raises
    ------
    ValueError
        If there would be more than 4e6 cells.
    """
    outline = _Sides(corners, sides, in_spacings)
    through = outline.distinct(corners[0]), outline.distinct(corners[1])
    closed = outline.closed(through)
    if closed is None:
        log.info(
            "mesh along the fibres: some lines of warp and weft do not meet at the "
            "sides; elements there may be thin, and may lock where a side is fixed"
        )
    keys = closed or through
    counts = [np.ceil(outline.spacings(i, keys[i]) - 1e-6).clip(min=1) for i in (0, 1)]
    if closed:
        counts = outline.matched(closed, counts)
    if (cells := counts[0].sum() * counts[1].sum()) > _MOST_CELLS:
        raise ValueError(
            f"the spacing is too small: the mesh would have about {cells:.1g} cells, "
            f"more than {_MOST_CELLS:g}"
        )
    a, b = (
        np.interp(np.arange(n.sum() + 1), np.cumsum([0, *n]), at)
        for at, n in zip(keys, counts, strict=True)
    )
    return a, b


class _Sides:
    """Sides of an outline in coordinates along the fibres; arguments as of `even`."""

    def __init__(self, corners: ndarray, sides: ndarray, in_spacings: ndarray) -> None:
        self._start, self._along = sides[0], sides[1] - sides[0]
        self._lengths = np.linalg.norm(in_spacings @ self._along, axis=0)
        self._near = NEAR * np.ptp(corners, axis=1).max()
        self._oblique = np.abs(self._along) > self._near

    def distinct(self, lines: ndarray) -> ndarray:
        """Lines in ascending order, without those that coincide with another."""
        lines = np.sort(lines)
        return lines[np.diff(lines, prepend=-np.inf) > self._near]

    def closed(self, lines: tuple[ndarray, ndarray]) -> tuple[ndarray, ndarray] | None:
        """Lines, and lines of the other family where they meet the sides.

        None if lines would be too close to each other.
        """
        while True:
            a, b = (
                self.distinct(np.append(lines[i], self._meet(1 - i, lines[1 - i])[2]))
                for i in (0, 1)
            )
            if len(a) == len(lines[0]) and len(b) == len(lines[1]):
                return lines
            if min(self.spacings(0, a).min(), self.spacings(1, b).min()) < _NARROWEST:
                return None
            lines = a, b

    def spacings(self, axis: int, lines: ndarray) -> ndarray:
        """Number of spacings along the sides between adjacent lines, not rounded."""
        side, gap, _ = self._meet(axis, (lines[1:] + lines[:-1]) / 2)
        most = np.zeros(len(lines) - 1)
        along = np.abs(self._along[axis, side])
        np.maximum.at(most, gap, self._lengths[side] / along)
        return most * np.diff(lines)

    def matched(
        self, lines: tuple[ndarray, ndarray], counts: list[ndarray]
    ) -> list[ndarray]:
        """Subdivisions for which added lines in a closed net meet at the sides.

        Each side joins a gap between lines of one family to one of the other.
        """
        a, b = lines
        side, i, at = self._meet(0, (a[1:] + a[:-1]) / 2)
        joined = self._oblique[1, side]
        i, j = i[joined], np.searchsorted(b, at[joined]) - 1 + len(counts[0])
        n = len(counts[0]) + len(counts[1])
        label = components(n, (i, j))
        most = np.zeros(n)
        np.maximum.at(most, label, np.concatenate(counts))
        return np.split(most[label], [len(counts[0])])

    def _meet(self, axis: int, lines: ndarray) -> tuple[ndarray, ndarray, ndarray]:
        """Intersections of lines with sides: sides, lines and other coordinates."""
        crossed = np.flatnonzero(self._oblique[axis])
        start, along = self._start[:, crossed, None], self._along[:, crossed, None]
        share = (lines - start[axis]) / along[axis]
        at = start[1 - axis] + share * along[1 - axis]
        side, line = np.nonzero((share >= 0) & (share <= 1))
        return crossed[side], line, at[side, line]


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
    inside = [_between(points, used, quads[k - 1], quads[k])[1] for k in range(4)]
    split = np.any(inside, axis=0)
    of_quads = _halved(quads[:, ~split], (i + j)[~split] % 2 == 1)
    n_split = np.count_nonzero(split)
    nodes = np.concatenate([nodes, quads[:, split].T.ravel()])
    of_ring = np.append(of_ring, len(rings) + np.repeat(np.arange(n_split), 4))
    of_part = np.append(of_part, len(parts) + np.arange(n_split))
    following = nodes[_next(of_ring)]
    hits, counts = _between(points, used, nodes, following)
    place = np.repeat(np.arange(len(nodes)) + 1, counts)
    nodes = np.insert(nodes, place, hits)
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


def _between(
    points: ndarray, used: ndarray, start: ndarray, end: ndarray
) -> tuple[ndarray, ndarray]:
    """Used nodes in the interior of edges along a line of either family.

    In the order of the edges, and the number of them on each edge.
    """
    found = [np.empty(0, dtype=int)] * 2
    edges = [np.empty(0, dtype=int)] * 2
    for axis in range(2):
        same = points[start, axis] == points[end, axis]
        which = np.flatnonzero(same & (start != end))
        order = used[np.lexsort((points[used, 1 - axis], points[used, axis]))]
        rank = np.empty(len(points), dtype=int)
        rank[order] = np.arange(len(order))
        begin, steps = rank[start[which]], rank[end[which]] - rank[start[which]]
        n = np.abs(steps) - 1
        edges[axis] = np.repeat(which, n)
        step = 1 + np.arange(n.sum()) - np.repeat(np.cumsum(n) - n, n)
        found[axis] = order[np.repeat(begin, n) + np.repeat(np.sign(steps), n) * step]
    edge, nodes = np.concatenate(edges), np.concatenate(found)
    order = np.argsort(edge, kind="stable")
    return nodes[order], np.bincount(edge, minlength=len(start))


def _next(of_ring: ndarray) -> ndarray:
    """Index of the next corner in each ring; the corners of a ring are contiguous."""
    following = np.arange(1, len(of_ring) + 1)
    first = np.flatnonzero(np.diff(of_ring, prepend=-1))
    following[np.flatnonzero(np.diff(of_ring, append=-1))] = first
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
        self._beside: dict[int, set[int]] = {}  # neighbours along the boundary
        for p, q in boundary_edges([t]).T.tolist():
            self._beside.setdefault(p, set()).add(q)
            self._beside.setdefault(q, set()).add(p)
        order = np.argsort(t.ravel(), kind="stable")
        self._of_node = order % t.shape[1]
        self._first = np.searchsorted(t.ravel()[order], np.arange(len(points) + 1))
        self._stars: dict[int, set[int]] = {}

    def triangles(self) -> ndarray:
        """Triangles after all collapses, shape (3, n)."""
        for _ in range(5):
            edges = edges_of([self._t[self._alive].T])[0].T
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
