"""Triangles of a polygon with holes that have given lines as edges.

Lines are divided into segments of the size of the elements, a lattice fills the
polygon, and a Delaunay refinement (Ruppert 1995) improves the angles: segments with a
node in their circle are halved, and circumcentres of poor triangles become nodes. At
small angles between lines, segments are divided on circles around the common corner.
"""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
import shapely
from numpy import ndarray
from scipy.sparse import csr_matrix
from scipy.spatial import Delaunay, KDTree

from ..mesh.user_input import coords
from .cells import CORNER, angle, corners_of_rings

# Distance relative to the extent below which points coincide.  It is far above the
# error of curved fibres on the outline (1e-9).
_NEAR = 1e-8

# A guard against slivers: lines that run within a distance of others or of the outline
# and borders for more than a multiple of it are left out there: distances relative to
# the size, and multiples, for angles of less than 10 degrees and 3 degrees.
_BESIDE_LINE, _OF_LINE = (0.2, 0.05, 0.0125), 6.0
_BESIDE_EDGE, _OF_EDGE = (0.05, 0.0125, 0.003), 20.0

# Length of tangents that are left out, relative to the root of this length times the
# size: beside circular borders of ten sizes, where sides of the mesh turn by 3 degrees.
_TANGENT = 2.0

# Length relative to the size by which lines end before a part that is left out.
_TRIMMED = 0.2

# Share of the size below which lines between crossings are collapsed, a guard against
# slivers: a line then moves, and its fibres are stretched.
_COLLAPSED = 0.01

# Corners are kept if the turn in radians times the shorter side exceeds this share of
# the size, a guard against slivers: a smaller one moves the line by a fortieth of an
# element.
_KEPT = 0.1

# Sides of the outline, relative to the size, between which its corners are kept.
_SIDE = 0.5

# Smallest angle in degrees that refinement aims at.  Ruppert's proof holds up to 20.7;
# in practice it ends up to 33.
_AIM = 25.0

# The same beside nodes that do not move: below Ruppert's bound.
_AIM_BESIDE_LATTICE = 20.0

# Largest turn of a curved outline, in radians, along an edge of such meshes.  Small
# holes have eight edges: more of them make slivers, which cost solves between tools
# (`python -m studies forming --case "outline,*"`).
_TURN_BESIDE_LATTICE = np.pi / 4

# Circumradius of a triangle relative to the size above which it is divided; 0.577 for
# an equilateral triangle of this size.
_LARGEST = 0.8

# Distance of points of the lattice to segments, relative to the size.  It is below the
# height of an equilateral triangle, 0.87.
_CLEARANCE = 0.6

# Angle in degrees between lines below which their segments are divided on circles.
_ACUTE = 61.0

# Turn in radians of a line over the size of elements above which its edges have half
# the size: their angle with the line would stretch the fibres.
_BENT = 0.01

# Rounds of smoothing, and most rounds of refinement.
_SMOOTHING, _MOST_ROUNDS = 6, 200

# Length of edges relative to the size below which triangles are left as they are, a
# limit of work.
_FINEST = 1e-4


class Triangulation(NamedTuple):
    """Triangles of a polygon.

    Attributes
    ----------
    points
        Nodes, shape (2, n).
    triangles
        Node numbers, anticlockwise, shape (3, n).
    edges
        Nodes of the edges on the outline and on lines, shape (2, n).
    line
        Number of the line of each of them; −1 on the outline.
    """

    points: ndarray
    triangles: ndarray
    edges: ndarray
    line: ndarray


