"""Sums of the terms of a ply: by their kernels, or by their forms where they have none."""

from collections.abc import Mapping, Sequence
from functools import cached_property
from typing import Any

import numpy as np
from numpy import ndarray
from skfem import asm

from .assembly import Part, element_forces, element_matrices, pairs_of
from .kernels import Kernel
from .pattern import Pattern
from .stencils import Motion, Stencil, stencils
from .terms import Term

#: Parameters of the forms of some terms beyond what these remember.
Given = Mapping[Term, dict[str, ndarray]]


class Sum:
    """The terms of a ply as functions of the displacement.

    What the fibres do at a displacement is kept until they are asked for another: the
    forces and the tangent of one state share it.

    Parameters
    ----------
    n_nodes
        Number of nodes.
    terms
        The terms.
    """

    def __init__(self, n_nodes: int, terms: Sequence[Term]) -> None:
        self._n_nodes, self._terms = n_nodes, terms
        self._u, self._motions = np.empty(0), dict[Stencil, list[Motion]]()

    def energies(self, u: ndarray) -> dict[str, float]:
        """Energy of each term in N·mm."""
        return {
            t.name: float(self._energy(t, u) + (t.memory.work if t.memory else 0.0))
            for t in self._terms
        }

    def residuals(self, u: ndarray) -> dict[str, ndarray]:
        """Nodal forces of each term in N."""
        return {t.name: self._residual(t, u) for t in self._terms}

    def stiffness(self, u: ndarray, given: Given) -> ndarray:
        """Blocks of the tangent in the order of ``pattern``, in N/mm."""
        matrices = []
        for nodes, terms in self._kinds:
            if isinstance(terms, Term):
                w = _parameters(terms, given)
                form, size = terms.forms.tangent, terms.basis.Nbfun
                local = form.elemental(terms.basis, u=u, **w).data
                matrices.append(pairs_of(local.reshape(size, size, -1), nodes))
            else:
                parts = [self._part(t, at, u, given) for t, at in terms]
                matrices.append(element_matrices(parts))
        return self.pattern.sum(matrices)

    @cached_property
    def pattern(self) -> Pattern:
        """Where the tangent has entries."""
        return Pattern(self._n_nodes, [nodes for nodes, _ in self._kinds])

    @cached_property
    def _kinds(self) -> list[tuple[ndarray, Any]]:
        """Nodes of elements, with a term without a kernel or all that these meet in."""
        kinds: list[tuple[ndarray, Any]] = []
        for term in self._terms:
            if term.kernel is None:
                kinds.append((term.basis.element_dofs[::2] // 2, term))
                continue
            for at in stencils(term.basis, term.kernel.fabric):
                for nodes, terms in kinds:
                    if isinstance(terms, list) and np.array_equal(nodes, at.nodes):
                        terms.append((term, at))
                        break
                else:
                    kinds.append((at.nodes, [(term, at)]))
        return kinds

    def _energy(self, term: Term, u: ndarray) -> float:
        if term.kernel is None:
            return asm(term.forms.energy, term.basis, u=u, **_parameters(term))
        return sum(part.energy() for part in self._parts(term, term.kernel, u))

    def _residual(self, term: Term, u: ndarray) -> ndarray:
        if term.kernel is None:
            return asm(term.forms.residual, term.basis, u=u, **_parameters(term))
        f = np.zeros((2, self._n_nodes))
        for part in self._parts(term, term.kernel, u):
            nodes, own = part.at.nodes.ravel(), element_forces(part)
            for i in range(2):
                f[i] += np.bincount(nodes, own[:, i].ravel(), self._n_nodes)
        return f.T.ravel()

    def _parts(self, term: Term, kernel: Kernel, u: ndarray) -> list[Part]:
        found = stencils(term.basis, kernel.fabric)
        return [self._part(term, at, u) for at in found]

    def _part(self, term: Term, at: Stencil, u: ndarray, given: Given = {}) -> Part:
        if not np.array_equal(u, self._u):
            self._u, self._motions = u.copy(), {}
        if at not in self._motions:
            self._motions[at] = at.motions(u)
        return Part(term.kernel, at, self._motions[at], _parameters(term, given))


def _parameters(term: Term, given: Given = {}) -> dict[str, Any]:
    remembered = {} if term.memory is None else term.memory.parameters
    return {**remembered, **given.get(term, {})}
