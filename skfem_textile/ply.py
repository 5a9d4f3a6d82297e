"""A ply: a mesh, a fabric and a formulation, as a function of the displacement."""

from functools import cached_property
from typing import Any

import numpy as np
from numpy import ndarray
from scipy.sparse import csr_matrix
from skfem import Mesh
from skfem.assembly.form.form import FormExtraParams
from skfem.helpers import ddot

from . import kinematics as kin
from .corners import Corners, CornerTerm, corner_resistance, corner_stiffness
from .elements import node_dofs, node_positions
from .fabric import Fabric, is_zero
from .forms import directions, shear
from .formulations import Formulation
from .law_check import check_laws
from .pattern import Pattern
from .sums import Sum
from .terms import LocalTerm, Term


class Ply:
    """Internal energy of a ply and its derivatives.

    Only the terms that the fabric and the formulation need are built: no shear
    term without shear stiffness, no hourglass basis without stabilisation.

    Parameters
    ----------
    mesh
        The reference configuration: a `skfem.MeshQuad`, for `Macro` one that was
        split, or for `Quadratic` a `skfem.MeshTri`.
    fabric
        Fibre directions and laws.
    formulation
        `Full`, `OnePoint`, `Macro` or `Quadratic`.

    Attributes
    ----------
    basis
        `skfem.CellBasis` of the displacement at the ply's own points.  Every
        ``u`` below is a DOF vector of this basis.
    nodes
        Reference positions of the nodes, shape (2, n_nodes): the vertices of the mesh,
        then, for `Quadratic`, the middles of its edges in the order of ``mesh.facets``.
    centre, fine_points
        Reference coordinates of the element's centre, shape (2, 1), and of the points
        at which strain and folding are judged, (2, n_points): 2×2 of quadrilaterals,
        six of quadratic triangles.
    corners
        Det F at the nodes of the elements, at which folding is judged too.
    terms
        The terms of the energy, each with its forms, its basis and what it remembers.
        With a memory (`OnePoint` of kind ``rate``) energy, residual and tangent are
        those of a step from the last committed state, and the residual is no
        derivative of the energy.

    Raises
    ------
    MeshError
        If the mesh is not sound, or not of the cells of the formulation.
    ValueError
        If the fabric or the formulation is none, the fabric has no stiffness at all, a
        fibre direction is not valid somewhere on the mesh, or the parts of a law
        contradict each other (`check_laws`).

    Examples
    --------
    >>> from skfem import MeshQuad
    >>> from skfem_textile import Fabric, OnePoint, Ply
    >>> ply = Ply(MeshQuad().refined(3), Fabric(1e4), OnePoint(stabilisation=1.0))
    >>> u = ply.basis.zeros()
    >>> float(ply.energy(u)), ply.residual(u).shape, ply.tangent(u).shape
    (0.0, (162,), (162, 162))
    """

    def __init__(self, mesh: Mesh, fabric: Fabric, formulation: Formulation) -> None:
        if not isinstance(fabric, Fabric):
            raise ValueError(
                f"fabric must be a Fabric, like Fabric(1e4), not {fabric!r}"
            )
        if isinstance(formulation, type) or not hasattr(formulation, "tension_term"):
            raise ValueError(
                f"formulation must be like Full() or OnePoint(), not {formulation!r}"
            )
        self.mesh = mesh
        self.fabric = fabric
        self.formulation = formulation
        self.basis = formulation.basis(mesh)
        check_laws(fabric, self.basis.dx.shape)
        self.nodes = node_positions(self.basis)
        self.centre, self.fine_points = formulation.centre, formulation.fine_points
        self.corners = Corners(self.basis)
        self._tension = None
        if not all(is_zero(family.tension) for family in fabric.families):
            self._tension = formulation.tension_term(self.basis, fabric)
        self.terms = self._needed_terms()
        for term in self.terms:  # refuses directions that are not valid
            directions(fabric, FormExtraParams(term.basis.default_parameters()))

    def _needed_terms(self) -> list[Term]:
        terms: list[Term] = [self._tension] if self._tension else []
        if not is_zero(self.fabric.shear_law):
            terms.append(Term("shear", shear(self.fabric), self.basis))
        if not terms:
            raise ValueError("the fabric has no stiffness: give it tension or shear")
        if (kappa := corner_stiffness(self.fabric, self.basis)) > 0:
            forms, corners = corner_resistance(kappa), self.corners
            terms.append(
                CornerTerm("corners", forms, basis=self.basis, corners=corners)
            )
        return terms + self.formulation.stabilising_terms(self.basis, self.fabric)

    @cached_property
    def _sum(self) -> Sum:
        return Sum(self.nodes.shape[1], self.terms)

    @property
    def pattern(self) -> Pattern:
        """Which nodes the tangent couples."""
        return self._sum.pattern

    def energies(self, u: ndarray) -> dict[str, float]:
        """Energy of each term in N·mm, by the name of the term."""
        return {term.name: self._energy(term, u) for term in self.terms}

    def _energy(self, term: Term, u: ndarray) -> float:
        stored = term.memory.work if term.memory else 0.0
        return self._sum.energy(u, term) + stored

    def energy(self, u: ndarray, corners: bool = True) -> float:
        """Internal energy in N·mm; ``corners`` as for `residual`."""
        return sum(self._energy(t, u) for t in self._acting(corners))

    def residuals(self, u: ndarray) -> dict[str, ndarray]:
        """Internal nodal forces of each term in N, by the name of the term."""
        return {t.name: self._sum.residual(u, [t]) for t in self.terms}

    def residual(self, u: ndarray, corners: bool = True) -> ndarray:
        """Internal nodal forces in N: the derivative of the energy.

        Parameters
        ----------
        u
            Displacement.
        corners
            Whether corners resist.
        """
        return self._sum.residual(u, self._acting(corners))

    def tangent(self, u: ndarray, tension: ndarray | None = None) -> csr_matrix:
        """Derivative of the residual in N/mm.

        Parameters
        ----------
        u
            Displacement.
        tension
            Fibre tensions to use in the geometric stiffness instead of those of
            ``u``, shape (2, n_elements, n_points).
        """
        return self.pattern.matrix(self.stiffness(u, tension))

    def stiffness(
        self, u: ndarray, tension: ndarray | None = None, corners: bool = True
    ) -> ndarray:
        """Blocks of the tangent in the order of ``pattern``, shape (n_blocks, 2, 2).

        Parameters
        ----------
        u, tension
            As for `tangent`.
        corners
            Whether corners resist.
        """
        given: dict[Term, dict[str, ndarray]] = {}
        if self._tension and tension is not None:
            given[self._tension] = {"tension": self._tension.arrange(tension)}
        return self._sum.stiffness(u, self._acting(corners), given)

    def _acting(self, corners: bool) -> list[Term]:
        """The terms, those of corners on demand."""
        return [t for t in self.terms if corners or not isinstance(t, LocalTerm)]

    def commit(self, u: ndarray) -> bool:
        """Make ``u`` the last converged state, for terms that remember one.

        The load stepper does this after each step; a Newton loop of one's own must,
        if the formulation has a memory (`OnePoint` of kind ``rate``, or with the
        stabilisation ``auto``).

        Returns
        -------
        bool
            Whether that changes the forces at ``u``.
        """
        changed = [t.memory.commit(u) for t in self.terms if t.memory is not None]
        return any(changed)

    @property
    def drift(self) -> tuple[float, float]:
        """Change of the energy with what the terms remember at the last commit, N·mm.

        And the energy of these terms before the change, without their stored work.
        """
        memories = [term.memory for term in self.terms if term.memory]
        return sum(m.drift for m in memories), sum(m.held for m in memories)

    def reset(self) -> None:
        """Forget every committed state."""
        for term in self.terms:
            if term.memory is not None:
                term.memory.reset()

    def gradient(self, u: ndarray, points: ndarray | None = None) -> ndarray:
        """Displacement gradient ∇u, shape (2, 2, n_elements, n_points).

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

    def deformation_gradient(
        self, u: ndarray, points: ndarray | None = None
    ) -> ndarray:
        """Deformation gradient F, shape (2, 2, n_elements, n_points)."""
        return kin.deformation_gradient(self.gradient(u, points))

    def area_ratio(self, u: ndarray, points: ndarray | None = None) -> ndarray:
        """Current area per reference area, det F, shape (n_elements, n_points)."""
        return kin.area_ratio(self.deformation_gradient(u, points))

    def fibre_strain(self, u: ndarray, points: ndarray | None = None) -> ndarray:
        """Fibre strain of warp and weft, shape (2, n_elements, n_points)."""
        F = self.deformation_gradient(u, points)
        return np.array([kin.fibre_strain(F, A) for A in self.directions(points)])

    def law_strain(self, u: ndarray) -> ndarray:
        """Fibre strain of warp and weft that the law of tension sees.

        At the ply's own points, shape (2, n_elements, n_points): the fibre strain
        there, or where fibres have the tension of the mean strain (`Macro`,
        `Quadratic` with a deviation) this mean.
        """
        strain = self.fibre_strain(u)
        return strain if self._tension is None else self._tension.seen(strain)

    def fibre_tension(self, u: ndarray) -> ndarray:
        """Tension of warp and weft in N/mm at the ply's own points.

        Shape (2, n_elements, n_points).
        """
        return self._tensions(self.fibre_strain(u))

    def predicted_tension(self, u: ndarray, du: ndarray) -> ndarray:
        """Fibre tensions after the increment ``du``, to first order in it.

        At the ply's own points, shape (2, n_elements, n_points): T(ε) + T′ ∂ε·∇du.
        """
        F, dF, A = self.deformation_gradient(u), self.gradient(du), self.directions()
        strain = [kin.fibre_strain(F, A_i) for A_i in A]
        change = [ddot(kin.fibre_strain_d(F, A_i), dF) for A_i in A]
        return self._tensions(np.array(strain), np.array(change))

    def _tensions(self, strain: ndarray, change: ndarray | float = 0.0) -> ndarray:
        if self._tension is None:
            return np.zeros_like(strain)
        return self._tension.law(strain, change)

    def fibre_direction(self, u: ndarray, points: ndarray | None = None) -> ndarray:
        """Current unit direction of warp and weft, (2, 2, n_elements, n_points).

        The first axis is the family, the second the component.
        """
        F = self.deformation_gradient(u, points)
        a = np.array([kin.fibre(F, A) for A in self.directions(points)])
        return a / np.linalg.norm(a, axis=1, keepdims=True)

    def shear_angle(self, u: ndarray, points: ndarray | None = None) -> ndarray:
        """Shear angle Γ in radians, shape (n_elements, n_points)."""
        F = self.deformation_gradient(u, points)
        return kin.shear_angle(F, *self.directions(points))

    def directions(self, points: ndarray | None = None) -> tuple[ndarray, ndarray]:
        """Unit reference directions of warp and weft at the points."""
        xi = self.basis.X if points is None else points
        return self.fabric.directions(self.basis.mapping.F(xi))

    def nodal(self, u: ndarray) -> ndarray:
        """A DOF vector as one column per node of ``nodes``, shape (2, n_nodes)."""
        return u[node_dofs(self.basis)]

    def __repr__(self) -> str:
        terms = ", ".join(term.name for term in self.terms)
        return (
            f"<Ply of {self.mesh.nelements} elements, {self.basis.N} unknowns, "
            f"{self.formulation}, terms: {terms}>"
        )
