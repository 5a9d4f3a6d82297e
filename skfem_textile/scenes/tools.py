"""Scenes of plies draped on a sphere, a cylinder, a double dome and a saddle."""

from collections.abc import Callable
from functools import cache, partial

import numpy as np
from numpy import ndarray

from ..declarations import scenes as declared
from ..surfaces.analytic import (
    Cylinder,
    Height,
    HeightField,
    Sphere,
    positive_length,
)
from ..surfaces.analytic import double_dome as tool
from .draped_ply import draped_ply
from .scene import Scene, with_parameters

#: Argument at which the net folds, ω = 0.
FOLD = 1.8616

# Argument below which the series ω = π/2 − z replaces the differential equation.
_SERIES = 1e-6


@cache
def _omega() -> Callable:
    from scipy.integrate import solve_ivp

    start = [np.pi / 2 - _SERIES, -1.0]

    def slope(z: float, y: ndarray) -> list[float]:
        return [y[1], -(y[1] + np.sin(y[0])) / z]

    settings = {"rtol": 1e-12, "atol": 1e-13, "dense_output": True}
    return solve_ivp(slope, (_SERIES, 1.9), start, **settings).sol


def shear_angle(z: ndarray) -> ndarray:
    """Shear angle π/2 − ω in radians at z = uv/R², an odd function of z.

    Examples
    --------
    >>> np.degrees(shear_angle(np.array([0.25, 1.0, -1.0]))).round(4).tolist()
    [14.2744, 54.3183, -54.3183]
    """
    size = np.maximum(np.abs(z), _SERIES)
    angle = np.pi / 2 - _omega()(size.ravel())[0].reshape(z.shape)
    return np.where(np.abs(z) < _SERIES, z, np.copysign(angle, z))


# Tolerance relative to the ply's width and to an eighth of a turn.
_OFF = 1e-6


@with_parameters(declared.Hemisphere)
def hemisphere(given: declared.Hemisphere) -> Scene:
    """Ply on a sphere with its pole at the origin.

    If the ply is symmetric about the fibres through the pole (fibres along the sides,
    or at 45° to the sides of a square), these are great circles, and the exact solution
    is the Chebyshev net.

    Parameters
    ----------
    radius
        Radius in mm.
    mesh, size, jitter, seed, fibres, width, height, tension, part
        As for `draped_ply`.

    Raises
    ------
    ValueError
        See `draped_ply`; also if the radius is not positive.
    """
    fibres, radius = given.fibres, given.radius
    return draped_ply(
        "hemisphere",
        Sphere(radius, (0.0, 0.0, -radius)),
        given.mesh,
        **given.ply(),
        exact=partial(_of_sphere, fibres=fibres, radius=radius),
        off_exact=partial(_off_exact, fibres=fibres, radius=radius),
    )


def _of_sphere(X: ndarray, t: float, fibres: float, radius: float) -> ndarray:
    return shear_angle(t * t * _threads(X, fibres, radius))


def _threads(X: ndarray, fibres: float, radius: float) -> ndarray:
    """uv/R² for points of the flat ply, with lengths u and v along the threads."""
    c, s = np.cos(fibres), np.sin(fibres)
    return (c * X[0] + s * X[1]) * (c * X[1] - s * X[0]) / radius**2


def _off_exact(X: ndarray, fibres: float, radius: float) -> str:
    """Reason why the Chebyshev net is not the exact solution; empty if it is."""
    eighths = fibres / (np.pi / 4)
    if abs(eighths - round(eighths)) > _OFF:
        return (
            "the exact net is known only for fibres along the sides or at 45 degrees "
            "to them"
        )
    low, high, (width, height) = X.min(axis=1), X.max(axis=1), np.ptp(X, axis=1)
    if low.min() < -_OFF * width and np.abs(low + high).max() > _OFF * width:
        return "the exact net is known only for a ply whose middle touches the pole"
    if round(eighths) % 2 and abs(width - height) > _OFF * width:
        return (
            "for fibres at 45 degrees to the sides the exact net is known only for a "
            "square ply"
        )
    if np.abs(_threads(X, fibres, radius)).max() > FOLD:
        return "the exact net folds within the ply"
    return ""


@with_parameters(declared.Cylinder)
def cylinder(given: declared.Cylinder) -> Scene:
    """Ply on a cylinder with its axis along y below the origin.

    The exact solution for fibres at any angle is zero shear.

    Parameters
    ----------
    radius
        Radius in mm.
    mesh, size, jitter, seed, fibres, width, height, tension, part
        As for `draped_ply`.

    Raises
    ------
    ValueError
        See `draped_ply`; also if the radius is not positive.
    """
    return draped_ply(
        "cylinder",
        Cylinder(given.radius, (0.0, 0.0, -given.radius)),
        given.mesh,
        **given.ply(),
        exact=_no_shear,
        off_exact=lambda X: "",
    )


def _no_shear(X: ndarray, t: float) -> ndarray:
    return np.zeros(X.shape[1])


@with_parameters(declared.DoubleDome)
def double_dome(given: declared.DoubleDome) -> Scene:
    """Ply on `skfem_textile.drape.double_dome` with its long side along x.

    Parameters
    ----------
    mesh, size, jitter, seed, fibres, width, height, tension, part
        As for `draped_ply`.

    Raises
    ------
    ValueError
        See `draped_ply`.
    """
    return draped_ply("double_dome", tool(), given.mesh, **given.ply())


@with_parameters(declared.Saddle)
def saddle(given: declared.Saddle) -> Scene:
    """Ply on a saddle that is concave along x and convex along y.

    Parameters
    ----------
    radius
        Radius R of both curvatures in the middle, in mm.
    mesh, size, jitter, seed, fibres, width, height, tension, part
        As for `draped_ply`.

    Raises
    ------
    ValueError
        See `draped_ply`; also if the radius is not positive.
    """
    radius = positive_length("saddle: radius", given.radius)
    surface = HeightField(partial(_saddle, radius=radius))
    return draped_ply("saddle", surface, given.mesh, **given.ply())


def _saddle(x: ndarray, y: ndarray, radius: float) -> Height:
    curved, zero = np.full_like(x, 1 / radius), np.zeros_like(x)
    h = 0.5 * (x * x - y * y) / radius
    return Height(h, x / radius, -y / radius, curved, zero, -curved)
