"""Triangles with edges along fibres at 45°, in which these fibres do not lock."""

from typing import ClassVar

import numpy as np
from numpy import ndarray
from skfem import CellBasis, ElementTriP1, ElementVector, Mesh, MeshTri

from skfem_textile.mesh.checks import with_edges
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

    def basis(self, mesh: Mesh) -> CellBasis:
        """Basis of the displacement."""
        rule = self.centre, np.array([0.5])
        return CellBasis(mesh, ElementVector(ElementTriP1()), quadrature=rule)


def crossed(width: float, height: float, size: tuple[int, int]) -> Mesh:
    """Equal cells of [0, width] × [0, height], each cut along both diagonals.

    Examples
    --------
    >>> crossed(50, 100, (2, 4)).nelements
    32
    """
    nx, ny = size
    x, y = np.meshgrid(np.linspace(0, width, nx + 1), np.linspace(0, height, ny + 1))
    middles = [(a[:-1, :-1] + a[1:, 1:]).ravel() / 2 for a in (x, y)]
    node = np.arange(x.size).reshape(x.shape)
    corners = node[:-1, :-1], node[:-1, 1:], node[1:, 1:], node[1:, :-1]
    a, b, c, d = (corner.ravel() for corner in corners)
    middle = x.size + np.arange(nx * ny)
    triangles = [[p, q, middle] for p, q in ((a, b), (b, c), (c, d), (d, a))]
    points = np.hstack([[x.ravel(), y.ravel()], middles])
    return with_edges(MeshTri(points, np.hstack(triangles)))
