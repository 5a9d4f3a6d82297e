"""What the terms of a ply make of a displacement: energies, forces and stiffness."""

from collections.abc import Iterable, Sequence
from functools import cached_property
from itertools import chain
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy import ndarray
from scipy.sparse import csr_matrix
from skfem import CellBasis

from ...mesh.bases import components
from ...mesh.pattern import Pattern
from ..kernels.assembly import KernelSum
from ..kernels.element_groups import Parameters
from ..measures import Measures
from ..term import (
    Contribution,
    ElementTerm,
    Load,
    MatrixTerm,
    Term,
    refuse_unsymmetric,
)
from .remembering_terms import RememberingTerms
from .term_check import coupled_nodes, terms_on_basis

if TYPE_CHECKING:
    from ..own_terms.corners import CornerTerm
    from ..terms import TensionTerm


class SumOfTerms(RememberingTerms, Measures):
    """Terms on a basis, added up: what `Ply` is, once it is built.

    Parameters
    ----------
    basis
        Basis of the displacement.
    terms
        Terms and loads, their names all different.
    tension, corners
        The terms of the fibres and of the corners among them, if there are such.

    Raises
    ------
    ValueError
        If one is no term on the basis, or has the name of another.
    """

    def __init__(
        self,
        basis: CellBasis,
        terms: Iterable[Term | Load],
        tension: "TensionTerm | None" = None,
        corners: "CornerTerm | None" = None,
    ) -> None:
        super().__init__(terms_on_basis(terms, basis))
        self.basis, self._tension, self._of_corners = basis, tension, corners

    @cached_property
    def _fused(self) -> KernelSum:
        """The terms with kernels, which share what they know of the fibres."""
        fused: list[Any] = [term for term in self.terms if _is_fused(term)]
        return KernelSum(self.basis.N, fused)

    @cached_property
    def pattern(self) -> Pattern:
        """Which nodes the tangent couples."""
        others = [term for term in self.terms if not _is_fused(term)]
        plain = [term.nodes for term in others if isinstance(term, ElementTerm)]
        couples = [nodes for x in others for nodes in coupled_nodes(x, self.basis)]
        d = components(self.basis)
        return Pattern(d, self.basis.N // d, [*self._fused.elements, *plain], couples)

    @cached_property
    def _constant(self) -> dict[str, ndarray]:
        """Blocks of the tangents that do not change, by the names of their terms."""
        found = {}
        for term in self.terms:
            if isinstance(term, MatrixTerm):
                shape = len(self.pattern.rows), *2 * (components(self.basis),)
                found[term.name] = blocks = np.zeros(shape)
                self.pattern.add(blocks, term.matrix, term.name)
        return found

    def energies(self, u: ndarray, t: float = 1.0) -> dict[str, float]:
        """Energy of each term in N·mm, by the name of the term."""
        return {term.name: self._energy(term, u, t) for term in self.terms}

    def _energy(self, term: Term, u: ndarray, t: float) -> float:
        if not _is_fused(term):
            return term.energy(u, t)
        stored = term.memory.work if term.memory else 0.0
        return self._fused.energy(u, _kernel_parameters([term], t)) + stored

    def energy(self, u: ndarray, t: float = 1.0, corners: bool = True) -> float:
        """Energy in N·mm, potentials of loads included; parameters of `residual`."""
        return sum(self._energy(term, u, t) for term in self._acting(corners))

    def residuals(self, u: ndarray, t: float = 1.0) -> dict[str, ndarray]:
        """Nodal forces of each term in N, by the name of the term."""
        return {term.name: self._forces([term], u, t) for term in self.terms}

    def _forces(self, terms: Sequence[Term], u: ndarray, t: float) -> ndarray:
        others = (term.residual(u, t) for term in terms if not _is_fused(term))
        return sum(others, self._fused.forces(u, _kernel_parameters(terms, t)))

    def residual(self, u: ndarray, t: float = 1.0, corners: bool = True) -> ndarray:
        """Nodal forces in N, internal ones less loads: the derivative of the energy.

        Parameters
        ----------
        u, t
            Displacement and load factor.
        corners
            Whether corners resist.
        """
        return self._forces(self._acting(corners), u, t)

    def parts(self, u: ndarray, t: float = 1.0) -> list[Contribution]:
        """Terms, loads aside, with what meets deviations from mean stretches apart."""
        terms = [term for term in self.terms if term.role != "load"]
        parts = [
            Contribution(
                term.role, self._energy(term, u, t), self._forces([term], u, t)
            )
            for term in terms
        ]
        tension = self._tension
        if tension is not None and tension.of_means is not None:
            means = {tension: _kernel_parameters([tension], t)[tension]}
            means[tension] |= tension.of_means
            whole = parts[terms.index(tension)]
            energy, forces = self._fused.energy(u, means), self._fused.forces(u, means)
            parts[terms.index(tension)] = Contribution("internal", energy, forces)
            deviation = whole.energy - energy, whole.forces - forces
            parts.append(Contribution("deviation", *deviation))
        return parts

    def load(self, u: ndarray, t: float) -> ndarray:
        """Nodal forces of the loads in N."""
        loads = [term for term in self.terms if term.role == "load"]
        if not loads:
            return np.zeros_like(u)
        return -self._forces(loads, u, t)

    def tangent(
        self, u: ndarray, t: float = 1.0, *, tension: ndarray | None = None
    ) -> csr_matrix:
        """Derivative of the residual in N/mm.

        Parameters
        ----------
        u, t
            Displacement and load factor.
        tension
            Fibre tensions to use in the geometric stiffness instead of those of
            ``u``, shape (2, n_elements, n_points).
        """
        if tension is not None:
            tension = self.arranged(tension)
        return self.pattern.matrix(self.stiffness(u, t, tension=tension))

    def arranged(self, tension: ndarray) -> ndarray:
        """Fibre tensions at the ply's own points, as `stiffness` takes them."""
        return self._tension.arrange(tension) if self._tension else tension

    def stiffness(
        self,
        u: ndarray,
        t: float = 1.0,
        tension: ndarray | None = None,
        corners: bool = True,
        convex: bool = False,
    ) -> ndarray:
        """Blocks of the tangent in the order of ``pattern``, shape (n_blocks, d, d).

        Parameters
        ----------
        u, t
            Displacement and load factor.
        tension
            Fibre tensions to use in the geometric stiffness, as `geometric_tension`
            gives them.
        corners
            Whether corners resist.
        convex
            Whether what resists shear and stabilises is made positive semi-definite, at
            each point or in each element, as a last resort of an iteration.
        """
        terms = self._acting(corners)
        parameters = _kernel_parameters(terms, t)
        if self._tension in parameters and tension is not None:
            parameters[self._tension]["tension"] = tension
        others = [term for term in terms if not _is_fused(term)]
        plain = [term for term in others if isinstance(term, ElementTerm)]
        fused = self._fused.matrices(u, parameters, convex)
        matrices = (term.matrices(u, t, convex) for term in plain)
        blocks = self.pattern.sum(chain(fused, matrices))
        for term in others:
            if isinstance(term, MatrixTerm):
                blocks += self._constant[term.name]
            elif term not in plain and (K := term.tangent(u, t)) is not None:
                refuse_unsymmetric(term.name, K - K.T, K)
                self.pattern.add(blocks, K, term.name)
        return blocks

    def geometric_tension(self, u: ndarray, du: ndarray) -> ndarray:
        """`predicted_tension` to first order, at the points of the fibres' term.

        Of mean stretches it is the predicted force T/λ times the stretch at u + du.
        """
        term = self._tension
        if term is None or not _is_fused(term):
            return self.arranged(self.predicted_tension(u, du))
        w = _kernel_parameters([term], 1.0)[term]
        return self._fused.predicted_tension(u, du, term, w)

    def _acting(self, corners: bool) -> list[Term]:
        """The terms, that of the corners on demand."""
        return [t for t in self._terms if corners or t is not self._of_corners]

    def gradient(self, u: ndarray, points: ndarray | None = None) -> ndarray:
        """Displacement gradient ∇u, shape (d, 2, n_elements, n_points).

        Parameters
        ----------
        u
            Displacement.
        points
            Reference coordinates in the unit square or triangle, shape (2,
            n_points); the ply's own points if not given.
        """
        xi = self.basis.X if points is None else points
        vector: Any = self.basis.elem
        scalar = vector.elem
        n_nodes = len(scalar.doflocs)
        dN = np.array([scalar.lbasis(xi, i)[1] for i in range(n_nodes)])
        nodal = u[self.basis.element_dofs].reshape(n_nodes, vector.dim, -1)
        du_dxi = nodal.transpose(1, 2, 0)[:, None] @ dN.transpose(1, 0, 2)
        return np.einsum("ijnq,jknq->iknq", du_dxi, self.basis.mapping.invDF(xi))


def _is_fused(term: Any) -> bool:
    """Whether the numbers of a term come from a kernel, with those of others."""
    return isinstance(term, ElementTerm) and term.fused


def _kernel_parameters(terms: Sequence[Any], t: float) -> dict[Any, Parameters]:
    """What the kernels of terms are given beside the displacement."""
    return {
        term: {"t": t, **(term.memory.parameters if term.memory else {})}
        for term in terms
        if _is_fused(term)
    }
