"""The functions of `arithmetic`, compiled by numba.

Loops run over elements innermost, along contiguous rows of few arrays at a time, so
that they become vector instructions.
"""

import numpy as np
from numba import njit
from numpy import ndarray

#: Elements at a time: what these need stays in the processor's nearest cache.
BLOCK = 2048

_compiled = njit(cache=True)


def motion(A: ndarray, eta: ndarray, u: ndarray) -> tuple[ndarray, ndarray, ndarray]:
    """z/λ² and λ² of the fibres, and the angle between them."""
    A = np.broadcast_to(A, (2, eta.shape[1], 2, eta.shape[2]))
    v, squared, cross, dot = _motion(A, eta, u)
    return v, squared, np.arctan2(cross, dot)


@_compiled
def _motion(A, eta, u):
    P, n = eta.shape[1:]
    v, squared = np.empty((2, P, 2, n)), np.empty((2, P, n))
    cross, dot = np.empty((P, n)), np.empty((P, n))
    for p in range(P):
        for e in range(n):
            x = A[0, p, 0, e] + u[0, 0, e] + eta[0, p, e] * u[2, 0, e]
            y = A[0, p, 1, e] + u[0, 1, e] + eta[0, p, e] * u[2, 1, e]
            z = A[1, p, 0, e] + u[1, 0, e] + eta[1, p, e] * u[2, 0, e]
            w = A[1, p, 1, e] + u[1, 1, e] + eta[1, p, e] * u[2, 1, e]
            first, second = x * x + y * y, z * z + w * w
            squared[0, p, e], squared[1, p, e] = first, second
            v[0, p, 0, e], v[0, p, 1, e] = x / first, y / first
            v[1, p, 0, e], v[1, p, 1, e] = z / second, w / second
            cross[p, e], dot[p, e] = x * w - y * z, x * z + y * w
    return v, squared, cross, dot


@_compiled
def forces(eta, v, T, M):
    """Forces on the motions, shape (3, 2, n), of tensions and shear moments."""
    P, n = eta.shape[1:]
    f = np.zeros((3, 2, n))
    for k in range(2):
        sign = 1.0 - 2.0 * k
        for p in range(P):
            for e in range(n):
                x, y, t, m = v[k, p, 0, e], v[k, p, 1, e], T[k, p, e], sign * M[p, e]
                first, second = t * x - m * y, t * y + m * x
                f[k, 0, e] += first
                f[k, 1, e] += second
                f[2, 0, e] += eta[k, p, e] * first
                f[2, 1, e] += eta[k, p, e] * second
    return f


@_compiled
def add_stiffness(K, eta, v, T, M, E):
    """Add what tensions, their slopes and moments make of the products b_a b_c."""
    P, n = eta.shape[1:]
    m = np.empty((3, n))
    for k in range(2):
        for p in range(P):
            _curvature(m, v[k, p], T[k, p], (1.0 - 2.0 * k) * M[p], E[k, p])
            for pair in (3 * k, 2 + 2 * k, 5):
                for i in range(2):
                    for j in range(2):
                        _increase(K[pair, i, j], m[i + j])
                for c in range(3):
                    _scale(m[c], eta[k, p])


@_compiled
def _curvature(m, v, T, M, E):
    xx, xy, yy = m[0], m[1], m[2]
    for e in range(m.shape[1]):
        x, y = v[0, e], v[1, e]
        turned, along = 2 * x * y, x * x - y * y
        first, second = T[e] * along - M[e] * turned, T[e] * turned + M[e] * along
        xx[e] = E[e] * x * x - first
        xy[e] = E[e] * x * y - second
        yy[e] = E[e] * y * y + first


@_compiled
def _increase(x, y):
    for e in range(len(x)):
        x[e] += y[e]


@_compiled
def _scale(x, y):
    for e in range(len(x)):
        x[e] *= y[e]


@_compiled
def turning(eta, v):
    """Gradient of the shear angle, shape (P, 3, 2, n)."""
    P, n = eta.shape[1:]
    g = np.empty((P, 3, 2, n))
    for p in range(P):
        for e in range(n):
            a, b = -v[0, p, 1, e], v[0, p, 0, e]
            c, d = v[1, p, 1, e], -v[1, p, 0, e]
            g[p, 0, 0, e], g[p, 0, 1, e] = a, b
            g[p, 1, 0, e], g[p, 1, 1, e] = c, d
            g[p, 2, 0, e] = eta[0, p, e] * a + eta[1, p, e] * c
            g[p, 2, 1, e] = eta[0, p, e] * b + eta[1, p, e] * d
    return g


@_compiled
def add_squares(K, g, s):
    """Add Σ s g_a g_cᵀ over points to the blocks of all pairs of motions."""
    P, n_motions, _, n = g.shape
    pair = 0
    for a in range(n_motions):
        for c in range(a, n_motions):
            for p in range(P):
                for e in range(n):
                    x, y = s[p, e] * g[p, a, 0, e], s[p, e] * g[p, a, 1, e]
                    K[pair, 0, 0, e] += x * g[p, c, 0, e]
                    K[pair, 0, 1, e] += x * g[p, c, 1, e]
                    K[pair, 1, 0, e] += y * g[p, c, 0, e]
                    K[pair, 1, 1, e] += y * g[p, c, 1, e]
            pair += 1


@_compiled
def to_nodes(K, modes):
    """Blocks of the pairs of nodes from those of the pairs of motions: Rᵀ K R."""
    _, n_nodes, n = modes.shape
    out = np.empty((n_nodes * (n_nodes + 1) // 2, 2, 2, n))
    for i in range(2):
        for j in range(2):
            for e in range(n):
                a, b, c = K[0, i, j, e], K[1, i, j, e], K[2, i, j, e]
                d, f, g = K[1, j, i, e], K[3, i, j, e], K[4, i, j, e]
                h, k, m = K[2, j, i, e], K[4, j, i, e], K[5, i, j, e]
                pair = 0
                for s in range(n_nodes):
                    q, r, t = modes[0, s, e], modes[1, s, e], modes[2, s, e]
                    x = q * a + r * d + t * h
                    y = q * b + r * f + t * k
                    z = q * c + r * g + t * m
                    for u in range(s, n_nodes):
                        out[pair, i, j, e] = (
                            x * modes[0, u, e] + y * modes[1, u, e] + z * modes[2, u, e]
                        )
                        pair += 1
    return out


class Total:
    """Sum of the blocks of element matrices by their slots; see `arithmetic`."""

    def __init__(self, slots: ndarray, size: int) -> None:
        self._slots, self._total = slots, np.zeros(size)

    def put(self, K: ndarray, some: slice) -> None:
        """Add the blocks of some elements."""
        _scatter(self._total, self._slots[..., some], K)

    def sum(self) -> ndarray:
        """The sums, shape (size,)."""
        return self._total


@_compiled
def _scatter(total, slots, K):
    for pair in range(K.shape[0]):
        for i in range(2):
            for j in range(2):
                for e in range(K.shape[3]):
                    total[slots[pair, i, j, e]] += K[pair, i, j, e]