def triangles(
    shape: shapely.Polygon,
    lines: Sequence[ndarray],
    size: float,
    fixed: ndarray | None = None,
    turn: float = 0.0,
    borders: int = 0,
    lattice: ndarray | None = None,
) -> Triangulation:
    """Triangles of a polygon with holes that have given lines as edges.

    Parameters
    ----------
    shape
        The polygon.  Its corners are nodes, except where many short sides approximate a
        curve.
    lines
        Polylines within the polygon, shape (2, n).  They may cross and touch.  Parts
        beside earlier ones or the outline are left out, except tangents of borders.
    size
        Length of edges in mm; half of it along curved lines.
    fixed
        Points that become nodes, on the outline or on lines, shape (2, n).
    turn
        Direction of the rows of nodes in radians.
    borders
        Number of the first lines that are borders between regions.
    lattice
        Points that become nodes and do not move, except near the outline, in place of
        rows of nodes, shape (n, 2).

    Raises
    ------
    ValueError
        If the size is not positive or too small, or there is no such mesh.

    Examples
    --------
    >>> square = shapely.box(0, 0, 100, 100)
    >>> mesh = triangles(square, [np.array([[0, 100], [0, 50]])], 10)
    >>> mesh.points.shape[1] < 180, bool((mesh.line == 0).sum() >= 11)
    (True, True)
    """
    if (n := shape.area / size**2) > _MOST:
        raise ValueError(
            f"the size {size:g} mm would give about {2.3 * n:.1g} triangles: choose a "
            "larger one"
        )
    refuse_narrow_gaps(shape, size)
    points = np.empty((2, 0)) if fixed is None else fixed
    points = np.hstack([points, _corners(shape, _SIDE * size)])
    kept = _without_doubles(shape, lines, size, borders)
    turn_of_side = CORNER if lattice is None else _TURN_BESIDE_LATTICE
    p, segments = _divided(*_chains(shape, *kept, size, points), size, turn_of_side)
    inner = _rows(shape, size, turn) if lattice is None else lattice
    return _Refinement(p, segments, size).run(inner, moves=lattice is None)


def _rows(shape: shapely.Polygon, size: float, turn: float) -> ndarray:
    """Nodes of equilateral triangles around a polygon, shape (n, 2)."""
    x0, y0, x1, y1 = shape.bounds
    n = int(np.ceil((np.hypot(x1 - x0, y1 - y0) / 2 / size + 1) / np.sqrt(0.75)))
    i, j = np.meshgrid(np.arange(-n, n + 1), np.arange(-n, n + 1))
    x = size * ((i + 0.5 * (j % 2)) + 1j * np.sqrt(0.75) * j).ravel()
    # Qhull prefers points that are not on common circles.
    x = x * np.exp(1j * turn) + size * 1e-3 * np.exp(1j * np.arange(x.size) ** 2)
    return np.stack([x.real + (x0 + x1) / 2, x.imag + (y0 + y1) / 2], axis=1)


# Largest area over size².
_MOST = 1e6

# Least distance of holes from each other and from the outline, relative to the size, a
# limit of work: elements in the gap are as small as it, and their number grows.
_NARROWEST = 1e-3


def refuse_narrow_gaps(shape: shapely.Polygon, size: float) -> None:
    """Refuse holes that are close to each other or to the outline."""
    rings = np.array([shape.exterior, *shape.interiors], dtype=object)
    for i, j in shapely.STRtree(rings).query(rings, "dwithin", _NARROWEST * size).T:
        if i < j:
            gap = shapely.shortest_line(rings[i], rings[j])
            raise ValueError(
                f"the gap of {gap.length:.3g} mm at {coords(shapely.get_point(gap, 0))}"
                f" is too narrow for triangles of {size:.3g} mm: choose a size below "
                f"{gap.length / _NARROWEST:.3g} mm, or widen or close the gap"
            )


class _Chain:
    """Line between two nodes, shape (n, 2), its ends, and the number of its line.

    ``s`` are distances of the points from the first one along the line.
    """

    def __init__(self, x: ndarray, ends: tuple[int, int], line: int) -> None:
        self.x, self.ends, self.line = x, ends, line
        steps = np.linalg.norm(np.diff(x, axis=0), axis=1)
        self.s = np.concatenate([[0.0], np.cumsum(steps)])
        self.length = float(self.s[-1])

    def at(self, s: ndarray) -> ndarray:
        """Points at distances along the line, shape (n, 2)."""
        return np.stack([np.interp(s, self.s, xi) for xi in self.x.T], axis=-1)

    @property
    def turn(self) -> float:
        sides = np.diff(self.x, axis=0).T
        return float(np.abs(angle(sides[:, :-1], sides[:, 1:])).sum())


def _corners(shape: shapely.Polygon, side: float) -> ndarray:
    """Corners between two sides longer than a length, shape (2, n)."""
    found = []
    for x in corners_of_rings(shape):
        length = np.hypot(*(np.roll(x, -1, axis=1) - x))
        found.append(x[:, np.minimum(length, np.roll(length, 1)) > side])
    return np.hstack(found)


