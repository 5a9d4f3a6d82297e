"""Sums of the terms of a ply, by their kernels or else by their forms."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from itertools import chain
from typing import Any

import numpy as np
from numpy import ndarray
from skfem import asm

from .assembly import Part, element_forces, element_matrices, pairs_of
from .pattern import Pattern
from .points import Motion, Points, alike
from .stencils import Stencil, stencils
from .terms import LocalTerm, Term

#: Parameters of the forms of some terms beyond what these remember.
Given = Mapping[Term, dict[str, ndarray]]

_NOTHING: Given = {}


@dataclass
class _Kind:
    """Elements with the same motions, and what each term sees of them.

    Of points where fibres move alike the first stand for all.
    """

    first: Stencil
    seen: dict[Term, tuple[Stencil, list[Points]]] = field(default_factory=dict)

    def add(self, term: Term, at: Stencil) -> None:
        """Let a term see the elements."""
        known = [place for _, places in self.seen.values() for place in places]
        places = [next((q for q in known if alike(p, q)), p) for p in at.points]
        self.seen[term] = at, places


class Sum:
    """The terms of a ply as functions of the displacement.

    What the fibres do at a displacement, and where local terms are at work, is kept
    until they are asked for another: forces and tangent of one state share it.

    Parameters
    ----------
    n_nodes
        Number of nodes.
    terms
        The terms.
    """

    def __init__(self, n_nodes: int, terms: Sequence[Term]) -> None:
        self._n_nodes, self._terms = n_nodes, terms
        self._kept = np.empty(0), dict[Any, Any]()

    def energy(self, u: ndarray, term: Term) -> float:
        """Energy of a term in N·mm, what it remembers aside."""
        if term.kernel is None:
            basis = self._acting(term, u)
            if basis is None:
                return 0.0
            return float(asm(term.forms.energy, basis, u=u, **_parameters(term)))
        return sum(
            part.energy()
            for kind in self._kinds
            for part in self._parts(kind, u, [term])
        )

    def residual(self, u: ndarray, terms: Sequence[Term]) -> ndarray:
        """Nodal forces of some terms in N."""
        f = np.zeros((2, self._n_nodes))
        for kind in self._kinds:
            if parts := self._parts(kind, u, terms):
                own, nodes = element_forces(parts), kind.first.nodes.ravel()
                for i in range(2):
                    f[i] += np.bincount(nodes, own[:, i].ravel(), self._n_nodes)
        plain = ((t, self._acting(t, u)) for t in terms if t.kernel is None)
        others = (
            asm(t.forms.residual, basis, u=u, **_parameters(t))
            for t, basis in plain
            if basis is not None
        )
        return sum(others, f.T.ravel())

    def stiffness(self, u: ndarray, terms: Sequence[Term], given: Given) -> ndarray:
        """Blocks of the tangent in the order of ``pattern``, in N/mm.

        Of the terms only local ones may be left out.
        """
        fused = (
            element_matrices(self._parts(kind, u, self._terms, given))
            for kind in self._kinds
        )
        plain = (_matrices(t, t.basis, u, _parameters(t, given)) for t in self._plain)
        blocks = self.pattern.sum(chain(fused, plain))
        for term in terms:
            if not isinstance(term, LocalTerm):
                continue
            basis = self._acting(term, u)
            if basis is not None:
                few = _matrices(term, basis, u, _parameters(term))
                self.pattern.add(blocks, _nodes(basis), few)
        return blocks

    @cached_property
    def pattern(self) -> Pattern:
        """Where the tangent has entries."""
        fused = [kind.first.nodes for kind in self._kinds]
        return Pattern(self._n_nodes, fused + [_nodes(t.basis) for t in self._plain])

    @property
    def _plain(self) -> list[Term]:
        """Terms without a kernel that are at work everywhere."""
        plain = (term for term in self._terms if term.kernel is None)
        return [term for term in plain if not isinstance(term, LocalTerm)]

    @cached_property
    def _kinds(self) -> list[_Kind]:
        """Elements by their nodes, for the terms with a kernel."""
        kinds: list[_Kind] = []
        for term in self._terms:
            if term.kernel is None:
                continue
            for at in stencils(term.basis, term.kernel.fabric):
                kind = next((k for k in kinds if k.first.alike(at)), None)
                if kind is None:
                    kinds.append(kind := _Kind(at))
                kind.add(term, at)
        return kinds

    def _parts(
        self, kind: _Kind, u: ndarray, terms: Sequence[Term], given: Given = _NOTHING
    ) -> list[Part]:
        """What the kernels of some terms see of the elements."""
        return [
            Part(
                term.kernel,
                at,
                places,
                self._seen(at, places, u),
                _parameters(term, given),
            )
            for term, (at, places) in kind.seen.items()
            if term in terms and term.kernel
        ]

    def _seen(self, at: Stencil, places: list[Points], u: ndarray) -> list[Motion]:
        """The motions at the places; threads may ask for those of different states."""
        kept = self._kept_of(u)
        if new := [place for place in places if place not in kept]:
            kept.update(zip(new, at.motions(u, new), strict=True))
        return [kept[place] for place in places]

    def _acting(self, term: Term, u: ndarray) -> Any:
        """The basis on which a term is at work; None where it is not."""
        if not isinstance(term, LocalTerm):
            return term.basis
        kept = self._kept_of(u)
        if term not in kept:
            kept[term] = term.acting(u)
        return kept[term]

    def _kept_of(self, u: ndarray) -> dict[Any, Any]:
        """What is known of the ply at ``u``; empty for another than before."""
        kept = self._kept
        if not np.array_equal(u, kept[0]):
            kept = self._kept = u.copy(), {}
        return kept[1]


def _matrices(
    term: Term, basis: Any, u: ndarray, parameters: dict[str, Any]
) -> ndarray:
    """Matrices of a term without a kernel."""
    form, size = term.forms.tangent, basis.Nbfun
    K = form.elemental(basis, u=u, **parameters).data.reshape(size, size, -1)
    return pairs_of(K, _nodes(basis))


def _nodes(basis: Any) -> ndarray:
    """Nodes of the elements of a basis, shape (n_nodes, n_elements)."""
    return basis.element_dofs[::2] // 2


def _parameters(term: Term, given: Given = _NOTHING) -> dict[str, Any]:
    remembered = {} if term.memory is None else term.memory.parameters
    return {**remembered, **given.get(term, {})}
