"""Fibres of a ply as lines, at equal distances in the undeformed ply.

Lines along a family are contours of a position ψ across it, with A·∇ψ = 0 and |∇ψ| = 1
for parallel fibres with the unit direction A.  For other fibres the second cannot hold
everywhere, and ψ minimises ∫ w (A·∇ψ)² + (A⊥·∇ψ − 1)² on linear triangles, with w ≫ 1.
ψ has one value at a point: radial fibres around a closed ring have no lines.
"""

from typing import NamedTuple

import numpy as np
from numpy import ndarray
from scipy.sparse import csr_matrix, identity
from scipy.sparse.linalg import spsolve

from ..mesh.graph import components, edges_of
from ..surfaces.tool_mesh import cut_in_two

# Weight of A·∇ψ = 0.  Chosen: lines deviate by less than their width from the fibres.
_ALONG = 1e3

# Cosine of the angle between the directions in adjacent elements below which no fibre
# continues from one to the other.  Chosen: 20°, more than a curved fibre turns.
_CONTINUES = np.cos(np.radians(20))

# Weight of ψ = A⊥·X relative to the other equations: it fixes the constant in ψ.
_FIXED = 1e-9


class Fibres(NamedTuple):
    """Positions across warp and weft at the corners of triangles.

    ``triangles`` are vertices of a shape, shape (3, n); ``across`` are the positions in
    mm in the undeformed ply, shape (2, 3, n).
    """

    triangles: ndarray
    across: ndarray

    @classmethod
    def of(
        cls, flat: ndarray, cells: tuple[ndarray, ...], warp: ndarray, weft: ndarray
    ) -> "Fibres":
        """Fibres with given directions in the elements of a flat ply.

        Parameters
        ----------
        flat
            Vertices in mm, shape (2, n_vertices).
        cells
            Vertices of the elements, arrays of shape (3, n) and (4, n).
        warp, weft
            Directions in the elements, of any length, shape (2, n_elements).
        """
        triangles = cut_in_two(cells)
        numbers, first = [], 0
        for cell in cells:
            numbers += (len(cell) - 2) * [first + np.arange(cell.shape[1])]
            first += cell.shape[1]
        element = np.concatenate(numbers)
        families = (A[:, element] / np.hypot(*A[:, element]) for A in (warp, weft))
        return cls(triangles, np.array([_across(flat, triangles, A) for A in families]))

    def lines(self, points: ndarray, family: int, spacing: float) -> ndarray:
        """Ends of the lines of a family in the triangles, shape (n, 2, 3).

        Parameters
        ----------
        points
            Positions of the vertices, shape (n_vertices, 3).
        family
            0 for the warp, 1 for the weft.
        spacing
            Distance between the lines in the undeformed ply in mm.
        """
        number = self.across[family] / spacing - 0.5
        first, last = np.ceil(number.min(axis=0)), np.floor(number.max(axis=0))
        counts = np.maximum(last - first + 1, 0).astype(int)
        triangle = np.repeat(np.arange(counts.size), counts)
        begins = np.repeat(np.cumsum(counts) - counts, counts)
        level = first[triangle] + np.arange(triangle.size) - begins
        at, corners = number[:, triangle], self.triangles[:, triangle]
        ends_at, ends = np.roll(at, -1, axis=0), np.roll(corners, -1, axis=0)
        crossed = (at > level) != (ends_at > level)
        two = crossed.any(axis=0)
        sides = np.argsort(~crossed[:, two], axis=0, kind="stable")[:2]
        at, ends_at, corners, ends = (
            np.take_along_axis(x[:, two], sides, axis=0)
            for x in (at, ends_at, corners, ends)
        )
        share = ((level[two] - at) / (ends_at - at))[..., None]
        along = (1 - share) * points[corners] + share * points[ends]
        return np.asarray(along.swapaxes(0, 1))


def _across(flat: ndarray, triangles: ndarray, A: ndarray) -> ndarray:
    """ψ at the corners of triangles with directions A, (2, n), shape (3, n)."""
    n, part = triangles.shape[1], _connected(triangles, A)
    corners = np.stack([np.tile(part, 3), triangles.ravel()])
    _, some, vertex = np.unique(corners, axis=1, return_index=True, return_inverse=True)
    vertex = vertex.reshape(3, n)
    a, b, c = flat[:, triangles].swapaxes(0, 1)
    sides = np.array([c - b, a - c, b - a])
    twice = (b - a)[0] * (c - a)[1] - (b - a)[1] * (c - a)[0]
    root = np.sqrt(np.abs(twice))
    # Gradients of the hat functions times the root of twice the area.
    slopes = np.stack([-sides[:, 1], sides[:, 0]], axis=1) * np.sign(twice)
    slopes = np.divide(slopes, root, out=np.zeros_like(slopes), where=root > 0)
    B = np.array([-A[1], A[0]])

    def derivative(along: ndarray) -> csr_matrix:
        entries = (slopes * along).sum(axis=1)
        at = np.tile(np.arange(n), 3), vertex.ravel()
        return csr_matrix((entries.ravel(), at), (n, some.size))

    along, across = derivative(A), derivative(B)
    K = _ALONG * along.T @ along + across.T @ across
    fixed = _FIXED * K.diagonal().mean()
    of_corners = (flat[:, triangles] * B[:, None]).sum(axis=0).ravel()
    psi = spsolve(
        (K + fixed * identity(some.size)).tocsc(),
        across.T @ root + fixed * of_corners[some],
    )
    return np.asarray(psi[vertex])


def _connected(triangles: ndarray, A: ndarray) -> ndarray:
    """Number of the part of each triangle within which fibres continue, shape (n,)."""
    n = triangles.shape[1]
    _, edge = edges_of((triangles,))
    order = np.argsort(edge, kind="stable")
    same = edge[order[1:]] == edge[order[:-1]]
    one, other = order[:-1][same] % n, order[1:][same] % n
    continues = (A[:, one] * A[:, other]).sum(axis=0) >= _CONTINUES
    return components(n, (one[continues], other[continues]))
