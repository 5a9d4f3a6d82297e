"""Sums of kernels over the points of elements: nodal forces, and blocks of matrices.

Element matrices are symmetric and hold the 2×2 blocks of the pairs of nodes (a, c) with
a ≤ c, in the order of `numpy.triu_indices`: shape (n_pairs, 2, 2, n_elements).
"""

from collections.abc import Sequence
from operator import add
from typing import Any, NamedTuple

import numpy as np
from numpy import ndarray

from .kernels import Kernel, Parameters, Square, Stress
from .stencils import Motion, Points, Stencil, blocks


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


def element_forces(parts: Sequence[Part], shape: tuple[int, ...]) -> ndarray:
    """Sum of the nodal forces that kernels find in the same elements.

    Parameters
    ----------
    parts
        What the kernels see.
    shape
        Numbers of nodes and of elements.
    """
    n_nodes, n = shape
    f = np.zeros((n_nodes, 2, n))
    for points, (motion, stress) in _stresses(parts).items():
        for some in blocks(n):
            (T, M, _), (x, y) = stress.on_fibres(some), _components(motion.v[..., some])
            r = np.stack([T * x - M * y, T * y + M * x], axis=2)
            b = points.b[..., some]
            f[points.nodes, :, some] += np.einsum("fpan,fpin->ain", b, r)
    return f


def element_matrices(parts: Sequence[Part], shape: tuple[int, ...]) -> ndarray:
    """Sum of the matrices that kernels find of the same elements, in one pass.

    Parameters
    ----------
    parts, shape
        As of `element_forces`.
    """
    n_nodes, n = shape
    stresses = _stresses(parts)
    squares = [square for part in parts for square in part.squares()]
    pairs = {points: _pairs(points.nodes, n_nodes) for points in stresses}
    K = np.empty((n_nodes * (n_nodes + 1) // 2, 2, 2, n))
    for some in blocks(n):
        own = np.zeros((*K.shape[:-1], len(range(*some.indices(n)))))
        for points, (motion, stress) in stresses.items():
            m = _curvature(motion.v[..., some], *stress.on_fibres(some))
            _add_products(own, pairs[points], points.b[..., some], m)
        for square in squares:
            _add_squares(own, square.gradients(some), square.stiffness[:, some])
        K[..., some] = own
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
    n_nodes = round(np.sqrt(2 * len(K)))  # of n (n + 1) / 2 pairs
    whole = np.empty((n_nodes, 2, n_nodes, 2, K.shape[-1]))
    for (a, c), block in zip(np.transpose(np.triu_indices(n_nodes)), K, strict=True):
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


def _add_products(K: ndarray, pairs: Any, b: ndarray, m: ndarray) -> None:
    """Add Σ b_a b_c m over fibres and points to the blocks of ``pairs`` of nodes."""
    first, second = np.triu_indices(b.shape[2])
    b, m = b.reshape(-1, *b.shape[2:]), m.reshape(-1, *m.shape[2:])
    sums = np.einsum("spn,scn->pcn", b[:, first] * b[:, second], m)
    K[pairs] += sums[:, [[0, 1], [1, 2]]]


def _add_squares(K: ndarray, g: ndarray, s: ndarray) -> None:
    """Add Σ s g_a g_cᵀ over points to the blocks of all pairs of nodes."""
    first, second = np.triu_indices(g.shape[1])
    scaled = s[:, None, None] * g
    K += np.einsum("pain,pajn->aijn", scaled[:, first], g[:, second])


def _components(v: ndarray) -> tuple[ndarray, ndarray]:
    return v[:, :, 0], v[:, :, 1]


def _pairs(nodes: ndarray, n_nodes: int) -> Any:
    """Where the pairs of some nodes are among those of all; a slice if they are all."""
    number = np.zeros((n_nodes, n_nodes), dtype=int)
    first, second = np.triu_indices(n_nodes)
    number[first, second] = number[second, first] = np.arange(len(first))
    first, second = np.triu_indices(len(nodes))
    pairs = number[nodes[first], nodes[second]]
    return slice(None) if len(pairs) == number.max() + 1 else pairs
