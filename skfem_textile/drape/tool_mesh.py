"""The elements of a tool, as they are: triangles and quadrilaterals in space."""

from dataclasses import dataclass

import numpy as np
from numpy import ndarray

from ..mesh.checks import MeshError
from ..mesh.user_input import real_numbers
from .elements import boundary_edges, edge_lengths, unit


@dataclass(frozen=True, eq=False)
class ToolMesh:
    """Triangles and quadrilaterals in space, one block after the other.

    Parameters
    ----------
    points
        Nodes in mm, shape (3, n_nodes).
    cells
        Their numbers in the elements, arrays of shape (3, n) and (4, n), anticlockwise
        seen from outside.

    Raises
    ------
    MeshError
        If a node is not there or not finite, or an element has no area.
    """

    points: ndarray
    cells: tuple[ndarray, ...]

    def __post_init__(self) -> None:
        points = real_numbers("a tool: points", self.points)
        if points.ndim != 2 or len(points) != 3 or not np.isfinite(points).all():
            raise MeshError("a tool: points must be finite, shape (3, n)")
        for cell in self.cells:
            if np.ndim(cell) != 2 or len(cell) not in (3, 4):
                raise MeshError("a tool: cells must be numbers of 3 or 4 nodes each")
            if (
                np.size(cell)
                and not 0 <= np.min(cell) <= np.max(cell) < points.shape[1]
            ):
                raise MeshError("a tool: an element has a node that is not there")
        object.__setattr__(self, "points", points)
        if not self.n_elements:
            raise MeshError("a tool: it has no triangles or quadrilaterals")
        flat = np.flatnonzero(~(np.linalg.norm(self._area_vectors(), axis=0) > 0))
        if flat.size:
            raise MeshError(f"a tool: element {flat[0] + 1} has no area")

    @property
    def n_elements(self) -> int:
        """Number of elements."""
        return sum(np.shape(cell)[1] for cell in self.cells)

    def centres(self) -> ndarray:
        """Means of the corners, shape (3, n_elements)."""
        return np.hstack([self.points[:, cell].mean(axis=1) for cell in self.cells])

    def normals(self) -> ndarray:
        """Unit normals at the centres, shape (3, n_elements)."""
        return unit(self._area_vectors())

    def longest_edges(self) -> ndarray:
        """Longest edge of each element in mm, shape (n_elements,)."""
        return np.hstack(
            [edge_lengths(self.points, cell).max(axis=0) for cell in self.cells]
        )

    def triangles(self) -> ndarray:
        """Nodes of triangles, quadrilaterals cut in two, shape (3, n)."""
        return cut_in_two(self.cells)

    def boundary(self) -> list[ndarray]:
        """Closed curves along the edges of one element alone, the longest first.

        Returns
        -------
        list
            Points of each, shape (3, n), the first not repeated.

        Raises
        ------
        MeshError
            If there is no such edge, or more than two of them meet at a node.
        """
        start, end = boundary_edges(self.cells)
        if not start.size:
            raise MeshError("a tool: it is closed, and has no boundary to trim along")
        after = dict(zip(start.tolist(), end.tolist(), strict=True))
        if len(after) < len(start) or len(set(after.values())) < len(end):
            raise MeshError("a tool: its boundary crosses itself, or sides differ")
        curves = []
        while after:
            begin = at = next(iter(after))
            nodes = []
            while at in after:
                nodes.append(at)
                at = after.pop(at)
            if at != begin:
                raise MeshError("a tool: its boundary is not closed")
            curves.append(self.points[:, nodes])
        return sorted(curves, key=curve_length, reverse=True)

    def _area_vectors(self) -> ndarray:
        """Normals as long as twice the areas: cross products of diagonals or edges."""
        corners = [self.points[:, cell] for cell in self.cells]
        pairs = [(x[:, 2] - x[:, 0], x[:, -1] - x[:, 1]) for x in corners]
        return np.hstack([np.cross(one, other, axis=0) for one, other in pairs])


def cut_in_two(cells: tuple[ndarray, ...]) -> ndarray:
    """Nodes of triangles, quadrilaterals cut in two, shape (3, n)."""
    cuts = {3: ([0, 1, 2],), 4: ([0, 1, 2], [0, 2, 3])}
    return np.hstack([cell[cut] for cell in cells for cut in cuts[len(cell)]])


def curve_length(curve: ndarray) -> float:
    """Length of a closed polyline, shape (d, n)."""
    return float(np.linalg.norm(np.roll(curve, -1, axis=1) - curve, axis=0).sum())
