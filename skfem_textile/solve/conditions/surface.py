"""Surfaces as zeros of a function of position, and points brought onto them."""

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy import ndarray

# Distance from a surface, as a share of the largest coordinate, of a point that is on
# it, and iterations at most to get there.  Chosen: far below any mesh, and above the
# rounding of a surface that is itself computed.
_ON_SURFACE, _MOST = 1e-11, 50


class Surface(Protocol):
    """A surface: the points x at which φ(x) = 0, where the gradient is not 0.

    φ may be any smooth function that is positive on one side and negative on the other;
    it need not be the distance.  Positions ``x`` have the shape (3, n), in mm.
    """

    def level(self, x: ndarray) -> ndarray:
        """φ, shape (n,)."""
        ...

    def gradient(self, x: ndarray) -> ndarray:
        """∇φ, shape (3, n)."""
        ...

    def hessian(self, x: ndarray) -> ndarray:
        """∇²φ, shape (3, 3, n)."""
        ...


class OffSurfaceError(ValueError):
    """A point that has no way to a surface."""


@dataclass(frozen=True, eq=False)
class Grown:
    """A surface on its way from its tangent plane at a point: φ(p + t(x − p))/t.

    It is the surface enlarged by 1/t about the point p, so that curvatures grow in
    proportion to t.  At t = 0 it is the tangent plane.

    Parameters
    ----------
    surface
        The surface.
    point
        The point p on it, in mm, shape (3,).
    t
        From 0 to 1.
    """

    surface: Surface
    point: ndarray
    t: float

    def level(self, x: ndarray) -> ndarray:
        """φ, shape (n,)."""
        p = self.point[:, None]
        if self.t == 0:
            return (self.surface.gradient(p) * (x - p)).sum(axis=0)
        return self.surface.level(p + self.t * (x - p)) / self.t

    def gradient(self, x: ndarray) -> ndarray:
        """∇φ, shape (3, n)."""
        p = self.point[:, None]
        return self.surface.gradient(p + self.t * (x - p))

    def hessian(self, x: ndarray) -> ndarray:
        """∇²φ, shape (3, 3, n)."""
        p = self.point[:, None]
        return self.t * self.surface.hessian(p + self.t * (x - p))


def distance(surface: Surface, x: ndarray) -> ndarray:
    """Distance from a surface to first order, shape (n,), with the sign of φ, in mm."""
    return surface.level(x) / np.linalg.norm(surface.gradient(x), axis=0)


def is_on(surface: Surface, x: ndarray) -> bool:
    """Whether all points are on a surface, but for what rounding makes of them."""
    allowed = 2 * _ON_SURFACE * np.abs(x).max(initial=1.0)
    return bool((np.abs(distance(surface, x)) <= allowed).all())


def onto(surface: Surface, x: ndarray, free: ndarray | None = None) -> ndarray:
    """Points brought onto a surface along its normals, by Newton's method.

    Parameters
    ----------
    surface
        The surface.
    x
        Points near it, shape (3, n).
    free
        Projectors onto the directions in which each point may move, shape (n, 3, 3);
        any direction if not given.

    Returns
    -------
    ndarray
        Shape (3, n).

    Raises
    ------
    OffSurfaceError
        If a point does not get there.
    """
    allowed = _ON_SURFACE * np.abs(x).max(initial=1.0)
    for _ in range(_MOST):
        g, level = surface.gradient(x), surface.level(x)
        along = g if free is None else np.einsum("nij,jn->in", free, g)
        off = ~(np.abs(level) <= allowed * np.linalg.norm(g, axis=0))
        if not off.any():
            return x
        with np.errstate(all="ignore"):  # what is not finite is caught
            x = x - np.where(off, level / (along * g).sum(axis=0), 0.0) * along
        if not np.isfinite(x).all():
            break
    place = np.round(x[:, np.flatnonzero(off)[0]], 6).tolist()
    raise OffSurfaceError(
        f"{off.sum()} point(s) have no way to the surface, the first at {place}"
    )
