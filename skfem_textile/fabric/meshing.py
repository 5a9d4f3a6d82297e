"""Meshes of a convex outline with edges along straight fibres.

A point has the coordinates s₁ and s₂ along warp and weft, X = s₁ A₁ + s₂ A₂.  A motion
without fibre stretch is x = f(s₁) + g(s₂).  If f and g have kinks only at lines s₁ = a
and s₂ = b of a net, the motion is linear in every cell of the net and in every part of
a cell.  Elements that are cells of the net, or parts of them, represent it exactly.
"""

import logging
from itertools import pairwise

import numpy as np
from numpy import ndarray
from numpy.typing import ArrayLike
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components
from skfem import Mesh, MeshQuad, MeshTri

from ..mesh.checks import MeshError, refuse_positions, with_edges
from ..mesh.contact import signed_areas
from .fabric import Fabric


def cells_of_net(
    outline: ndarray, a: ndarray, b: ndarray, near: float
) -> tuple[ndarray, ndarray]:
    """Cells between the lines x = a and y = b within an outline.

    Parameters
    ----------
    outline
        Corners of a convex outline, shape (2, n).  Lines of both families pass through
        each of them.
    a, b
        Lines in ascending order.
    near
        Distance below which a point is on a side.

    Returns
    -------
    tuple of ndarray
        Nodes, shape (2, n_nodes), and elements as node numbers: the cells, shape (4,
        n), if the outline cuts none; else triangles, shape (3, n), with alternating
        diagonals.
    """
    points = np.stack(np.meshgrid(a, b))
    distances = _distances(outline, points)
    distances[np.abs(distances) <= near] = 0.0
    inside: ndarray = np.all(distances >= 0, axis=0)
    number = np.cumsum(inside).reshape(inside.shape) - 1
    row, column = np.indices((len(b) - 1, len(a) - 1)).reshape(2, -1)
    rows = np.stack([row, row, row + 1, row + 1])
    columns = np.stack([column, column + 1, column + 1, column])
    complete = inside[rows, columns].all(axis=0)
    cut_off = ~complete & (distances > 0)[:, rows, columns].any(axis=1).all(axis=0)

    quads = number[rows, columns][:, complete]
    if not cut_off.any():
        return points[:, inside], quads
    other = (row + column)[complete] % 2 == 1
    quads[:, other] = np.roll(quads[:, other], 1, axis=0)
    nodes = _Nodes(points[:, inside])
    triangles = [quads[[0, 1, 2]], quads[[0, 2, 3]]]
    for cell in zip(rows[:, cut_off].T, columns[:, cut_off].T, strict=True):
        corners = _cut_off(points[:, *cell].T, distances[:, *cell].T, near)
        triangles.append(nodes.numbers(corners)[_fan(corners)])
    return nodes.positions, np.hstack(triangles)


def _distances(outline: ndarray, points: ndarray) -> ndarray:
    """Distances of points from the sides, shape (n_sides, ...), positive inside."""
    side = np.roll(outline, -1, axis=1) - outline
    normal = np.sign(signed_areas(*outline)) * np.stack([-side[1], side[0]])
    normal /= np.linalg.norm(normal, axis=0)
    offset = np.sum(normal * outline, axis=0)
    return np.tensordot(normal.T, points, 1) - offset[:, None, None]


def _cut_off(corners: ndarray, distances: ndarray, near: float) -> ndarray:
    """Part of a cell within the outline: its corners, shape (2, n).

    Arguments are the corners of the cell and their distances from the sides; ``near``
    as in `cells_of_net`.
    """
    known = np.hstack([corners, distances])
    for side in range(2, known.shape[1]):
        accepted = []
        for one, other in pairwise([*known, known[0]]):
            if one[side] >= 0:
                accepted.append(one)
            if one[side] * other[side] < 0:
                # Interpolate in the same direction for both cells that share an edge.
                p, q = sorted((one, other), key=lambda corner: (*corner[:2],))
                point = p + p[side] / (p[side] - q[side]) * (q - p)
                point[2:][np.abs(point[2:]) <= near] = 0.0
                point[side] = 0.0
                accepted.append(point)
        known = np.array(accepted)
    return known[:, :2].T


def _fan(corners: ndarray) -> ndarray:
    """Fan of triangles of a convex cell with the largest minimum area.

    Returned as local corner numbers, shape (3, n - 2).
    """
    n = corners.shape[1]

    def fan(first: int) -> ndarray:
        turned = np.roll(np.arange(n), -first)
        return np.stack([np.full(n - 2, turned[0]), turned[1:-1], turned[2:]])

    def smallest(triangles: ndarray) -> float:
        p, q, r = corners[:, triangles].swapaxes(0, 1)
        (x, y), (u, v) = q - p, r - p
        return float(np.abs(x * v - y * u).min())

    return max(map(fan, range(n)), key=smallest)


