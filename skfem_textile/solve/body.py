"""What the nonlinear solver needs of a ply."""

from typing import Protocol

from numpy import ndarray
from skfem import CellBasis

from ..fabric import Fabric
from ..fabric.law import LawEnd
from ..mesh.pattern import Pattern
from ..ply.parameters import PlyParameters
from ..ply.terms import Term


class Body(Protocol):
    """Energies, forces and stiffness of a ply, its parameters, and where its laws hold.

    `Ply` describes each of them.
    """

    basis: CellBasis
    fabric: Fabric
    follows_load_factor: bool

    @property
    def terms(self) -> tuple[Term, ...]:
        """The terms, loads among them."""
        ...

    @property
    def pattern(self) -> Pattern:
        """Which nodes the tangent couples."""
        ...

    @property
    def parameters_at_rest(self) -> PlyParameters:
        """Parameters of the undeformed ply."""
        ...

    def updated(
        self, parameters: PlyParameters, u: ndarray, t: float, tension: ndarray | None
    ) -> PlyParameters:
        """Parameters updated within an iteration."""
        ...

    def energies(
        self, u: ndarray, t: float, parameters: PlyParameters
    ) -> dict[str, float]:
        """Energies of the terms by name."""
        ...

    def residual(self, u: ndarray, t: float, parameters: PlyParameters) -> ndarray:
        """Nodal forces, internal ones less loads."""
        ...

    def load(self, u: ndarray, t: float, parameters: PlyParameters) -> ndarray:
        """Nodal forces of the loads."""
        ...

    def stiffness(
        self,
        u: ndarray,
        t: float,
        parameters: PlyParameters,
        tension: ndarray | None,
        positive: bool,
    ) -> ndarray:
        """Blocks of the tangent in the order of ``pattern``."""
        ...

    def geometric_tension(
        self, u: ndarray, du: ndarray, parameters: PlyParameters
    ) -> ndarray:
        """Predicted fibre tensions for ``stiffness``."""
        ...

    def largest_gradient(self, u: ndarray) -> float:
        """Largest component of the displacement gradient."""
        ...

    def in_domain(self, u: ndarray) -> bool:
        """Whether every law has a value."""
        ...

    def closest_end(self, u: ndarray) -> LawEnd | None:
        """The end of a law that is closest."""
        ...
