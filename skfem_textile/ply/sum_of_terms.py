"""Assembly of energy, residual and tangent, and measures of the deformation."""

from collections.abc import Iterable, Iterator, Sequence
from functools import cached_property
from itertools import chain
from typing import Any, NamedTuple

import numpy as np
from numpy import ndarray
from scipy.sparse import csr_matrix
from skfem import CellBasis

from ..fabric import Fabric
from ..fabric.fabric import LawEnd
from ..forms.fields import FabricOnBasis
from ..forms.kernels.elements import (
    ElementGroup,
    FibreDeformation,
    IntegrationPoints,
)
from ..forms.kernels.kernel import (
    KernelState,
    SharedGroup,
    element_forces,
    element_matrices,
    positive_part,
    shared_groups,
)
from ..mesh.bases import components
from ..mesh.pattern import Pattern, padded
from .builtin_terms import BendingTerm, Corners
from .parameters import NO_VALUES, Frozen, PlyParameters, Values
from .term_check import coupled_nodes, terms_on_basis
from .terms import (
    ContactTerm,
    Contribution,
    ElementTerm,
    FormTerm,
    Load,
    Role,
    TensionTerm,
    Term,
)


class _Kinds(NamedTuple):
    """Terms by their kind of assembly.

    Terms in ``by_kernel`` share the fibre deformations of ``groups`` of elements, those
    in ``by_element`` return element matrices, those in ``by_matrix`` a sparse matrix.
    """

    groups: list[SharedGroup]
    by_kernel: list[FormTerm]
    by_element: list[ElementTerm]
    by_matrix: list[Term]


