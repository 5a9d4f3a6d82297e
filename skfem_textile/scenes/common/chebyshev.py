"""The Chebyshev net of the sphere.

With two great circles through a pole as first threads, and lengths u and v along the
threads from there, the angle ω between the families depends on z = uv/R² alone:
z ω″ + ω′ + sin ω = 0 with ω(0) = π/2.
"""

from collections.abc import Callable
from functools import cache

import numpy as np
from numpy import ndarray

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
