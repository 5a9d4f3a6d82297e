"""Sewing, checks and repair of the triangles of a tool, as CAD systems export them.

STL files repeat the vertices of every triangle, and CAD systems tessellate the faces of
a body separately: copies of a vertex scatter, and along a seam the vertices of one face
lie on the edges of the other.
"""

from typing import NamedTuple

import numpy as np
from numpy import ndarray

from ..mesh.checks import MeshError
from ..mesh.graph import boundary_edges, components, edges_once
from ..mesh.user_input import coords
from .holes import of_outer_edges, parts_of, turning
from .tool_mesh import pairs_of

# Distance, relative to the extent, below which vertices coincide: single precision.
_ONE = 1e-6

# Distances, relative to the shorter of the shortest edges at two vertices, below which
# they are copies of each other: of vertices at open edges, one after the other, and of
# others, as in a face that the file contains twice.  Three copies in a row are closer
# than an edge.  Sides of a thin shell of separate triangles remain apart: their edges
# are not open after the first of these.
_COPIES, _TWICE = (0.01, 0.1, 0.3, 0.3), 0.02

# Smallest ratio of successive distances between scattered copies and the shortest
# edges, and the share of the median edge below which it is sought.  Copies scatter
# without gaps of this ratio in the upper half of their distances.
_GAP, _SHORT = 3.0, 0.2

# Distance from an edge, relative to its length, below which an open vertex lies on it,
# and the share of its length at its ends where it does not.  The height of an arc of
# 45° is a tenth of its chord.
_ON_EDGE, _END = 0.1, 0.01


class Sewing(NamedTuple):
    """Numbers of sewn vertices and of removed triangles, and the largest gap in mm."""

    merged: int = 0
    on_edges: int = 0
    duplicates: int = 0
    gap: float = 0.0


def sewn(x: ndarray, triangles: ndarray) -> tuple[ndarray, ndarray, Sewing]:
    """Merge copies of vertices; vertices (n, 3), triangles (3, m) and a `Sewing`.

    Triangles with coincident corners are removed, and so are duplicates.

    Parameters
    ----------
    x
        Vertices in mm, shape (n, 3).
    triangles
        Their numbers, shape (3, m).

    Raises
    ------
    MeshError
        If no triangle remains.
    """
    x, triangles = _without_repetition(x, triangles)
    triangles, duplicates = _without_duplicates(triangles)
    merged, gap = 0, 0.0
    for share in _COPIES:
        groups, distance, is_sewn = _copies(x, triangles, share)
        if is_sewn:
            break
        count = len(x) - int(groups.max() + 1)
        size = np.bincount(groups)
        x = np.array([np.bincount(groups, own) / size for own in x.T]).T
        triangles, twice = _without_duplicates(_with_corners(groups[triangles]))
        merged, gap, duplicates = merged + count, max(gap, distance), duplicates + twice
    on_edges = 0
    while True:
        triangles, count, distance = _cut_at_vertices(x, triangles)
        if not count:
            break
        on_edges, gap = on_edges + count, max(gap, distance)
    used, numbers = np.unique(triangles, return_inverse=True)
    sewing = Sewing(merged, on_edges, duplicates, gap)
    return x[used], numbers.reshape(triangles.shape), sewing


def _without_duplicates(triangles: ndarray) -> tuple[ndarray, int]:
    """Remove duplicate triangles; triangles, and the number removed."""
    n = int(triangles.max()) + 1
    corners = np.sort(triangles, axis=0).astype(np.int64)
    _, pair = np.unique(corners[0] * n + corners[1], return_inverse=True)
    _, first = np.unique(pair.reshape(-1) * n + corners[2], return_index=True)
    return triangles[:, np.sort(first)], triangles.shape[1] - len(first)


def _without_repetition(x: ndarray, triangles: ndarray) -> tuple[ndarray, ndarray]:
    """Merge vertices that coincide in single precision."""
    low, extent = x.min(axis=0), np.ptp(x, axis=0).max()
    grid = np.round((x - low) / (_ONE * extent)).astype(np.int64)
    side = round(1 / _ONE) + 2
    _, first, number = np.unique(
        grid @ np.array([side**2, side, 1]), return_index=True, return_inverse=True
    )
    return x[first], _with_corners(number.reshape(-1)[triangles])


