"""Sums of kernels over elements and their points: forces, and blocks of matrices.

Terms of a ply share work: fibres that deform equally are computed once a displacement,
and the modes of an element are transformed to its nodes once for all terms.

Element matrices are symmetric and hold the d×d blocks of the pairs of nodes (a, c) with
a ≤ c, in the order of `numpy.triu_indices`: shape (n_pairs, d, d, n_elements).
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import combinations_with_replacement
from typing import Any, NamedTuple, Protocol

import numpy as np
from numpy import ndarray

from .element_groups import (
    Deformations,
    ElementGroup,
    Kernel,
    Parameters,
    element_groups,
    transformed,
)
from .integration_points import (
    FibreDeformation,
    IntegrationPoints,
    RankOneStiffness,
    Stress,
    same_deformation,
)


class KernelOnGroup(NamedTuple):
    """A kernel on a group of elements in one state.

    ``points`` are those of the group, or equal ones of another term.
    """

    kernel: Kernel
    group: ElementGroup
    points: Sequence[IntegrationPoints]
    fibres: Deformations
    parameters: Parameters

    def energy(self) -> float:
        """Energy in N·mm."""
        return self.kernel.energy(self.group, self.fibres, self.parameters)

    def stresses(self) -> list[Stress]:
        """Stresses at the points."""
        return self.kernel.stresses(self.group, self.fibres, self.parameters)

    def rank_one_stiffnesses(self) -> list[RankOneStiffness]:
        """Stiffnesses that couple fibres or points."""
        return self.kernel.rank_one_stiffnesses(
            self.group, self.fibres, self.parameters
        )


class KernelTerm(Protocol):
    """A term with a kernel that can compute on its basis."""

    @property
    def kernel(self) -> Any: ...  # noqa: D102

    @property
    def basis(self) -> Any: ...  # noqa: D102


#: Parameters of the forms of terms.
TermParameters = Mapping[Any, Parameters]


@dataclass
class _SharedGroup:
    """Elements with the same nodes and modes, with the points of each term.

    Of points at which fibres deform equally the first stand for all.
    """

    group: ElementGroup
    terms: dict[Any, tuple[ElementGroup, list[IntegrationPoints]]] = field(
        default_factory=dict
    )

    def add(self, term: KernelTerm, group: ElementGroup) -> None:
        """Add a term on the elements."""
        known = [p for _, points in self.terms.values() for p in points]
        points = [
            next((p for p in known if same_deformation(own, p)), own)
            for own in group.points
        ]
        self.terms[term] = group, points


class KernelSum:
    """The sum of terms whose kernels know their bases.

    The deformations at the last displacement are kept: forces and tangent of one state
    share them.

    Parameters
    ----------
    n_unknowns
        Number of unknowns.
    terms
        The terms.
    """

    def __init__(self, n_unknowns: int, terms: Sequence[KernelTerm]) -> None:
        self._n_unknowns = n_unknowns
        self._last = np.empty(0), dict[IntegrationPoints, FibreDeformation]()
        self._groups: list[_SharedGroup] = []
        for term in terms:
            for group in element_groups(term.basis, term.kernel.fabric):
                same = (s for s in self._groups if s.group.same_nodes_and_modes(group))
                shared = next(same, None)
                if shared is None:
                    self._groups.append(shared := _SharedGroup(group))
                shared.add(term, group)

    @property
    def elements(self) -> list[ndarray]:
        """Nodes of the elements of each group, shape (n_nodes_of_element, n)."""
        return [shared.group.nodes for shared in self._groups]

    def energy(self, u: ndarray, given: TermParameters) -> float:
        """Energy of the given terms in N·mm."""
        groups = (self._kernels(shared, u, given) for shared in self._groups)
        return sum(kernel.energy() for kernels in groups for kernel in kernels)

    def forces(self, u: ndarray, given: TermParameters) -> ndarray:
        """Nodal forces of the given terms in N, shape (n_unknowns,)."""
        f = np.zeros(self._n_unknowns)
        for shared in self._groups:
            if kernels := self._kernels(shared, u, given):
                local, nodes = element_forces(kernels), shared.group.nodes.ravel()
                d = shared.group.dimension
                for i in range(d):
                    f[i::d] += np.bincount(nodes, local[:, i].ravel(), len(f) // d)
        return f

    def matrices(self, u: ndarray, given: TermParameters) -> Iterator[ndarray]:
        """Blocks of the elements of each group, sums over terms, for `Pattern.sum`."""
        for shared in self._groups:
            yield element_matrices(self._kernels(shared, u, given))

    def predicted_tension(
        self, u: ndarray, du: ndarray, term: KernelTerm, w: Parameters
    ) -> ndarray:
        """Tensions of a term after an increment of the displacement, to first order.

        At the points of the term's basis, shape (2, n_elements, n_points).
        """
        T = np.zeros((2, *term.basis.dx.shape))
        for shared in self._groups:
            if term in shared.terms:
                group, points = shared.terms[term]
                before = self._deformations(group, points, u)
                after = self._deformations(group, points, u + du)
                tension = term.kernel.predicted_tension(group, before, after, w)
                group.put_values(T, tension)
        return T

    def _kernels(
        self, shared: _SharedGroup, u: ndarray, given: TermParameters
    ) -> list[KernelOnGroup]:
        """The kernels of the given terms on a group of elements."""
        return [
            KernelOnGroup(
                term.kernel,
                group,
                points,
                self._deformations(group, points, u),
                given[term],
            )
            for term, (group, points) in shared.terms.items()
            if term in given
        ]

    def _deformations(
        self, group: ElementGroup, points: list[IntegrationPoints], u: ndarray
    ) -> Deformations:
        """Deformations at points; threads may want those of different states."""
        last = self._last
        if not np.array_equal(u, last[0]):
            last = self._last = u.copy(), {}
        if new := [p for p in points if p not in last[1]]:
            last[1].update(zip(new, group.deformations(u, new), strict=True))
        return [last[1][p] for p in points]


def element_forces(kernels: Sequence[KernelOnGroup]) -> ndarray:
    """Sum of the nodal forces of kernels on a group, shape (n_nodes, d, n)."""
    group = kernels[0].group
    f = np.zeros((group.n_modes, group.dimension, group.nodes.shape[1]))
    for points, (fibres, stress) in _stresses(kernels).items():
        for block in group.blocks():
            T, M, _ = stress.of(block)
            f[..., block] += points.forces(fibres.forces(T, M, block), block)
    return f if group.modes is None else transformed(group, "ran,rin->ain", f)


def element_matrices(kernels: Sequence[KernelOnGroup]) -> ndarray:
    """Sum of the element matrices of kernels on a group.

    Parameters
    ----------
    kernels
        The kernels.

    Returns
    -------
    ndarray
        Blocks of the pairs of nodes, shape (n_pairs, d, d, n).
    """
    group, d = kernels[0].group, kernels[0].group.dimension
    stresses = _stresses(kernels)
    rank_one = [s for kernel in kernels for s in kernel.rank_one_stiffnesses()]
    n_nodes, n = group.nodes.shape
    K = np.empty((_n_pairs(n_nodes), d, d, n))
    for block in group.blocks():
        k = np.zeros((_n_pairs(group.n_modes), d, d, block.stop - block.start))
        for points, (fibres, stress) in stresses.items():
            points.add_stiffness(k, *fibres.stiffness(stress.of(block), block), block)
        for strain in rank_one:
            add_rank_one(k, strain.gradients(block), strain.stiffness[:, block])
        K[..., block] = (
            k if group.modes is None else nodal_blocks(k, group.modes[..., block])
        )
    return K


def _n_pairs(n: int) -> int:
    return n * (n + 1) // 2


def _stresses(
    kernels: Sequence[KernelOnGroup],
) -> dict[IntegrationPoints, tuple[FibreDeformation, Stress]]:
    """Deformation and the sum of the stresses of all kernels at each set of points."""
    sums: dict[IntegrationPoints, tuple[FibreDeformation, Stress]] = {}
    for kernel in kernels:
        sets = zip(kernel.points, kernel.fibres, kernel.stresses(), strict=True)
        for points, fibres, stress in sets:
            _, others = sums.get(points, (fibres, Stress()))
            sums[points] = fibres, others.plus(stress)
    return sums


def add_rank_one(K: ndarray, g: ndarray, s: ndarray) -> None:
    """Add Σ s g_a g_cᵀ over points to the blocks of all pairs of modes."""
    scaled, n_modes = s[:, None, None] * g, g.shape[1]
    for pair, (a, c) in enumerate(combinations_with_replacement(range(n_modes), 2)):
        K[pair] += np.einsum("pin,pjn->ijn", scaled[:, a], g[:, c])


def nodal_blocks(K: ndarray, modes: ndarray) -> ndarray:
    """Blocks of the pairs of nodes from those of the pairs of modes: Rᵀ K R."""
    (n_modes, _, n), d = modes.shape, K.shape[1]
    k = full_matrices(K).reshape(n_modes, d, n_modes, d, n)
    half = np.einsum("ran,risjn->asijn", modes, k)
    rows = [
        np.einsum("sijn,scn->cijn", row, modes[:, a:]) for a, row in enumerate(half)
    ]
    return np.concatenate(rows)


def full_matrices(K: ndarray) -> ndarray:
    """Matrices over the unknowns of an element, shape (d n_nodes, d n_nodes, n)."""
    n_nodes, d = int(np.sqrt(2 * len(K))), K.shape[1]  # of n (n + 1) / 2 pairs
    full = np.empty((n_nodes, d, n_nodes, d, K.shape[-1]))
    pairs = combinations_with_replacement(range(n_nodes), 2)
    for (a, c), block in zip(pairs, K, strict=True):
        full[a, :, c], full[c, :, a] = block, block.transpose(1, 0, 2)
    return full.reshape(d * n_nodes, d * n_nodes, -1)


def positive_part(K: ndarray | None) -> ndarray | None:
    """Element matrices with their negative eigenvalues set to zero.

    Parameters
    ----------
    K
        Blocks of the pairs of nodes, shape (n_pairs, d, d, n).

    Returns
    -------
    ndarray
        Blocks of the nearest positive semi-definite matrices (Higham 1988).
    """
    if K is None or not np.isfinite(K).all():
        return K
    full = full_matrices(K).transpose(2, 0, 1).copy()
    eigenvalues, vectors = np.linalg.eigh(full)
    indefinite = eigenvalues[:, 0] < 0
    values, V = np.minimum(eigenvalues[indefinite], 0.0), vectors[indefinite]
    full[indefinite] -= (V * values[:, None]) @ V.swapaxes(1, 2)
    n_nodes, d = full.shape[1] // K.shape[1], K.shape[1]
    first, second = np.triu_indices(n_nodes)
    blocks = full.reshape(-1, n_nodes, d, n_nodes, d)
    return blocks[:, first, :, second].transpose(0, 2, 3, 1)


def node_pair_blocks(K: ndarray, nodes: ndarray, d: int) -> ndarray:
    """Blocks of the pairs of nodes of whole symmetric matrices.

    Parameters
    ----------
    K
        Shape (d n_nodes, d n_nodes, n).
    nodes
        Nodes of the elements, shape (n_nodes, n); one may be there several times.
    d
        Components of the displacement.
    """
    n_nodes = len(nodes)
    first, second = np.triu_indices(n_nodes)
    K = K.reshape(n_nodes, d, n_nodes, d, -1)[first, :, second]
    same = (nodes[first] == nodes[second]) & (first != second)[:, None]
    return K + np.where(same[:, None, None], K.swapaxes(1, 2), 0.0)
