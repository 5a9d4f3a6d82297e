"""Term protocol: energy, residual and tangent of one part of a ply."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any, Literal, NamedTuple, Protocol, TypeAlias, TypeVar

import numpy as np
from numpy import ndarray
from scipy.sparse import csr_matrix
from skfem import CellBasis

T = TypeVar("T")

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


class Frozen(Mapping[str, T]):
    """An immutable mapping, which can be copied and pickled."""

    __slots__ = ("_items",)

    def __init__(self, items: Mapping[str, T] = MappingProxyType({})) -> None:
        self._items = dict(items)

    def __getitem__(self, name: str) -> T:
        return self._items[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._items)

    def __len__(self) -> int:
        return len(self._items)

    def __repr__(self) -> str:
        return f"{type(self).__name__}({', '.join(self)})"


class Values(Frozen[ndarray]):
    """Read-only arrays by name, on which a term's energy depends beside u and t.

    Parameters
    ----------
    arrays
        The arrays, which are copied unless they are read-only.
    """

    __slots__ = ()

    def __init__(self, arrays: Mapping[str, Any] = MappingProxyType({})) -> None:
        super().__init__({name: _read_only(array) for name, array in arrays.items()})

    def same_as(self, other: "Values") -> bool:
        """Whether other values are equal arrays under the same names."""
        return self is other or (
            list(self) == list(other)
            and all(np.array_equal(self[name], other[name]) for name in self)
        )


#: Values of the terms of a ply that have parameters, by the names of the terms.
PlyParameters: TypeAlias = Mapping[str, Values]

#: The values of a term without parameters.
NO_VALUES = Values()


def _read_only(array: Any) -> ndarray:
    array = np.asarray(array)
    if array.flags.writeable:
        array = array.copy()
        array.flags.writeable = False
    return array


class TermParameters(Protocol):
    """Declaration of the parameters of a term: value at rest and two update rules.

    Both rules are pure: they return new values and change nothing.  A class that
    derives from this one defines ``at_rest`` and one or both of the rules.  Values
    named ``work`` are an energy in N·mm that the term has stored so far; `FormTerm`
    adds it to its energy form.

    Attributes
    ----------
    depends_on_steps
        Whether the values depend on the length of the steps however short these are,
        so that no number of steps resolves a load path.
    """

    depends_on_steps: bool = False

    def at_rest(self) -> Values:
        """Values of the undeformed ply."""
        ...

    def updated(
        self, values: Values, u: ndarray, t: float, tension: ndarray | None = None
    ) -> Values:
        """Values updated within an iteration, such as stiffnesses at a state.

        Parameters
        ----------
        values
            The values before.
        u, t
            Displacement and load factor.
        tension
            Predicted fibre tensions, which replace those at ``u``, shape (2,
            n_elements, n_points), as `Ply.geometric_tension` returns them.
        """
        return values

    def advanced(self, values: Values, u: ndarray, t: float) -> Values:
        """Values updated once a step, at its converged displacement ``u``."""
        return values


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
    kernel, basis
        What gives its numbers fast, if there is something, and where.
    fused
        Whether its numbers come from the kernel, together with those of other terms.
    nodes
        Nodes of its elements, shape (n_nodes, n_elements).
    """

    kernel: Any = None
    basis: Any = None
    fused: Any = False
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