class _Nodes:
    """Nodes of the net, and nodes added by position."""

    def __init__(self, positions: ndarray) -> None:
        self._numbers = {(x, y): n for n, (x, y) in enumerate(positions.T.tolist())}

    @property
    def positions(self) -> ndarray:
        """All nodes, shape (2, n_nodes)."""
        return np.array(list(self._numbers)).T

    def numbers(self, positions: ndarray) -> ndarray:
        """Numbers of nodes at positions of shape (2, n), created where needed."""
        known = self._numbers
        return np.array(
            [known.setdefault((x, y), len(known)) for x, y in positions.T.tolist()]
        )


log = logging.getLogger(__name__)

# Distance, relative to the outline, below which two lines coincide.  Chosen: far above
# rounding (2e-16), which accumulates from line to line, and far below practical
# spacings.
_NEAR = 1e-9

# Components of unit vectors below this are zero.  Chosen: above cos 90°, 6e-17.
_ROUNDING = 1e-15

# Maximum number of lines of a family.  Chosen: the square of it exceeds any memory.
_MOST = 1e5

# Smallest gap between lines that are added so that the families meet at the sides,
# relative to the spacing.  Chosen: it bounds the smallest elements.
_NARROWEST = 0.2


def mesh_along_fibres(
    outline: ArrayLike, warp: ArrayLike, weft: ArrayLike, spacing: ArrayLike
) -> Mesh:
    """Mesh of a convex outline with edges along warp and weft.

    Lines of both families pass through each corner of the outline, with equally spaced
    lines between them.  If possible, lines of both families meet wherever one meets a
    side; otherwise this is logged at the level INFO.  The cells of this net are
    parallelograms, cut off at the sides.  The mesh consists of these if none is cut
    off, and otherwise of triangles, into which the cells are cut along a diagonal.

    Parameters
    ----------
    outline
        Corners in mm, in order, shape (2, n).  Lines also pass through a corner of
        180°, such as the end of a clamp within a side.
    warp, weft
        Directions of the fibres: vectors of any length, not parallel.
    spacing
        Largest distance in mm between points at which lines meet a side: a number, or
        a pair for distances along x and y.

    Returns
    -------
    Mesh
        A `skfem.MeshQuad` or `skfem.MeshTri`, its edges on the sides of the bounding
        box named ``left``, ``bottom``, ``right`` and ``top``.

    Raises
    ------
    MeshError
        If the outline is not convex or has no area, or the spacing is far too small.
    ValueError
        If a direction is zero or not finite, warp and weft are parallel, or the spacing
        is not positive.

    Examples
    --------
    >>> square = [[0, 1, 1, 0], [0, 0, 1, 1]]
    >>> mesh_along_fibres(square, (1, 1), (-1, 1), 0.5).nelements
    16
    >>> mesh_along_fibres(square, (1, 0), (0, 1), 0.5).nelements
    4
    """
    corners = _convex(np.array(outline, dtype=float))
    fabric = Fabric(warp=np.asarray(warp), weft=np.asarray(weft))
    A = np.hstack(fabric.directions(np.zeros((2, 1, 1))))[:, :, 0]
    A[np.abs(A) < _ROUNDING] = 0.0
    h = np.broadcast_to(np.asarray(spacing, dtype=float), 2)
    if not (np.isfinite(h) & (h > 0)).all():
        raise ValueError(f"the spacing must be positive and finite, got {h} mm")
    net = _Net(np.linalg.solve(A, corners), A / h[:, None])
    s, cells = cells_of_net(net.corners, *net.lines(), net.near)
    kind = MeshQuad if len(cells) == 4 else MeshTri
    return with_edges(kind(_on_sides(A @ s, corners, net.near), cells))


