"""Surfaces as level sets: projection of points, gaps and geodesics."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any, NamedTuple, Protocol

import numpy as np
from numpy import ndarray
from skfem import CellBasis

from ..mesh.user_input import CopiedError, coords, shortened

# Distance from a surface, relative to the largest coordinate, below which a point is on
# it, and maximum number of iterations of the projection.  It is far below any element
# size, and above the rounding of computed surfaces.
_ON_SURFACE, _MOST = 1e-11, 50

# Number of steps along the longest geodesic, and shortest step relative to its length.
# The error on a sphere over a quarter of its circumference is 4e-7 of the radius; the
# shortest steps occur only at edges of a surface.
_STEPS, _SHORTEST = 32, 1e-3

# Estimated error, relative to the length of the longest geodesic, above which steps are
# shortened: the error of the derivative at the end, times the whole length.  It is far
# below the accuracy of an initial guess.  Smoothed triangles have curvatures that vary
# between triangles and deviate more from the tool that they represent.
_ACCURACY = 1e-3

# Safety factor of the step length, and limits of its change per step.
_CAUTION, _SHORTER, _LONGER = 0.9, 0.2, 5.0

# Sine of the angle up to which a tangent plane counts as vertical.  It is above the
# error of smoothed triangles of a vertical wall, and below the draft of moulds.
_UPRIGHT = 0.01

# Inclination of a plane to the plane normal to x below which the projection of x onto
# it is not used, 1°.
_ACROSS = 0.0175

# Lower bound of the error in the step control, in mm.
_TINY = 1e-100


class Surface(Protocol):
    """Level set: points x with φ(x) = 0 and a nonzero gradient.

    φ may be any smooth function that is positive on one side and negative on the other,
    not necessarily the distance.  Positions ``x`` have the shape (3, n), in mm.
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


class OffSurfaceError(CopiedError, ValueError):
    """Point or geodesic that leaves a surface.

    Parameters
    ----------
    what
        Point or geodesic, in words.
    position
        Position in mm, shape (3,).
    """

    def __init__(self, what: str, position: ndarray) -> None:
        super().__init__(f"{what} at {coords(position, 4)} mm")
        self.what, self.position = what, position


