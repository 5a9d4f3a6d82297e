"""Sewing of triangles whose vertices do not coincide.

STL files repeat the vertices of every triangle, and CAD systems tessellate the faces of
a body separately: copies of a vertex scatter, and along a seam the vertices of one face
lie on the edges of the other.
"""

from typing import NamedTuple

import numpy as np
from numpy import ndarray

from ..mesh.checks import MeshError
from ..mesh.graph import components, edges_once

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
    edge, vertex, share, away = (
        edge[others],
        vertex[others],
        share[others],
        away[others],
    )
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
    sizes = np.fromiter(map(len, near), dtype=int, count=len(near))
    edge = np.repeat(np.arange(len(near)), sizes)
    flat = [number for own in near for number in own]
    vertex = vertices[np.array(flat, dtype=int)]
    along, off = (end - begin)[edge], x[vertex] - begin[edge]
    share = (along * off).sum(axis=1) / length[edge] ** 2
    away = np.linalg.norm(off - share[:, None] * along, axis=1)
    on = (away < _ON_EDGE * length[edge]) & (np.abs(share - 0.5) < 0.5 - _END)
    on &= (vertex != edges[:, edge]).all(axis=0)
    return edge[on], vertex[on], share[on], away[on]
