"""Smooth surface through the contact points of a ply, and its points below others.

The normal of a node is the mean over its elements, weighted with their areas.  The
surface is bilinear in each element, moved along the normals by

    c = −½ Σ N_b (n·n_b) n_b·(y − x_b)

at its point y with the shape functions N_b, the nodes x_b and their normals n_b: as
Phong tessellation with the factor ½ (Boubekeur & Alexa 2008), for which edges are
parabolas that end at right angles to the normals.  The surface is continuous, and
touches a smooth one, through whose points it passes, in its nodes.
"""

from typing import Any, NamedTuple

import numpy as np
from numpy import ndarray
from scipy.sparse import csr_matrix
from scipy.spatial import KDTree

from ..mesh.recovery import nodes_and_normal

# Largest number of iterations by which a foot is found, a limit of work, and change of
# its reference coordinates that is round-off.
_MOST, _ROUND_OFF = 30, 1e-10

# Reference coordinates outside an element from which on the foot is in the one beside
# it, before the iteration converges and after it.
_FAR_OUT, _OUT = 0.3, 1e-12

# Reference coordinates beyond an element up to which it is extrapolated.
_BEYOND = 1.0


class Feet(NamedTuple):
    """Points of a surface below or above other points, along its normals.

    Attributes
    ----------
    foot, bulge
        Positions in the bilinear elements, shape (3, n), and heights of the surface
        over them along the normals, shape (n,), in mm.
    normal
        Unit normals, shape (3, n).
    nodes, weights
        Nodes of the elements and their weights, shape (4, n).
    off
        Distance from the element in reference coordinates, 0 inside, shape (n,).
    turn
        Symmetric gradients of the normals along the surface, shape (3, 3, n).
    """

    foot: ndarray
    bulge: ndarray
    normal: ndarray
    nodes: ndarray
    weights: ndarray
    off: ndarray
    turn: ndarray

    def heights(self, s: ndarray) -> ndarray:
        """Signed distances of the points along the normals in mm, shape (n,)."""
        return ((s - self.foot) * self.normal).sum(axis=0) - self.bulge

    def matrix(self, rows: ndarray, n_nodes: int, least: float = 0.0) -> csr_matrix:
        """Matrix from nodal values to values at the feet, in some rows.

        Shape (n_nodes, n_nodes).  Weights up to ``least`` are omitted.
        """
        weights = np.where(np.abs(self.weights) > least, self.weights, 0.0)
        weights = weights / weights.sum(axis=0)
        shape = n_nodes, n_nodes
        at = np.tile(rows, len(self.nodes)), self.nodes.ravel()
        matrix = csr_matrix((weights.ravel(), at), shape)
        matrix.eliminate_zeros()
        return matrix


