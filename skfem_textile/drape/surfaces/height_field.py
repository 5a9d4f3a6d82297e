"""Height fields z = h(x, y), and a smooth double dome."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple, TypeAlias

import numpy as np
from numpy import ndarray


class Height(NamedTuple):
    """A height and its derivatives, each of shape (n,)."""

    h: ndarray
    x: ndarray
    y: ndarray
    xx: ndarray
    xy: ndarray
    yy: ndarray


#: Height and derivatives at points, ``(x, y) -> Height``.
HeightFunction: TypeAlias = Callable[[ndarray, ndarray], Height]


@dataclass(frozen=True, eq=False)
class HeightField:
    """The surface z = h(x, y), φ = z − h.

    Parameters
    ----------
    height
        h and its first and second derivatives, ``(x, y) -> Height``.

    Examples
    --------
    A saddle:

    >>> import numpy as np
    >>> from skfem_textile import drape
    >>> def saddle(x, y):
    ...     zero, a = np.zeros_like(x), 0.01
    ...     return drape.Height(a * x * y, a * y, a * x, zero, zero + a, zero)
    >>> surface = drape.HeightField(saddle)
    >>> surface.level(np.array([[10.0], [20.0], [3.0]]))
    array([1.])
    """

    height: HeightFunction

    def level(self, x: ndarray) -> ndarray:
        """φ, shape (n,)."""
        return x[2] - self.height(*x[:2]).h

    def gradient(self, x: ndarray) -> ndarray:
        """∇φ, shape (3, n)."""
        at = self.height(*x[:2])
        return np.array([-at.x, -at.y, np.ones_like(at.x)])

    def hessian(self, x: ndarray) -> ndarray:
        """∇²φ, shape (3, 3, n)."""
        at, zero = self.height(*x[:2]), np.zeros(x.shape[1])
        rows = (at.xx, at.xy, zero), (at.xy, at.yy, zero), (zero, zero, zero)
        return -np.array(rows)


def double_dome(
    height: float = 60.0,
    length: float = 180.0,
    width: float = 75.0,
    waist: float = 0.25,
    valley: float = 60.0,
) -> HeightField:
    """A smooth double dome, z = H (exp(−(x/a)⁴ − (y/b)⁴) − 1), its top at z = 0.

    Its half width b = w (1 − s exp(−(x/v)²)) is smaller in the middle.

    Parameters
    ----------
    height
        H in mm.
    length, width
        Half length a and half width w in mm, where the height has fallen to H/e.
    waist
        Share s by which the middle is narrower, from 0 to less than 1.
    valley
        Half length v of the waist in mm.

    Raises
    ------
    ValueError
        If a length is not positive, or the waist no share.
    """
    lengths = height, length, width, valley
    if not (all(np.isfinite(x) and x > 0 for x in lengths) and 0 <= waist < 1):
        raise ValueError(
            "double dome: height, length, width and valley must be positive, and the "
            f"waist from 0 to less than 1, got {(*lengths, waist)}"
        )

    def at(x: ndarray, y: ndarray) -> Height:
        narrow = waist * np.exp(-((x / valley) ** 2))
        b = width * (1 - narrow)
        b_x = width * narrow * 2 * x / valley**2
        b_xx = width * narrow * (2 - 4 * (x / valley) ** 2) / valley**2
        r = y / b
        r_x = -r * b_x / b
        r_xx = -r_x * b_x / b - r * (b_xx / b - (b_x / b) ** 2)
        q = (x / length) ** 4 + r**4
        q_x = 4 * x**3 / length**4 + 4 * r**3 * r_x
        q_y = 4 * r**3 / b
        q_xx = 12 * x**2 / length**4 + 12 * r**2 * r_x**2 + 4 * r**3 * r_xx
        q_xy = 12 * r**2 * r_x / b - 4 * r**3 * b_x / b**2
        q_yy = 12 * r**2 / b**2
        e = height * np.exp(-q)
        return Height(
            h=e - height,
            x=-q_x * e,
            y=-q_y * e,
            xx=(q_x**2 - q_xx) * e,
            xy=(q_x * q_y - q_xy) * e,
            yy=(q_y**2 - q_yy) * e,
        )

    return HeightField(at)
