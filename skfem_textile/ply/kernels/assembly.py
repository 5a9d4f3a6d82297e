"""Sums of kernels over elements and their points: forces, and blocks of matrices.

What the terms of a ply share is found once: where their fibres move alike, how they
move at a displacement, and the way from the motions of an element to its nodes.

Element matrices are symmetric and hold the 2×2 blocks of the pairs of nodes (a, c) with
a ≤ c, in the order of `numpy.triu_indices`: shape (n_pairs, 2, 2, n_elements).
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import combinations_with_replacement
from typing import Any, NamedTuple, Protocol

import numpy as np
from numpy import ndarray

from .kernel import Kernel, Parameters, Square, Stress
from .points import Motion, Points, alike
from .stencils import Stencil, stencils, transformed


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


class Kerneled(Protocol):
    """A term whose kernel knows its basis."""

    @property
    def kernel(self) -> Any: ...  # noqa: D102

    @property
    def basis(self) -> Any: ...  # noqa: D102


#: Terms and the parameters of their forms.
Given = Mapping[Any, Parameters]


@dataclass
class _Kind:
    """Elements with the same motions, and what each term sees of them.

    Of points where fibres move alike the first stand for all.
    """

    first: Stencil
    seen: dict[Any, tuple[Stencil, list[Points]]] = field(default_factory=dict)

    def add(self, term: Kerneled, at: Stencil) -> None:
        """Let a term see the elements."""
        known = [place for _, places in self.seen.values() for place in places]
        places = [next((q for q in known if alike(p, q)), p) for p in at.points]
        self.seen[term] = at, places


class KernelSum:
    """The sum of terms whose kernels know their bases.

    What the fibres do at a displacement is kept until it is asked for another: forces
    and tangent of one state share it.

    Parameters
    ----------
    n_unknowns
        Number of unknowns.
    terms
        The terms.
    """

    def __init__(self, n_unknowns: int, terms: Sequence[Kerneled]) -> None:
        self._n_unknowns = n_unknowns
        self._kept = np.empty(0), dict[Points, Motion]()
        self._kinds: list[_Kind] = []
        for term in terms:
            for at in stencils(term.basis, term.kernel.fabric):
                kind = next((k for k in self._kinds if k.first.alike(at)), None)
                if kind is None:
                    self._kinds.append(kind := _Kind(at))
                kind.add(term, at)

    @property
    def elements(self) -> list[ndarray]:
        """Nodes of the elements of each kind, shape (n_nodes_of_element, n)."""
        return [kind.first.nodes for kind in self._kinds]

    def energy(self, u: ndarray, given: Given) -> float:
        """Energy of the given terms in N·mm."""
        kinds = (self._parts(kind, u, given) for kind in self._kinds)
        return sum(part.energy() for parts in kinds for part in parts)

    def forces(self, u: ndarray, given: Given) -> ndarray:
        """Nodal forces of the given terms in N, shape (n_unknowns,)."""
        f = np.zeros(self._n_unknowns)
        for kind in self._kinds:
            if parts := self._parts(kind, u, given):
                own, nodes = element_forces(parts), kind.first.nodes.ravel()
                for i in range(2):
                    f[i::2] += np.bincount(nodes, own[:, i].ravel(), len(f) // 2)
        return f

    def matrices(self, u: ndarray, given: Given) -> Iterator[ndarray]:
        """Blocks of the elements of each kind, of all terms, as `Pattern.sum` takes."""
        for kind in self._kinds:
            yield element_matrices(self._parts(kind, u, given))

    def predicted_tension(self, u: ndarray, du: ndarray, term: Kerneled) -> ndarray:
        """Tensions of a term after an increment of the displacement, to first order.

        At the points of the term's basis, shape (2, n_elements, n_points).
        """
        T = np.zeros((2, *term.basis.dx.shape))
        for kind in self._kinds:
            if term in kind.seen:
                at, places = kind.seen[term]
                before, after = (
                    self._seen(at, places, u),
                    self._seen(at, places, u + du),
                )
                at.put(T, term.kernel.predicted_tension(at, before, after))
        return T

    def _parts(self, kind: _Kind, u: ndarray, given: Given) -> list[Part]:
        """What the kernels of the given terms see of the elements."""
        return [
            Part(term.kernel, at, places, self._seen(at, places, u), given[term])
            for term, (at, places) in kind.seen.items()
            if term in given
        ]

    def _seen(self, at: Stencil, places: list[Points], u: ndarray) -> list[Motion]:
        """The motions at the places; threads may ask for those of different states."""
        kept = self._kept
        if not np.array_equal(u, kept[0]):
            kept = self._kept = u.copy(), {}
        if new := [place for place in places if place not in kept[1]]:
            kept[1].update(zip(new, at.motions(u, new), strict=True))
        return [kept[1][place] for place in places]


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


def pairs_of(K: ndarray, nodes: ndarray, d: int) -> ndarray:
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
