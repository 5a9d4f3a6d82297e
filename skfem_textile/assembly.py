"""Sums of kernels over the points of elements: nodal forces, and blocks of matrices.

Element matrices are symmetric and hold the 2×2 blocks of the pairs of nodes (a, c) with
a ≤ c, in the order of `numpy.triu_indices`: shape (n_pairs, 2, 2, n_elements).
"""

from collections.abc import Sequence
from itertools import combinations_with_replacement
from operator import add
from typing import Any, NamedTuple

import numpy as np
from numpy import ndarray

from .kernels import Kernel, Parameters, Square, Stress
from .points import Motion, Points
from .stencils import Stencil, blocks, transformed


class Part(NamedTuple):
    """What one kernel sees of some elements."""

    kernel: Kernel
    at: Stencil
    motions: list[Motion]
    parameters: Parameters

    def energy(self) -> float:
        """Energy in N·mm."""
        return self.kernel.energy(self.at, self.motions, self.parameters)

    def stresses(self) -> list[Stress]:
        """Stresses at the points."""
        return self.kernel.stresses(self.at, self.motions, self.parameters)

    def squares(self) -> list[Square]:
        """What couples several fibres or points."""
        return self.kernel.squares(self.at, self.motions, self.parameters)


def element_forces(parts: Sequence[Part]) -> ndarray:
    """Nodal forces that kernels find in the same elements, shape (n_nodes, 2, n)."""
    at = parts[0].at
    f = np.zeros((at.n_motions, 2, at.nodes.shape[1]))
    for points, (motion, stress) in _stresses(parts).items():
        for some in blocks(f.shape[-1]):
            (T, M, _), (x, y) = stress.on_fibres(some), _components(motion.v[..., some])
            r = np.stack([T * x - M * y, T * y + M * x], axis=2)
            f[..., some] += points.forces(r, some)
    return f if at.modes is None else transformed("ran,rin->ain", at.modes, f)


def element_matrices(parts: Sequence[Part]) -> ndarray:
    """Matrices that kernels find of the same elements, in one pass over these.

    Blocks of the pairs of nodes, shape (n_pairs, 2, 2, n).
    """
    at = parts[0].at
    stresses = _stresses(parts)
    squares = [square for part in parts for square in part.squares()]
    n_nodes, n = at.nodes.shape
    K = np.empty((n_nodes * (n_nodes + 1) // 2, 2, 2, n))
    n_pairs = at.n_motions * (at.n_motions + 1) // 2
    for some in blocks(n):
        own = np.zeros((n_pairs, 2, 2, some.stop - some.start))
        for points, (motion, stress) in stresses.items():
            m = _curvature(motion.v[..., some], *stress.on_fibres(some))
            points.add_products(own, m, some)
        for square in squares:
            _add_squares(own, square.gradients(some), square.stiffness[:, some])
        if at.modes is None:
            K[..., some] = own
        else:
            _to_nodes(own, at.modes[..., some], K[..., some])
    return K


def _stresses(parts: Sequence[Part]) -> dict[Points, tuple[Motion, Stress]]:
    """Motion at the points, and the sum of the stresses of all kernels there."""
    found: dict[Points, tuple[Motion, Stress]] = {}
    for part in parts:
        here = zip(part.at.points, part.motions, part.stresses(), strict=True)
        for points, motion, stress in here:
            _, others = found.get(points, (motion, Stress()))
            found[points] = motion, Stress(*map(add, others, stress))
    return found


def whole_matrices(K: ndarray) -> ndarray:
    """Matrices over the unknowns of an element, shape (2 n_nodes, 2 n_nodes, n)."""
    n_nodes = int(np.sqrt(2 * len(K)))  # of n (n + 1) / 2 pairs
    whole = np.empty((n_nodes, 2, n_nodes, 2, K.shape[-1]))
    pairs = combinations_with_replacement(range(n_nodes), 2)
    for (a, c), block in zip(pairs, K, strict=True):
        whole[a, :, c], whole[c, :, a] = block, block.transpose(1, 0, 2)
    return whole.reshape(2 * n_nodes, 2 * n_nodes, -1)


def pairs_of(K: ndarray, nodes: ndarray) -> ndarray:
    """Blocks of the pairs of nodes of whole symmetric matrices.

    Parameters
    ----------
    K
        Shape (2 n_nodes, 2 n_nodes, n).
    nodes
        Nodes of the elements, shape (n_nodes, n); one may be there several times.
    """
    n_nodes = len(nodes)
    first, second = np.triu_indices(n_nodes)
    K = K.reshape(n_nodes, 2, n_nodes, 2, -1)[first, :, second]
    same = (nodes[first] == nodes[second]) & (first != second)[:, None]
    return K + np.where(same[:, None, None], K.swapaxes(1, 2), 0.0)


def _curvature(v: ndarray, T: Any, M: Any, E: Any) -> ndarray:
    """E v vᵀ + T ∂²ε + M ∂²θ per b_a b_c as (xx, xy, yy), shape (2, P, 3, n)."""
    x, y = _components(v)
    xx, xy, yy = x * x, x * y, y * y
    turned, along = 2 * xy, xx - yy  # −∂²θ and −∂²ε of what is displaced along x
    m = np.empty((*v.shape[:2], 3, v.shape[-1]))
    first, second = T * along - M * turned, T * turned + M * along
    m[:, :, 0] = E * xx - first
    m[:, :, 1] = E * xy - second
    m[:, :, 2] = E * yy + first
    return m


def _add_squares(K: ndarray, g: ndarray, s: ndarray) -> None:
    """Add Σ s g_a g_cᵀ over points to the blocks of all pairs of motions."""
    scaled, n_motions = s[:, None, None] * g, g.shape[1]
    for pair, (a, c) in enumerate(combinations_with_replacement(range(n_motions), 2)):
        K[pair] += np.einsum("pin,pjn->ijn", scaled[:, a], g[:, c])


def _to_nodes(K: ndarray, modes: ndarray, out: ndarray) -> None:
    """Blocks of the pairs of nodes from those of the pairs of motions: Rᵀ K R."""
    n_motions, n_nodes, n = modes.shape
    k = whole_matrices(K).reshape(n_motions, 2, n_motions, 2, n)
    half, end = np.einsum("ran,risjn->asijn", modes, k), 0
    for a in range(n_nodes):
        start, end = end, end + n_nodes - a
        own = out[start:end]
        np.einsum("sijn,scn->cijn", half[a], modes[:, a:], out=own)


def _components(v: ndarray) -> tuple[ndarray, ndarray]:
    return v[:, :, 0], v[:, :, 1]
