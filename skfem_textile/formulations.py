"""Formulations: where a ply takes its points, and what stabilises it."""

from dataclasses import dataclass
from typing import ClassVar, NamedTuple, Protocol

import numpy as np
from numpy import ndarray
from skfem import CellBasis

from .elements import CENTRE, GAUSS, HourglassBasis
from .fabric import Fabric
from .forms import Forms, hourglass


class Term(NamedTuple):
    """A term of the internal energy and the basis on which it is assembled."""

    name: str
    forms: Forms
    basis: CellBasis


class Formulation(Protocol):
    """Points and weights of tension and shear, and the stabilising terms."""

    name: ClassVar[str]
    rule: ClassVar[tuple[ndarray, ndarray]]

    @property
    def title(self) -> str:
        """What to call it in a picture."""
        ...

    def stabilising_terms(self, basis: CellBasis, fabric: Fabric) -> list[Term]:
        """Terms beyond tension and shear; ``basis`` is that of the displacement."""
        ...


@dataclass(frozen=True)
class Full:
    """2×2 points and no stabilisation: locks unless a mesh follows the fibres."""

    name: ClassVar[str] = "full"
    title: ClassVar[str] = "2×2 points"
    rule: ClassVar[tuple[ndarray, ndarray]] = GAUSS

    def stabilising_terms(self, basis: CellBasis, fabric: Fabric) -> list[Term]:
        """None."""
        return []


@dataclass(frozen=True)
class OnePoint:
    """One point at the centre, stabilised on the non-constant shear angle alone.

    Parameters
    ----------
    stabilisation
        Stabilisation stiffness C_s in N/mm (Hamila & Boisse 2013, §3.2).

    Raises
    ------
    ValueError
        If the stabilisation is negative or not finite.
    """

    stabilisation: float = 1.0

    name: ClassVar[str] = "one-point"
    rule: ClassVar[tuple[ndarray, ndarray]] = CENTRE

    def __post_init__(self) -> None:
        if not (np.isfinite(self.stabilisation) and self.stabilisation >= 0):
            raise ValueError(
                f"stabilisation must be a finite number >= 0, got {self.stabilisation}"
            )

    @property
    def title(self) -> str:
        """What to call it in a picture."""
        return f"one point, Cs = {self.stabilisation:g}"

    def stabilising_terms(self, basis: CellBasis, fabric: Fabric) -> list[Term]:
        """The hourglass term, unless C_s is zero."""
        if self.stabilisation == 0:
            return []
        shared = HourglassBasis(basis.mesh, mapping=basis.mapping, dofs=basis.dofs)
        return [Term("stabilisation", hourglass(fabric, self.stabilisation), shared)]
