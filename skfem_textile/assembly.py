"""Sums of kernels over the points of elements: nodal forces, and blocks of matrices.

Element matrices are symmetric and hold the 2×2 blocks of the pairs of nodes (a, c) with
a ≤ c, in the order of `numpy.triu_indices`: shape (n_pairs, 2, 2, n_elements).
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy import ndarray

from .arithmetic import add_squares, to_nodes
from .kernels import Kernel, Parameters, Square, Stress
from .points import Motion, Points
from .stencils import Stencil, transformed


class Part(NamedTuple):
    """What one kernel sees of some elements.

    ``places`` are its points, or others, where fibres move alike, that stand for them.
    """

    kernel: Kernel
    at: Stencil
    places: Sequence[Points]
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
        for some in at.blocks():
            T, M, _ = stress.on(some)
            f[..., some] += points.forces(motion.v[..., some], T, M, some)
    return f if at.modes is None else transformed(at, "ran,rin->ain", f)


def element_matrices(parts: Sequence[Part]) -> ndarray:
    """Matrices that kernels find of the same elements, in one pass over these.

    Blocks of the pairs of nodes, shape (n_pairs, 2, 2, n).
    """
    at = parts[0].at
    stresses = _stresses(parts)
    squares = [square for part in parts for square in part.squares()]
    n_nodes, n = at.nodes.shape
    K = np.empty((_n_pairs(n_nodes), 2, 2, n))
    for some in at.blocks():
        k = np.zeros((_n_pairs(at.n_motions), 2, 2, some.stop - some.start))
        for points, (motion, stress) in stresses.items():
            points.add_stiffness(k, motion.v[..., some], stress.on(some), some)
        for square in squares:
            add_squares(k, square.gradients(some), square.stiffness[:, some])
        K[..., some] = k if at.modes is None else to_nodes(k, at.modes[..., some])
    return K


def _n_pairs(n: int) -> int:
    return n * (n + 1) // 2


def _stresses(parts: Sequence[Part]) -> dict[Points, tuple[Motion, Stress]]:
    """Motion at each place, and the sum of the stresses of all kernels there."""
    found: dict[Points, tuple[Motion, Stress]] = {}
    for part in parts:
        here = zip(part.places, part.motions, part.stresses(), strict=True)
        for place, motion, stress in here:
            _, others = found.get(place, (motion, Stress()))
            found[place] = motion, others.plus(stress)
    return found


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