@dataclass(frozen=True, eq=False)
class GrowingSurface:
    """Surface growing from its tangent plane at a point: φ(p + t(x − p))/t.

    It is the surface enlarged by 1/t about the point p, so that curvatures are
    proportional to t.  At t = 0 it is the tangent plane.

    Parameters
    ----------
    surface
        The surface.
    point
        The point p on the surface, in mm, shape (3,).
    t
        Parameter from 0 to 1.
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
        if self.t == 0:
            return np.repeat(self.surface.gradient(p), x.shape[1], axis=1)
        return self.surface.gradient(p + self.t * (x - p))

    def hessian(self, x: ndarray) -> ndarray:
        """∇²φ, shape (3, 3, n)."""
        p = self.point[:, None]
        if self.t == 0:
            return np.zeros((3, 3, x.shape[1]))
        return self.t * self.surface.hessian(p + self.t * (x - p))


def triangle_sums(surface: Surface) -> ndarray:
    """Numbers that identify the triangles of a surface, shape (9,).

    Sums of their corners with different weights; empty for a surface without triangles.
    """
    facets: Any = getattr(surface, "facets", None)
    if facets is None:
        return np.empty(0)
    corners = facets.points[:, facets.triangles()]
    return np.ravel(corners @ np.sin(np.arange(1, corners.shape[-1] + 1)))


def distance(surface: Surface, x: ndarray) -> ndarray:
    """Signed distance from a surface to first order, shape (n,), in mm."""
    return surface.level(x) / np.linalg.norm(surface.gradient(x), axis=0)


def is_on(surface: Surface, x: ndarray) -> bool:
    """True if all points are on a surface, to round-off."""
    allowed = 2 * _ON_SURFACE * np.abs(x).max(initial=1.0)
    return bool((np.abs(distance(surface, x)) <= allowed).all())


def onto(
    surface: Surface,
    x: ndarray,
    free: ndarray | None = None,
    origin: ndarray | float = 0.0,
) -> ndarray:
    """Project points onto a surface along its normals, by Newton's method.

    Parameters
    ----------
    surface
        The surface.
    x
        Points near the surface, shape (3, n).
    free
        Projectors onto the free directions of each point, shape (n, 3, 3); all
        directions are free if not given.
    origin
        Positions from which displacements are stored.  The result is rounded as the sum
        of both, at which the surface has then been evaluated.

    Returns
    -------
    ndarray
        Shape (3, n).

    Raises
    ------
    OffSurfaceError
        If the projection of a point fails.
    """
    allowed = _ON_SURFACE * np.abs(x).max(initial=1.0)
    for _ in range(_MOST):
        g, level = surface.gradient(x), surface.level(x)
        along = g if free is None else np.einsum("nij,jn->in", free, g)
        off = ~(np.abs(level) <= allowed * np.linalg.norm(g, axis=0))
        if not off.any():
            return x
        with np.errstate(all="ignore"):  # non-finite values are detected
            x = x - np.where(off, level / (along * g).sum(axis=0), 0.0) * along
            x = origin + (x - origin)
        if not np.isfinite(x).all():
            break
    raise OffSurfaceError(
        f"{off.sum()} point(s) cannot be projected onto the surface, the first",
        x[:, np.flatnonzero(off)[0]],
    )


class SurfaceGaps(NamedTuple):
    """Gaps between elements and their surfaces, 0 if an element is not on a surface.

    Attributes
    ----------
    share
        Largest gap of each element, relative to its longest edge, shape (n_elements,).
    gap
        Largest gap in mm, shape (n_elements,).
    position
        Its position in mm, shape (3, n_elements).
    """

    share: ndarray
    gap: ndarray
    position: ndarray


def gaps(
    surfaces: Iterable[tuple[Surface, ndarray]], x: ndarray, basis: CellBasis
) -> SurfaceGaps:
    """Gaps of the elements whose nodes all lie on one surface.

    They are measured midway between nodes: at the centre and the edge midpoints of
    quadrilaterals, and between corners and edge midpoints of quadratic triangles.

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
    gap, position = np.zeros(n), corners.mean(axis=1)
    for surface, on_surface in surfaces:
        elements = np.flatnonzero(np.isin(nodes, on_surface).all(axis=0))
        points = np.einsum("kp,ike->ipe", shapes, x[:, nodes[:, elements]])
        off = np.abs(distance(surface, points.reshape(3, -1)))
        off = off.reshape(points.shape[1:])
        furthest = off.argmax(axis=0), np.arange(len(elements))
        gap[elements] = off[furthest]
        position[:, elements] = points[:, *furthest]
    return SurfaceGaps(gap / edges.max(axis=0), gap, position)


class Geodesics(NamedTuple):
    """Geodesics from one point of a surface: m computed positions on each of n.

    Attributes
    ----------
    arc
        Arc length at the positions, relative to the longest geodesic, shape (m, n).
    x, v, a
        Positions in mm and their first and second derivatives in ``arc``, (m, 3, n).
    """

    arc: ndarray
    x: ndarray
    v: ndarray
    a: ndarray

    def at(self, t: float) -> ndarray:
        """Positions at a fraction of the length, by quintic interpolation, (3, n)."""
        arc, nodes = t * self.arc[-1], np.arange(self.arc.shape[1])
        i = np.clip((self.arc <= arc).sum(axis=0), 1, len(self.arc) - 1) - 1
        x, v, a, x_1, v_1, a_1 = (
            values[k, :, nodes].T for k in (i, i + 1) for values in self[1:]
        )
        h = self.arc[i + 1, nodes] - self.arc[i, nodes]
        s = (arc - self.arc[i, nodes]) / np.where(h > 0, h, 1.0)
        off, turn = x_1 - x - h * v - h * h / 2 * a, h * (v_1 - v - h * a)
        bend = h * h / 2 * (a_1 - a)
        rest = 10 * off - 4 * turn + bend
        rest += s * (7 * turn - 15 * off - 2 * bend + s * (6 * off - 3 * turn + bend))
        return x + s * h * (v + s * h / 2 * a) + s**3 * rest

    def on_growing(self, point: ndarray, t: float) -> ndarray:
        """Ends of the geodesics on the `GrowingSurface` with parameter t, shape (3, n).

        They are the points at the fraction t of these geodesics, scaled by 1/t.
        """
        point = point[:, None]
        if t == 0:
            return point + self.arc[-1] * self.v[0]
        return point + (self.at(t) - point) / t


