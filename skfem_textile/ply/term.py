"""What a term is: the one way in for whatever has an energy or a force."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal, NamedTuple, Protocol, TypeAlias

import numpy as np
from numpy import ndarray
from scipy.sparse import csr_matrix
from skfem import CellBasis

#: What a term stands for: ``internal`` forces and ``stabilisation`` make the internal
#: energy, and a ``load`` works on the ply.
Role: TypeAlias = Literal["internal", "stabilisation", "load"]


#: What a memory depends on, see `Memory`.
DependsOn: TypeAlias = Literal["state", "path", "steps"]


class Contribution(NamedTuple):
    """A part of a ply: a term, or the part of one that meets deviations.

    ``role`` is a `Role` or ``deviation``, ``energy`` in N·mm, ``forces`` are nodal
    forces in N, shape (n_unknowns,).
    """

    role: str
    energy: float
    forces: ndarray


# How far a tangent may be from symmetric, as a share of its largest entry.
_SYMMETRIC = 1e-8


class Memory(Protocol):
    """What a term remembers of the last converged state.

    ``parameters`` are passed to its forms, ``work`` is what it has stored so far in
    N·mm: the term's energy form gives the rest.  ``depends_on`` says of what this is:
    of the ``state`` alone, so that the load stepper may find a state again with it; of
    the ``path`` to the state; or of the length of ``steps``, however short, so that no
    number of them resolves a path.
    """

    parameters: dict[str, ndarray]
    work: float = 0.0
    depends_on: DependsOn = "path"

    def begin(self) -> None:
        """Return to the undeformed state."""
        ...

    def commit(self, u: ndarray) -> bool:
        """Make ``u`` the last converged displacement; tell if that changes forces."""
        ...

    def restore(self, parameters: dict[str, ndarray], work: float) -> None:
        """Remember what was remembered at another state."""
        ...


class Term(Protocol):
    """Something with an energy: of the ply, of what it lies on, or of a load.

    ``u`` is a displacement of all nodes and ``t`` the load factor.  What has these
    members is a term; a class of one's own that derives from `Term` needs to define no
    more than ``name``, ``role`` and the three methods.

    Attributes
    ----------
    name
        Tells it from the other terms of a ply.
    role
        One of `Role`.
    memory
        What it remembers of the last converged state; None if nothing.
    """

    name: str
    role: Role
    memory: Memory | None = None

    def energy(self, u: ndarray, t: float) -> float:
        """Energy in N·mm; of a load its potential, −F·u of a constant force F."""
        ...

    def residual(self, u: ndarray, t: float) -> ndarray:
        """Derivative of the energy: nodal forces in N, shape (n_unknowns,)."""
        ...

    def tangent(self, u: ndarray, t: float) -> csr_matrix | None:
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
    kernel, basis
        What gives its numbers fast, if there is something, and where.
    fused
        Whether its numbers come from the kernel, together with those of other terms.
    nodes
        Nodes of its elements, shape (n_nodes, n_elements).
    """

    kernel: Any
    basis: Any
    fused: Any
    nodes: Any

    def matrices(self, u: ndarray, t: float, convex: bool = False) -> ndarray:
        """Blocks of the tangents of the elements, as `Pattern.sum` takes them.

        Where ``convex``, a term that can leaves out what is not.
        """
        raise NotImplementedError


class Load(Protocol):
    """Something that becomes a term on the basis of a ply's displacement."""

    def on(self, basis: CellBasis) -> Term:
        """The term."""
        ...


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

    def energy(self, u: ndarray, t: float) -> float:
        """½ u·K·u."""
        return 0.5 * float(u @ (self.matrix @ u))

    def residual(self, u: ndarray, t: float) -> ndarray:
        """K·u."""
        return self.matrix @ u

    def tangent(self, u: ndarray, t: float) -> csr_matrix:
        """K."""
        return csr_matrix(self.matrix)

    def misfit(self, basis: CellBasis) -> str:
        """Why it is no term on a basis of the displacement; empty where it is one."""
        N = basis.N
        fits = np.shape(self.matrix) == (N, N)
        return "" if fits else f"its matrix must be {N} × {N}"


def refuse_unsymmetric(name: str, difference: Any, matrix: Any) -> None:
    """Refuse a tangent that is no second derivative.

    Parameters
    ----------
    name
        Name of the term.
    difference
        The tangent less its transpose.
    matrix
        The tangent.

    Raises
    ------
    ValueError
        If it is not symmetric.
    """
    if abs(difference).max() > _SYMMETRIC * abs(matrix).max():
        raise ValueError(
            f"term {name!r}: its tangent is not symmetric, so it is not the second "
            "derivative of an energy; mend its forms, or leave out what has no energy"
        )
