"""Cells of a net of lines within a convex outline, as elements."""

from itertools import pairwise

import numpy as np
from numpy import ndarray

from ...mesh.contact import signed_areas


def cells_of_net(
    outline: ndarray, a: ndarray, b: ndarray, near: float
) -> tuple[ndarray, ndarray]:
    """Cells between the lines x = a and y = b, as far as they lie within an outline.

    Parameters
    ----------
    outline
        Corners of a convex outline, shape (2, n).  Lines of both kinds pass through
        each of them.
    a, b
        The lines in ascending order.
    near
        A point that is nearer to a side than this is on it.

    Returns
    -------
    tuple of ndarray
        Nodes, shape (2, n_nodes), and elements as node numbers: the cells, shape
        (4, n), if the outline cuts none; else triangles, shape (3, n), into which cells
        are cut along one diagonal and the other in turns.
    """
    points = np.stack(np.meshgrid(a, b))
    distances = _distances(outline, points)
    distances[np.abs(distances) <= near] = 0.0
    inside: ndarray = np.all(distances >= 0, axis=0)
    number = np.cumsum(inside).reshape(inside.shape) - 1
    row, column = np.indices((len(b) - 1, len(a) - 1)).reshape(2, -1)
    rows = np.stack([row, row, row + 1, row + 1])
    columns = np.stack([column, column + 1, column + 1, column])
    whole = inside[rows, columns].all(axis=0)
    cut_off = ~whole & (distances > 0)[:, rows, columns].any(axis=1).all(axis=0)

    quads = number[rows, columns][:, whole]
    if not cut_off.any():
        return points[:, inside], quads
    other = (row + column)[whole] % 2 == 1
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
    """The part of a cell within the outline: its corners, shape (2, n).

    Parameters
    ----------
    corners, distances
        Of each corner its position, and its distances from the sides.
    near
        As for `cells_of_net`.
    """
    known = np.hstack([corners, distances])
    for side in range(2, known.shape[1]):
        kept = []
        for one, other in pairwise([*known, known[0]]):
            if one[side] >= 0:
                kept.append(one)
            if one[side] * other[side] < 0:
                # From the same end in both of the cells that share an edge.
                p, q = sorted((one, other), key=lambda corner: (*corner[:2],))
                point = p + p[side] / (p[side] - q[side]) * (q - p)
                point[2:][np.abs(point[2:]) <= near] = 0.0
                point[side] = 0.0
                kept.append(point)
        known = np.array(kept)
    return known[:, :2].T


def _fan(corners: ndarray) -> ndarray:
    """Triangles of a convex cell from the corner that makes the smallest one largest.

    Places in the corners, shape (3, n - 2).
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
    """Nodes of the net, and those that are added by position."""

    def __init__(self, positions: ndarray) -> None:
        self._numbers = {(x, y): n for n, (x, y) in enumerate(positions.T.tolist())}

    @property
    def positions(self) -> ndarray:
        """All of them, shape (2, n_nodes)."""
        return np.array(list(self._numbers)).T

    def numbers(self, positions: ndarray) -> ndarray:
        """Numbers of nodes at positions of the shape (2, n), new ones where needed."""
        known = self._numbers
        return np.array(
            [known.setdefault((x, y), len(known)) for x, y in positions.T.tolist()]
        )
