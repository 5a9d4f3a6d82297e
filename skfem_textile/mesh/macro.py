"""Macro-elements: the quadrilaterals that were split off an element, together."""

from itertools import product
from typing import Any

import numpy as np
from numpy import ndarray
from skfem import DiscreteField, ElementQuad1, ElementVector

from .bases import CENTRE, MeanBasis
from .scikit_fem import set_element_dofs, set_positions


class MacroBasis(MeanBasis):
    """Basis of the displacement on the elements that a mesh was split off.

    An element's points are the centres of its quadrilaterals, each with the weight of
    their area, and its functions those of all of their nodes.

    Parameters
    ----------
    mesh
        Quadrilaterals that were split off other elements (`SplitMesh`).
    **kwargs
        Passed to `skfem.CellBasis`: ``mapping``, ``dofs``.

    Attributes
    ----------
    parts
        Numbers of the quadrilaterals of each element, shape (n_elements, n_points);
        −1 where an element has fewer than others.
    corners
        Which of the nodes of an element are those of its quadrilaterals, shape (4,
        n_points, n_elements).
    """

    def __init__(self, mesh: Any, **kwargs: Any) -> None:
        element = ElementVector(ElementQuad1())
        super().__init__(mesh, element, quadrature=CENTRE, **kwargs)
        bilinear: Any = self.basis
        x = np.asarray(self.global_coordinates())
        self.parts = _parts(mesh.parent)
        there = self.parts >= 0
        self.nelems, n_points = self.parts.shape
        self.X = np.repeat(self.X, n_points, axis=1)
        self.dx = np.where(there, self.dx[self.parts, 0], 0.0)
        set_positions(self, x[:, self.parts, 0])

        # Nodes of an element, and for each node of its parts which of them it is.
        nodes = np.where(there, mesh.t[:, self.parts], mesh.t[:, self.parts[:, :1]])
        own, which = _distinct(nodes.transpose(0, 2, 1).reshape(-1, self.nelems))
        self.corners = which = which.reshape(4, n_points, self.nelems)
        dofs = self.nodal_dofs[:, own].transpose(1, 0, 2)
        set_element_dofs(self, dofs.reshape(-1, self.nelems))

        values = np.zeros((len(own), self.nelems, n_points))
        gradients = np.zeros((len(own), 2, self.nelems, n_points))
        for i, j in product(range(4), range(n_points)):
            some = np.flatnonzero(there[:, j])
            a, part = which[i, j, some], self.parts[some, j]
            values[a, some, j] = 0.25
            gradients[a, :, some, j] = bilinear[2 * i][0].grad[0, :, part, 0]
        self.basis = [
            (_along(axis, N, dN),)
            for N, dN in zip(values, gradients, strict=True)
            for axis in range(2)
        ]

    def default_parameters(self) -> dict[str, Any]:
        """Those of `MeanBasis`, and the quadrilateral of each point."""
        return {**super().default_parameters(), "element": self.parts}

    def of_parts(self, x: ndarray) -> ndarray:
        """Values of the quadrilaterals, (..., n, 1), as those of the points."""
        return x[..., self.parts, 0]

    def on_parts(self, x: ndarray) -> ndarray:
        """Values of the points as those of the quadrilaterals, (..., n, 1)."""
        there = self.parts >= 0
        y = np.empty((*x.shape[:-2], there.sum(), 1))
        y[..., self.parts[there], 0] = x[..., there]
        return y


def _along(axis: int, N: ndarray, dN: ndarray) -> DiscreteField:
    """A function that displaces along one axis."""
    value, gradient = np.zeros((2, *N.shape)), np.zeros((2, *dN.shape))
    value[axis], gradient[axis] = N, dN
    return DiscreteField(value, gradient)


def _parts(parent: ndarray) -> ndarray:
    """Parts of each parent, shape (n_parents, most), −1 where there are fewer."""
    order, counts = np.argsort(parent, kind="stable"), np.bincount(parent)
    parts = np.full((len(counts), counts.max()), -1)
    parts[np.arange(counts.max()) < counts[:, None]] = order
    return parts


def _distinct(nodes: ndarray) -> tuple[ndarray, ndarray]:
    """The distinct nodes of each column, and for each entry which of them it is.

    In the order in which they appear, so that elements alike are alike; columns with
    fewer distinct nodes than others repeat their first.
    """
    rows = np.arange(len(nodes))[:, None]
    first = (nodes[:, None] == nodes).argmax(axis=1)
    which = np.take_along_axis((first == rows).cumsum(axis=0) - 1, first, axis=0)
    own = np.repeat(nodes[:1], which.max() + 1, axis=0)
    np.put_along_axis(own, which, nodes, axis=0)
    return own, which
