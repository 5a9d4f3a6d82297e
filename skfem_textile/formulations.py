"""Formulations: on which element, at which points, and what stabilises it."""

from dataclasses import dataclass
from typing import ClassVar, Literal, NamedTuple, Protocol, TypeAlias, get_args

import numpy as np
from numpy import ndarray
from skfem import CellBasis, Mesh

from .elements import CENTRE, GAUSS, SIX, HourglassBasis, quad_basis, triangle_basis
from .fabric import Fabric
from .forms import Forms
from .hourglass import (
    AccumulatedMoment,
    HeldStabilisation,
    hourglass,
    hourglass_rate,
)
from .isotropic import isotropic_hourglass
from .meshes import check_quads, check_triangles

Kind: TypeAlias = Literal["energy", "rate", "isotropic"]


class Memory(Protocol):
    """What a term remembers of the last converged state.

    ``parameters`` are passed to its forms, ``work`` is what it has stored so far in
    N·mm: the term's energy form gives the rest.
    """

    parameters: dict[str, ndarray]
    work: float

    def reset(self) -> None:
        """Return to the undeformed state."""
        ...

    def commit(self, u: ndarray) -> bool:
        """Make ``u`` the last converged displacement; tell if that changes forces."""
        ...


class Term(NamedTuple):
    """A term of the internal energy, the basis on which it is assembled, its memory."""

    name: str
    forms: Forms
    basis: CellBasis
    memory: Memory | None = None


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

    def basis(self, mesh: Mesh) -> CellBasis:
        """Basis of the displacement, with the points of tension and shear.

        Raises
        ------
        MeshError
            If the mesh is not sound, or has not the cells of this formulation.
        """
        ...

    def stabilising_terms(self, basis: CellBasis, fabric: Fabric) -> list[Term]:
        """Terms beyond tension and shear; ``basis`` is that of the displacement."""
        ...


class _Quadrilaterals:
    """Bilinear quadrilaterals, judged at the 2×2 points."""

    rule: ClassVar[tuple[ndarray, ndarray]]
    centre: ClassVar[ndarray] = CENTRE[0]
    fine_points: ClassVar[ndarray] = GAUSS[0]

    def basis(self, mesh: Mesh) -> CellBasis:
        """Basis of the displacement."""
        check_quads(mesh)
        return quad_basis(mesh, self.rule)


@dataclass(frozen=True)
class Full(_Quadrilaterals):
    """2×2 points and no stabilisation: locks unless a mesh follows the fibres."""

    name: ClassVar[str] = "full"
    title: ClassVar[str] = "2×2 points"
    rule: ClassVar[tuple[ndarray, ndarray]] = GAUSS

    def stabilising_terms(self, basis: CellBasis, fabric: Fabric) -> list[Term]:
        """None."""
        return []


@dataclass(frozen=True)
class OnePoint(_Quadrilaterals):
    """One point at the centre, stabilised on the non-constant shear angle alone.

    Parameters
    ----------
    stabilisation
        Stabilisation stiffness C_s in N/mm (Hamila & Boisse 2013, §3.2), or ``auto``:
        in each element ten times its secant shear stiffness at the last converged
        state, held during a step; 10⁻⁴ of the fibre stiffness where there is none.
    kind
        ``energy``: independent of the path, with an exact tangent.  ``rate``: the
        paper's accumulated rates; a `Ply` then remembers the last converged state.
        ``isotropic``, for comparison: against hourglass motions of all directions.

    Raises
    ------
    ValueError
        If the stabilisation is negative or not finite, or ``auto`` with another kind
        than ``energy``, or the kind unknown.
    """

    stabilisation: float | Literal["auto"] = 1.0
    kind: Kind = "energy"

    name: ClassVar[str] = "one-point"
    rule: ClassVar[tuple[ndarray, ndarray]] = CENTRE

    def __post_init__(self) -> None:
        if self.kind not in get_args(Kind):
            raise ValueError(
                f"kind must be one of {', '.join(get_args(Kind))}, got {self.kind!r}"
            )
        if self.stabilisation == "auto":
            if self.kind != "energy":
                raise ValueError(
                    f"stabilisation auto goes with kind energy, not {self.kind}"
                )
        elif isinstance(self.stabilisation, str) or not (
            np.isfinite(self.stabilisation) and self.stabilisation >= 0
        ):
            raise ValueError(
                "stabilisation must be a finite number >= 0 or 'auto', got "
                f"{self.stabilisation}"
            )

    @property
    def title(self) -> str:
        """What to call it in a picture."""
        kind = "" if self.kind == "energy" else f", {self.kind}"
        C_s = self.stabilisation
        return f"one point, Cs = {C_s if C_s == 'auto' else f'{C_s:g}'}{kind}"

    def stabilising_terms(self, basis: CellBasis, fabric: Fabric) -> list[Term]:
        """The hourglass term, unless C_s is zero."""
        if self.stabilisation == 0:
            return []
        C_s = self.stabilisation
        corners = HourglassBasis(basis.mesh, mapping=basis.mapping, dofs=basis.dofs)
        if C_s == "auto":
            held = HeldStabilisation(fabric, corners)
            return [Term("stabilisation", hourglass(fabric), corners, held)]
        if self.kind == "energy":
            return [Term("stabilisation", hourglass(fabric, C_s), corners)]
        if self.kind == "isotropic":
            return [Term("stabilisation", isotropic_hourglass(C_s), corners)]
        memory = AccumulatedMoment(fabric, C_s, corners)
        return [Term("stabilisation", hourglass_rate(fabric, C_s), corners, memory)]


@dataclass(frozen=True)
class Quadratic:
    """Quadratic triangles with three points and no stabilisation, for comparison.

    The element is `skfem.ElementTriP2` on a `skfem.MeshTri`: nodes at vertices and at
    the middles of edges.  Judged at six points, exact to degree 4.
    """

    name: ClassVar[str] = "quadratic"
    title: ClassVar[str] = "quadratic triangles"
    centre: ClassVar[ndarray] = np.array([[1 / 3], [1 / 3]])
    fine_points: ClassVar[ndarray] = SIX[0]

    def basis(self, mesh: Mesh) -> CellBasis:
        """Basis of the displacement."""
        check_triangles(mesh)
        return triangle_basis(mesh)

    def stabilising_terms(self, basis: CellBasis, fabric: Fabric) -> list[Term]:
        """None."""
        return []