def _with_corners(triangles: ndarray) -> ndarray:
    """Triangles with three different corners."""
    a, b, c = triangles
    triangles = triangles[:, (a != b) & (b != c) & (c != a)]
    if not triangles.size:
        raise MeshError("triangle mesh: all triangles have coincident corners")
    return triangles


def _copies(
    x: ndarray, triangles: ndarray, share: float
) -> tuple[ndarray, float, bool]:
    """Group of each vertex, and the largest distance between two copies in mm.

    Also True if no vertices are closer than the largest share of an edge.
    """
    from scipy.spatial import KDTree

    ends, first, _, count = edges_once([triangles])
    length = np.linalg.norm(x[ends[0]] - x[ends[1]], axis=1)
    typical = float(np.median(length))
    reach = max(_COPIES) * typical
    one, other = KDTree(x).query_pairs(reach, output_type="ndarray").T
    if not one.size:
        return np.arange(len(x)), 0.0, True
    distance = np.linalg.norm(x[one] - x[other], axis=1)
    true = length > _largest_scatter(np.concatenate([distance, length]), typical)
    shortest = np.full(len(x), np.inf)
    for end in ends:
        np.minimum.at(shortest, end[true], length[true])
    shortest = np.minimum(shortest, typical, where=np.isinf(shortest), out=shortest)
    is_open = np.zeros(len(x), dtype=bool)
    is_open[ends[:, first[count == 1]]] = True
    limit = np.where(is_open[one] & is_open[other], share, min(share, _TWICE))
    copies = distance < limit * np.minimum(shortest[one], shortest[other])
    one, other, distance = one[copies], other[copies], distance[copies]
    groups = components(len(x), (one, other))
    return groups, float(distance.max(initial=0.0)), False