class PlySurface:
    """Surface through the contact points of the nodes of a ply.

    Parameters
    ----------
    mesh
        Mesh of all plies.
    elements
        Numbers of the elements of the ply.
    mirrors
        Numbers of the edges on each plane of symmetry, of all plies.
    """

    def __init__(self, mesh: Any, elements: ndarray, mirrors: Any = ()) -> None:
        self._t = mesh.t[:, elements]
        number = np.full(mesh.nelements + 1, -1)
        number[elements] = np.arange(len(elements))
        one, other = mesh.f2t[:, mesh.t2f[:, elements]]
        own = one == elements
        self._beside = number[np.where(own, other, one)]
        self.nodes = np.unique(self._t)
        self._mirrors = [nodes_and_normal(mesh, edges) for edges in mirrors]
        corners = np.pad(mesh.p, ((0, 1), (0, 0)))
        self._up = np.sign(self._areas(corners)[2])

    def _areas(self, x: ndarray) -> ndarray:
        """Normals of the elements times twice their areas, shape (3, n_elements)."""
        a, b, c, d = x[:, self._t].swapaxes(0, 1)
        return np.cross(c - a, d - b, axis=0)

    def normals(self, x: ndarray) -> ndarray:
        """Unit normals of the nodes, shape (3, n_nodes), for their positions.

        Upwards at rest; zero at nodes of other plies.
        """
        areas, n = self._up * self._areas(x), np.zeros(x.shape)
        corners = self._t.ravel()
        for component, area in zip(n, areas, strict=True):
            component += np.bincount(corners, np.tile(area, 4), x.shape[1])
        for nodes, N in self._mirrors:
            n[:2, nodes] -= np.outer(N, N @ n[:2, nodes])
        return n / np.maximum(np.linalg.norm(n, axis=0), 1e-300)

    def feet(self, x: ndarray, s: ndarray) -> Feet:
        """Points of the surface below or above points s, shape (3, n).

        Parameters
        ----------
        x
            Positions of the contact points of all nodes, shape (3, n_nodes).
        s
            The points.
        """
        normals = self.normals(x)
        centres = x[:, self._t].mean(axis=1)
        _, element = KDTree(centres.T).query(s.T)
        xi = self._followed(x, normals, s, element)
        nodes = self._t[:, element]
        y, n = x[:, nodes], normals[:, nodes]
        N, dN = _shape_functions(xi)
        mean = (N * n).sum(axis=1)
        normal = mean / np.linalg.norm(mean, axis=0)
        foot = (N * y).sum(axis=1)
        below = (n * (foot[:, None] - y)).sum(axis=0)
        bulge = -0.5 * (N * (normal[:, None] * n).sum(axis=0) * below).sum(axis=0)
        beyond = np.maximum(np.maximum(-xi, xi - 1.0), 0.0).max(axis=0)
        return Feet(foot, bulge, normal, nodes, N, beyond, _turn(dN, y, n, normal))

    def _followed(
        self, x: ndarray, normals: ndarray, s: ndarray, element: ndarray
    ) -> ndarray:
        """Reference coordinates of the feet, (2, n), whose elements are replaced.

        Newton's method for s = Σ N (x + h n); a point that leaves an element continues
        in the element beside it.
        """
        xi, h = np.full((2, s.shape[1]), 0.5), np.zeros(s.shape[1])
        left = np.arange(s.shape[1])
        for _ in range(_MOST):
            nodes = self._t[:, element[left]]
            y = x[:, nodes] + h[left] * normals[:, nodes]
            N, dN = _shape_functions(xi[:, left])
            off = s[:, left] - (N * y).sum(axis=1)
            a, b = (dN[:, None] * y).sum(axis=2)
            c = (N * normals[:, nodes]).sum(axis=1)
            step = _solved(a, b, c, off)
            at = xi[:, left] + step[:2]
            h[left] += step[2]
            moved = np.abs(step[:2]).max(axis=0) > _ROUND_OFF
            side = np.array([-at[1], at[0] - 1, at[1] - 1, -at[0]])
            worst = side.argmax(axis=0)
            beside = self._beside[worst, element[left]]
            limit = np.where(moved, _FAR_OUT, _OUT)
            crosses = (side.max(axis=0) > limit) & (beside >= 0)
            element[left[crosses]] = beside[crosses]
            at = np.where(crosses, 0.5, np.clip(at, -_BEYOND, 1 + _BEYOND))
            moved &= (at != xi[:, left]).any(axis=0)
            xi[:, left] = at
            left = left[moved | crosses]
            if not left.size:
                break
        return xi


def _shape_functions(xi: ndarray) -> tuple[ndarray, ndarray]:
    """Bilinear functions and their derivatives, shapes (4, n) and (2, 4, n)."""
    r, q = xi
    N = np.array([(1 - r) * (1 - q), r * (1 - q), r * q, (1 - r) * q])
    return N, np.array([[q - 1, 1 - q, q, -q], [r - 1, -r, r, 1 - r]])


def _solved(a: ndarray, b: ndarray, c: ndarray, f: ndarray) -> ndarray:
    """Solution of [a b c] z = f at n points, each (3, n)."""
    bc, ca = np.cross(b, c, axis=0), np.cross(c, a, axis=0)
    ab = np.cross(a, b, axis=0)
    every = np.array([bc, ca, ab])
    volume = (a * bc).sum(axis=0)
    return (every * f).sum(axis=1) / np.where(volume == 0, 1.0, volume)


def _turn(dN: ndarray, y: ndarray, n: ndarray, normal: ndarray) -> ndarray:
    """Symmetric part of the gradient of the normals along a surface, (3, 3, n)."""
    a, b = (dN[:, None] * y).sum(axis=2)
    of_a, of_b = (dN[:, None] * n).sum(axis=2)
    ab = np.cross(a, b, axis=0)
    square = (ab * ab).sum(axis=0)
    dual_a, dual_b = np.cross(b, ab, axis=0) / square, np.cross(ab, a, axis=0) / square
    K = of_a[:, None] * dual_a + of_b[:, None] * dual_b
    along = np.eye(3)[..., None] - normal[:, None] * normal
    K = np.einsum("ijn,jkn,kln->iln", along, K, along)
    return 0.5 * (K + K.swapaxes(0, 1))
