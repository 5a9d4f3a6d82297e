"""Terms of a ply: protocols, and terms given by forms, a matrix or a vector.

A term returns its tangent as a sparse matrix (`Term`) or as element matrices
(`ElementTerm`).
"""

from collections.abc import Sequence
from dataclasses import KW_ONLY, dataclass
from functools import cached_property
from typing import Any, ClassVar, Literal, NamedTuple, Protocol, TypeAlias

import numpy as np
from numpy import ndarray
from scipy.sparse import csr_matrix
from skfem import AbstractBasis, CellBasis, Mesh, asm

from ..fabric import Fabric
from ..fabric.law import keep
from ..forms import Forms
from ..forms.kernels.kernel import Kernel, can_compute, node_pair_blocks
from ..mesh.bases import components, element_numbers
from ..mesh.pattern import Pattern, refuse_unsymmetric
from ..mesh.user_input import keep_copies
from .amount import Amount, AmountLike, proportional
from .parameters import NO_VALUES, TermParameters, Values

#: Role of a term: ``internal`` and ``stabilisation`` terms make up the internal energy,
#: a ``load`` does work on the ply.
Role: TypeAlias = Literal["internal", "stabilisation", "load"]


class Contribution(NamedTuple):
    """Contribution to a ply: a term, or its part due to deviations.

    ``role`` is a `Role` or ``deviation``, ``energy`` is in N·mm, ``forces`` are nodal
    forces in N, shape (n_unknowns,).
    """

    role: str
    energy: float
    forces: ndarray


class Term(Protocol):
    """Term with an energy: of the ply, of a foundation or tool, or of a load.

    ``u`` is a displacement of all nodes, ``t`` the load factor and ``p`` the parameter
    values of the term (`Values`, empty without parameters).  Energy, residual and
    tangent are pure functions of these three.  A class derived from `Term` defines
    ``name``, ``role`` and the three methods.

    Attributes
    ----------
    name
        Name, unique among the terms of a ply.
    role
        One of `Role`.
    parameters
        Declaration of the term's parameters; None without parameters.
    line_search
        True if increments are shortened until the energy decreases: for energies with
        kinks or steep walls, such as contact, where full increments overshoot.
    balances
        True for a load that leaves the supports of the ply without reactions.
    release
        Resultant in N at which a clamp lets go, infinite if it never does; None for
        other terms.
    amounts
        Amounts that the steps of a run must not miss, such as factors of loads.
    """

    name: str
    role: Role
    amounts: Sequence[Amount] = ()
    parameters: TermParameters | None = None
    line_search: bool = False
    balances: bool = False
    release: float | None = None

    def energy(self, u: ndarray, t: float, p: Values) -> float:
        """Energy in N·mm; for a load its potential, −F·u for a constant force F."""
        ...

    def residual(self, u: ndarray, t: float, p: Values) -> ndarray:
        """Derivative of the energy: nodal forces in N, shape (n_unknowns,)."""
        ...

    def tangent(self, u: ndarray, t: float, p: Values) -> csr_matrix | None:
        """Derivative of the residual in N/mm, symmetric; None if it is zero."""
        ...

    def balanced(self, p: Values, motions: ndarray, work: ndarray) -> Values:
        """Parameter values of a load that does further work; see ``balances``.

        Parameters
        ----------
        p
            Previous values.
        motions
            Displacements of all nodes, shape (n_motions, n_unknowns).
        work
            Further work over each of them in N·mm, shape (n_motions,).
        """
        return p

    def couples(self) -> Sequence[ndarray] | None:
        """Pairs of nodes coupled by the tangent, besides those within elements.

        Arrays of shape (n_nodes, n): the nodes of a column are all coupled.  None for
        those coupled by the tangent at rest.
        """
        return None