def _largest_scatter(distances: ndarray, typical: float) -> float:
    """Lower end of the largest jump in sorted short distances; 0 without a jump."""
    limit = _SHORT * typical
    short = np.sort(distances[distances < limit])
    upper = short[len(short) // 2 :]
    gaps = np.flatnonzero(np.append(upper[1:], limit) > _GAP * upper)
    return float(upper[gaps[-1]]) if gaps.size else 0.0


def _cut_at_vertices(x: ndarray, triangles: ndarray) -> tuple[ndarray, int, float]:
    """Split triangles where open vertices lie on their open edges.

    One edge of each triangle is cut.  Also the number of these vertices, and their
    largest distance from an edge in mm.
    """
    edges, first, _, count = edges_once([triangles])
    first = first[count == 1]
    edge, vertex, share, away = _on_open_edges(x, edges[:, first])
    side, triangle = np.divmod(first[edge], triangles.shape[1])
    # A needle has its third corner on its edge.
    others = triangles[(side + 2) % 3, triangle] != vertex
    edge, vertex, share, away = (of[others] for of in (edge, vertex, share, away))
    if not edge.size:
        return triangles, 0, 0.0
    _, choice = np.unique(triangle[others], return_index=True)
    chosen = np.flatnonzero(np.isin(edge, edge[choice]))
    chosen = chosen[np.lexsort([share[chosen], edge[chosen]])]
    edge, vertex, away = edge[chosen], vertex[chosen], away[chosen]
    side, triangle = np.divmod(first[edge], triangles.shape[1])
    corners = np.array([triangles[(side + k) % 3, triangle] for k in range(3)])
    begins = np.flatnonzero(np.diff(edge, prepend=-1))
    ends = np.flatnonzero(np.diff(edge, append=-1))
    after = np.append(vertex[1:], -1)
    after[ends] = corners[1, ends]
    start = np.array([corners[0, begins], vertex[begins], corners[2, begins]])
    kept = np.delete(triangles, np.unique(triangle), axis=1)
    pieces = [kept, start, np.array([vertex, after, corners[2]])]
    return _with_corners(np.hstack(pieces)), len(vertex), float(away.max())


def _on_open_edges(
    x: ndarray, edges: ndarray
) -> tuple[ndarray, ndarray, ndarray, ndarray]:
    """Pairs of edge and vertex of another edge on it, both by number.

    Also the share of the length of the edge at the vertex, and the distance in mm.
    """
    from scipy.spatial import KDTree

    begin, end = x[edges]
    vertices = np.unique(edges)
    length = np.linalg.norm(end - begin, axis=1)
    near = KDTree(x[vertices]).query_ball_point(
        (begin + end) / 2, (0.5 + _ON_EDGE) * length
    )
    edge, number = pairs_of(near)
    vertex = vertices[number]
    along, off = (end - begin)[edge], x[vertex] - begin[edge]
    share = (along * off).sum(axis=1) / length[edge] ** 2
    away = np.linalg.norm(off - share[:, None] * along, axis=1)
    on = (away < _ON_EDGE * length[edge]) & (np.abs(share - 0.5) < 0.5 - _END)
    on &= (vertex != edges[:, edge]).all(axis=0)
    return edge[on], vertex[on], share[on], away[on]


# Smallest and largest extent in mm.  Squares of areas are then finite and nonzero.
_LEAST, _LARGEST = 1e-50, 1e50

# Distance of a vertex from the median of all, relative to the distance within which
# nine of ten are, beyond which its coordinates are not sane: a tool of 10 m
# of which nine tenths of the vertices are within 10 mm.
_STRAY = 1e3

# Share of triangles in separate parts above which they do not meet: sewn triangles of
# a tool of several faces have a few parts.
_LOOSE = 0.05

# Gap between faces, relative to the mean edge, above which its effect is reported, and
# the largest error of shear angles in degrees per gap.  Measured with 12 shapes and
# nets of 24×24 cells: at most 16 (`python -m studies tools`).
_STEP, _SHEAR_ERROR = 0.02, 20.0

# Gap between sewn triangles, relative to the mean edge, above which a twist, or a hole
# of at most this circumference, relative to the same edge, is a gap that was not sewn,
# or sewn wrongly.  Measured with scattered triangles of 12 shapes: 0.06 to 0.18
# (`python -m studies tools`); a hole where one triangle is missing has three edges.
_WIDE, _SMALL = 0.05, 6.0

# Share of edges of more than two triangles above which a tool is not a surface, a guard
# against tools of crossing sheets: slivers along a seam fold in a few places.
_BRANCHES = 1e-3

# Share of the area within which the orientation of a part follows most triangles;
# between this and its complement, it faces upwards.
_MOST = 0.6

# Share of the area of a part below which it is not counted, as left-over slivers.
_SLIVER = 1e-4

# Area of a part relative to the largest part below which it is rounding.
_NO_AREA = 1e-14

# Distance between opposite sides, relative to the mean edge, below which the quadrics
# of one affect the other: at three quarters of their reach the weight is a thousandth.
# Share of the triangles above which the tool is a shell; a trailing edge has fewer.
_THIN, _SHELL = 1.5, 0.1


def repaired(
    vertices: ndarray, triangles: ndarray, least: int
) -> tuple[ndarray, ndarray, tuple[str, ...]]:
    """Sewn and consistently oriented triangles.

    Parameters
    ----------
    vertices
        Vertices in mm, shape (3, n_vertices).
    triangles
        Vertex numbers, shape (3, n).
    least
        Smallest number of vertices.

    Returns
    -------
    tuple
        Vertices, shape (3, n), triangles, (3, m), and a line for each repair and for
        each property that affects results.

    Raises
    ------
    MeshError
        If they are not valid, or not one surface with two sides.
    """
    x, triangles = _valid(vertices, triangles)
    x, triangles, sewing = sewn(x, triangles)
    x, triangles, flat = _with_area(x, triangles)
    if len(x) < least:
        raise MeshError(
            f"triangle mesh: there are {len(x)} vertices, but at least {least} are "
            "required: export it with smaller triangles"
        )
    _refuse_loose(x, triangles)
    if sewing.gap > _WIDE * mean_edge(x, triangles):
        _of_shell(x, triangles)  # its sides may be sewn to each other
        _refuse_gaps(x, triangles, sewing.gap)
    triangles, turned = _oriented(x, triangles)
    shell = _of_shell(x, triangles)
    branches = _branches(x, triangles)
    duplicates = sewing.duplicates
    remarks = [
        _of_sewing(sewing, mean_edge(x, triangles)),
        f"{duplicates} duplicate triangle(s) removed" if duplicates else "",
        f"{flat} triangle(s) of parts without area removed" if flat else "",
        branches,
        turned,
        _of_parts(x, triangles),
        _of_holes(x, triangles),
        shell,
    ]
    return x.T, triangles, tuple(filter(None, remarks))


def _valid(vertices: ndarray, triangles: ndarray) -> tuple[ndarray, ndarray]:
    """Vertices, shape (n, 3), and triangles; refuses numbers out of range."""
    vertices = np.asarray(vertices, dtype=float)
    triangles = np.asarray(triangles, dtype=int)
    if vertices.ndim != 2 or len(vertices) != 3:
        raise MeshError(
            "triangle mesh: vertices must be finite numbers of shape (3, n)"
        )
    if triangles.ndim != 2 or len(triangles) != 3 or not triangles.size:
        raise MeshError(
            "triangle mesh: triangles must be vertex numbers of shape (3, n), n >= 1"
        )
    if triangles.min() < 0 or triangles.max() >= vertices.shape[1]:
        raise MeshError("triangle mesh: a triangle refers to an undefined vertex")
    used, numbers = np.unique(triangles, return_inverse=True)
    x, triangles = vertices.T[used], numbers.reshape(triangles.shape)
    if (stray := _stray(x)).any():
        vertex = np.flatnonzero(stray)[0]
        triangle = np.flatnonzero((triangles == vertex).any(axis=0))[0]
        raise MeshError(
            f"triangle mesh: triangle {triangle + 1} has a corner at "
            f"{coords(x[vertex])} mm, which is not finite or far from all others: "
            "correct this vertex"
        )
    with np.errstate(over="ignore"):
        extent = np.ptp(x, axis=0).max()
    if not _LEAST < extent < _LARGEST:
        raise MeshError(
            f"triangle mesh: the vertices extend over {extent:.3g} mm: specify "
            "coordinates in mm"
        )
    return x, triangles


def _stray(x: ndarray) -> ndarray:
    """Mask of vertices that are not finite or far from all others, shape (n,)."""
    finite = np.isfinite(x).all(axis=1)
    if not finite.all():
        return ~finite
    with np.errstate(over="ignore"):
        away = np.abs(x - np.median(x, axis=0)).max(axis=1)
        stray: ndarray = away > _STRAY * np.quantile(away, 0.9)
    return stray


def mean_edge(x: ndarray, triangles: ndarray) -> float:
    """Mean edge length of triangles in mm; vertices have the shape (n, 3)."""
    edges = x[triangles] - x[np.roll(triangles, 1, axis=0)]
    return float(np.linalg.norm(edges, axis=2).mean())


def area_vectors(x: ndarray, triangles: ndarray) -> ndarray:
    """Normals of triangles with twice the area as length, shape (n, 3)."""
    a, b, c = x[triangles]
    return np.cross(b - a, c - a)


def _of_sewing(sewing: Sewing, edge: float) -> str:
    parts = []
    if sewing.merged:
        parts.append(f"{sewing.merged} copies of vertices merged")
    if sewing.on_edges:
        parts.append(f"{sewing.on_edges} vertices inserted into edges of other faces")
    if not parts:
        return ""
    text = f"sewn: {' and '.join(parts)}; the largest gap was {sewing.gap:.3g} mm"
    if sewing.gap < _STEP * edge:
        return text
    error = _SHEAR_ERROR * sewing.gap / edge
    return (
        f"{text}, {sewing.gap / edge:.2g} of the mean edge: errors of shear angles at "
        f"seams may reach {error:.1g} degrees"
    )


def _neighbours(triangles: ndarray) -> tuple[ndarray, ndarray]:
    """Pairs of triangles at edges of exactly two, shape (2, n).

    Also 1 for those that run along the edge in opposite directions, else 0, shape (n,).
    """
    edges, _, _, count = edges_once([triangles])
    low, high = edges.min(axis=0).astype(np.int64), edges.max(axis=0)
    order = np.argsort(low * (int(high.max()) + 1) + high, kind="stable")
    start = (np.cumsum(count) - count)[count == 2]
    pair = np.array([order[start], order[start + 1]])
    return pair % triangles.shape[1], (edges[0, pair[0]] != edges[0, pair[1]]) * 1


def _with_area(x: ndarray, triangles: ndarray) -> tuple[ndarray, ndarray, int]:
    """Vertices and triangles without the parts that have no area, and their number."""
    part = parts_of(len(x), triangles)[triangles[0]]
    area = np.bincount(part, np.linalg.norm(area_vectors(x, triangles), axis=1))
    keep = (area > _NO_AREA * area.max())[part]
    if keep.all():
        return x, triangles, 0
    used, numbers = np.unique(triangles[:, keep], return_inverse=True)
    return x[used], numbers.reshape(3, -1), int((~keep).sum())


def _refuse_loose(x: ndarray, triangles: ndarray) -> None:
    """Refuse triangles that do not meet."""
    part = components(triangles.shape[1], _neighbours(triangles)[0])
    n = int(part.max()) + 1
    if n <= max(_LOOSE * triangles.shape[1], 1):
        return
    edge = mean_edge(x, triangles)
    raise MeshError(
        f"triangle mesh: {n} parts of the {triangles.shape[1]} triangles do not meet: "
        f"the gaps between them are too wide for their edges of {edge:.3g} mm. "
        "Sew the faces before the export, or use larger triangles"
    )


def _refuse_gaps(x: ndarray, triangles: ndarray, gap: float) -> None:
    """Refuse triangles with wide gaps of which some were not sewn."""
    n, edge = triangles.shape[1], mean_edge(x, triangles)
    side = _sides(triangles)
    around = _around_openings(x, triangles)[0]
    if (side[:n] == side[n:]).any() or (around < _SMALL * edge).any():
        raise MeshError(
            f"triangle mesh: triangles do not meet: their vertices scatter by up to "
            f"{gap:.3g} mm, {gap / edge:.2g} of the mean edge, and not all gaps can be "
            "sewn. Sew the faces before the export, or use larger triangles"
        )


def _around_openings(
    x: ndarray, triangles: ndarray
) -> tuple[ndarray, ndarray, ndarray]:
    """Circumferences of the closed chains of open edges in mm.

    Also the open edges, (2, n), and the chain of each, (n,).
    """
    open_edges = boundary_edges([triangles])
    loop = components(len(x), open_edges)[open_edges[0]]
    length = np.linalg.norm(x[open_edges[0]] - x[open_edges[1]], axis=1)
    _, loop = np.unique(loop, return_inverse=True)
    return np.bincount(loop.reshape(-1), length), open_edges, loop.reshape(-1)


def _branches(x: ndarray, triangles: ndarray) -> str:
    """Remark about edges of more than two triangles.

    Raises
    ------
    MeshError
        If there are many of them.
    """
    edges, first, _, count = edges_once([triangles])
    several = count > 2
    if not several.any():
        return ""
    ends = x[edges[:, first[several][0]]]
    text = (
        f"{several.sum()} edge(s) belong to more than two triangles, one of them at "
        f"{coords(ends.mean(axis=0))} mm"
    )
    if several.mean() > _BRANCHES:
        raise MeshError(
            f"triangle mesh: {text}: export only the surface that is draped, without "
            "ribs and inner faces"
        )
    return text


def _sides(triangles: ndarray) -> ndarray:
    """Number of the side of each triangle and of its back, shape (2n,).

    Both are the same on a surface with one side only.
    """
    n = triangles.shape[1]
    pairs, same = _neighbours(triangles)
    both = np.hstack([pairs, pairs + n])
    both[1] = np.where(np.tile(same, 2) > 0, both[1], (both[1] + n) % (2 * n))
    return components(2 * n, both)


def _oriented(x: ndarray, triangles: ndarray) -> tuple[ndarray, str]:
    """Orient triangles consistently; triangles, and a remark on reversed ones.

    Sides are propagated over shared edges.  Each part then keeps the side of most of
    its area, or faces upwards if there is none; a closed part faces outwards.
    """
    n = triangles.shape[1]
    pairs, _ = _neighbours(triangles)
    side = _sides(triangles)
    if (twisted := np.flatnonzero(side[:n] == side[n:])).size:
        place = x[triangles[:, twisted[0]]].mean(axis=0)
        raise MeshError(
            f"triangle mesh: the surface around {coords(place)} mm has only one side, "
            "like a Moebius strip: export only the surface that is draped"
        )
    part = np.unique(np.minimum(side[:n], side[n:]), return_inverse=True)[1].reshape(-1)
    turned = side[:n] > side[n:]
    vectors = area_vectors(x, triangles)
    area, signs = np.linalg.norm(vectors, axis=1), np.where(turned, -1, 1)
    flat = np.bincount(part, area) <= 0
    if flat.any():
        place = x[triangles[:, flat[part]][0, 0]]
        raise MeshError(
            f"triangle mesh: the separate part at {coords(place)} mm has no area: "
            "remove it"
        )
    share = np.bincount(part, area * turned) / np.bincount(part, area)
    up = np.bincount(part, vectors[:, 2] * signs)
    reverse = np.where(np.abs(share - 0.5) > _MOST - 0.5, share > 0.5, up < 0)
    closed = 3 * np.bincount(part) == 2 * np.bincount(part[pairs[0]], minlength=len(up))
    a, b, c = x[triangles]
    centred = (a + b + c) / 3 - x.mean(axis=0)
    volume = np.bincount(part, (centred * vectors).sum(axis=1) * signs)
    reverse = np.where(closed, volume < 0, reverse)
    turned ^= reverse[part]
    if not turned.any():
        return triangles, ""
    triangles = np.where(turned, triangles[::-1], triangles)
    which = "outwards" if closed[part[turned]].all() else "to the side of the others"
    if not closed.any() and (np.abs(share - 0.5) <= _MOST - 0.5).any():
        which = "upwards (+z), as there is no side of most of them"
    return triangles, f"{turned.sum()} of {n} triangles turned {which}"


def _of_parts(x: ndarray, triangles: ndarray) -> str:
    part = components(triangles.shape[1], _neighbours(triangles)[0])
    area = np.bincount(part, np.linalg.norm(area_vectors(x, triangles), axis=1))
    share = np.sort(area / area.sum())[::-1]
    if (n := int((share > _SLIVER).sum())) <= 1:
        return ""
    return (
        f"the tool has {n} separate parts, the largest with {share[0]:.0%} of the "
        "area: a draped ply spans the gaps between them"
    )


def _of_holes(x: ndarray, triangles: ndarray) -> str:
    around, open_edges, loop = _around_openings(x, triangles)
    if not open_edges.size:
        return "the tool is closed: a ply lies on its outside"
    order = np.argsort(-around)
    turn = np.bincount(loop, turning(x.T, triangles)[open_edges[0]])
    part = np.empty(len(around), dtype=int)
    part[loop] = parts_of(len(x), triangles)[open_edges[0]]
    holes = order[~of_outer_edges(turn[order], part[order])]
    if not (n := len(holes)):
        return ""
    hole = holes[0]
    place = x[open_edges[0, loop == hole]].mean(axis=0)
    return (
        f"the tool has {n} hole(s), the largest with a circumference of "
        f"{around[hole]:.3g} mm around {coords(place)} mm: a draped ply spans them on "
        "a smooth continuation, a formed ply does not touch the tool there"
    )


def _of_shell(x: ndarray, triangles: ndarray) -> str:
    """Remark about opposite sides close to each other.

    Raises
    ------
    MeshError
        If they are a part of the tool.
    """
    from scipy.spatial import KDTree

    a, b, c = x[triangles]
    vectors, centres = area_vectors(x, triangles), (a + b + c) / 3
    area = np.linalg.norm(vectors, axis=1)
    normals = vectors / np.maximum(area, 1e-300)[:, None]
    edge = mean_edge(x, triangles)
    pairs = KDTree(centres).query_pairs(_THIN * edge, output_type="ndarray").T
    pairs = pairs[:, (normals[pairs[0]] * normals[pairs[1]]).sum(axis=1) < -0.5]
    d = centres[pairs[1]] - centres[pairs[0]]
    across = np.abs((d * normals[pairs[0]]).sum(axis=1))
    thin = across > 0.5 * np.linalg.norm(d, axis=1)
    if not thin.any():
        return ""
    pairs, across = pairs[:, thin], across[thin]
    share = len(np.unique(pairs)) / len(area)
    nearest = across.argmin()
    text = (
        f"opposite sides of the tool are {across[nearest]:.3g} mm apart at "
        f"{coords(centres[pairs[0, nearest]])} mm, too close for edges of "
        f"{edge:.3g} mm"
    )
    if share > _SHELL:
        raise MeshError(
            f"triangle mesh: {text}: export only the side that is draped, or use "
            "smaller triangles"
        )
    return f"{text}: keep the ply away from there"