def _without_doubles(
    shape: shapely.Polygon, lines: Sequence[ndarray], size: float, borders: int
) -> tuple[list[shapely.LineString], list[int]]:
    """Lines without stretches nearly parallel to earlier lines; and their indices."""
    left = [shape.boundary, *(shapely.linestrings(line.T) for line in lines)]
    tree = shapely.STRtree(left)
    pairs = tree.query(tree.geometries, "dwithin", _BESIDE_LINE[0] * size)
    near: dict[int, list[tuple[Any, float]]] = {}
    for i, j in sorted(pairs.T.tolist()):
        if j >= i:
            continue
        border = left[j] if 0 < j <= borders else None
        of = (_BESIDE_EDGE, _OF_EDGE) if j <= borders else (_BESIDE_LINE, _OF_LINE)
        if j not in near:
            shares = [share * size for share in of[0]]
            near[j] = [(left[j].buffer(d, quad_segs=4), of[1] * d) for d in shares]
        for beside, length in near[j]:
            left[i] = _without(left[i], beside, length, size, border)
    parts, number = shapely.get_parts(left[1:], return_index=True)
    lengthy = shapely.length(parts) > 0
    return parts[lengthy].tolist(), number[lengthy].tolist()


def _without(line: Any, beside: Any, length: float, size: float, border: Any) -> Any:
    """Cut out stretches longer than ``length`` inside ``beside``.

    Stretches that touch a border between their ends may be longer.
    """
    parts = shapely.get_parts(shapely.intersection(line, beside))
    longest = np.full(len(parts), length)
    for k, part in enumerate(parts if border is not None else ()):
        inner = shapely.points(shapely.get_coordinates(part)[1:-1])
        if shapely.dwithin(inner, border, _NEAR * size).any():
            longest[k] = _TANGENT * np.sqrt(length * size)
    long = parts[shapely.length(parts) > longest]
    if not long.size:
        return line
    cut = shapely.union_all(shapely.buffer(long, _TRIMMED * size, quad_segs=4))
    return shapely.difference(line, cut)


def _chains(
    shape: shapely.Polygon,
    given: list[shapely.LineString],
    number_of_line: list[int],
    size: float,
    fixed: ndarray,
) -> tuple[ndarray, list[_Chain]]:
    """Nodes at crossings and corners, shape (n, 2), and the chains between them."""
    x0, y0, x1, y1 = shape.bounds
    near = _NEAR * float(np.hypot(x1 - x0, y1 - y0))
    boundary = shapely.snap(shape.boundary, shapely.multipoints(fixed.T), near)
    noded = shapely.get_parts(shapely.union_all([boundary, *given], grid_size=near))
    x, of = shapely.get_coordinates(noded, return_index=True)
    x, number = np.unique(x, axis=0, return_inverse=True)
    same = np.diff(of) == 0
    ends = np.stack([number[:-1][same], number[1:][same]])
    ends = np.unique(np.sort(ends, axis=0), axis=1)
    middle = shapely.points(x[ends].mean(axis=0))
    line = np.full(ends.shape[1], -1)
    inside = ~shapely.dwithin(boundary, middle, 10 * near)
    if given:
        _, nearest = shapely.STRtree(given).query_nearest(middle, all_matches=False)
        line[inside] = np.array(number_of_line)[nearest[inside]]
    used = ~inside | shapely.contains(shape, middle)
    ends, line = ends[:, used], line[used]
    exact = np.hstack([shapely.get_coordinates(boundary).T, fixed]).T
    distance, at = KDTree(x).query(exact)
    close = distance <= 4 * near
    x[at[close]] = exact[close]
    kept = np.zeros(len(x), dtype=bool)
    kept[at[close & (np.arange(len(at)) >= len(at) - fixed.shape[1])]] = True
    return _joined(x, ends, line, kept, size)


