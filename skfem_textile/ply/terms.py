"""Terms of a ply: their protocols, and those given by forms, a matrix or a vector.

A term gives its tangent in one of two ways: as a sparse matrix (`Term`), or as matrices
of elements (`ElementTerm`).
"""

from collections.abc import Callable, Sequence
from dataclasses import KW_ONLY, dataclass
from functools import cached_property
from typing import Any, ClassVar, Literal, NamedTuple, Protocol, TypeAlias

import numpy as np
from numpy import ndarray
from scipy.sparse import csr_matrix
from skfem import CellBasis, Mesh, asm
from skfem.assembly.basis import AbstractBasis

from ..fabric import Fabric
from ..forms import Forms
from ..mesh.bases import components, element_numbers
from ..mesh.pattern import refuse_unsymmetric
from ..mesh.user_input import call_user_function, real_numbers
from .kernels.kernel import Kernel, can_compute, node_pair_blocks
from .kernels.kernel_forms import with_kernel
from .parameters import NO_VALUES, TermParameters, Values

#: What a term stands for: ``internal`` forces and ``stabilisation`` make the internal
#: energy, and a ``load`` works on the ply.
Role: TypeAlias = Literal["internal", "stabilisation", "load"]


class Contribution(NamedTuple):
    """A part of a ply: a term, or the part of one that meets deviations.

    ``role`` is a `Role` or ``deviation``, ``energy`` in N·mm, ``forces`` are nodal
    forces in N, shape (n_unknowns,).
    """

    role: str
    energy: float
    forces: ndarray


class Term(Protocol):
    """Something with an energy: of the ply, of what it lies on, or of a load.

    ``u`` is a displacement of all nodes, ``t`` the load factor and ``p`` the values of
    the term's own parameters (`Values`, empty without parameters).  Energy, residual
    and tangent are pure functions of these three.  A class that derives from `Term`
    defines ``name``, ``role`` and the three methods.

    Attributes
    ----------
    name
        Name, unique among the terms of a ply.
    role
        One of `Role`.
    parameters
        Declaration of the term's parameters; None without parameters.
    line_search
        Whether increments are shortened until the energy falls: for energies with
        kinks or steep walls, such as a contact, where whole increments overshoot.
    """

    name: str
    role: Role
    parameters: TermParameters | None = None
    line_search: bool = False

    def energy(self, u: ndarray, t: float, p: Values) -> float:
        """Energy in N·mm; of a load its potential, −F·u of a constant force F."""
        ...

    def residual(self, u: ndarray, t: float, p: Values) -> ndarray:
        """Derivative of the energy: nodal forces in N, shape (n_unknowns,)."""
        ...

    def tangent(self, u: ndarray, t: float, p: Values) -> csr_matrix | None:
        """Derivative of the residual in N/mm, symmetric; None where it vanishes."""
        ...

    def couples(self) -> Sequence[ndarray] | None:
        """Nodes that the tangent couples, beside those of each of the ply's elements.

        Arrays of shape (n_nodes, n): the nodes of a column all couple.  None for those
        that the tangent at rest couples.
        """
        return None


class ElementTerm(Term):
    """A term whose tangent is a sum of matrices of elements.

    Attributes
    ----------
    nodes
        Nodes of its elements, shape (n_nodes, n_elements).
    """

    nodes: Any

    def matrices(self, u: ndarray, t: float, p: Values) -> ndarray | None:
        """Blocks of the tangents of the elements, as `Pattern.sum` takes them.

        None where all vanish.
        """
        raise NotImplementedError


class Load(Protocol):
    """Something that becomes a term on the basis of a ply's displacement."""

    def on(self, basis: CellBasis) -> Term:
        """The term."""
        ...


