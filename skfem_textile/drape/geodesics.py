"""Plies laid on a surface along geodesics: where a mechanical drape may start."""

from typing import NamedTuple

import numpy as np
from numpy import ndarray

from ..solve.conditions.surface import Surface, onto

# Steps of the classical Runge-Kutta method along a geodesic.  Chosen: on a sphere, over
# a quarter of its circumference, it is off by 1e-7 of the radius, far less than a start
# needs.
_STEPS = 32


class Axes(NamedTuple):
    """Axes of a ply among those of its tool.

    Attributes
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

        Raises
        ------
        ValueError
            If the normal is along x.
        """
        plane = tangents(surface, point, (1.0, 0.0, 0.0))
        return cls(point, np.column_stack([plane, np.cross(*plane.T)]))

    def of_tool(self, x: ndarray) -> ndarray:
        """Points of the ply's axes in those of the tool, shape (3, n)."""
        return self.origin[:, None] + self.turn @ x

    def of_ply(self, x: ndarray) -> ndarray:
        """Points of the tool's axes in those of the ply, shape (3, n)."""
        return self.turn.T @ (x - self.origin[:, None])


#: Of a ply whose axes are those of its tool.
SAME_AXES = Axes()


def exponential_map(
    surface: Surface,
    X: ndarray,
    touch: tuple[float, float] = (0.0, 0.0),
    point: ndarray | None = None,
    first: ndarray | None = None,
) -> ndarray:
    """Positions on a surface at the ends of geodesics, as long as they are in the ply.

    A geodesic starts for each point of the ply at the point where the ply touches the
    surface, in the direction and with the length that it has in the ply.

    Parameters
    ----------
    surface
        The surface.
    X
        Points of the ply in mm, shape (2, n).
    touch
        The point of the ply that touches the surface.
    point
        Where it does in space, shape (3,); (x, y, 0) of the ``touch`` if not given.
    first
        Direction in space of the ply's x there; without its part across the surface.
        The x axis if not given.

    Returns
    -------
    ndarray
        Shape (3, n).

    Raises
    ------
    OffSurfaceError
        If a geodesic leaves the surface.
    ValueError
        If the direction is normal to the surface.

    Examples
    --------
    >>> import numpy as np
    >>> from skfem_textile import drape
    >>> cylinder = drape.Cylinder(10.0, (0, 0, -10))
    >>> x = drape.exponential_map(cylinder, np.array([[5 * np.pi], [3]]))
    >>> bool(np.abs(x[:, 0] - [10, 3, -10]).max() < 1e-4)
    True
    """
    start = np.array([*touch, 0.0]) if point is None else np.asarray(point, dtype=float)
    start = onto(surface, start[:, None])
    along = tangents(surface, start[:, 0], (1.0, 0.0, 0.0) if first is None else first)
    away = X - np.asarray(touch)[:, None]
    x, v = np.broadcast_to(start, (3, X.shape[1])), along @ away
    h = 1 / _STEPS
    for _ in range(_STEPS):
        a = _bent(surface, x, v)
        b = _bent(surface, x + h / 2 * v, v + h / 2 * a)
        c = _bent(surface, x + h / 2 * v + h * h / 4 * a, v + h / 2 * b)
        d = _bent(surface, x + h * v + h * h / 2 * b, v + h * c)
        x = x + h * v + h * h / 6 * (a + b + c)
        v = v + h / 6 * (a + 2 * b + 2 * c + d)
    return onto(surface, x)


def tangents(surface: Surface, point: ndarray, first: ndarray | tuple) -> ndarray:
    """Unit vectors of the ply's x and y in the tangent plane at a point, shape (3, 2).

    y is to the left of x, seen from above: from the side on which z increases, where
    the tangent plane is not upright.

    Raises
    ------
    ValueError
        If the direction of x is normal to the surface.
    """
    n = surface.gradient(point[:, None])[:, 0]
    n = n / np.linalg.norm(n) * np.copysign(1.0, n[2])
    x = np.asarray(first, dtype=float)
    length = np.linalg.norm(x)
    x = x - n * (n @ x)
    if not np.linalg.norm(x) > 1e-6 * length:
        raise ValueError(f"the direction {first} is normal to the surface")
    x = x / np.linalg.norm(x)
    return np.array([x, np.cross(n, x)]).T


def displacement(X: ndarray, x: ndarray) -> ndarray:
    """The displacement of a ply whose nodes X, shape (2, n), lie at x, shape (3, n).

    A DOF vector, as `equilibrium_near` takes one.
    """
    return (x - np.pad(X, ((0, 1), (0, 0)))).T.ravel()


def _bent(surface: Surface, x: ndarray, v: ndarray) -> ndarray:
    """Second derivative of geodesics, −(v·∇²φ v) ∇φ/‖∇φ‖²."""
    g = surface.gradient(x)
    curved = np.einsum("ijn,in,jn->n", surface.hessian(x), v, v)
    return -curved / (g * g).sum(axis=0) * g