def _joined(
    x: ndarray, ends: ndarray, line: ndarray, kept: ndarray, size: float
) -> tuple[ndarray, list[_Chain]]:
    """Chains of sides between nodes where lines meet or have a corner."""
    around: list[list[int]] = [[] for _ in x]
    for i, pair in enumerate(ends.T.tolist()):
        for k in pair:
            around[k].append(i)
    node, rank = kept.copy(), np.where(kept, 2, 0)
    for k, sides in enumerate(around):
        outline = [i for i in sides if line[i] < 0]
        pair = outline if len(outline) == 2 else sides
        turn, shorter = 0.0, 0.0
        if len(pair) == 2:
            u, v = (x[ends[:, i].sum() - k] - x[k] for i in pair)
            turn = abs(angle(u, -v))
            shorter = float(min(np.linalg.norm(u), np.linalg.norm(v)))
        if len(sides) != 2:  # a corner of the outline may meet lines
            node[k] = bool(sides)
            rank[k] = max(rank[k], 2 if turn > 1e-6 else bool(outline))
        elif turn > CORNER or turn * shorter > _KEPT * size:
            node[k], rank[k] = True, 2
        elif line[sides[0]] != line[sides[1]]:
            node[k] = True
    chains, left = [], set(range(len(line)))

    def walk(k: int, i: int) -> None:
        path = [k]
        while i in left:
            left.remove(i)
            k = int(ends[:, i].sum() - k)
            path.append(k)
            if node[k]:
                break
            i = next((j for j in around[k] if j in left), -1)
        chains.append(_Chain(x[path], (path[0], path[-1]), int(line[i])))

    for k in np.flatnonzero(node).tolist():
        for i in around[k]:
            if i in left:
                walk(k, i)
    while left:  # closed lines without corners
        i = min(left)
        node[ends[0, i]] = True
        walk(int(ends[0, i]), i)
    return x, _collapsed(x, chains, rank, size)


def _collapsed(
    x: ndarray, chains: list[_Chain], rank: ndarray, size: float
) -> list[_Chain]:
    """Collapse short chains, unless lines would then cross."""
    root = np.arange(len(x))
    short = [c for c in chains if c.length < _COLLAPSED * size]
    for chain in sorted(short, key=lambda c: c.length):
        a, b = sorted((root[k] for k in chain.ends), key=lambda k: -rank[k])
        # A line would cut a corner of the outline off.
        if rank[b] == 0 or (rank[b] == 1 and chain.line < 0):
            root[root == b] = a
    kept: dict[tuple[int, int], list[_Chain]] = {}
    for chain in sorted(chains, key=lambda c: c.line >= 0):  # the outline first
        a, b = (int(root[k]) for k in chain.ends)
        if a == b and chain.ends[0] != chain.ends[1]:
            continue
        x_chain = np.vstack([x[a], chain.x[1:-1], x[b]])
        others = kept.setdefault((min(a, b), max(a, b)), [])
        line = shapely.linestrings(x_chain)
        distances = [line.hausdorff_distance(shapely.linestrings(c.x)) for c in others]
        if min(distances, default=np.inf) > 2 * _COLLAPSED * size:
            others.append(_Chain(x_chain, (a, b), chain.line))
    left = [chain for same in kept.values() for chain in same]
    shapes = [shapely.linestrings(c.x) for c in left]
    pairs = shapely.STRtree(shapes).query(shapes, predicate="crosses")
    return chains if pairs.size else left


class _Segments(NamedTuple):
    """Segments between nodes, shape (n, 2), and the chain of each.

    The line and the ends of each chain, and True for ends at which chains meet at a
    small angle; the ends are the first nodes.
    """

    ends: ndarray
    chain: ndarray
    line_of_chain: ndarray
    ends_of_chain: ndarray
    acute: ndarray


def _divided(
    x: ndarray, chains: list[_Chain], size: float, turn: float
) -> tuple[ndarray, _Segments]:
    """Nodes and segments of chains that are divided into parts of a size.

    A curved chain turns by at most ``turn`` in each part, in radians.
    """
    ends_of_chain = np.array([c.ends for c in chains])
    used, numbers = np.unique(ends_of_chain, return_inverse=True)
    ends_of_chain = numbers.reshape(-1, 2)
    bent = [c.line >= 0 and c.turn * size > _BENT * c.length for c in chains]
    spacing = np.where(bent, size / 2, size)
    least = spacing / 8
    while True:
        acute = _acute_corners(len(used), ends_of_chain, chains, spacing)
        points, ends, of = [x[used]], [], []
        n = len(used)
        for i, chain in enumerate(chains):
            fewest = max(1, int(np.ceil(chain.turn / turn)))
            at_ends = acute[ends_of_chain[i]]
            inner = _along(chain, spacing[i], at_ends, least[i], fewest)
            k = np.arange(n, n + len(inner))
            k = np.concatenate([ends_of_chain[i, :1], k, ends_of_chain[i, 1:]])
            ends.append(np.stack([k[:-1], k[1:]], axis=1))
            of.append(np.full(len(k) - 1, i))
            points.append(inner)
            n += len(inner)
        p, s, c = np.concatenate(points), np.concatenate(ends), np.concatenate(of)
        sides = shapely.linestrings(p[s])
        i, j = shapely.STRtree(sides).query(sides, predicate="intersects")
        apart = (s[i][:, :, None] != s[j][:, None]).all(axis=(1, 2))
        crossing = np.unique(c[np.concatenate([i[apart], j[apart]])])
        if not crossing.size:
            break
        if spacing[crossing].min() < _FINEST * size:
            where = coords(chains[crossing[0]].x[0])
            raise ValueError(f"lines are too close to each other near {where}")
        spacing[crossing] /= 2
    lines = np.array([chain.line for chain in chains])
    return p, _Segments(s, c, lines, ends_of_chain, acute)


