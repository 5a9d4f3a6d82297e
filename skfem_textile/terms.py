"""Terms of the internal energy of a ply, and what they remember."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

from numpy import ndarray
from skfem import CellBasis

from .continuity import JumpBasis
from .forms import Forms
from .kernels import Kernel


class Memory(Protocol):
    """What a term remembers of the last converged state.

    ``parameters`` are passed to its forms, ``work`` is what it has stored so far in
    N·mm: the term's energy form gives the rest.  ``drift`` is by how much that form
    changed when the term last changed what it remembers, ``held`` its value before.
    """

    parameters: dict[str, ndarray]
    work: float
    drift: float
    held: float

    def reset(self) -> None:
        """Return to the undeformed state."""
        ...

    def commit(self, u: ndarray) -> bool:
        """Make ``u`` the last converged displacement; tell if that changes forces."""
        ...


@dataclass(frozen=True, eq=False)
class Term:
    """A term of the internal energy, the basis on which it is assembled, its memory."""

    name: str
    forms: Forms
    basis: CellBasis | JumpBasis
    memory: Memory | None = None

    @property
    def kernel(self) -> Kernel | None:
        """What gives the numbers of the forms fast; not all have one."""
        return self.forms.tangent.params.get("kernel")


class LocalTerm(Term):
    """A term at work in a few elements, which depend on the displacement.

    It couples no nodes but those of an element of ``basis``.
    """

    def acting(self, u: ndarray) -> CellBasis | None:
        """Basis of where the term is at work at ``u``; None where it is not."""
        raise NotImplementedError


@dataclass(frozen=True, eq=False, kw_only=True)
class TensionTerm(Term):
    """The term of the fibres.

    ``law`` gives their tensions at the ply's own points after a change of the fibre
    strains, ``(strain, change) -> tension``, to first order in it; ``seen`` gives, of
    the strains at these points, those that the fabric's law sees there; all have the
    shape (2, n_elements, n_points).  ``arrange`` puts them at the points of ``basis``.
    """

    law: Callable[..., ndarray]
    seen: Callable[[ndarray], ndarray]
    arrange: Callable[[ndarray], ndarray]
