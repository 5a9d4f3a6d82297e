"""Linear triangles, in which fibres along their edges do not lock."""

from typing import ClassVar

import numpy as np
from numpy import ndarray
from skfem import CellBasis, ElementTriP1, ElementVector, Mesh

from skfem_textile.ply.formulations.common import Pointwise


class LinearTriangles(Pointwise):
    """Linear triangles of one point."""

    name: ClassVar[str] = "linear"
    title: ClassVar[str] = "linear triangles"
    centre: ClassVar[ndarray] = np.array([[1 / 3], [1 / 3]])
    fine_points: ClassVar[ndarray] = centre

    def working_mesh(self, mesh: Mesh) -> Mesh:
        """The mesh as it is."""
        return mesh

    def basis(self, mesh: Mesh, dimension: int = 2) -> CellBasis:
        """Basis of the displacement."""
        rule = self.centre, np.array([0.5])
        return CellBasis(
            mesh, ElementVector(ElementTriP1(), dimension), quadrature=rule
        )