@dataclass(frozen=True, eq=False)
class FormTerm(ElementTerm):
    """A term given by scikit-fem forms.

    Parameters
    ----------
    name
        Tells it from the other terms of a ply.
    forms
        Energy, residual and tangent.  They find the displacement in ``w["u"]``, the
        load factor in ``w["t"]``, the numbers of the elements in ``w["element"]``, and
        the values of the parameters by their names, except ``work``.
    basis
        Any scikit-fem basis of the displacement: of all elements or some, of the
        facets of a boundary, of interior facets.
    kernel
        Gives the numbers of the forms fast, on the bases that it takes, together with
        those of other terms.
    role
        One of `Role`.
    parameters
        Declaration of the term's parameters.

    Examples
    --------
    An elastic foundation of 0.1 N/mm per mm² under a ply:

    >>> from skfem import BilinearForm, Functional, LinearForm, MeshQuad
    >>> from skfem.helpers import dot
    >>> from skfem_textile import Fabric, Forms, FormTerm, Full, Ply
    >>> forms = Forms(
    ...     Functional(lambda w: 0.05 * dot(w["u"], w["u"])),
    ...     LinearForm(lambda v, w: 0.1 * dot(w["u"], v)),
    ...     BilinearForm(lambda u, v, w: 0.1 * dot(u, v)),
    ... )
    >>> ply = Ply(MeshQuad(), Fabric(1e4), Full())
    >>> ply = ply.with_terms(FormTerm("foundation", forms, ply.basis))
    >>> round(ply.energies(ply.basis.zeros() + 1.0)["foundation"], 12)
    0.1
    """

    name: str
    forms: Forms
    basis: AbstractBasis
    kernel: Kernel | None = None
    _: KW_ONLY
    role: Role = "internal"
    parameters: TermParameters | None = None

    def energy(self, u: ndarray, t: float, p: Values = NO_VALUES) -> float:
        """The energy form, and the work stored so far."""
        return float(self._asm(self._forms.energy, u, t, p)) + float(p.get("work", 0.0))

    def residual(self, u: ndarray, t: float, p: Values = NO_VALUES) -> ndarray:
        """The residual form."""
        return self._asm(self._forms.residual, u, t, p)

    def tangent(self, u: ndarray, t: float, p: Values = NO_VALUES) -> csr_matrix:
        """The tangent form."""
        return self._asm(self._forms.tangent, u, t, p)

    def misfit(self, basis: CellBasis) -> str:
        """Why it is no term on a basis of the displacement; empty where it is one."""
        if _same_unknowns(self.basis, basis):
            return ""
        return "its basis is not one of the displacement: build it on ply.mesh"

    @property
    def nodes(self) -> ndarray:
        """Nodes of the elements of the basis, shape (n_nodes, n_elements)."""
        d = components(self.basis)
        return self.basis.element_dofs[::d] // d

    def matrices(self, u: ndarray, t: float, p: Values = NO_VALUES) -> ndarray:
        """See `ElementTerm`."""
        basis: Any = self.basis
        form, size = self.forms.tangent, basis.Nbfun
        K = form.elemental(basis, u=u, **self._given(t, p)).data
        K = K.reshape(size, size, -1)
        refuse_unsymmetric(self.name, K - K.swapaxes(0, 1), K)
        return node_pair_blocks(K, self.nodes, components(basis))

    @cached_property
    def _forms(self) -> Forms:
        return with_kernel(self.forms, self.kernel) if self.kernel else self.forms

    def _asm(self, form: Any, u: ndarray, t: float, p: Values) -> Any:
        return asm(form, self.basis, u=u, **self._given(t, p))

    def _given(self, t: float, p: Values) -> dict[str, Any]:
        """Parameters of the forms beside the displacement."""
        values = {name: value for name, value in p.items() if name != "work"}
        return {"t": t, "element": element_numbers(self.basis), **values}


@dataclass(frozen=True, eq=False, kw_only=True)
class TensionTerm(FormTerm):
    """The term of the fibres, whose kernel predicts their tensions.

    Where fibres have the tension of the mean stretch, ``basis`` is a `MeanBasis`, and
    ``of_means`` are values with which the forms leave out deviations from the mean.

    Raises
    ------
    ValueError
        If it has no kernel that takes the basis.
    """

    of_means: Values | None = None

    def __post_init__(self) -> None:
        if not can_compute(self.kernel, self.basis):
            raise ValueError(
                f"term {self.name!r}: the term of the fibres needs a kernel that takes "
                "its basis"
            )