def _acute_corners(
    n: int, ends: ndarray, chains: list[_Chain], spacing: ndarray
) -> ndarray:
    """True for nodes at which chains meet at a small angle."""
    directions: list[list[ndarray]] = [[] for _ in range(n)]
    for i, (a, b) in enumerate(ends.tolist()):
        x, length = chains[i].x, chains[i].length
        step = min(spacing[i], length / 2)
        u, v = chains[i].at(np.array([step, length - step])) - x[[0, -1]]
        directions[a].append(np.arctan2(u[1], u[0]))
        directions[b].append(np.arctan2(v[1], v[0]))
    acute = np.zeros(n, dtype=bool)
    for k, angles in enumerate(directions):
        if len(angles) > 1:
            a = np.sort(angles)
            gaps = np.diff(np.append(a, a[0] + 2 * np.pi))
            acute[k] = gaps.min() < np.radians(_ACUTE)
    return acute


def _along(
    chain: _Chain, spacing: float, acute: ndarray, least: float, fewest: int
) -> ndarray:
    """Inner nodes of a chain with at least ``fewest`` parts, shape (n, 2)."""
    s = chain.s
    if spacing <= least:  # the line itself, divided
        n = np.maximum(1, np.ceil(np.diff(s) / spacing - 1e-6)).astype(int)
        parts = [
            np.linspace(a, b, k, endpoint=False)
            for a, b, k in zip(s[:-1], s[1:], n, strict=True)
        ]
        at = np.concatenate(parts)[1:]
    else:
        fewest = max(fewest, 3 * (chain.ends[0] == chain.ends[1]))
        first = spacing * 2.0 ** -np.ceil(max(0, np.log2(2.5 * spacing / s[-1])))
        on_circle = acute & (s[-1] > 1.2 * spacing)
        ends = np.where(on_circle, (first, s[-1] - first), (0.0, s[-1]))
        fewest -= on_circle.sum()
        few = max(int(np.ceil(np.diff(ends)[0] / spacing - 0.2)), fewest, 1)
        at = np.union1d(ends[on_circle], np.linspace(ends[0], ends[1], few + 1)[1:-1])
    return chain.at(at)


