"""Macro-elements: all quadrilaterals into which an element was split."""

from itertools import product
from typing import Any

import numpy as np
from numpy import ndarray
from skfem import DiscreteField, ElementQuad1, ElementVector

from .bases import CENTRE, MeanBasis
from .scikit_fem import set_element_dofs, set_positions


class MacroBasis(MeanBasis):
    """Basis of the displacement on the original elements of a mesh that was split.

    The points of an element are the centres of its quadrilaterals, weighted with their
    areas; its functions are those of all their nodes.

    Parameters
    ----------
    mesh
        A mesh that was split (`SplitMesh`).
    dimension
        Components of the displacement.
    **kwargs
        Passed to `skfem.CellBasis`: ``mapping``, ``dofs``.

    Attributes
    ----------
    parts
        Numbers of the quadrilaterals of each element, shape (n_elements, n_points);
        −1 where an element has fewer than others.
    corners
        For each corner of its quadrilaterals, which node of the element it is; shape
        (4, n_points, n_elements).
    """

    parts: ndarray

    def __init__(self, mesh: Any, dimension: int = 2, **kwargs: Any) -> None:
        element = ElementVector(ElementQuad1(), dimension)
        super().__init__(mesh, element, quadrature=CENTRE, **kwargs)
        bilinear: Any = self.basis
        x = np.asarray(self.global_coordinates())
        self.parts = _parts(mesh.parent)
        exists = self.parts >= 0
        self.nelems, n_points = self.parts.shape
        self.X = np.repeat(self.X, n_points, axis=1)
        self.dx = np.where(exists, self.dx[self.parts, 0], 0.0)
        set_positions(self, x[:, self.parts, 0])

        # Nodes of an element, and for each corner of its parts which of them it is.
        nodes = np.where(exists, mesh.t[:, self.parts], mesh.t[:, self.parts[:, :1]])
        own_nodes, which = _distinct(nodes.transpose(0, 2, 1).reshape(-1, self.nelems))
        self.corners = corners = which.reshape(4, n_points, self.nelems)
        dofs = self.nodal_dofs[:, own_nodes].transpose(1, 0, 2)
        set_element_dofs(self, dofs.reshape(-1, self.nelems))

        values = np.zeros((len(own_nodes), self.nelems, n_points))
        gradients = np.zeros((len(own_nodes), 2, self.nelems, n_points))
        for i, j in product(range(4), range(n_points)):
            elements = np.flatnonzero(exists[:, j])
            a, part = corners[i, j, elements], self.parts[elements, j]
            values[a, elements, j] = 0.25  # at the centre of a bilinear quadrilateral
            gradients[a, :, elements, j] = bilinear[dimension * i][0].grad[
                0, :, part, 0
            ]
        self.basis = [
            (_along(axis, dimension, N, dN),)
            for N, dN in zip(values, gradients, strict=True)
            for axis in range(dimension)
        ]

    def default_parameters(self) -> dict[str, Any]:
        """Parameters of `MeanBasis`, and the quadrilateral of each point."""
        return {**super().default_parameters(), "element": self.parts}

    def from_ply_points(self, x: ndarray) -> ndarray:
        """Convert values of quadrilaterals, (..., n, 1), to values at the points."""
        return x[..., self.parts, 0]

    def to_ply_points(self, x: ndarray) -> ndarray:
        """Convert values at the points to values of the quadrilaterals, (..., n, 1)."""
        exists = self.parts >= 0
        values = np.empty((*x.shape[:-2], exists.sum(), 1))
        values[..., self.parts[exists], 0] = x[..., exists]
        return values


def _along(axis: int, dimension: int, N: ndarray, dN: ndarray) -> DiscreteField:
    """A basis function that displaces along one axis."""
    value = np.zeros((dimension, *N.shape))
    gradient = np.zeros((dimension, *dN.shape))
    value[axis], gradient[axis] = N, dN
    return DiscreteField(value, gradient)


def _parts(parent: ndarray) -> ndarray:
    """Parts of each parent, shape (n_parents, n_most), filled up with −1."""
    order, counts = np.argsort(parent, kind="stable"), np.bincount(parent)
    parts = np.full((len(counts), counts.max()), -1)
    parts[np.arange(counts.max()) < counts[:, None]] = order
    return parts


def _distinct(nodes: ndarray) -> tuple[ndarray, ndarray]:
    """Distinct nodes of each column, and for each entry which of them it is.

    They stand in the order of their appearance, so that elements of one kind have one
    numbering.  A column with fewer distinct nodes than others repeats its first.
    """
    rows = np.arange(len(nodes))[:, None]
    first = (nodes[:, None] == nodes).argmax(axis=1)
    which = np.take_along_axis((first == rows).cumsum(axis=0) - 1, first, axis=0)
    distinct = np.repeat(nodes[:1], which.max() + 1, axis=0)
    np.put_along_axis(distinct, which, nodes, axis=0)
    return distinct, which
