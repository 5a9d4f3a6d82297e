"""Assembly of energy, residual and tangent from the terms of a ply."""

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
from ..kernels.assembly import KernelSum, positive_part
from ..kernels.element_groups import Parameters
from ..measures import Measures
from ..term import (
    NO_VALUES,
    Contribution,
    ElementTerm,
    Frozen,
    Load,
    PlyParameters,
    Role,
    Term,
    TermParameters,
    Values,
)
from .term_check import coupled_nodes, terms_on_basis

if TYPE_CHECKING:
    from ..terms import TensionTerm


class SumOfTerms(Measures):
    """Terms on a basis and their sum, the base of `Ply`.

    Energies, forces and stiffnesses are pure functions of a displacement ``u``, a load
    factor ``t`` and the ``parameters`` of the terms; without these, of those at rest.

    Parameters
    ----------
    basis
        Basis of the displacement.
    terms
        Terms and loads, their names all different.
    tension
        The term of the fibres among them, if there is one.

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
    ) -> None:
        self._terms = terms_on_basis(terms, basis)
        self.basis, self._tension = basis, tension

    @property
    def terms(self) -> tuple[Term, ...]:
        """Of the fibres, of shear, of corners, of the formulation, and further ones.

        With `OnePoint` of kind ``rate`` energy, residual and tangent are those of a
        step from the state of the parameters, and the residual is no derivative of the
        energy.
        """
        return self._terms

    @property
    def roles(self) -> dict[str, Role]:
        """Role of each term, by its name."""
        return {term.name: term.role for term in self.terms}

    @cached_property
    def parameters_at_rest(self) -> PlyParameters:
        """Parameters of the undeformed ply: those of each term that has any."""
        return Frozen({n: d.at_rest() for n, d in self._declared.items()})

    def updated(
        self,
        parameters: PlyParameters,
        u: ndarray,
        t: float = 1.0,
        tension: ndarray | None = None,
    ) -> PlyParameters:
        """Parameters updated within an iteration, such as stiffnesses at ``u``.

        A Newton loop calls this near the equilibrium of a step: with `Macro`,
        `Quadratic` of mean stretch, and `OnePoint` with the stabilisation ``auto``.

        Parameters
        ----------
        parameters
            The parameters before; they are returned where nothing changes.
        u, t
            Displacement and load factor.
        tension
            Predicted fibre tensions, which replace those at ``u``, as
            `geometric_tension` returns them: away from balance the tensions of stiff
            fibres are far from those at balance.
        """
        after = {
            name: declared.updated(parameters[name], u, t, tension)
            for name, declared in self._declared.items()
        }
        return self._changed(parameters, after)

    def advanced(
        self, parameters: PlyParameters, u: ndarray, t: float = 1.0
    ) -> PlyParameters:
        """Parameters advanced at the end of a step, such as accumulated moments.

        A Newton loop calls this after each step, with `OnePoint` of kind ``rate``.

        Parameters
        ----------
        parameters
            Those of the step; they are returned where nothing changes.
        u, t
            Converged displacement and its load factor.
        """
        after = {
            name: declared.advanced(parameters[name], u, t)
            for name, declared in self._declared.items()
        }
        return self._changed(parameters, after)

    @cached_property
    def _declared(self) -> dict[str, TermParameters]:
        """Declarations of parameters, by the names of the terms."""
        return {x.name: x.parameters for x in self.terms if x.parameters is not None}

    def _changed(
        self, before: PlyParameters, after: dict[str, Values]
    ) -> PlyParameters:
        same = all(values.same_as(before[name]) for name, values in after.items())
        return before if same else Frozen(after)

    def _of(self, term: Term, parameters: PlyParameters | None) -> Values:
        """The values of a term; those at rest without parameters."""
        if parameters is None:
            parameters = self.parameters_at_rest
        return parameters.get(term.name, NO_VALUES)

    @cached_property
    def _fused(self) -> KernelSum:
        """The terms with kernels, which share the deformations of the fibres."""
        fused: list[Any] = [term for term in self.terms if _is_fused(term)]
        return KernelSum(self.basis.N, fused)

    @cached_property
    def _by_element(self) -> list[ElementTerm]:
        """Further terms that give matrices of elements."""
        return [
            term
            for term in self.terms
            if isinstance(term, ElementTerm) and not term.fused
        ]

    @cached_property
    def _by_matrix(self) -> list[Term]:
        """Terms that give a sparse matrix."""
        return [term for term in self.terms if not isinstance(term, ElementTerm)]

    @cached_property
    def pattern(self) -> Pattern:
        """Which nodes the tangent couples."""
        elements = [*self._fused.elements, *(term.nodes for term in self._by_element)]
        couples = [n for x in self._by_matrix for n in coupled_nodes(x, self.basis)]
        d = components(self.basis)
        return Pattern(d, self.basis.N // d, elements, couples)

    def energies(
        self, u: ndarray, t: float = 1.0, parameters: PlyParameters | None = None
    ) -> dict[str, float]:
        """Energy of each term in N·mm, by the name of the term."""
        return {term.name: self._energy(term, u, t, parameters) for term in self.terms}

    def _energy(
        self, term: Term, u: ndarray, t: float, parameters: PlyParameters | None
    ) -> float:
        if not _is_fused(term):
            return term.energy(u, t, self._of(term, parameters))
        return self._fused.energy(u, self._of_kernels([term], t, parameters))

    def energy(
        self,
        u: ndarray,
        t: float = 1.0,
        parameters: PlyParameters | None = None,
    ) -> float:
        """Energy in N·mm, potentials of loads included; parameters of `residual`."""
        return sum(self._energy(term, u, t, parameters) for term in self.terms)

    def residuals(
        self, u: ndarray, t: float = 1.0, parameters: PlyParameters | None = None
    ) -> dict[str, ndarray]:
        """Nodal forces of each term in N, by the name of the term."""
        return {x.name: self._forces([x], u, t, parameters) for x in self.terms}

    def _forces(
        self,
        terms: Sequence[Term],
        u: ndarray,
        t: float,
        parameters: PlyParameters | None,
    ) -> ndarray:
        others = (
            term.residual(u, t, self._of(term, parameters))
            for term in terms
            if not _is_fused(term)
        )
        of_kernels = self._of_kernels(terms, t, parameters)
        return sum(others, self._fused.forces(u, of_kernels))

    def residual(
        self,
        u: ndarray,
        t: float = 1.0,
        parameters: PlyParameters | None = None,
    ) -> ndarray:
        """Nodal forces in N, internal ones less loads: the derivative of the energy.

        Parameters
        ----------
        u, t
            Displacement and load factor.
        parameters
            Parameters of the terms; those at rest if not given.
        """
        return self._forces(self.terms, u, t, parameters)

    def parts(
        self, u: ndarray, t: float = 1.0, parameters: PlyParameters | None = None
    ) -> list[Contribution]:
        """Terms, loads aside, with the part of deviations from mean stretches apart."""
        terms = [term for term in self.terms if term.role != "load"]
        parts = [
            Contribution(
                term.role,
                self._energy(term, u, t, parameters),
                self._forces([term], u, t, parameters),
            )
            for term in terms
        ]
        tension = self._tension
        if tension is not None and tension.of_means is not None:
            means = {tension: {"t": t, **tension.of_means}}
            whole = parts[terms.index(tension)]
            energy, forces = self._fused.energy(u, means), self._fused.forces(u, means)
            parts[terms.index(tension)] = Contribution("internal", energy, forces)
            deviation = whole.energy - energy, whole.forces - forces
            parts.append(Contribution("deviation", *deviation))
        return parts

    def load(
        self, u: ndarray, t: float, parameters: PlyParameters | None = None
    ) -> ndarray:
        """Nodal forces of the loads in N."""
        loads = [term for term in self.terms if term.role == "load"]
        if not loads:
            return np.zeros_like(u)
        return -self._forces(loads, u, t, parameters)

    def tangent(
        self,
        u: ndarray,
        t: float = 1.0,
        parameters: PlyParameters | None = None,
        *,
        tension: ndarray | None = None,
    ) -> csr_matrix:
        """Derivative of the residual in N/mm.

        Parameters
        ----------
        u, t, parameters
            As for `residual`.
        tension
            Fibre tensions to use in the geometric stiffness instead of those of
            ``u``, shape (2, n_elements, n_points).
        """
        if tension is not None:
            tension = self.arranged(tension)
        return self.pattern.matrix(self.stiffness(u, t, parameters, tension))

    def arranged(self, tension: ndarray) -> ndarray:
        """Fibre tensions at the ply's own points, as `stiffness` takes them."""
        return self._tension.arrange(tension) if self._tension else tension

    def stiffness(
        self,
        u: ndarray,
        t: float = 1.0,
        parameters: PlyParameters | None = None,
        tension: ndarray | None = None,
        positive: bool = False,
    ) -> ndarray:
        """Blocks of the tangent in the order of ``pattern``, shape (n_blocks, d, d).

        Parameters
        ----------
        u, t, parameters
            As for `residual`.
        tension
            Fibre tensions to use in the geometric stiffness, as `geometric_tension`
            gives them.
        positive
            Whether the matrices of the elements are replaced by the nearest positive
            semi-definite ones.
        """
        of_kernels = self._of_kernels(self.terms, t, parameters)
        if self._tension in of_kernels and tension is not None:
            of_kernels[self._tension]["tension"] = tension
        matrices: Iterable[ndarray | None] = chain(
            self._fused.matrices(u, of_kernels),
            (x.matrices(u, t, self._of(x, parameters)) for x in self._by_element),
        )
        if positive:
            matrices = map(positive_part, matrices)
        blocks = self.pattern.sum(matrices)
        for term in self._by_matrix:
            K = term.tangent(u, t, self._of(term, parameters))
            if K is not None:
                self.pattern.add(blocks, K, term.name)
        return blocks

    def geometric_tension(
        self, u: ndarray, du: ndarray, parameters: PlyParameters | None = None
    ) -> ndarray:
        """`predicted_tension` to first order, at the points of the fibres' term.

        Of mean stretches it is the predicted force T/λ times the stretch at u + du.
        """
        term = self._tension
        if term is None or not _is_fused(term):
            return self.arranged(self.predicted_tension(u, du, parameters))
        w = self._of_kernels([term], 1.0, parameters)[term]
        return self._fused.predicted_tension(u, du, term, w)

    def _of_kernels(
        self, terms: Sequence[Any], t: float, parameters: PlyParameters | None
    ) -> dict[Any, Parameters]:
        """Parameters of the kernels of terms, beside the displacement."""
        return {
            term: {"t": t, **self._of(term, parameters)}
            for term in terms
            if _is_fused(term)
        }

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
