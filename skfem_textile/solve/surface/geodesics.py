"""Plies laid on a surface along geodesics: where a mechanical drape may start."""

from collections.abc import Callable

import numpy as np
from numpy import ndarray

from .surface import OffSurfaceError, Surface, onto

# Steps along the longest geodesic, and the shortest over its length.  Chosen: a sphere
# over a quarter of its circumference is off by 4e-7 of the radius; steps are as short
# as the shortest only where a surface has an edge.
_STEPS, _SHORTEST = 32, 1e-3

# Estimated error over the length of the longest geodesic above which steps are shorter:
# the error of the derivative at the end, times the whole way.  Chosen: far less than a
# start needs.  Triangles that are smoothed have curvatures that vary from one to the
# next, and are off the tool they stand for by more.
_ACCURACY = 1e-3

# Share of the step that would have this error, and how much shorter and longer than the
# last a step is at most.
_CAUTION, _SHORTER, _LONGER = 0.9, 0.2, 5.0

# Sine of the angle to an upright plane up to which one is upright.  Chosen: above what
# smoothed triangles of an upright wall are off, and below the draft of moulds.
_UPRIGHT = 0.01

# Smallest error that is divided by, in mm.
_TINY = 1e-100


def exponential_map(
    surface: Surface,
    X: ndarray,
    touch: tuple[float, float] = (0.0, 0.0),
    point: ndarray | None = None,
    first: ndarray | None = None,
    steps: int = _STEPS,
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
    steps
        Steps along the longest geodesic; more where the curvature varies.

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
    lengths = np.linalg.norm(away, axis=0)
    directions = along @ (away / np.where(lengths > 0, lengths, 1.0))
    # All geodesics advance together by steps of one length, a share of the longest, so
    # that their errors are alike, each to its own end.  It is Nyström's method
    # of order 4 (Hairer, Nørsett & Wanner 1993, Solving ordinary differential equations
    # I, II.14); the change at the end of a step tells its error.
    longest = lengths.max(initial=0.0)
    x, v = np.tile(start, len(lengths)), longest * directions
    bend = _bending(surface, x)(v)
    way, step, ends = 0.0, 1 / steps, lengths / (longest or 1.0)
    left = np.flatnonzero(ends)
    while left.size:
        h = np.minimum(step, ends[left] - way)
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
            x[:, left], v[:, left], bend[:, left] = x_1, v_1, after
            way += step
            left = left[ends[left] > way]
        longer = _CAUTION * np.cbrt(_ACCURACY * longest / max(error, _TINY))
        step *= float(np.clip(longer, _SHORTER, _LONGER))
        step = min(max(step, _SHORTEST), 1 / steps)
    return onto(surface, x)


def tangents(surface: Surface, point: ndarray, first: ndarray | tuple) -> ndarray:
    """Unit vectors of the ply's x and y in the tangent plane at a point, shape (3, 2).

    y is to the left of x, seen from above: from the side on which z increases.  Where
    the tangent plane is upright it is seen from the side on which φ is positive.

    Raises
    ------
    ValueError
        If the direction of x is normal to the surface.
    """
    n = surface.gradient(point[:, None])[:, 0]
    n = n / np.linalg.norm(n)
    n = n * np.copysign(1.0, n[2] if abs(n[2]) > _UPRIGHT else 1.0)
    x = np.asarray(first, dtype=float)
    length = np.linalg.norm(x)
    x = x - n * (n @ x)
    if not np.linalg.norm(x) > 1e-6 * length:
        raise ValueError(
            f"the direction {first} is normal to the surface: give another as first"
        )
    x = x / np.linalg.norm(x)
    return np.array([x, np.cross(n, x)]).T


def displacement(X: ndarray, x: ndarray) -> ndarray:
    """The displacement of a ply whose nodes X, shape (2, n), lie at x, shape (3, n).

    A DOF vector, as `equilibrium_near` takes one.
    """
    return (x - np.pad(X, ((0, 1), (0, 0)))).T.ravel()


def _bending(surface: Surface, x: ndarray) -> Callable[[ndarray], ndarray]:
    """Second derivatives of geodesics at points by their first, −(v·∇²φ v) ∇φ/‖∇φ‖².

    Raises
    ------
    OffSurfaceError
        If the surface has no normal there.
    """
    H = surface.hessian(x)
    g = surface.gradient(x)
    with np.errstate(all="ignore"):  # what is not finite is refused
        along = g / (g * g).sum(axis=0)
    off = ~np.isfinite(H.sum(axis=(0, 1)) + along.sum(axis=0))
    if off.any():
        place = np.round(x[:, off.argmax()], 3).tolist()
        raise OffSurfaceError(f"a geodesic leaves the surface at {place}")
    return lambda v: -np.einsum("ijn,in,jn->n", H, v, v) * along