class _Refinement:
    """Nodes and segments during the refinement.

    Nodes of segments come first; ``chain`` of a node is the chain of its segments, −1
    for ends of chains, −2 for free nodes, −3 for nodes of a lattice, which stay.
    """

    def __init__(self, p: ndarray, segments: _Segments, size: float) -> None:
        self._p, self._size, self._of = p, size, segments
        self._s, self._chain_of_s = segments.ends, segments.chain
        self._acute = np.zeros(len(p), dtype=bool)
        self._acute[: len(segments.acute)] = segments.acute
        self._chain = np.full(len(p), -1)
        self._chain[self._s] = self._chain_of_s[:, None]
        self._chain[: len(segments.acute)] = -1
        outline = shapely.linestrings(p[self._s[self._line < 0]])
        self._shape = shapely.build_area(shapely.union_all(outline))
        if self._shape.is_empty:
            raise ValueError("the lines of the outline do not close")
        shapely.prepare(self._shape)

    @property
    def _line(self) -> ndarray:
        """Line of each segment, −1 on the outline."""
        return self._of.line_of_chain[self._chain_of_s]

    def run(self, inner: ndarray, moves: bool) -> Triangulation:
        """Add inner nodes, which may move, shape (n, 2), smooth and refine."""
        self._aim = _AIM if moves else _AIM_BESIDE_LATTICE
        self._add(inner, -2 if moves else -3)
        self._drop_close(_CLEARANCE)
        for _ in range(_SMOOTHING):
            self._smooth()
        for _ in range(_MOST_ROUNDS):
            t = self._triangles()
            if not (self._halve_encroached(t) or self._add_circumcentres(t)):
                break
        t = self._inside(self._triangles())
        self._refuse_missing(t)
        used, t = np.unique(t, return_inverse=True)
        return Triangulation(
            np.ascontiguousarray(self._p[used].T),
            np.ascontiguousarray(t.reshape(-1, 3).T),
            np.searchsorted(used, self._s).T,
            self._line,
        )

    def _add(self, q: ndarray, chain: ndarray | int) -> None:
        self._p = np.concatenate([self._p, q])
        self._chain = np.append(self._chain, np.broadcast_to(chain, len(q)))
        self._acute = np.append(self._acute, np.zeros(len(q), dtype=bool))

    def _drop_close(self, share: float) -> None:
        """Remove free nodes outside, or closer to segments than a share of these."""
        free = np.flatnonzero(self._chain <= -2)
        q = shapely.points(self._p[free])
        sides = self._p[self._s]
        length = np.linalg.norm(sides[:, 1] - sides[:, 0], axis=1)
        _, close = shapely.STRtree(q).query(
            shapely.linestrings(sides), "dwithin", share * length
        )
        out = np.zeros(len(self._p), dtype=bool)
        out[free[close]] = True
        out[free[~shapely.contains(self._shape, q)]] = True
        self._p, self._chain = self._p[~out], self._chain[~out]
        self._acute = self._acute[~out]
        self._s = (np.cumsum(~out) - 1)[self._s]

    def _triangles(self) -> ndarray:
        """Delaunay triangles with area, anticlockwise, shape (n, 3)."""
        t = Delaunay(self._p).simplices.astype(np.int64)
        a, b, c = self._p[t].transpose(1, 0, 2)
        u, v = b - a, c - a
        area = u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0]
        t[area < 0] = t[area < 0][:, ::-1]
        longest = np.maximum((u * u).sum(axis=1), (v * v).sum(axis=1))
        return t[np.abs(area) > 1e-9 * longest]

    def _inside(self, t: ndarray) -> ndarray:
        return t[shapely.contains_xy(self._shape, *self._p[t].mean(axis=1).T)]

    def _smooth(self) -> None:
        """Move free nodes to the mean of their neighbours."""
        t, n = self._inside(self._triangles()), len(self._p)
        i, j = t.ravel(), np.roll(t, -1, axis=1).ravel()
        links = csr_matrix((np.ones(2 * len(i)), (np.r_[i, j], np.r_[j, i])), (n, n))
        links.data[:] = 1.0
        count = np.asarray(links.sum(axis=1))
        free = (self._chain == -2) & (count[:, 0] > 0)
        self._p[free] = (links @ self._p / np.maximum(count, 1))[free]
        self._drop_close(0.5 * _CLEARANCE)

    def _keys(self, ends: ndarray) -> ndarray:
        a, b = np.sort(ends, axis=-1).T
        return a * len(self._p) + b

    def _halve_encroached(self, t: ndarray) -> bool:
        """Halve segments that are not edges or have a node in their circle."""
        sides = np.concatenate([t[:, [0, 1]], t[:, [1, 2]], t[:, [2, 0]]])
        opposite = np.concatenate([t[:, 2], t[:, 0], t[:, 1]])
        keys, own = self._keys(sides), self._keys(self._s)
        missing = ~np.isin(own, keys)
        order = np.argsort(own)
        at = order[np.searchsorted(own[order], keys).clip(max=len(own) - 1)]
        on = own[at] == keys
        a, b = self._p[sides].transpose(1, 0, 2)
        o = self._p[opposite]
        inside = ((a - o) * (b - o)).sum(axis=1) < -1e-9 * ((a - b) ** 2).sum(axis=1)
        # On the outline only nodes on the side of the polygon count.
        hit = np.flatnonzero(on & inside)
        hit = hit[
            (self._line[at[hit]] >= 0)
            | shapely.contains_xy(self._shape, *self._p[t[hit % len(t)]].mean(axis=1).T)
        ]
        missing[at[hit]] = True
        length = np.linalg.norm(np.diff(self._p[self._s], axis=1)[:, 0], axis=1)
        return self._halve(missing & (length > _FINEST * self._size))

    def _halve(self, which: ndarray) -> bool:
        """Halve segments; near an acute corner on circles around it."""
        ends = self._s[which]
        a, b = self._p[ends].transpose(1, 0, 2)
        length = np.linalg.norm(b - a, axis=1)
        circle = self._size * 2.0 ** np.round(np.log2(length / 2 / self._size))
        first, last = self._acute[ends].T
        share = np.where(first & ~last, circle / length, 0.5)
        share = np.where(last & ~first, 1 - circle / length, share)
        q = a + share[:, None] * (b - a)
        k = len(self._p) + np.arange(len(q))
        self._add(q, self._chain_of_s[which])
        halves = np.stack([k, ends[:, 1]], axis=1)
        self._s = np.concatenate([self._s, halves])
        self._s[: len(which)][which, 1] = k
        self._chain_of_s = np.append(self._chain_of_s, self._chain_of_s[which])
        return bool(which.any())

    def _add_circumcentres(self, t: ndarray) -> bool:
        """Add circumcentres of poor triangles, or halve the segments they are near."""
        t = self._inside(t)
        x = self._p[t]
        side = np.linalg.norm(np.roll(x, -1, axis=1) - x, axis=2)
        (a, b, c), shortest = x.transpose(1, 0, 2), side.min(axis=1)
        u, v = b - a, c - a
        twice = u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0]
        radius = side.prod(axis=1) / (2 * twice)
        angle = np.degrees(np.arcsin(np.clip(shortest / (2 * radius), 0, 1)))
        poor = (angle < self._aim) & (shortest > _FINEST * self._size)
        poor[poor] = ~self._between_circles(t[poor], side[poor])
        poor |= radius > _LARGEST * self._size
        if not poor.any():
            return False
        u, v, twice, radius = u[poor], v[poor], twice[poor, None], radius[poor]
        uu, vv = (u * u).sum(axis=1), (v * v).sum(axis=1)
        w = uu[:, None] * v - vv[:, None] * u
        q = a[poor] + np.stack([w[:, 1], -w[:, 0]], axis=1) / (2 * twice)
        order = np.argsort(-radius, kind="stable")
        q, radius = q[order], radius[order]
        q = q[_apart(q, radius)]
        middle = self._p[self._s].mean(axis=1)
        half = np.linalg.norm(np.diff(self._p[self._s], axis=1)[:, 0], axis=1) / 2
        near = KDTree(q).query_ball_point(middle, half * (1 - 1e-9))
        halved = near.astype(bool) & (half > _FINEST * self._size)
        q = np.delete(q, np.unique(np.concatenate(near).astype(int)), axis=0)
        q = q[shapely.contains_xy(self._shape, *q.T)]
        self._add(q, -2)
        return self._halve(halved) or len(q) > 0

    def _between_circles(self, t: ndarray, side: ndarray) -> ndarray:
        """True for triangles whose shortest edge is between lines at a small angle."""
        k = side.argmin(axis=1)[:, None]
        edge = np.take_along_axis(t, np.hstack([k, (k + 1) % 3]), axis=1)
        result = np.zeros(len(t), dtype=bool)
        chain, ends = self._chain[edge], self._of.ends_of_chain
        for i in np.flatnonzero((chain >= 0).all(axis=1) & (np.ptp(chain, axis=1) > 0)):
            for corner in np.intersect1d(*ends[chain[i]]):
                r = np.linalg.norm(self._p[edge[i]] - self._p[corner], axis=1)
                # Chords of curved lines are at nearly equal distances.
                result[i] |= abs(r[0] - r[1]) < 0.05 * max(r)
        return result

    def _refuse_missing(self, t: ndarray) -> None:
        sides = t[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)
        missing = ~np.isin(self._keys(self._s), self._keys(sides))
        if missing.any():
            where = coords(self._p[self._s[missing.argmax()]].mean(axis=0))
            raise ValueError(f"lines are too close to each other near {where}")


def _apart(q: ndarray, radius: ndarray) -> ndarray:
    """True for a subset of points whose distances exceed the smaller radius."""
    accepted = np.ones(len(q), dtype=bool)
    for i, near in enumerate(KDTree(q).query_ball_point(q, radius)):
        if accepted[i]:
            accepted[[j for j in near if j > i]] = False
    return accepted