def exponential_map(
    surface: Surface,
    X: ndarray,
    touch: tuple[float, float] = (0.0, 0.0),
    point: ndarray | None = None,
    first: ndarray | None = None,
    steps: int = _STEPS,
) -> ndarray:
    """Ends of geodesics on a surface, one for each point of the ply.

    Each geodesic starts at the point where the ply touches the surface, with the
    direction and length of the line to the point in the plane of the ply.

    Parameters
    ----------
    surface
        The surface.
    X
        Points of the ply in mm, shape (2, n).
    touch
        Point of the ply that touches the surface.
    point
        Its position in space, shape (3,); (x, y, 0) of ``touch`` if not given.
    first
        Direction in space of the x axis of the ply there, projected onto the tangent
        plane.  The x axis if not given.
    steps
        Number of steps along the longest geodesic; more where the curvature varies.

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
    return onto(surface, geodesics(surface, X, touch, point, first, steps).at(1.0))


def geodesics(
    surface: Surface,
    X: ndarray,
    touch: tuple[float, float] = (0.0, 0.0),
    point: ndarray | None = None,
    first: ndarray | None = None,
    steps: int = _STEPS,
) -> Geodesics:
    """Integrate the geodesics whose end points `exponential_map` returns."""
    start = np.array([*touch, 0.0]) if point is None else np.asarray(point, dtype=float)
    start = onto(surface, start[:, None])
    along = tangents(surface, start[:, 0], (1.0, 0.0, 0.0) if first is None else first)
    away = X - np.asarray(touch)[:, None]
    lengths = np.linalg.norm(away, axis=0)
    directions = along @ (away / np.where(lengths > 0, lengths, 1.0))
    # All geodesics advance together, by the same fraction of their lengths.  Nyström's
    # method of order 4 (Hairer, Nørsett & Wanner 1993, Solving ordinary differential
    # equations I, II.14); the change at the end of a step estimates its error.
    longest = lengths.max(initial=0.0)
    x, v = np.tile(start, len(lengths)), longest * directions
    bend = _bending(surface, x)(v)
    arc, step, ends = 0.0, 1 / steps, lengths / (longest or 1.0)
    left = np.flatnonzero(ends)
    places = [(np.zeros(len(ends)), x, v, bend)]
    while left.size:
        h = np.minimum(step, ends[left] - arc)
        x_0, v_0, a = x[:, left], v[:, left], bend[:, left]
        middle = _bending(surface, x_0 + h / 2 * v_0 + h * h / 8 * a)
        b = middle(v_0 + h / 2 * a)
        c = middle(v_0 + h / 2 * b)
        d = _bending(surface, x_0 + h * v_0 + h * h / 2 * c)(v_0 + h * c)
        x_1 = x_0 + h * v_0 + h * h / 6 * (a + b + c)
        v_1 = v_0 + h / 6 * (a + 2 * b + 2 * c + d)
        after = _bending(surface, x_1)(v_1)
        error = 0.1 * float(np.linalg.norm(after - d, axis=0).max())
        if error <= _ACCURACY * longest or step <= _SHORTEST:
            x, v, bend = x.copy(), v.copy(), bend.copy()
            x[:, left], v[:, left], bend[:, left] = x_1, v_1, after
            arc += step
            places.append((np.minimum(arc, ends), x, v, bend))
            left = left[ends[left] > arc]
        longer = _CAUTION * np.cbrt(_ACCURACY * longest / max(error, _TINY))
        step *= float(np.clip(longer, _SHORTER, _LONGER))
        step = min(max(step, _SHORTEST), 1 / steps)
    if len(places) == 1:
        places *= 2
    return Geodesics(*map(np.array, zip(*places, strict=True)))


def tangents(surface: Surface, point: ndarray, first: ndarray | tuple) -> ndarray:
    """Unit vectors of the x and y axes of the ply in the tangent plane, shape (3, 2).

    Seen from the side of increasing z, y is to the left of x.  A vertical tangent plane
    is seen from the side on which φ is positive.

    Raises
    ------
    ValueError
        If the direction of x is not a direction, or normal to the surface.
    """
    n = surface.gradient(point[:, None])[:, 0]
    n = n / np.linalg.norm(n)
    n = n * np.copysign(1.0, n[2] if abs(n[2]) > _UPRIGHT else 1.0)
    x = np.asarray(first, dtype=float)
    if x.shape != (3,) or not np.isfinite(x).all():
        raise ValueError(
            "the direction `first` must be three finite numbers, got "
            f"{shortened(first)}"
        )
    length = np.linalg.norm(x)
    x = x - n * (n @ x)
    if not np.linalg.norm(x) > 1e-6 * length:
        raise ValueError(
            f"the direction {first} is normal to the surface: specify another "
            "direction as `first`"
        )
    x = x / np.linalg.norm(x)
    return np.array([x, np.cross(n, x)]).T


class Axes(NamedTuple):
    """Coordinate axes of a ply relative to its tool.

    Parameters
    ----------
    origin
        Origin of the ply in mm, shape (3,).
    turn
        Directions of x, y and z of the ply, columns of shape (3, 3).
    """

    origin: ndarray = np.zeros(3)
    turn: ndarray = np.eye(3)

    @classmethod
    def at(cls, surface: Surface, point: ndarray) -> "Axes":
        """Axes of a ply that touches a surface at a point, shape (3,).

        z is the normal, and x is the projection of the tool's x onto the tangent plane.
        If the normal is along x, to 1°, the tool's z is used instead of its x.
        """
        normal = surface.gradient(point[:, None])[:, 0]
        across = np.hypot(*normal[1:]) <= _ACROSS * abs(normal[0])
        plane = tangents(surface, point, (0.0, 0.0, 1.0) if across else (1.0, 0.0, 0.0))
        return cls(point, np.column_stack([plane, np.cross(*plane.T)]))

    def of_tool(self, x: ndarray) -> ndarray:
        """Convert points from ply axes to tool axes, shape (3, n)."""
        return self.origin[:, None] + self.turn @ x

    def of_ply(self, x: ndarray) -> ndarray:
        """Convert points from tool axes to ply axes, shape (3, n)."""
        return self.turn.T @ (x - self.origin[:, None])


#: Axes of a ply that coincide with the axes of its tool.
SAME_AXES = Axes()


def displacement(X: ndarray, x: ndarray) -> ndarray:
    """Displacement of a ply whose nodes X, shape (2, n), lie at x, shape (3, n).

    Returned as a DOF vector for `equilibrium_near`.
    """
    return (x - np.pad(X, ((0, 1), (0, 0)))).T.ravel()


def _bending(surface: Surface, x: ndarray) -> Callable[[ndarray], ndarray]:
    """Second derivatives of geodesics from their first, −(v·∇²φ v) ∇φ/‖∇φ‖².

    Raises an error if the surface has no normal there.
    """
    H = surface.hessian(x)
    g = surface.gradient(x)
    with np.errstate(all="ignore"):  # non-finite values are refused
        along = g / (g * g).sum(axis=0)
    off = ~np.isfinite(H.sum(axis=(0, 1)) + along.sum(axis=0))
    if off.any():
        raise OffSurfaceError("a geodesic leaves the surface", x[:, off.argmax()])
    return lambda v: -np.einsum("ijn,in,jn->n", H, v, v) * along
