"""What formulations share, and how one is registered."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from numbers import Real
from typing import ClassVar

import numpy as np
from numpy import ndarray
from skfem import CellBasis, Mesh

from ... import forms
from ...fabric import Fabric
from ...forms.mean_tension import mean_fibre_tension, mean_strain
from ...forms.tension import fibre_tension
from ...mesh.bases import CENTRE, GAUSS, MeanBasis, quad_basis
from ...mesh.checks import check_quads
from ...registration import Registration
from ..kernels.kernel import MeanTensionKernel, TensionKernel
from ..term import Term
from ..terms import TensionTerm


@dataclass(frozen=True, kw_only=True)
class FormulationRegistration(Registration):
    """A formulation that can be chosen by name.

    Attributes
    ----------
    on_triangles
        Whether it takes triangles, and not quadrilaterals.
    is_default
        Whether a mesh may get it where no formulation is named: of those that say so,
        and that take the options which are given, it gets the last.
    """

    on_triangles: bool = False
    is_default: Callable[[Mesh], bool] = lambda mesh: False


class Pointwise:
    """Every point has the tension of its own fibre strain, and nothing is added."""

    def tension_term(self, basis: CellBasis, fabric: Fabric) -> TensionTerm:
        """The tension T(ε) at every point."""
        return TensionTerm(
            "tension",
            forms.tension(fabric),
            basis,
            TensionKernel(fabric),
            law=partial(fibre_tension, fabric.at()),
            seen=lambda strain: strain,
        )

    def stabilising_terms(self, basis: CellBasis, fabric: Fabric) -> list[Term]:
        """None."""
        return []


class Quadrilaterals(Pointwise):
    """Bilinear quadrilaterals, judged at the 2×2 points."""

    rule: ClassVar[tuple[ndarray, ndarray]]
    centre: ClassVar[ndarray] = CENTRE[0]
    fine_points: ClassVar[ndarray] = GAUSS[0]

    def basis(self, mesh: Mesh) -> CellBasis:
        """Basis of the displacement."""
        check_quads(mesh)
        return quad_basis(mesh, self.rule)


def mean_tension_term(
    fabric: Fabric, deviation: float | ndarray, basis: MeanBasis
) -> TensionTerm:
    """The term of fibres that meet their whole stiffness in mean strains alone."""
    return TensionTerm(
        "tension",
        forms.mean_tension(fabric, deviation),
        basis,
        MeanTensionKernel(fabric, deviation),
        law=partial(mean_fibre_tension, fabric, deviation, basis),
        seen=partial(mean_strain, basis),
        arrange=basis.of_parts,
    )


def refuse_stiffness(name: str, value: float | str, also: str = "") -> None:
    """Refuse what is no stiffness, nor ``auto`` where that may be."""
    if also and isinstance(value, str) and value == "auto":
        return
    if not isinstance(value, Real) or not (np.isfinite(value) and value >= 0):
        raise ValueError(f"{name} must be a finite number >= 0{also}, got {value}")
