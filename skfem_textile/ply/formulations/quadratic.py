"""Quadratic triangles."""

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from numpy import ndarray
from skfem import CellBasis, ElementQuad1, Mesh

from ...fabric import Fabric
from ...mesh.bases import SIX, MeanBasis, triangle_basis
from ...mesh.checks import MeshError, check_mesh
from ...mesh.splitting import SplitMesh, cut
from ...registration import FormulationRegistration, Option
from ..terms import TensionTerm
from .common import Pointwise, mean_tension_term, refuse_stiffness


@dataclass(frozen=True)
class Quadratic(Pointwise):
    """Quadratic triangles with three points and no stabilisation.

    The element is `skfem.ElementTriP2` on triangles, in which quadrilaterals are cut
    (`cut`): nodes at vertices and at the middles of edges.  Judged at six points, exact
    to degree 4.

    Parameters
    ----------
    deviation
        If given, fibres meet their whole stiffness in the mean stretch of a triangle
        alone, and deviations from it this multiple of shear stiffness and tension
        (`deviation_stiffness`).

    Raises
    ------
    ValueError
        If it is negative or not finite.
    """

    deviation: float | None = None

    name: ClassVar[str] = "quadratic"
    centre: ClassVar[ndarray] = np.array([[1 / 3], [1 / 3]])
    fine_points: ClassVar[ndarray] = SIX[0]

    def __post_init__(self) -> None:
        if self.deviation is not None:
            refuse_stiffness("deviation", self.deviation)

    @property
    def title(self) -> str:
        """What to call it in a picture."""
        C_d = self.deviation
        return "quadratic triangles" + ("" if C_d is None else f", mean, {C_d:g}")

    def working_mesh(self, mesh: Mesh) -> Mesh:
        """Triangles as they are, quadrilaterals cut."""
        if isinstance(mesh, SplitMesh):
            raise MeshError(
                "quadratic triangles take no mesh that was split, as that of a file "
                "with both triangles and quadrilaterals is: give one of either"
            )
        if getattr(mesh, "elem", None) is not ElementQuad1:
            return mesh
        check_mesh(mesh)
        quads: Any = mesh
        return cut(quads)

    def basis(self, mesh: Mesh, dimension: int = 2) -> CellBasis:
        """Basis of the displacement."""
        check_mesh(mesh)
        return triangle_basis(mesh, dimension)

    def tension_term(self, basis: CellBasis, fabric: Fabric) -> TensionTerm:
        """The tension at each of the points, or of their mean stretch."""
        if self.deviation is None:
            return super().tension_term(basis, fabric)
        means = MeanBasis(
            basis.mesh,
            basis.elem,
            mapping=basis.mapping,
            dofs=basis.dofs,
            quadrature=basis.quadrature,
        )
        return mean_tension_term(fabric, self.deviation, means)


REGISTRATION = FormulationRegistration(
    name=Quadratic.name,
    description="quadratic triangles, for which quadrilaterals are cut along a "
    "diagonal",
    build=Quadratic,
    options=(
        Option(
            name="deviation",
            help="give quadratic triangles the tension of their mean stretch, and "
            "deviations from it this multiple of shear stiffness and tension (80 does "
            "well), or half of the fibre stiffness where there is none",
            read=float,
            metavar="C",
        ),
    ),
    rank=4,
)