class _Net:
    """Lines s₁ = a and s₂ = b within an outline in coordinates along the fibres.

    The matrix ``in_spacings`` converts a difference of coordinates to multiples of the
    spacings along x and y.
    """

    def __init__(self, corners: ndarray, in_spacings: ndarray) -> None:
        self.corners, self._in_spacings = corners, in_spacings
        self.near = _NEAR * np.ptp(corners, axis=1).max()

    def lines(self) -> tuple[ndarray, ndarray]:
        """Lines (a, b) through the corners, of the closed net, and between them."""
        of_corners = self._distinct(self.corners[0]), self._distinct(self.corners[1])
        closed = self._closed(of_corners)
        if closed is None:
            log.info(
                "mesh along the fibres: some lines of warp and weft do not meet at "
                "the sides; elements there may be thin, and may lock where a side is "
                "fixed"
            )
        a, b = lines = closed or of_corners
        spacings = [self._spacings(axis, lines[axis]) for axis in range(2)]
        if max(n.sum() for n in spacings) > _MOST:
            raise MeshError(
                f"the spacing is too small: the mesh would have more than {_MOST:g} "
                "lines"
            )
        counts = [np.ceil(n - 1e-6).clip(min=1).astype(int) for n in spacings]
        if closed:
            counts = self._matched(lines, counts)
        return _subdivided(a, counts[0]), _subdivided(b, counts[1])

    def _closed(self, lines: tuple[ndarray, ndarray]) -> tuple[ndarray, ndarray] | None:
        """Lines, and lines of the other family through their ends on the outline.

        None if lines would be too close to each other.
        """
        while True:
            a, b = lines
            more = (
                self._distinct(np.append(a, self._ends(1, b))),
                self._distinct(np.append(b, self._ends(0, a))),
            )
            if [len(x) for x in more] == [len(x) for x in lines]:
                return lines
            gaps = [self._spacings(axis, more[axis]).min() for axis in range(2)]
            if min(gaps) < _NARROWEST:
                return None
            lines = more

    def _ends(self, axis: int, lines: ndarray) -> ndarray:
        """Other coordinate of the intersections of lines with the outline.

        Shape (2, n_lines), the lower first.
        """
        start, end = self.corners, np.roll(self.corners, -1, axis=1)
        crosses = np.abs(end[axis] - start[axis]) > self.near
        start, end = start[:, crosses, None], end[:, crosses, None]
        share = (lines - start[axis]) / (end[axis] - start[axis])
        slack = self.near / np.abs(end[axis] - start[axis])
        inside = (share >= -slack) & (share <= 1 + slack)
        other = 1 - axis
        at = start[other] + share.clip(0, 1) * (end[other] - start[other])
        low, high = np.where(inside, at, np.inf), np.where(inside, at, -np.inf)
        return np.stack([low.min(axis=0), high.max(axis=0)])

    def _spacings(self, axis: int, lines: ndarray) -> ndarray:
        """Number of spacings along the sides between adjacent lines, not rounded."""
        other = np.diff(self._ends(axis, lines))
        step = np.stack([np.broadcast_to(np.diff(lines), other.shape), other])
        along = np.einsum("ij,jkn->ikn", self._in_spacings, step[:: 1 - 2 * axis])
        return np.linalg.norm(along, axis=0).max(axis=0)

    def _matched(
        self, lines: tuple[ndarray, ndarray], counts: list[ndarray]
    ) -> list[ndarray]:
        """Subdivisions for which added lines in a closed net meet at the sides.

        Each side joins a gap between lines of one family to one of the other.
        """
        a, b = lines
        low, high = np.sort(self._ends(0, (a[:-1] + a[1:]) / 2), axis=0)
        gaps = np.arange(len(a) - 1)
        pairs = [(gaps, np.searchsorted(b, end) - 1) for end in (low, high)]
        i, j = np.hstack(pairs)
        # Lines that end on a side along the warp all end on one line s₂ = b.
        on_line = np.abs(b[:, None] - np.append(low, high)).min(axis=0) <= self.near
        i, j = i[~on_line], j[~on_line] + len(gaps)
        n = len(a) + len(b) - 2
        graph = coo_matrix((np.ones(len(i)), (i, j)), (n, n))
        _, label = connected_components(graph, directed=False)
        most = np.zeros(n, dtype=int)
        np.maximum.at(most, label, np.concatenate(counts))
        return np.split(most[label], [len(gaps)])

    def _distinct(self, lines: ndarray) -> ndarray:
        """Lines in ascending order, without those that coincide with another."""
        lines = np.sort(lines, axis=None)
        return lines[np.diff(lines, prepend=-np.inf) > self.near]


def _subdivided(lines: ndarray, counts: ndarray) -> ndarray:
    """Lines, with equally spaced lines between them."""
    gaps = zip(lines[:-1], lines[1:], counts, strict=True)
    parts = [np.linspace(low, high, n, endpoint=False) for low, high, n in gaps]
    return np.concatenate([*parts, lines[-1:]])


def _on_sides(p: ndarray, corners: ndarray, near: float) -> ndarray:
    """Positions, projected onto nearby sides of the bounding box."""
    for at in (corners.min(axis=1)[:, None], corners.max(axis=1)[:, None]):
        p = np.where(np.abs(p - at) <= near, at, p)
    return p


def _convex(corners: ndarray) -> ndarray:
    """Corners in anticlockwise order; raises an error if the outline is not convex."""
    if corners.ndim != 2 or corners.shape[0] != 2 or corners.shape[1] < 3:
        raise MeshError(
            f"the outline must have the shape (2, n), n >= 3, not {corners.shape}"
        )
    refuse_positions(corners)
    side = np.roll(corners, -1, axis=1) - corners
    turn = _cross(side, np.roll(side, -1, axis=1))
    area = _cross(corners - corners[:, :1], side).sum()
    if area < 0:
        return _convex(corners[:, ::-1])
    least = _NEAR * np.ptp(corners, axis=1).max()
    if np.linalg.norm(side, axis=0).min() <= least or area <= least**2:
        raise MeshError("the outline has no area, or two coincident corners")
    angles = np.arctan2(turn, np.sum(side * np.roll(side, -1, axis=1), axis=0))
    if (angles < -_NEAR).any() or angles.sum() > 2 * np.pi + 1:
        raise MeshError(
            "the outline is not convex: mesh its convex parts, or use the default "
            "formulation on any mesh"
        )
    return corners


def _cross(u: ndarray, v: ndarray) -> ndarray:
    return u[0] * v[1] - u[1] * v[0]
