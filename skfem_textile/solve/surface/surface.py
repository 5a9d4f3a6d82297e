"""Surfaces as zeros of a function of position, points brought onto them, and gaps."""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any, NamedTuple, Protocol

import numpy as np
from numpy import ndarray
from skfem import CellBasis

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


class Gaps(NamedTuple):
    """Gaps between elements and their surfaces, 0 where an element is on none.

    Attributes
    ----------
    share
        Largest gap of each element over its longest edge, shape (n_elements,).
    gap
        Largest gap in mm, shape (n_elements,).
    place
        Where that is in mm, shape (3, n_elements).
    """

    share: ndarray
    gap: ndarray
    place: ndarray


def gaps(
    surfaces: Iterable[tuple[Surface, ndarray]], x: ndarray, basis: CellBasis
) -> Gaps:
    """Gaps of the elements whose nodes all lie on one surface.

    They are measured midway between nodes: of quadrilaterals at the centre and the
    middles of the edges, of quadratic triangles between corners and middles of edges.

    Parameters
    ----------
    surfaces
        Surfaces, and the numbers of the nodes on each.
    x
        Positions of the nodes in mm, shape (3, n_nodes).
    basis
        Basis of the displacement.
    """
    nodes, n = basis.element_dofs[::3] // 3, basis.nelems
    vector: Any = basis.elem
    element = vector.elem  # of each component
    one, other = np.triu_indices(len(nodes), 1)
    middles = 0.5 * (element.doflocs[one] + element.doflocs[other]).round(12)
    at = np.unique(middles, axis=0).T
    shapes = np.array([element.lbasis(at, i)[0] for i in range(len(nodes))])
    corners = x[:, nodes[: len(basis.mesh.t)]]
    edges = np.linalg.norm(np.roll(corners, -1, axis=1) - corners, axis=0)
    gap, place = np.zeros(n), corners.mean(axis=1)
    for surface, own in surfaces:
        elements = np.flatnonzero(np.isin(nodes, own).all(axis=0))
        points = np.einsum("kp,ike->ipe", shapes, x[:, nodes[:, elements]])
        off = np.abs(distance(surface, points.reshape(3, -1)))
        off = off.reshape(points.shape[1:])
        furthest = off.argmax(axis=0), np.arange(len(elements))
        gap[elements] = off[furthest]
        place[:, elements] = points[:, *furthest]
    return Gaps(gap / edges.max(axis=0), gap, place)
