"""A ply: mesh, fabric, formulation and terms, as a function of the displacement."""

from collections.abc import Iterable, Mapping, Sequence
from copy import deepcopy
from functools import cached_property
from itertools import chain
from typing import Any, TypeAlias

import numpy as np
from numpy import ndarray
from scipy.sparse import csr_matrix
from skfem import Mesh
from skfem.assembly.form.form import FormExtraParams

from .. import forms
from ..fabric import Fabric, is_zero
from ..fabric.law_check import check_laws
from ..fabric.regions import fabric_of_regions, fabric_on
from ..forms.bending import FibreEnd
from ..forms.corners import RESISTING
from ..forms.form import directions
from ..mesh.bases import components, node_positions
from ..mesh.corners import Corners
from ..mesh.pattern import Pattern
from ..mesh.splitting import original_elements
from ..mesh.splitting.hats import hat_functions
from .finer import FinerPly, finer_ply
from .formulations import DEFAULT
from .kernels.assembly import KernelSum
from .kernels.element_groups import Parameters
from .kernels.kernel import ShearKernel
from .measures import Measures
from .memory import HeldStiffness
from .own_terms.bending import bending_term, checked_ends
from .own_terms.corners import CornerTerm, corner_stiffness
from .term import (
    Contribution,
    Load,
    MatrixTerm,
    Memory,
    Role,
    Term,
    refuse_unsymmetric,
)
from .term_check import check_term, coupled_nodes, terms_on_basis, with_own_memory
from .terms import FormTerm, Formulation

#: Parameters and work that terms remember at a state, by the names of the terms.
Remembered: TypeAlias = Mapping[str, tuple[dict[str, ndarray], float]]