@dataclass(frozen=True, eq=False)
class MatrixTerm(Term):
    """A constant stiffness: springs, or a structure condensed to its matrix.

    Parameters
    ----------
    name
        Tells it from the other terms of a ply.
    matrix
        Symmetric, shape (n_unknowns, n_unknowns), N/mm: the energy is ½ u·K·u.
    role
        One of `Role`.
    """

    name: str
    matrix: Any
    role: Role = "internal"

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
        """Why it is no term on a basis of the displacement; empty where it is one."""
        N = basis.N
        fits = np.shape(self.matrix) == (N, N)
        return "" if fits else f"its matrix must be {N} × {N}"


#: A function of the load factor, or a number.
Factor: TypeAlias = Callable[[float], float] | float


def proportional(t: float) -> float:
    """The load factor itself."""
    return t


@dataclass(frozen=True, eq=False)
class VectorTerm(Term):
    """Constant nodal forces, times a function of the load factor.

    Parameters
    ----------
    name
        Tells it from the other terms of a ply.
    vector
        Forces in N, shape (n_unknowns,).
    factor
        Function of the load factor; a number for forces that are there from the start.
    role
        One of `Role`.
    """

    name: str
    vector: ndarray
    factor: Factor = proportional
    role: Role = "load"

    def energy(self, u: ndarray, t: float, p: Values = NO_VALUES) -> float:
        """Potential −g(t) F·u."""
        return -self._factor_at(t) * float(self.vector @ u)

    def residual(self, u: ndarray, t: float, p: Values = NO_VALUES) -> ndarray:
        """−g(t) F."""
        return -self._factor_at(t) * self.vector

    def tangent(self, u: ndarray, t: float, p: Values = NO_VALUES) -> None:
        """None."""

    def misfit(self, basis: CellBasis) -> str:
        """Why it is no term on a basis of the displacement; empty where it is one."""
        N = basis.N
        fits = np.shape(self.vector) == (N,) and bool(np.isfinite(self.vector).all())
        return "" if fits else f"its vector must be {N} finite numbers"

    def _factor_at(self, t: float) -> float:
        return factor_at(f"term {self.name!r}", self.factor, t)


def factor_at(owner: str, factor: Factor, t: float) -> float:
    """A factor at the load factor t, refused if it is no finite number."""
    subject, answer = f"{owner}: its factor", factor
    if callable(factor):
        answer = call_user_function(subject, factor, t)
    value = real_numbers(subject, answer)
    if value.shape or not np.isfinite(value):
        raise ValueError(f"{subject} must be a finite number, got {answer} at {t:g}")
    return float(value)


class Formulation(Protocol):
    """Element and points of tension and shear, and the stabilising terms.

    ``centre`` is that of the reference element, ``fine_points`` are those in it at
    which folding and strain are judged, shape (2, n_points).
    """

    name: ClassVar[str]
    centre: ClassVar[ndarray]
    fine_points: ClassVar[ndarray]

    @property
    def title(self) -> str:
        """What to call it in a picture."""
        ...

    def working_mesh(self, mesh: Mesh) -> Mesh:
        """The mesh on which it works: the user's, or this split or cut.

        Raises
        ------
        MeshError
            If the user's mesh is not sound, or cannot be split or cut.
        """
        ...

    def basis(self, mesh: Mesh, dimension: int = 2) -> CellBasis:
        """Basis of the displacement, with the points of tension and shear.

        ``mesh`` is a `working_mesh`, ``dimension`` the number of components.

        Raises
        ------
        MeshError
            If the mesh is not sound.
        """
        ...

    def tension_term(self, basis: CellBasis, fabric: Fabric) -> TensionTerm:
        """The term of the fibres; ``basis`` is that of the displacement."""
        ...

    def stabilising_terms(self, basis: CellBasis, fabric: Fabric) -> list[Term]:
        """Terms beyond tension and shear.

        ``basis`` is that of the tension term, if there is one, else that of the
        displacement.
        """
        ...


def _same_unknowns(other: Any, basis: CellBasis) -> bool:
    """Whether a basis has the unknowns of that of the displacement, node by node."""
    if not isinstance(other, AbstractBasis):
        return False
    if (other.N, components(other)) != (basis.N, components(basis)):
        return False
    mesh, ply_mesh = other.mesh, basis.mesh
    return mesh is ply_mesh or (
        np.array_equal(mesh.p, ply_mesh.p) and np.array_equal(mesh.t, ply_mesh.t)
    )
