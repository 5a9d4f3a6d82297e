"""Sums over points of bilinear quadrilaterals in three motions, all at once.

The motions of an element are those of warp and weft at its centre, and that of the
hourglass, which moves the fibres at a point by η.  The arrays are those of `QuadPoints`
and `Motion`; element matrices hold the blocks of the pairs of motions (a, c), a ≤ c.
"""

from itertools import combinations_with_replacement
from typing import TypeAlias

import numpy as np
from numpy import ndarray

#: Stresses at points, or none.
Some: TypeAlias = ndarray | None


def motion(A: ndarray, eta: ndarray, u: ndarray) -> tuple[ndarray, ndarray, ndarray]:
    """z/λ² and λ² of the fibres, and the angle between them."""
    z = A + u[:2, None] + eta[:, :, None] * u[2]
    squared = z[:, :, 0] ** 2 + z[:, :, 1] ** 2
    return z / squared[:, :, None], squared, between(z)


def forces(eta: ndarray, v: ndarray, T: Some, M: Some) -> ndarray:
    """Forces on the motions, shape (3, 2, n), of tensions and shear moments."""
    r = pulls(v, T, M)
    hourglass = np.einsum("fpn,fpin->in", eta, r)
    return np.concatenate([r.sum(axis=1), hourglass[None]])


def add_stiffness(
    K: ndarray, eta: ndarray, v: ndarray, T: Some, M: Some, E: Some
) -> None:
    """Add what tensions, their slopes and moments make of the products b_a b_c."""
    m = curvature(v, T, M, E)
    mixed = eta[:, :, None] * m
    for own, beside, fibre, both in zip((0, 3), (2, 4), m, mixed, strict=True):
        add(K[own], fibre.sum(axis=0))
        add(K[beside], both.sum(axis=0))
    add(K[5], np.einsum("fpn,fpcn->cn", eta, mixed))


def turning(eta: ndarray, v: ndarray) -> ndarray:
    """Gradient of the shear angle, shape (P, 3, 2, n)."""
    g = np.empty((v.shape[1], 3, *v.shape[2:]))
    g[:, 0], g[:, 1] = turned(v[0]), -turned(v[1])
    g[:, 2] = eta[0][:, None] * g[:, 0] + eta[1][:, None] * g[:, 1]
    return g


def add_squares(K: ndarray, g: ndarray, s: ndarray) -> None:
    """Add Σ s g_a g_cᵀ over points to the blocks of all pairs of motions."""
    scaled, n_motions = s[:, None, None] * g, g.shape[1]
    for pair, (a, c) in enumerate(combinations_with_replacement(range(n_motions), 2)):
        K[pair] += np.einsum("pin,pjn->ijn", scaled[:, a], g[:, c])


def to_nodes(K: ndarray, modes: ndarray) -> ndarray:
    """Blocks of the pairs of nodes from those of the pairs of motions: Rᵀ K R."""
    n_motions, n_nodes, n = modes.shape
    k = whole(K).reshape(n_motions, 2, n_motions, 2, n)
    half = np.einsum("ran,risjn->asijn", modes, k)
    rows = zip(half, range(n_nodes), strict=True)
    return np.concatenate(
        [np.einsum("sijn,scn->cijn", row, modes[:, a:]) for row, a in rows]
    )


def whole(K: ndarray) -> ndarray:
    """Matrices over the unknowns of an element, shape (2 n_nodes, 2 n_nodes, n)."""
    n_nodes = int(np.sqrt(2 * len(K)))  # of n (n + 1) / 2 pairs
    full = np.empty((n_nodes, 2, n_nodes, 2, K.shape[-1]))
    pairs = combinations_with_replacement(range(n_nodes), 2)
    for (a, c), block in zip(pairs, K, strict=True):
        full[a, :, c], full[c, :, a] = block, block.transpose(1, 0, 2)
    return full.reshape(2 * n_nodes, 2 * n_nodes, -1)


def pulls(v: ndarray, T: Some, M: Some) -> ndarray:
    """T v + M Jv of the warp, T v − M Jv of the weft: shape (2, P, 2, n)."""
    r = np.zeros(v.shape) if T is None else T[:, :, None] * v
    if M is not None:
        both = np.array([M, -M])
        r[:, :, 0] -= both * v[:, :, 1]
        r[:, :, 1] += both * v[:, :, 0]
    return r


def curvature(v: ndarray, T: Some, M: Some, E: Some) -> ndarray:
    """E v vᵀ + T ∂²ε + M ∂²θ per b_a b_c as (xx, xy, yy), shape (2, P, 3, n)."""
    x, y = v[:, :, 0], v[:, :, 1]
    xx, xy, yy = x * x, x * y, y * y
    turned, along = 2 * xy, xx - yy  # −∂²θ and −∂²ε of what is displaced along x
    first = second = np.zeros(1)
    if T is not None:
        first, second = T * along, T * turned
    if M is not None:
        both = np.array([M, -M])
        first, second = first - both * turned, second + both * along
    m = np.empty((*v.shape[:2], 3, v.shape[-1]))
    m[:, :, 0], m[:, :, 1], m[:, :, 2] = -first, -second, first
    if E is not None:
        m[:, :, 0] += E * xx
        m[:, :, 1] += E * xy
        m[:, :, 2] += E * yy
    return m


def between(z: ndarray) -> ndarray:
    """Angle from the first to the second fibre in (−π, π]."""
    (x1, y1), (x2, y2) = z.transpose(0, 2, 1, 3)
    return np.arctan2(x1 * y2 - y1 * x2, x1 * x2 + y1 * y2)


def turned(v: ndarray) -> ndarray:
    """Jv, of components on the last axis but one."""
    return np.stack([-v[..., 1, :], v[..., 0, :]], axis=-2)


def add(K: ndarray, m: ndarray) -> None:
    """Add a symmetric 2×2 matrix, given as (xx, xy, yy)."""
    K[0, 0] += m[0]
    K[0, 1] += m[1]
    K[1, 0] += m[1]
    K[1, 1] += m[2]
