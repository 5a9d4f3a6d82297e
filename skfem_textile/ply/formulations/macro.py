"""Macro-elements, which are split inside."""

from dataclasses import dataclass
from typing import Any, ClassVar, Literal

import numpy as np
from numpy import ndarray
from skfem import CellBasis, Mesh

from ...fabric import Fabric
from ...mesh.bases import CENTRE, MacroBasis, components
from ...mesh.checks import MeshError, check_mesh
from ...mesh.splitting import SplitMesh, split, was_split
from ...registration import FormulationRegistration
from ..terms import TensionTerm, Term
from .common import (
    STABILISATION,
    Quadrilaterals,
    hourglass_terms,
    mean_tension_term,
    refuse_stiffness,
)


@dataclass(frozen=True)
class Macro(Quadrilaterals):
    """Quadrilaterals and triangles split in parts of one point each, nothing to tune.

    The elements are split (`split`).  They are macro-elements, whose fibres meet their
    whole stiffness in the mean stretch alone (`mean_tension`); each of the parts is
    stabilised as by `OnePoint`.

    Parameters
    ----------
    stabilisation
        As of `OnePoint`, but that it grows with the tension too.
    deviation
        Stiffness that meets deviations from the mean stretch, as a multiple of shear
        stiffness and tension (`deviation_stiffness`), in what was a triangle and a
        quadrilateral.  Measured on bias extensions at 30°, 45° and 60°:
        `python -m studies angles --part choosing`.

    Raises
    ------
    ValueError
        If one of them is negative or not finite.
    """

    stabilisation: float | Literal["auto"] = "auto"
    deviation: tuple[float, float] = (370.0, 700.0)

    name: ClassVar[str] = "macro"
    rule: ClassVar[tuple[ndarray, ndarray]] = CENTRE

    def __post_init__(self) -> None:
        refuse_stiffness("stabilisation", self.stabilisation, " or 'auto'")
        if np.shape(np.asarray(self.deviation, dtype=object)) != (2,):
            raise ValueError(
                "deviation must be a pair (triangles, quadrilaterals), got "
                f"{self.deviation}"
            )
        for deviation in self.deviation:
            refuse_stiffness("deviation", deviation)

    @property
    def title(self) -> str:
        """What to call it in a picture."""
        C_s, own = self.stabilisation, self.deviation == Macro.deviation
        return (
            "macro-elements"
            + ("" if C_s == "auto" else f", Cs = {C_s:g}")
            + ("" if own else ", {:g} and {:g}".format(*self.deviation))
        )

    def working_mesh(self, mesh: Mesh) -> Mesh:
        """The mesh split, unless it was split already."""
        if was_split(mesh):
            return mesh
        if isinstance(mesh, SplitMesh):
            raise MeshError(
                "the mesh was split, and refined, cut out or renumbered since: do that "
                "to the mesh before it is split, or give its elements as a new MeshQuad"
            )
        check_mesh(mesh)
        return split(mesh)

    def tension_term(self, basis: CellBasis, fabric: Fabric) -> TensionTerm:
        """The tension of the mean stretch of each macro-element."""
        mesh: Any = basis.mesh
        d = components(basis)
        macro = MacroBasis(mesh, d, mapping=basis.mapping, dofs=basis.dofs)
        of_triangles, of_quadrilaterals = self.deviation
        four = (macro.parts >= 0).sum(axis=1) == 4
        deviation = np.where(four, of_quadrilaterals, of_triangles)
        return mean_tension_term(fabric, deviation[:, None], macro)

    def stabilising_terms(self, basis: CellBasis, fabric: Fabric) -> list[Term]:
        """The hourglass term, unless C_s is zero."""
        return hourglass_terms(self.stabilisation, basis, fabric)


REGISTRATION = FormulationRegistration(
    name=Macro.name,
    description="macro-elements, nothing to tune",
    build=lambda cs: Macro(cs),
    options=(STABILISATION,),
    rank=2,
)