class Ply(Measures):
    """Energy of a ply and its derivatives.

    Only the terms that the fabric and the formulation need are built: no shear
    term without shear stiffness, no hourglass basis without stabilisation.

    Parameters
    ----------
    mesh
        The reference configuration: a `skfem.MeshQuad`, a `skfem.MeshTri`, or what
        `read_mesh` made of a file with both.
    fabric
        Fibre directions and laws; or a fabric for each of the mesh's subdomains, by
        name.  Values per element are those of the user's elements, or of the elements
        of ``ply.mesh``.
    formulation
        `Macro`, `OnePoint`, `Full` or `Quadratic`.
    terms
        Further terms and loads, their names all different.  Terms whose bases are built
        from ``ply.mesh`` are added by `with_terms`.
    dimension
        Components d of the displacement: 2 for a ply in its plane, 3 for one in space,
        whose mesh and fibre directions lie in the plane z = 0 at rest.
    fibre_ends
        How fibres that resist bending are held where they end, by the names of
        boundaries: ``clamped`` keeps their direction at rest, ``mirror`` stands for a
        plane of symmetry.  A function of the load factor is a clamp that turns: it
        gives the axis times the angle in radians, shape (3,), and in the plane the
        angle.  Elsewhere they end freely, as in hinges.

    Attributes
    ----------
    mesh
        The mesh that is computed on.  `Macro` splits the user's elements (`split`),
        unless they were split already; `OnePoint` and `Full` split triangles, and
        `Quadratic` cuts quadrilaterals (`cut`).  The user's nodes are its first, with
        their numbers, and boundaries, subdomains and named nodes keep their names.
    users_mesh, users_fabric
        Mesh and fabric as they were given.
    cells
        The user's elements as node numbers, arrays of shape (3, n) and (4, n).
    parent
        For each element of ``mesh`` the user's element that it is part of, counted
        through ``cells``; shape (n_elements,).
    basis
        `skfem.CellBasis` of the displacement at the ply's own points.  Every
        ``u`` below is a DOF vector of this basis, every ``t`` a load factor, which
        plays a part in loads, and in terms that ask for it.
    nodes
        Reference positions of the nodes, shape (2, n_nodes): the vertices of the mesh,
        then, for `Quadratic`, the middles of its edges in the order of ``mesh.facets``.
    centre, fine_points
        Reference coordinates of the element's centre, shape (2, 1), and of the points
        at which strain and folding are judged, (2, n_points): 2×2 of quadrilaterals,
        six of quadratic triangles.
    corners
        Det F at the nodes of the elements, at which folding is judged too.

    Raises
    ------
    MeshError
        If the mesh is not sound, was changed after it was split, or was split and the
        formulation is `Quadratic`.
    ValueError
        If the fabric has no stiffness at all, a fibre direction is not valid somewhere
        on the mesh, the parts of a law contradict each other (`check_laws`), a term
        is not valid, the dimension is not 2 or 3, or fibre ends are unknown.

    Examples
    --------
    >>> from skfem import MeshQuad
    >>> from skfem_textile import Fabric, Ply
    >>> ply = Ply(MeshQuad().refined(2), Fabric(1e4))
    >>> u = ply.basis.zeros()
    >>> float(ply.energy(u)), ply.residual(u).shape, ply.tangent(u).shape
    (0.0, (162,), (162, 162))
    """

    def __init__(
        self,
        mesh: Mesh,
        fabric: Fabric | Mapping[str, Fabric],
        formulation: Formulation = DEFAULT,
        terms: Iterable[Term | Load] = (),
        *,
        dimension: int = 2,
        fibre_ends: Mapping[str, FibreEnd] | None = None,
    ) -> None:
        if dimension not in (2, 3):
            raise ValueError(
                "dimension must be 2, for a ply in its plane, or 3, for one in space; "
                f"got {dimension!r}"
            )
        if isinstance(formulation, type) or not hasattr(formulation, "tension_term"):
            raise ValueError(
                f"formulation must be like Macro() or OnePoint(), not {formulation!r}"
            )
        if not isinstance(fabric, Fabric | Mapping):
            raise ValueError(
                f"fabric must be a Fabric, like Fabric(1e4), not {fabric!r}"
            )
        self.users_mesh, self.users_fabric = mesh, fabric
        self.mesh = mesh = formulation.working_mesh(mesh)
        self.basis = formulation.basis(mesh, dimension)
        self.cells, self.parent = original_elements(mesh)
        if isinstance(fabric, Mapping):
            fabric = fabric_of_regions(mesh, fabric, self.parent)
        self.fabric = fabric = fabric_on(self.parent, fabric)
        self.formulation = formulation
        self.fibre_ends = checked_ends(mesh, fibre_ends or {})
        check_laws(fabric.at(), self.basis.dx.shape)
        self.nodes = node_positions(self.basis)
        self.centre, self.fine_points = formulation.centre, formulation.fine_points
        self.corners = Corners(self.basis)
        self._tension = None
        if not all(is_zero(family.tension) for family in fabric.families):
            self._tension = formulation.tension_term(self.basis, fabric)
        needed = self._needed_terms()
        for term in needed:  # refuses directions that are not valid
            if isinstance(term, FormTerm):
                parameters = term.basis.default_parameters()
                directions(fabric, FormExtraParams(parameters))
        self._further = tuple(map(with_own_memory, terms))
        self._terms = terms_on_basis((*needed, *self._further), self.basis)
        for term in self.further_terms:
            check_term(term, self.basis, self.element_size)

    def _needed_terms(self) -> list[Term]:
        fabric, basis = self.fabric, self.basis
        terms: list[Term] = [self._tension] if self._tension else []
        if not is_zero(fabric.shear_law):
            kernel = ShearKernel(fabric)
            terms.append(FormTerm("shear", forms.shear(fabric), basis, kernel))
        if not terms:
            raise ValueError("the fabric has no stiffness: give it tension or shear")
        if (kappa := corner_stiffness(fabric, basis)) > 0:
            terms.append(CornerTerm(kappa, basis, self.corners))
        if fabric.bends:
            terms.append(bending_term(basis, fabric, self.fibre_ends))
        of_fibres = self._tension.basis if self._tension else basis
        return terms + self.formulation.stabilising_terms(of_fibres, fabric)

    def with_terms(self, *terms: Term | Load) -> "Ply":
        """A ply like this one, at rest, on the same mesh, with further terms.

        Build their bases from ``ply.mesh``.

        Raises
        ------
        ValueError
            If a term is not valid, or its name is that of another.
        """
        further = (*self._further, *terms)
        arguments = self.mesh, self.fabric, self.formulation, further
        ply = Ply(*arguments, **self.placement)
        ply.users_mesh, ply.users_fabric = self.users_mesh, self.users_fabric
        return ply

    @property
    def placement(self) -> dict[str, Any]:
        """Dimension and fibre ends, which another ply of the same fabric may take."""
        return {"dimension": components(self.basis), "fibre_ends": self.fibre_ends}

    def hat_functions(self) -> csr_matrix:
        """Values at all nodes of `hat_functions` of the corners of the user's elements.

        Shape (n_corners, n_nodes).
        """
        return hat_functions(self.mesh, self.nodes.shape[1])

    def finer(self) -> FinerPly:
        """A ply of which each element of ``mesh`` is split in four.

        Raises
        ------
        ValueError
            If a term cannot be built anew, or depends on the steps.
        """
        return finer_ply(self)

    @cached_property
    def _fused(self) -> KernelSum:
        """The terms with kernels, which share what they know of the fibres."""
        fused: list[Any] = [term for term in self.terms if _is_fused(term)]
        return KernelSum(self.basis.N, fused)

    @cached_property
    def pattern(self) -> Pattern:
        """Which nodes the tangent couples."""
        others = [term for term in self.terms if not _is_fused(term)]
        plain = [term.nodes for term in others if isinstance(term, FormTerm)]
        couples = [nodes for x in others for nodes in coupled_nodes(x, self.basis)]
        d, n_nodes = components(self.basis), self.nodes.shape[1]
        return Pattern(d, n_nodes, [*self._fused.elements, *plain], couples)

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

    @property
    def element_size(self) -> float:
        """Size of the largest element in mm."""
        return self.mesh.param()

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
        plain = [term for term in others if isinstance(term, FormTerm)]
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
        return [t for t in self.terms if corners or not isinstance(t, CornerTerm)]

    def corners_open(self, u: ndarray) -> bool:
        """Whether no corner resists at ``u``."""
        return bool(self.corners.area_ratio(u).min() >= RESISTING)

    @property
    def terms(self) -> tuple[Term, ...]:
        """Of the fibres, of shear, of corners, of the formulation, and further ones.

        With a memory (`OnePoint` of kind ``rate``) energy, residual and tangent are
        those of a step from the last committed state, and the residual is no derivative
        of the energy.
        """
        return self._terms

    @property
    def further_terms(self) -> tuple[Term, ...]:
        """Terms beside those of fabric and formulation, loads among them."""
        return self.terms[len(self.terms) - len(self._further) :]

    @property
    def further_terms_as_given(self) -> tuple[Term | Load, ...]:
        """The same, loads as they were given and not as terms on the ply's basis."""
        return self._further

    @property
    def follows_load_factor(self) -> bool:
        """Whether the energy may change with the load factor."""
        return bool(self.further_terms) or any(map(callable, self.fibre_ends.values()))

    @property
    def roles(self) -> dict[str, Role]:
        """Role of each term, by its name."""
        return {term.name: term.role for term in self.terms}

    @property
    def memories(self) -> dict[str, Memory]:
        """What terms remember, by their names."""
        return {term.name: term.memory for term in self.terms if term.memory}

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

    def commit(self, u: ndarray) -> bool:
        """Make ``u`` the last converged state, for terms that remember one.

        The load stepper does this after each step; a Newton loop of one's own must,
        if the ply has `memories`: with `Macro`, `Quadratic` of mean stretch, and
        `OnePoint` of kind ``rate`` or with the stabilisation ``auto``.

        Returns
        -------
        bool
            Whether that changes the forces at ``u``.
        """
        changed = [memory.commit(u) for memory in self.memories.values()]
        return any(changed)

    def settle(self, u: ndarray, tension: ndarray | None = None) -> bool:
        """Like `commit`, for what depends on the state alone: stiffnesses at ``u``.

        Parameters
        ----------
        u
            Displacement.
        tension
            Fibre tensions that take the place of those at ``u``, as
            `geometric_tension` gives them: away from balance those of stiff fibres are
            far from what they will be.
        """
        changed = [
            memory.commit(u, tension)
            if isinstance(memory, HeldStiffness)
            else memory.commit(u)
            for memory in self.memories.values()
            if memory.depends_on == "state"
        ]
        return any(changed)

    @property
    def remembered(self) -> Remembered:
        """Parameters and work of each of the `memories`, by its name; can be set."""
        memories = self.memories.items()
        return {name: (deepcopy(m.parameters), m.work) for name, m in memories}

    @remembered.setter
    def remembered(self, of_state: Remembered) -> None:
        for name, memory in self.memories.items():
            parameters, work = of_state[name]
            memory.restore(deepcopy(parameters), work)

    def reset(self) -> None:
        """Forget every committed state."""
        for memory in self.memories.values():
            memory.begin()

    def __repr__(self) -> str:
        terms = ", ".join(term.name for term in self.terms)
        return (
            f"<Ply of {self.mesh.nelements} elements, {self.basis.N} unknowns, "
            f"{self.formulation}, terms: {terms}>"
        )


def _is_fused(term: Any) -> bool:
    """Whether the numbers of a term come from a kernel, with those of others."""
    return isinstance(term, FormTerm) and term.fused


def _kernel_parameters(terms: Sequence[Any], t: float) -> dict[Any, Parameters]:
    """What the kernels of terms are given beside the displacement."""
    return {
        term: {"t": t, **(term.memory.parameters if term.memory else {})}
        for term in terms
        if _is_fused(term)
    }
