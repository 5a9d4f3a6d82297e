"""Plies of a block of meshes: places, surfaces, and which of them cover others."""

from collections.abc import Sequence
from functools import cached_property
from typing import Any

import numpy as np
from numpy import ndarray
from skfem import CellBasis, LinearForm, asm

from ..mesh.recovery import ContactPoints
from .ply_surface import PlySurface


class Layers:
    """Plies of a `Stack` on a basis of its displacement, from the lowest.

    Parameters
    ----------
    basis
        Basis of the displacement of all plies.
    nodes, elements
        Number of nodes and of elements of each ply, whose numbers follow each other.
    thickness
        Thickness of each ply in mm.

    Attributes
    ----------
    ply
        Number of the ply of each node, shape (n_nodes,).
    heights
        Height of the middle of each ply at rest in mm; 0 halfway through the stack.
    """

    def __init__(
        self,
        basis: CellBasis,
        nodes: Sequence[int],
        elements: Sequence[int],
        thickness: ndarray,
    ) -> None:
        self._basis, self.thickness = basis, thickness
        self._starts = np.cumsum([0, *elements])
        self.ply = np.repeat(np.arange(len(nodes)), nodes)
        top = np.cumsum(thickness)
        self.heights = top - 0.5 * thickness - 0.5 * top[-1]

    @property
    def X(self) -> ndarray:
        """Nodes at rest in mm, shape (3, n_nodes)."""
        return np.vstack([self._basis.mesh.p, self.heights[self.ply]])

    @cached_property
    def points(self) -> ContactPoints:
        """Contact points of all nodes."""
        return ContactPoints(self.X, self._basis, recovered=False)

    @cached_property
    def areas(self) -> ndarray:
        """Integral of the shape function of each node in mm², shape (n_nodes,)."""
        return np.asarray(asm(LinearForm(lambda v, w: v[0]), self._basis)[::3])

    def elements(self, ply: int) -> ndarray:
        """Numbers of the elements of a ply."""
        return np.arange(self._starts[ply], self._starts[ply + 1])

    @cached_property
    def surfaces(self) -> list[PlySurface]:
        """Surface of each ply."""
        mesh: Any = self._basis.mesh
        mirrors = getattr(self._basis, "mirrors", ())
        plies = range(len(self.heights))
        return [PlySurface(mesh, self.elements(i), mirrors) for i in plies]

    @cached_property
    def size_of(self) -> ndarray:
        """Root of the mean area of the elements of each ply in mm."""
        plies = range(len(self.heights))
        dx = self._basis.dx.sum(axis=1)
        return np.sqrt([dx[self.elements(i)].mean() for i in plies])

    @cached_property
    def over(self) -> ndarray:
        """True for nodes above or below each ply at rest, shape (n_plies, n_nodes)."""
        flat = self.X * [[1.0], [1.0], [0.0]]
        return np.array([x.feet(flat, flat).off <= 1e-6 for x in self.surfaces])

    def exposed(self, side: int) -> ndarray:
        """True for nodes that no other ply covers at rest.

        Parameters
        ----------
        side
            −1 from below, 1 from above, 0 from either side.
        """
        order, ply = np.arange(len(self.heights))[:, None], self.ply
        beyond = order < ply if side < 0 else order > ply
        covered = (self.over & beyond).any(axis=0)
        return np.asarray(~covered if side else covered | True)

    def bare(self, low: int, high: int) -> ndarray:
        """True for nodes without another ply between two plies at rest, (n_nodes,)."""
        order = np.arange(len(self.heights))[:, None]
        between = self.over & (order > low) & (order < high)
        return np.asarray(~between.any(axis=0))

    def faces(self, low: int, high: int) -> bool:
        """True if two plies lie on each other somewhere at rest."""
        on = (self.ply == low) & self.over[high] | (self.ply == high) & self.over[low]
        return bool((on & self.bare(low, high)).any())


class Layer:
    """One of the plies of `Layers`, on its own basis.

    Attributes
    ----------
    X
        Its nodes at rest in mm, shape (3, n_nodes).
    thickness, ply
        See `Layers`, of this ply alone.
    """

    def __init__(self, layers: Layers, ply: int) -> None:
        of_ply = layers.ply == ply
        self.thickness = layers.thickness[[ply]]
        self.ply = np.zeros(np.count_nonzero(of_ply), dtype=int)
        self.X = layers.X[:, of_ply]
        self._exposed = {x: layers.exposed(x)[of_ply] for x in (-1, 0, 1)}

    def exposed(self, side: int) -> ndarray:
        """See `Layers.exposed`."""
        return self._exposed[side]
