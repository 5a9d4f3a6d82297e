"""What the load stepper asks of a ply, and of what holds it.

`skfem_textile.Ply` and `Constraints` have it all.
"""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, Protocol, TypeAlias

from numpy import ndarray
from scipy.sparse import csr_matrix

if TYPE_CHECKING:
    from ..fabric.law_end import LawEnd
    from ..mesh.pattern import Pattern

#: Parameters of the terms of a ply by the names of the terms; immutable.
Parameters: TypeAlias = Mapping[str, Any]

#: Load factors at which loads and further terms are compared, at no regular distances.
PROBED = (
    *(0.0, 0.0313, 0.1303, 0.2541, 0.3719, 0.5, 0.6237),
    *(0.7177, 0.8119, 0.9091, 0.9707, 1.0),
)


class Body(Protocol):
    """Nodes, forces and energies, and what a displacement does to the fibres.

    ``u`` is a displacement of all nodes, shape (n_unknowns,), ``t`` the load factor.
    """

    mesh: Any
    cells: Any
    basis: Any
    fabric: Any
    formulation: Any
    nodes: ndarray
    centre: ndarray
    fine_points: ndarray

    @property
    def pattern(self) -> "Pattern":
        """Which nodes the tangent couples."""
        ...

    @property
    def element_size(self) -> float:
        """Size of the largest element in mm."""
        ...

    @property
    def roles(self) -> Mapping[str, str]:
        """Role of each term, by its name: internal, stabilisation or load."""
        ...

    @property
    def terms(self) -> Sequence[Any]:
        """The terms."""
        ...

    @property
    def parameters_at_rest(self) -> Parameters:
        """Parameters of the terms of the undeformed ply."""
        ...

    @property
    def further_terms(self) -> Sequence[Any]:
        """Terms beside those of fabric and formulation, loads among them."""
        ...

    @property
    def follows_load_factor(self) -> bool:
        """Whether the energy may change with the load factor."""
        ...

    def energies(
        self, u: ndarray, t: float, parameters: Parameters
    ) -> dict[str, float]:
        """Energy of each term in N·mm, by the name of the term."""
        ...

    def parts(
        self, u: ndarray, t: float, parameters: Parameters
    ) -> Sequence[tuple[str, float, ndarray]]:
        """Role, energy in N·mm and nodal forces in N of each part, loads aside."""
        ...

    def energy(self, u: ndarray, t: float, parameters: Parameters) -> float:
        """Energy in N·mm, potential of loads included."""
        ...

    def residuals(self, u: ndarray, t: float) -> dict[str, ndarray]:
        """Nodal forces of each term in N, by the name of the term."""
        ...

    def residual(self, u: ndarray, t: float, parameters: Parameters) -> ndarray:
        """Nodal forces in N, internal ones less loads."""
        ...

    def load(
        self, u: ndarray, t: float, parameters: Parameters | None = None
    ) -> ndarray:
        """Nodal forces of the loads in N."""
        ...

    def stiffness(
        self,
        u: ndarray,
        t: float,
        parameters: Parameters,
        tension: ndarray | None,
        positive: bool,
    ) -> ndarray:
        """Blocks of the tangent in the order of ``pattern``."""
        ...

    def updated(
        self,
        parameters: Parameters,
        u: ndarray,
        t: float,
        tension: ndarray | None = None,
    ) -> Parameters:
        """Parameters updated within an iteration; the same where nothing changes."""
        ...

    def advanced(self, parameters: Parameters, u: ndarray, t: float) -> Parameters:
        """Parameters advanced at the end of a step."""
        ...

    def hat_functions(self) -> csr_matrix:
        """As of `Ply.hat_functions`, shape (n_corners, n_nodes)."""
        ...

    def finer(self) -> Any:
        """A body of which each element is split in four, as `Ply.finer` gives one."""
        ...

    def on_users_elements(self, values: ndarray) -> ndarray:
        """The mean of a field over each of the user's elements, ``cells``."""
        ...

    def nodal(self, u: ndarray) -> ndarray:
        """A vector of unknowns as one column per node."""
        ...

    def gradient(self, u: ndarray, points: ndarray | None = None) -> ndarray:
        """Displacement gradient."""
        ...

    def fibre_strain(self, u: ndarray, points: ndarray | None = None) -> ndarray:
        """Fibre strain of warp and weft."""
        ...

    def law_strain(self, u: ndarray) -> ndarray:
        """Fibre strain of warp and weft that the law of tension sees."""
        ...

    def fibre_tension(
        self, u: ndarray, parameters: Parameters | None = None
    ) -> ndarray:
        """Tension of warp and weft in N/mm."""
        ...

    def fibre_direction(self, u: ndarray, points: ndarray | None = None) -> ndarray:
        """Current unit direction of warp and weft."""
        ...

    def geometric_tension(
        self, u: ndarray, du: ndarray, parameters: Parameters
    ) -> ndarray:
        """Fibre tensions after an increment, to first order in it, for `stiffness`."""
        ...

    def shear_angle(self, u: ndarray, points: ndarray | None = None) -> ndarray:
        """Shear angle in radians."""
        ...

    def directions(self, points: ndarray | None = None) -> tuple[ndarray, ndarray]:
        """Unit reference directions of warp and weft."""
        ...

    def least_area_ratio(self, u: ndarray) -> ndarray:
        """Smallest area ratio of each element."""
        ...

    def normals(self, u: ndarray) -> ndarray:
        """Normals of the elements in space, of any length."""
        ...

    def creased(self, u: ndarray) -> ndarray:
        """Elements that turn sharply against a neighbour."""
        ...

    def past_peak(self, u: ndarray) -> ndarray:
        """Elements whose fibres tear."""
        ...

    def in_domain(self, u: ndarray) -> bool:
        """Whether no law is asked beyond the domain that it states."""
        ...

    def closest_end(self, u: ndarray) -> "LawEnd | None":
        """The end of a law that is closest; None if every law holds everywhere."""
        ...