class ElementTerm(Term):
    """Term whose tangent is a sum of element matrices.

    Attributes
    ----------
    nodes
        Nodes of its elements, shape (n_nodes, n_elements).
    """

    nodes: Any

    def matrices(self, u: ndarray, t: float, p: Values) -> ndarray | None:
        """Blocks of the element matrices, as arguments of `Pattern.sum`.

        None if all are zero.
        """
        raise NotImplementedError

    def tangent(self, u: ndarray, t: float, p: Values = NO_VALUES) -> csr_matrix | None:
        """Sum of the element matrices; see `Term`."""
        if (matrices := self.matrices(u, t, p)) is None:
            return None
        d = matrices.shape[1]
        pattern = Pattern(d, len(u) // d, [self.nodes])
        return pattern.matrix(pattern.sum([matrices]))


#: Stiffness of a gap in the tangent, relative to the contact stiffness.  It holds a ply
#: that nothing touches, and has no force.  It is far above the round-off of the contact
#: stiffness, and far below the stiffness of the free corners of a slack ply: with 1e-9
#: and a bending stiffness of 0.15 N·mm at 3·10⁵ N/mm they do not converge (`pytest
#: tests/contact/test_stiff_fibres.py`).
STIFFNESS_OF_GAP = 1e-12


class ContactTerm(Term):
    """Contact of a ply with a tool that moves with the load factor, or of two plies.

    Contact forces λ ≥ 0 and gaps g ≥ 0 with λ g = 0 satisfy λ = max(λ − κ g, 0) for any
    κ > 0: they are a stationary point of the augmented Lagrangian Σ (max(λ − κ g, 0)² −
    λ²)/2κ.  A derived class defines the gaps, and the parameter values ``force`` and
    ``stiffness``, λ in N and κ in N/mm of each node, shape (n_nodes,).  There is no
    contact with κ = 0.

    Attributes
    ----------
    points
        Weights with which the nodes determine the contact point of each node, at which
        the gap is evaluated, shape (n_nodes, n_nodes); see `contact_points`.
    friction
        `contact.friction.Friction` of the tool, or None.
    of_plies
        True for the contact of two plies.
    """

    role = "load"
    points: csr_matrix
    friction: Any = None
    of_plies: ClassVar[bool] = False

    @staticmethod
    def check(ply: Any, moved: float) -> None:
        """Refuse the contact terms of this class in a ply, before a run.

        Raises a ValueError if they leave no room for the ply or never touch it;
        ``moved`` is the largest displacement in mm that conditions prescribe.
        """

    @staticmethod
    def figures(result: Any) -> dict[str, Any]:
        """Figures of the contact terms of this class in the summary of a result."""
        return {}

    def gaps(self, u: ndarray, t: float, p: Values = NO_VALUES) -> ndarray:
        """Distances g of the contact points from the tool in mm, shape (n_nodes,).

        Infinite for nodes that the tool cannot touch, which parameters may determine.
        """
        raise NotImplementedError

    def gaps_at(self, x: ndarray, t: float) -> ndarray:
        """Distances of points, shape (3, n), from the tool in mm, shape (n,)."""
        raise NotImplementedError

    def normals(self, u: ndarray, t: float) -> ndarray:
        """Unit normals of the tool at the contact points, shape (3, n_nodes)."""
        raise NotImplementedError

    def relative(self, u: ndarray) -> csr_matrix:
        """Weights of the nodes in the motions that change the gaps along the normals.

        Shape (n_nodes, n_nodes): the ``points``, of two plies relative to each other.
        """
        return self.points

    def coupled(self, u: ndarray, p: Values) -> Sequence[csr_matrix]:
        """Weights of the nodes that the tangent couples, of normal forces and friction.

        Those of normal forces are ``relative`` without round-off.
        """
        return (self.points,)

    def around(self, u: ndarray) -> csr_matrix:
        """Matrix in whose rows are all nodes of the elements on each other."""
        return self.points

    def blocks(
        self, u: ndarray, t: float, p: Values
    ) -> Sequence[tuple[csr_matrix, ndarray]]:
        """Tangent as sums over points: weights of the nodes, and blocks (3, 3, n)."""
        raise NotImplementedError

    def curved(self, u: ndarray, t: float, forces: ndarray) -> tuple[ndarray, ndarray]:
        """Second derivatives Σ λ ∇²g by contact points, for forces λ of all nodes.

        Numbers of the points, shape (n,), and a block for each, shape (3, 3, n).
        """
        raise NotImplementedError

    def forces(self, u: ndarray, t: float, p: Values) -> ndarray:
        """Contact forces max(λ − κ g, 0) in N, shape (n_nodes,)."""
        raise NotImplementedError

    def travel(self, t: float) -> ndarray:
        """Translation of the tool from its initial position in mm, shape (3,)."""
        raise NotImplementedError

    def rotation(self, t: float) -> float:
        """Angle of the rotation of the tool from its initial position in radians."""
        raise NotImplementedError

    def passed(self, u_0: ndarray, t_0: float, u: ndarray, t: float) -> ndarray:
        """Numbers of nodes that pass through the tool between two states."""
        raise NotImplementedError

    def crosses_outline(self, u: ndarray, t: float, p: Values) -> bool:
        """True if nodes that touch cross its outline in a step that is too long."""
        return False


class Load(Protocol):
    """Object from which a term is built on a displacement basis of a ply."""

    def on(self, basis: CellBasis) -> Term:
        """Term on the basis."""
        ...


@dataclass(frozen=True, eq=False)
class FormTerm(ElementTerm):
    """Term given by scikit-fem forms.

    Parameters
    ----------
    name
        Unique name among the terms of a ply.
    forms
        Energy, residual and tangent, with the displacement in ``w["u"]``, the load
        factor in ``w["t"]``, the element numbers in ``w["element"]``, and the parameter
        values by name, except ``work``.
    basis
        Any scikit-fem basis of the displacement: on all or some elements, on boundary
        facets, or on interior facets.
    role
        ``"internal"`` or ``"stabilisation"`` for an elastic energy, ``"load"`` for the
        potential of a load.
    parameters
        Declaration of the term's parameters.

    Examples
    --------
    An elastic foundation of 0.1 N/mm per mm² under a ply:

    >>> from skfem import BilinearForm, CellBasis, Functional, LinearForm, MeshQuad
    >>> from skfem.helpers import dot
    >>> from skfem_textile import Fabric, Forms, FormTerm, Ply
    >>> forms = Forms(
    ...     Functional(lambda w: 0.05 * dot(w["u"], w["u"])),
    ...     LinearForm(lambda v, w: 0.1 * dot(w["u"], v)),
    ...     BilinearForm(lambda u, v, w: 0.1 * dot(u, v)),
    ... )
    >>> ply = Ply(MeshQuad(), Fabric(1e4))
    >>> cells = CellBasis(ply.mesh, ply.basis.elem)
    >>> ply = ply.with_terms(FormTerm("foundation", forms, cells))
    >>> round(ply.energies(ply.basis.zeros() + 1.0)["foundation"], 12)
    0.1
    """

    name: str
    forms: Forms
    basis: AbstractBasis
    _: KW_ONLY
    role: Role = "internal"
    parameters: TermParameters | None = None

    def energy(self, u: ndarray, t: float, p: Values = NO_VALUES) -> float:
        """Energy form, plus the accumulated work."""
        return float(self._asm(self.forms.energy, u, t, p)) + float(p.get("work", 0.0))

    def residual(self, u: ndarray, t: float, p: Values = NO_VALUES) -> ndarray:
        """Assembled residual form."""
        return self._asm(self.forms.residual, u, t, p)

    def tangent(self, u: ndarray, t: float, p: Values = NO_VALUES) -> csr_matrix:
        """Tangent form."""
        return self._asm(self.forms.tangent, u, t, p)

    def misfit(self, basis: CellBasis) -> str:
        """Reason why the term does not fit a basis; empty if it does."""
        if _same_unknowns(self.basis, basis):
            return ""
        return "its basis is not a basis of the displacement: build it on ply.mesh"

    @cached_property
    def nodes(self) -> ndarray:
        """Nodes of the elements of the basis, shape (n_nodes, n_elements)."""
        d = components(self.basis)
        return self.basis.element_dofs[::d] // d

    def matrices(self, u: ndarray, t: float, p: Values = NO_VALUES) -> ndarray:
        """See `ElementTerm`."""
        basis: Any = self.basis
        form, size = self.forms.tangent, basis.Nbfun
        K = form.elemental(basis, u=u, **self._form_parameters(t, p)).data
        K = K.reshape(size, size, -1)
        refuse_unsymmetric(self.name, K - K.swapaxes(0, 1), K)
        return node_pair_blocks(K, self.nodes, components(basis))

    @cached_property
    def kernel(self) -> Kernel | None:
        """Kernel of the forms, if it supports the basis."""
        kernel = self.forms.kernel
        return kernel if can_compute(kernel, self.basis) else None

    def _asm(self, form: Any, u: ndarray, t: float, p: Values) -> Any:
        return asm(form, self.basis, u=u, **self._form_parameters(t, p))

    def _form_parameters(self, t: float, p: Values) -> dict[str, Any]:
        """Parameters of the forms besides the displacement."""
        values = {name: value for name, value in p.items() if name != "work"}
        return {"t": t, "element": element_numbers(self.basis), **values}


@dataclass(frozen=True, eq=False, kw_only=True)
class TensionTerm(FormTerm):
    """Tension term, whose kernel predicts fibre tensions.

    If the law is evaluated at the mean stretch, ``basis`` is a `MeanBasis`, and
    ``of_means`` are values with which the forms exclude deviations from the mean.

    Raises
    ------
    ValueError
        If the term has no kernel that supports the basis.
    """

    of_means: Values | None = None

    def __post_init__(self) -> None:
        if self.kernel is None:
            raise ValueError(
                f"term {self.name!r}: the tension term needs a kernel that supports "
                "its basis"
            )


@dataclass(frozen=True, eq=False)
class MatrixTerm(Term):
    """Constant stiffness: springs, or a structure condensed to its matrix.

    Parameters
    ----------
    name
        Unique name among the terms of a ply.
    matrix
        Symmetric, shape (n_unknowns, n_unknowns), N/mm: the energy is ½ u·K·u.
    role
        One of `Role`.
    """

    name: str
    matrix: Any
    role: Role = "internal"

    def __post_init__(self) -> None:
        keep_copies(self, "matrix")

    def energy(self, u: ndarray, t: float, p: Values = NO_VALUES) -> float:
        """½ u·K·u."""
        return 0.5 * float(u @ (self.matrix @ u))

    def residual(self, u: ndarray, t: float, p: Values = NO_VALUES) -> ndarray:
        """K·u."""
        return self.matrix @ u

    def tangent(self, u: ndarray, t: float, p: Values = NO_VALUES) -> csr_matrix:
        """K."""
        return csr_matrix(self.matrix)

    def misfit(self, basis: CellBasis) -> str:
        """Reason why the term does not fit a basis; empty if it does."""
        N = basis.N
        fits = np.shape(self.matrix) == (N, N)
        return "" if fits else f"its matrix must be {N} × {N}"


@dataclass(frozen=True, eq=False)
class VectorTerm(Term):
    """Constant nodal forces, scaled by a function of the load factor.

    Parameters
    ----------
    name
        Unique name among the terms of a ply.
    vector
        Forces in N, shape (n_unknowns,).
    factor
        Function of the load factor; a number for forces that act from the start.
    role
        One of `Role`.
    """

    name: str
    vector: ndarray
    factor: AmountLike = proportional
    role: Role = "load"

    def __post_init__(self) -> None:
        factor = Amount(f"term {self.name!r}: its factor", self.factor)
        keep(self, amounts=(factor,))
        keep_copies(self, "vector")

    def energy(self, u: ndarray, t: float, p: Values = NO_VALUES) -> float:
        """Potential −g(t) F·u."""
        return -self.amounts[0](t) * float(self.vector @ u)

    def residual(self, u: ndarray, t: float, p: Values = NO_VALUES) -> ndarray:
        """−g(t) F."""
        return -self.amounts[0](t) * self.vector

    def tangent(self, u: ndarray, t: float, p: Values = NO_VALUES) -> None:
        """None: the force does not depend on the displacement."""

    def misfit(self, basis: CellBasis) -> str:
        """Reason why the term does not fit a basis; empty if it does."""
        N = basis.N
        fits = np.shape(self.vector) == (N,) and bool(np.isfinite(self.vector).all())
        return "" if fits else f"its vector must be {N} finite numbers"


def named_edges(what: str, mesh: Mesh, name: str) -> ndarray:
    """Numbers of the edges of a boundary, by its name; ``what`` is for messages."""
    boundaries = mesh.boundaries or {}
    if name not in boundaries:
        names = ", ".join(map(repr, boundaries)) or "none"
        raise ValueError(
            f"{what}: the mesh has no boundary {name!r} (available: {names})"
        )
    return np.unique(boundaries[name])


class Formulation(Protocol):
    """Element, integration points of tension and shear, and stabilisation terms.

    Folding and strain are checked at the ``fine_points``, shape (2, n_points).
    """

    name: ClassVar[str]
    fine_points: ClassVar[ndarray]

    @property
    def title(self) -> str:
        """Name in pictures."""
        ...

    def working_mesh(self, mesh: Mesh) -> Mesh:
        """Computational mesh: the user's mesh, unchanged, split or cut.

        Raises
        ------
        MeshError
            If the user's mesh is not valid, or cannot be split or cut.
        """
        ...

    def basis(self, mesh: Mesh, dimension: int = 2) -> CellBasis:
        """Basis of the displacement, with the integration points of tension and shear.

        ``mesh`` is a result of `working_mesh`, ``dimension`` the number of components.

        Raises
        ------
        MeshError
            If the mesh is not valid.
        """
        ...

    def tension_term(self, basis: CellBasis, fabric: Fabric) -> TensionTerm:
        """Tension term; ``basis`` is a basis of the displacement."""
        ...

    def stabilising_terms(self, basis: CellBasis, fabric: Fabric) -> list[Term]:
        """Terms besides tension and shear.

        ``basis`` is the basis of the tension term or, without one, a basis of the
        displacement.
        """
        ...

    def reference(self, mesh: Mesh) -> "Formulation":
        """Formulation with the same unknowns whose numerical stiffness is not zero.

        Numerical is the stiffness of stabilisation and deviations; ``mesh`` is a result
        of `working_mesh`.  The error of a state is estimated with this formulation.
        """
        ...

    def log_range(self, mesh: Mesh) -> float:
        """Logarithm of a factor by which the numerical stiffness may be wrong.

        The half-width of the error interval is the change of a result that belongs to
        this factor, to first order.
        """
        ...


def _same_unknowns(other: Any, basis: CellBasis) -> bool:
    """True if the unknowns of a basis are the displacements, node by node."""
    if not isinstance(other, AbstractBasis):
        return False
    if (other.N, components(other)) != (basis.N, components(basis)):
        return False
    mesh, ply_mesh = other.mesh, basis.mesh
    return mesh is ply_mesh or (
        np.array_equal(mesh.p, ply_mesh.p) and np.array_equal(mesh.t, ply_mesh.t)
    )