class SumOfTerms(FabricOnBasis):
    """Sum of terms on a basis; base class of `Ply`.

    Energies, forces and stiffnesses are pure functions of a displacement ``u``, a load
    factor ``t`` and the ``parameters`` of the terms, by default those at rest.  With
    `OnePoint` of kind ``rate`` they describe a step from the state of the parameters,
    and the residual is not a derivative of the energy.
    Strains, tensions, angles and directions are evaluated at the points of the basis.

    Parameters
    ----------
    basis, fabric
        Basis of the displacement, fibre directions and laws.
    terms
        Terms and loads with unique names.
    tension
        The tension term, if there is one.

    Attributes
    ----------
    roles
        Role of each term, by name.
    parent
        The user's element that contains each element of the mesh, shape (n_elements,).
    fine_points
        Reference coordinates of the points at which strain and folding are checked, (2,
        n_points).
    corners
        Det F at the nodes of the elements, where folding is also checked.

    Raises
    ------
    ValueError
        If a term is not valid on the basis, or its name is not unique.
    """

    roles: dict[str, Role]
    parent: ndarray
    fine_points: ndarray
    corners: Corners

    def __init__(
        self,
        basis: CellBasis,
        fabric: Fabric,
        terms: Iterable[Term | Load],
        tension: TensionTerm | None = None,
    ) -> None:
        of_means = tension is not None and tension.of_means is not None
        means: Any = tension.basis if tension and of_means else None
        super().__init__(basis, fabric, means)
        self._terms = terms_on_basis(terms, basis)
        self.roles = {x.name: x.role for x in self._terms}
        self._tension: Any = tension
        self._declared = {
            x.name: x.parameters for x in self._terms if x.parameters is not None
        }
        self._d = components(basis)
        self._coupled: list[ndarray] = []
        self._at_rest: Pattern | None = None
        self._last: tuple[
            bytes,
            dict[IntegrationPoints, FibreDeformation],
            dict[tuple[FormTerm, ElementGroup], KernelState],
        ] = (b"", {}, {})

    @property
    def terms(self) -> tuple[Term, ...]:
        """Terms of fibres, shear, corners and formulation, and further terms."""
        return self._terms

    @cached_property
    def parameters_at_rest(self) -> PlyParameters:
        """Parameters of the undeformed ply, for each term with parameters."""
        return Frozen({n: d.at_rest() for n, d in self._declared.items()})

    def updated(
        self,
        parameters: PlyParameters,
        u: ndarray,
        t: float = 1.0,
        tension: ndarray | None = None,
    ) -> PlyParameters:
        """Parameters updated within an iteration, such as stiffnesses at ``u``.

        A Newton loop calls this near the equilibrium of a step, for `Macro`,
        `Quadratic` with a deviation, and `OnePoint` with the stabilisation ``auto``.

        Parameters
        ----------
        parameters
            Previous parameters, which are returned if nothing changes.
        u, t
            Displacement and load factor.
        tension
            Predicted fibre tensions, used instead of those at ``u``, see
            `geometric_tension`: away from equilibrium the tensions of stiff fibres
            differ greatly from those at equilibrium.
        """
        self.refuse_other(u)
        after = {
            name: declared.updated(parameters[name], u, t, tension)
            for name, declared in self._declared.items()
        }
        return _changed(parameters, after)

    def advanced(
        self, parameters: PlyParameters, u: ndarray, t: float = 1.0
    ) -> PlyParameters:
        """Parameters advanced at the end of a step, such as accumulated moments.

        A Newton loop calls this after each step: for `OnePoint` of kind ``rate`` and
        for terms with such a `TermParameters.advanced`.

        Parameters
        ----------
        parameters
            Parameters of the step, which are returned if nothing changes.
        u, t
            Converged displacement and its load factor.
        """
        self.refuse_other(u)
        after = {
            name: declared.advanced(parameters[name], u, t)
            for name, declared in self._declared.items()
        }
        return _changed(parameters, after)

    def energy_lost(
        self, u: ndarray, t: float = 1.0, parameters: PlyParameters | None = None
    ) -> dict[str, float]:
        """Energy lost up to a state in N·mm, by term: by friction, and by clamps.

        Empty without friction and clamps that may let go.  A clamp that holds has lost
        nothing, even if it carries the force at which it lets go.

        Parameters
        ----------
        u, t, parameters
            Displacement, load factor and parameters of the state.
        """
        values = self.parameters_at_rest if parameters is None else parameters
        after = {
            name: x if "released_at" in x else self._declared[name].advanced(x, u, t)
            for name, x in values.items()
            if any(map(_is_of_loss, x))
        }
        return {name: float(x["work"]) for name, x in after.items()}

    @cached_property
    def _at_elements(self) -> Fabric:
        """The fabric with its laws at the elements."""
        return self.fabric.at()

    @cached_property
    def pattern(self) -> Pattern:
        """Sparsity pattern of the tangent."""
        elements = [shared.group.nodes for shared in self._kinds.groups]
        elements += [term.nodes for term in self._kinds.by_element]
        couples = [
            nodes
            for term in self._kinds.by_matrix
            for nodes in coupled_nodes(term, self.basis)
        ]
        d = self._d
        return Pattern(d, self.basis.N // d, elements, [*couples, *self._coupled])

    def couple(self, matrices: Iterable[csr_matrix]) -> None:
        """Extend the ``pattern`` by pairs of nodes in the rows of matrices.

        Each has the shape (n, n_nodes).
        """
        for rows in matrices:
            self._coupled.append(padded(rows[np.diff(rows.indptr) > 0])[0])
        self._at_rest = self._at_rest or self.pattern
        del self.pattern

    def uncouple(self) -> None:
        """Restore the ``pattern`` at rest, so that steps are independent."""
        if self._at_rest:
            self._coupled, self.pattern = [], self._at_rest

    @cached_property
    def _kinds(self) -> _Kinds:
        form_terms = [x for x in self._terms if isinstance(x, FormTerm)]
        by_kernel = [x for x in form_terms if x.kernel is not None]
        others = [x for x in self._terms if x not in by_kernel]
        by_element = [x for x in others if isinstance(x, ElementTerm)]
        by_matrix = [x for x in others if x not in by_element]
        return _Kinds(shared_groups(by_kernel), by_kernel, by_element, by_matrix)

    def _states(
        self,
        terms: Sequence[Term],
        u: ndarray,
        parameters: PlyParameters,
        tension: ndarray | None = None,
        stretched: bool = False,
    ) -> Iterator[dict[FormTerm, KernelState]]:
        """Kernel states of the given terms, for each group of elements.

        Deformations and states at the last displacement are cached, because energies,
        forces, tangent and predicted tensions share them.  Threads may use different
        displacements.
        """
        key, last = u.tobytes(), self._last
        if key != last[0]:
            last = self._last = key, {}, {}
        _, deformations, known = last
        for shared in self._kinds.groups:
            states = {}
            for term, (group, points) in shared.terms.items():
                if term not in terms:
                    continue
                w, x = parameters.get(term.name, NO_VALUES), known.get((term, group))
                if x is None or x.w is not w:
                    new = [p for p in points if p not in deformations]
                    found = group.deformations(u, new)
                    deformations.update(zip(new, found, strict=True))
                    fibres = [deformations[p] for p in points]
                    x = KernelState(term.kernel, group, points, fibres, w)
                    known[term, group] = x
                if tension is not None and term is self._tension:
                    x = x.for_stiffness(tension, stretched)
                states[term] = x
            if states:
                yield states

    def energies(
        self,
        u: ndarray,
        t: float = 1.0,
        parameters: PlyParameters | None = None,
        terms: Sequence[Term] | None = None,
    ) -> dict[str, float]:
        """Energy of each term in N·mm, by name; see `residual`."""
        self.refuse_other(u)
        p = self.parameters_at_rest if parameters is None else parameters
        terms, energies = self._terms if terms is None else terms, {}
        of_kernels: dict[Any, float] = dict.fromkeys(self._kinds.by_kernel, 0.0)
        for states in self._states(terms, u, p):
            for of_kernel, x in states.items():
                of_kernels[of_kernel] += x.kernel.energy(x)
        for term in terms:
            values = p.get(term.name, NO_VALUES)
            if term in of_kernels:
                work = float(values.get("work", 0.0))
                energies[term.name] = of_kernels[term] + work
            else:
                energies[term.name] = term.energy(u, t, values)
        return energies

    def energy(
        self,
        u: ndarray,
        t: float = 1.0,
        parameters: PlyParameters | None = None,
        terms: Sequence[Term] | None = None,
    ) -> float:
        """Energy in N·mm, including potentials of loads; see `residual`."""
        return sum(self.energies(u, t, parameters, terms).values(), 0.0)

    def residuals(
        self, u: ndarray, t: float = 1.0, parameters: PlyParameters | None = None
    ) -> dict[str, ndarray]:
        """Nodal forces of each term in N, by name."""
        return {x.name: self.residual(u, t, parameters, [x]) for x in self._terms}

    def residual(
        self,
        u: ndarray,
        t: float = 1.0,
        parameters: PlyParameters | None = None,
        terms: Sequence[Term] | None = None,
    ) -> ndarray:
        """Nodal forces in N, internal forces less loads: the derivative of the energy.

        Parameters
        ----------
        u, t
            Displacement and load factor.
        parameters
            Parameters of the terms; by default those at rest.
        terms
            Terms to sum; by default all.
        """
        self.refuse_other(u)
        p = self.parameters_at_rest if parameters is None else parameters
        terms, d, f = self._terms if terms is None else terms, self._d, np.zeros(len(u))
        for states in self._states(terms, u, p):
            (x, *_), local = states.values(), element_forces(states.values())
            for i in range(d):
                f[i::d] += x.group.sum_at_nodes(local[:, i], len(f) // d)
        for term in terms:
            if term not in self._kinds.by_kernel:
                f = f + term.residual(u, t, p.get(term.name, NO_VALUES))
        return f

    def parts(
        self, u: ndarray, t: float = 1.0, parameters: PlyParameters | None = None
    ) -> list[Contribution]:
        """All terms except loads, with deviations from means listed separately."""
        p = self.parameters_at_rest if parameters is None else parameters
        parts, deviations = [], []
        terms = [term for term in self._terms if term.role != "load"]
        energies = self.energies(u, t, p, terms)
        for term in terms:
            energy = energies[term.name]
            forces = self.residual(u, t, p, [term])
            if isinstance(term, TensionTerm) and term.of_means is not None:
                of_term = energy, forces
                means = {term.name: Values({**p[term.name], **term.of_means})}
                energy = self.energies(u, t, means, [term])[term.name]
                forces = self.residual(u, t, means, [term])
                remainder = of_term[0] - energy, of_term[1] - forces
                deviations.append(Contribution("deviation", *remainder))
            parts.append(Contribution(term.role, energy, forces))
        return parts + deviations

    def load(
        self, u: ndarray, t: float, parameters: PlyParameters | None = None
    ) -> ndarray:
        """Nodal forces of the loads in N."""
        self.refuse_other(u)
        loads = [term for term in self._terms if term.role == "load"]
        return -self.residual(u, t, parameters, loads) if loads else np.zeros(len(u))

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
            See `residual`.
        tension
            Fibre tensions in the geometric stiffness, instead of those at ``u``, shape
            (2, n_elements, n_points).
        """
        if tension is not None:
            tension = self.arranged(tension)
        return self.pattern.matrix(self.stiffness(u, t, parameters, tension))

    def stiffness(
        self,
        u: ndarray,
        t: float = 1.0,
        parameters: PlyParameters | None = None,
        tension: ndarray | None = None,
        positive: bool = False,
        stretched: bool = False,
    ) -> ndarray:
        """Blocks of the tangent in the order of ``pattern``, shape (n_blocks, d, d).

        Parameters
        ----------
        u, t, parameters
            See `residual`.
        tension
            Fibre tensions in the geometric stiffness, see `geometric_tension`.
        positive
            True if element matrices are replaced by the nearest positive semi-definite
            ones.
        stretched
            True if fibres shorter than at rest have the slope of their law at rest;
            requires ``tension``.
        """
        self.refuse_other(u)
        p = self.parameters_at_rest if parameters is None else parameters
        matrices: Iterable[ndarray | None] = chain(
            (
                element_matrices(states.values())
                for states in self._states(self._terms, u, p, tension, stretched)
            ),
            (
                x.matrices(u, t, p.get(x.name, NO_VALUES))
                for x in self._kinds.by_element
            ),
        )
        if positive:
            matrices = map(positive_part, matrices)
        blocks = self.pattern.sum(matrices)
        for term in self._kinds.by_matrix:
            values = p.get(term.name, NO_VALUES)
            if isinstance(term, ContactTerm):
                for rows, of_rows in term.blocks(u, t, values):
                    blocks += self.pattern.summed(rows, of_rows)
                continue
            K = term.tangent(u, t, values)
            if K is not None:
                self.pattern.add(blocks, K, term.name)
        return blocks

    def predicted_tension(
        self, u: ndarray, du: ndarray, parameters: PlyParameters | None = None
    ) -> ndarray:
        """Predicted tensions after the increment ``du``.

        At the integration points of the ply, shape (2, n_elements, n_points): T(ε) + T′
        ∂ε·∇du, to first order.  With mean stretches the force T/λ is linearised instead
        and multiplied by the stretch at u + du; it includes the contribution of the
        deviations, whose stiffness is one of the ``parameters``, by default those at
        rest.
        """
        T = self.geometric_tension(u, du, parameters)
        return self.means.to_ply_points(T) if self.means else T

    def geometric_tension(
        self, u: ndarray, du: ndarray, parameters: PlyParameters | None = None
    ) -> ndarray:
        """`predicted_tension` at the points of the tension term, for `stiffness`."""
        self.refuse_other(u)
        self.refuse_other(du)
        if (term := self._tension) is None:
            return np.zeros((2, *self.basis.dx.shape))
        T = np.zeros((2, *term.basis.dx.shape))
        p = self.parameters_at_rest if parameters is None else parameters
        before, after = (
            [states[term] for states in self._states([term], at, p)]
            for at in (u, u + du)
        )
        for x, y in zip(before, after, strict=True):
            at_points = term.kernel.predicted_tension(x, y)
            for numbers, tension in zip(x.group.point_numbers, at_points, strict=True):
                T[..., x.group.elements, numbers] = tension.swapaxes(1, 2)
        return T

    def arranged(self, tension: ndarray) -> ndarray:
        """Fibre tensions at the points of the ply, rearranged for `stiffness`."""
        return self.means.from_ply_points(tension) if self.means else tension

    def largest_gradient(self, u: ndarray) -> float:
        """Largest component of the displacement gradient at the fine points."""
        return float(np.abs(self.gradient(u, self.fine_points)).max())

    def fibre_tension(
        self, u: ndarray, parameters: PlyParameters | None = None
    ) -> ndarray:
        """Tension of warp and weft in N/mm at the integration points of the ply.

        Parameters
        ----------
        u
            Displacement.
        parameters
            Parameters of the terms, such as ``State.parameters``: with mean stretches
            the tension then includes the contribution of deviations from them, whose
            stiffness is one of the parameters.  Without parameters it is the value of
            the law at `law_strain`.

        Returns
        -------
        ndarray
            Shape (2, n_elements, n_points).
        """
        if parameters is not None:
            return self.predicted_tension(u, np.zeros_like(u), parameters)
        return super().fibre_tension(u)

    def nodal(self, u: ndarray) -> ndarray:
        """DOF vector as one column per node of ``nodes``, shape (d, n_nodes)."""
        self.refuse_other(u)
        return u.reshape(-1, self._d).T.copy(order="K")

    def least_area_ratio(self, u: ndarray) -> ndarray:
        """Smallest det F of each element at its nodes and the fine points."""
        fine = self.area_ratio(u, self.fine_points).min(axis=1)
        return np.minimum(fine, self.corners.area_ratio(u).min(axis=0))

    def normals(self, u: ndarray) -> ndarray:
        """Normals of the elements in space, not normalised, shape (3, n_elements).

        At rest all point to the same side of the ply.
        """
        self.refuse_other(u)
        return self.corners.normals(u)

    def creased(self, u: ndarray) -> ndarray:
        """Elements inclined by more than a right angle to a neighbour.

        Element numbers; empty in the plane.  Such a crease depends on the mesh.
        """
        if self._d == 2:
            return np.empty(0, dtype=int)
        one, other = self.mesh.f2t[:, self.mesh.f2t[1] >= 0]
        n = self.corners.normals(u)
        sharp = ~((n[:, one] * n[:, other]).sum(axis=0) > 0)
        return np.unique([one[sharp], other[sharp]])

    def is_slack(self, u: ndarray) -> bool:
        """True if a fibre is shorter than at rest, and less than half as stiff."""
        law, strain = self._at_elements.tensions, self.law_strain(u)
        both = (law.slopes(x).own for x in (strain, np.maximum(strain, 0.0)))
        pairs = zip(*both, strict=True)
        return any(bool(np.any(2 * slope < at_rest)) for slope, at_rest in pairs)

    def beyond_peak(self, strains: ndarray) -> ndarray:
        """Elements where T/λ decreases with λ (∂T/∂ε is below T) or ε is not finite.

        Beyond the peak of T/λ, the force per reference width, a fibre tears.  The fibre
        strains at points have the shape (2, n_elements, n_points).
        """
        past = ~np.isfinite(strains).all(axis=(0, 2))
        law = self._at_elements.tensions
        pairs = zip(law.slopes(strains).own, law.value(strains), strict=True)
        for slope, tension in pairs:
            past |= (slope < np.abs(tension)).any(axis=1)
        return past

    def in_domain(self, u: ndarray) -> bool:
        """True if every law is evaluated within its domain.

        Beyond the domain of a bending law the energy is not a number.
        """
        if self.fabric.unbounded:
            return True
        return self._at_elements.in_domain(self.law_strain(u), self.shear_angle(u))

    def closest_end(self, u: ndarray, t: float = 1.0) -> LawEnd | None:
        """The closest domain end of a law; None if all domains are unbounded."""
        bending = (x for x in self._terms if isinstance(x, BendingTerm))
        curvatures = [end for term in bending for end in term.ends(u, t)]
        state = self.law_strain(u), self.shear_angle(u)
        return self._at_elements.closest_end(*state, curvatures)


def _is_of_loss(value: str) -> bool:
    """True for the name of a parameter value of friction or of a clamp."""
    return "slip" in value or value == "released_at"


def _changed(before: PlyParameters, after: dict[str, Values]) -> PlyParameters:
    """New parameters; the previous object if all values are equal."""
    same = all(values.same_as(before[name]) for name, values in after.items())
    return before if same else Frozen(after)
