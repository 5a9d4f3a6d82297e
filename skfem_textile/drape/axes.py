"""Axes of a ply among those of its tool."""

from typing import NamedTuple

import numpy as np
from numpy import ndarray

from ..solve.surface import Surface
from ..solve.surface.geodesics import tangents

# Slope of a plane against one across the x axis up to which x has no direction in it,
# 1°.
_ACROSS = 0.0175


class Axes(NamedTuple):
    """Axes of a ply among those of its tool.

    Parameters
    ----------
    origin
        Where the origin of the ply is, in mm, shape (3,).
    turn
        Directions of the ply's x, y and z, columns of shape (3, 3).
    """

    origin: ndarray = np.zeros(3)
    turn: ndarray = np.eye(3)

    @classmethod
    def at(cls, surface: Surface, point: ndarray) -> "Axes":
        """Those of a ply that touches a surface at a point, shape (3,).

        z is the normal, and x is the tool's as far as it lies in the tangent plane.
        Where the normal is along x, to 1°, z of the tool takes the place of its x.
        """
        normal = surface.gradient(point[:, None])[:, 0]
        across = np.hypot(*normal[1:]) <= _ACROSS * abs(normal[0])
        plane = tangents(surface, point, (0.0, 0.0, 1.0) if across else (1.0, 0.0, 0.0))
        return cls(point, np.column_stack([plane, np.cross(*plane.T)]))

    def of_tool(self, x: ndarray) -> ndarray:
        """Points of the ply's axes in those of the tool, shape (3, n)."""
        return self.origin[:, None] + self.turn @ x

    def of_ply(self, x: ndarray) -> ndarray:
        """Points of the tool's axes in those of the ply, shape (3, n)."""
        return self.turn.T @ (x - self.origin[:, None])


#: Of a ply whose axes are those of its tool.
SAME_AXES = Axes()
