"""Scene `hemisphere`: a ply on a sphere, whose Chebyshev net is known.

The Chebyshev net of the sphere.

With two great circles through a pole as first threads, and lengths u and v along the
threads from there, the angle ω between the families depends on z = uv/R² alone:
z ω″ + ω′ + sin ω = 0 with ω(0) = π/2.
"""

from collections.abc import Callable
from functools import cache, partial
from typing import Unpack

import numpy as np
from numpy import ndarray
from skfem import Mesh

from ...drape import Sphere
from ..scene import Scene
from .laid import LaidPly, laid

#: Where the net folds, ω = 0.
FOLD = 1.8616

# Where the series ω = π/2 − z takes over from the differential equation.
_SERIES = 1e-6


@cache
def _omega() -> Callable:
    from scipy.integrate import solve_ivp  # takes long to load

    start = [np.pi / 2 - _SERIES, -1.0]

    def slope(z: float, y: ndarray) -> list[float]:
        return [y[1], -(y[1] + np.sin(y[0])) / z]

    settings = {"rtol": 1e-12, "atol": 1e-13, "dense_output": True}
    return solve_ivp(slope, (_SERIES, 1.9), start, **settings).sol


def shear_angle(z: ndarray) -> ndarray:
    """Shear angle π/2 − ω in radians where uv/R² is z, an odd function of it.

    Examples
    --------
    >>> np.degrees(shear_angle(np.array([0.25, 1.0, -1.0]))).round(4).tolist()
    [14.2744, 54.3183, -54.3183]
    """
    size = np.maximum(np.abs(z), _SERIES)
    angle = np.pi / 2 - _omega()(size.ravel())[0].reshape(z.shape)
    return np.where(np.abs(z) < _SERIES, z, np.copysign(angle, z))


#: Radius of the sphere and sides of the ply in mm.
RADIUS, WIDTH, HEIGHT = 100.0, 180.0, 180.0

# Share of the ply's width, and of an eighth of a turn, that counts as none.
_OFF = 1e-6


def hemisphere(
    mesh: str | Mesh = "irregular",
    radius: float = RADIUS,
    **ply: Unpack[LaidPly],
) -> Scene:
    """A ply on a sphere, its pole at the origin.

    Where the ply is symmetric about the fibres through the pole these are great
    circles, and the exact answer is the Chebyshev net: with fibres along the sides, or
    at 45° to the sides of a square.

    Parameters
    ----------
    radius
        Radius in mm.
    mesh, **ply
        As of `laid`.

    Raises
    ------
    ValueError
        As from `laid`, or if the radius is not positive.
    """
    fibres = ply.get("fibres", 0.0)
    return laid(
        "hemisphere",
        Sphere(radius, (0.0, 0.0, -radius)),
        mesh,
        **ply,
        exact=lambda X, t: shear_angle(t * t * _threads(X, fibres, radius)),
        off_exact=partial(_off_exact, fibres=fibres, radius=radius),
    )


def _threads(X: ndarray, fibres: float, radius: float) -> ndarray:
    """uv/R² of the lengths u and v along the threads of points of the flat ply."""
    c, s = np.cos(fibres), np.sin(fibres)
    return (c * X[0] + s * X[1]) * (c * X[1] - s * X[0]) / radius**2


def _off_exact(X: ndarray, fibres: float, radius: float) -> str:
    """Why the Chebyshev net is not the answer; empty if it is."""
    eighths = fibres / (np.pi / 4)
    if abs(eighths - round(eighths)) > _OFF:
        return "the net is known of fibres along the sides or at 45 degrees to them"
    low, high, (width, height) = X.min(axis=1), X.max(axis=1), np.ptp(X, axis=1)
    if low.min() < -_OFF * width and np.abs(low + high).max() > _OFF * width:
        return "the net is known of a ply that touches the pole in its middle"
    if round(eighths) % 2 and abs(width - height) > _OFF * width:
        return "with fibres at 45 degrees to the sides the net is known of a square"
    if np.abs(_threads(X, fibres, radius)).max() > FOLD:
        return "the net folds within the ply"
    return ""
