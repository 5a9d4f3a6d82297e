"""Draped ply as elements in space: location of points of a tool on the ply."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple, Protocol

import numpy as np
from numpy import ndarray

from ..fabric import kinematics as kin
from ..mesh.graph import boundary_edges
from ..ply import Ply
from ..surfaces.triangles import (
    Elements,
    ElementTree,
    edge_lengths,
    unit,
)
from .crossings import Net

# Distance of a foot outside its element, relative to the distance of the point, that is
# accepted: between two elements that meet at an angle, up to 50°, a point has no other
# foot.
_BETWEEN = 0.5

# Tolerance of an element edge, relative to the longest edge.
_ON_EDGE = 1e-6

# Largest coordinate in mm.  Its square is finite.
_FAR = 1e100

#: Largest distance of a point from the ply, relative to the longest edge, a guard
#: against points off it: the distance of an arc of 90° from its chord is 0.21 of the
#: chord.
REACH = 0.25


class SheetPoints(NamedTuple):
    """Points of a sheet: element, −1 if there is none, and local coordinates.

    ``distance`` in mm is the distance between the sheet and the given point, infinite
    without an element.  Shapes (n,), (2, n) and (n,).
    """

    element: ndarray
    local: ndarray
    distance: ndarray

    @property
    def found(self) -> ndarray:
        """Mask of points with an element, shape (n,)."""
        return self.element >= 0


class Pieces(Protocol):
    """A net, a net with darts, or a part of one."""

    @property
    def pieces(self) -> Sequence[tuple[Net, ndarray]]:
        """Nets, each with the mask of its cells."""
        ...


@dataclass(frozen=True, eq=False)
class Sheet:
    """Ply in space with the position of each of its points in the flat ply.

    Parameters
    ----------
    flat, positions
        Nodes in the flat ply and in space in mm, shapes (2, n_nodes) and (3, n_nodes).
    elements
        Nodes of the elements, shape (3, n_elements) or (4, n_elements).
    warp, weft
        Unit directions of the fibres in the flat ply, shape (2, n_elements).

    Examples
    --------
    >>> import numpy as np
    >>> from skfem_textile import drape
    >>> sphere = drape.Sphere(100.0, (0, 0, -100))
    >>> sheet = drape.Sheet.of_net(drape.net(sphere, 5.0, (0, 12), (0, 12)))
    >>> places = sheet.at(np.array([[0.0, 0.0], [10.0, 200.0], [0.0, 0.0]]))
    >>> places.found, sheet.flat_at(places)[:, 0].round(1)
    (array([ True, False]), array([ 0., 10.]))
    """

    flat: ndarray
    positions: ndarray
    elements: ndarray
    warp: ndarray
    weft: ndarray

    @classmethod
    def of_ply(cls, ply: Ply, u: ndarray) -> "Sheet":
        """Sheet of a ply in space after a displacement.

        Raises
        ------
        ValueError
            If the ply is not in space.
        """
        moved = ply.nodal(u)
        if len(moved) != 3:
            raise ValueError(
                "sheet: the ply must be in space: use Ply(..., dimension=3)"
            )
        mesh = ply.mesh
        flat, moved = mesh.p, moved[:, : mesh.nvertices]
        positions = np.pad(flat, ((0, 1), (0, 0))) + moved
        shape = 2, mesh.nelements
        warp, weft = (
            np.broadcast_to(A[..., 0], shape) for A in ply.directions(ply.centre)
        )
        return cls(flat, positions, mesh.t, warp, weft)

    @classmethod
    def of_net(cls, net: Pieces) -> "Sheet":
        """Sheet of a kinematic net, one quadrilateral per cell that was laid.

        The pieces of a net with darts have separate nodes.
        """
        flat, positions, elements, first = [], [], [], 0
        for piece, cells in net.pieces:
            s, t = np.meshgrid(*piece.along, indexing="ij")
            n = np.arange(s.size).reshape(s.shape)
            corners = n[:-1, :-1], n[1:, :-1], n[1:, 1:], n[:-1, 1:]
            nodes, numbers = np.unique(
                [corner[cells] for corner in corners], return_inverse=True
            )
            along = np.array([s.ravel()[nodes], t.ravel()[nodes]])
            flat.append(piece.directions @ along + piece.touch[:, None])
            positions.append(piece.positions.reshape(3, -1)[:, nodes])
            elements.append(first + numbers.reshape(4, -1))
            first += nodes.size
        joined = np.hstack(elements)
        warp, weft = (
            np.tile(a[:, None], (1, joined.shape[1])) for a in piece.directions.T
        )
        return cls(np.hstack(flat), np.hstack(positions), joined, warp, weft)

    @property
    def _elements(self) -> Elements:
        return Elements(self.elements)

    @property
    def longest_edge(self) -> float:
        """Length of the longest edge in space in mm."""
        return float(edge_lengths(self.positions, self.elements).max())

    @cached_property
    def _tree(self) -> "ElementTree":
        return ElementTree(self.positions[:, self.elements])

    def at(
        self,
        points: ndarray,
        reach: ndarray | float | None = None,
        rank: ndarray | None = None,
    ) -> SheetPoints:
        """Points of the sheet at points of a tool: feet of perpendiculars.

        Parameters
        ----------
        points
            Points in mm, shape (3, n).
        reach
            Largest distance from the sheet in mm, for all points or for each; by
            default a quarter of the longest edge of the sheet.  Use less than the
            thickness of a tool whose other side is not draped.
        rank
            Of several elements within reach of a point, the one of the least rank is
            chosen, shape (n_elements,); by default the nearest.
        """
        n, points = points.shape[1], np.clip(points, -_FAR, _FAR)
        reach = REACH * self.longest_edge if reach is None else reach
        most = np.broadcast_to(np.asarray(reach, dtype=float), n)
        point, element = self._tree.pairs(points, most)
        local, away = self._elements.feet(self.positions, points[:, point], element)
        distance = np.linalg.norm(away, axis=0)
        outside = self._elements.outside(local) * 2 * self._tree.radii[element]
        allowed = _ON_EDGE * self.longest_edge + _BETWEEN * distance
        accepted = (outside <= allowed) & (distance <= most[point])
        # The chosen element of each point is written last.
        last = distance + outside if rank is None else rank[element]
        order = np.flatnonzero(accepted)[np.argsort(-last[accepted])]
        chosen = np.full(n, -1)
        chosen[point[order]] = order
        feet = SheetPoints(np.full(n, -1), np.full((2, n), np.nan), np.full(n, np.inf))
        inside, chosen = chosen >= 0, chosen[chosen >= 0]
        feet.element[inside] = element[chosen]
        feet.local[:, inside] = self._elements.inside(local[:, chosen])
        feet.distance[inside] = distance[chosen]
        return feet

    def flat_at(self, points: SheetPoints) -> ndarray:
        """Points in the flat ply in mm, shape (2, n); NaN if there is none."""
        return self._elements.between(self.flat, points.element, points.local)

    def fibres_at(self, points: SheetPoints) -> tuple[ndarray, ndarray, ndarray]:
        """Unit directions of warp and weft, shape (3, n), and the shear angle, (n,).

        The deformation gradient is interpolated between nodes, where it is second-order
        accurate.  NaN if there is no point.
        """
        F = self._elements.between(self._gradients, points.element, points.local)
        A = [family[:, points.element] for family in (self.warp, self.weft)]
        warp, weft = (kin.fibre(F, family) for family in A)
        angle = kin.shear_angle(F, *A)
        return unit(warp), unit(weft), angle

    @cached_property
    def _gradients(self) -> ndarray:
        """Deformation gradient at each node, shape (3, 2, n_nodes).

        The mean over the elements at the node. Along the edges of the ply this mean is
        offset by half an element. There, and finally at the corners of the ply, nodal
        values are changed until the mean of the nodes of an element equals the gradient
        at its centre, which is second-order accurate.
        """
        corners = self._elements.corners
        at_corners = np.array([self._gradient_at(corner) for corner in corners])
        nodes, _ = self._mean_at_nodes(at_corners, self.elements)
        centre = self._gradient_at(corners.mean(axis=0))
        left = np.zeros(len(nodes), dtype=bool)
        left[boundary_edges([self.elements])] = True
        while left.any():
            n_left = left[self.elements].sum(axis=0)
            least = n_left[n_left > 0].min()
            elements = self.elements[:, n_left == least]
            lag = centre[n_left == least] - nodes[elements].mean(axis=0)
            lag = np.broadcast_to(
                lag * (len(corners) / least), (len(corners), *lag.shape)
            )
            change, reached = self._mean_at_nodes(lag, elements)
            nodes[left & reached] += change[left & reached]
            left &= ~reached
        return nodes.transpose(1, 2, 0)

    def _gradient_at(self, at: ndarray) -> ndarray:
        """Deformation gradient at a point of each element, (n_elements, 3, 2)."""
        n = self.elements.shape[1]
        local = np.tile(at[:, None], n)
        x, X = (
            self._elements.slopes(of, np.arange(n), local).transpose(2, 0, 1)
            for of in (self.positions, self.flat)
        )
        return x @ np.linalg.inv(X)

    def _mean_at_nodes(
        self, at_corners: ndarray, elements: ndarray
    ) -> tuple[ndarray, ndarray]:
        """Means at nodes over some elements, and mask of the nodes that have them.

        ``at_corners`` has the shape (n_corners, n_elements, ...).
        """
        n_nodes = self.flat.shape[1]
        total = np.zeros((n_nodes, *at_corners.shape[2:]))
        np.add.at(total, elements, at_corners)
        count = np.bincount(elements.ravel(), minlength=n_nodes)
        return total / np.maximum(count, 1)[:, None, None], count > 0
