"""Whether the parts of a user's surface contradict each other.

Gradient and Hessian are to be the slopes of level and gradient.  Between two points of
a line a slope must be some value of the derivative between those at its ends.  That
holds where the derivative jumps too.  Where it turns round it may fail, but not on
three intervals on end: there the parts contradict each other.
"""

from typing import NamedTuple

import numpy as np
from numpy import ndarray

from ..states import NoEquilibriumError
from .surface import Surface

# Nodes near which a surface is asked, and the length of an interval over the extent of
# the nodes.  Chosen: shorter than any fillet that a mesh of the ply follows, and long
# enough for surfaces that are themselves computed to ten digits.
_NODES, _INTERVAL = 12, 1e-3

# Ends of the intervals of a line, in intervals from its middle.
_ENDS = np.arange(-2, 3)

# How far slopes may be off: as a share of the derivative, and, for round-off, of what
# changes and of the coordinates.  Chosen: a derivative that is off by less takes no
# more iterations.
_OFF, _NOISE, _ROUNDING = 1e-2, 1e-9, 64 * 2.0**-53

# What a function may raise of points at which it need not be defined: beyond the nodes.
_UNDEFINED = (ValueError, ArithmeticError, LookupError, RuntimeError, AssertionError)

# Steps at most to the surface.
_MOST = 20

_AXES = "xyz"


class _Found(NamedTuple):
    """A contradiction: row, axis and place of its middle, slope and derivative."""

    row: int
    axis: int
    place: ndarray
    slope: float
    derivative: float


def check_derivatives(name: str, surface: Surface, x: ndarray) -> None:
    """Refuse a surface whose parts contradict each other where a ply may lie.

    It is asked at some points of it, to which slopes of level lead from nodes.

    Parameters
    ----------
    name
        Name of the condition.
    surface
        The surface.
    x
        Reference positions of the nodes in mm, shape (3, n).

    Raises
    ------
    ValueError
        If they do; the message names the part, the place, both numbers and the length
        over which they differ.
    NoEquilibriumError
        If a function of the surface fails with an error that is not one of its domain.
    """
    h = _INTERVAL * float(np.ptp(x, axis=1).max())
    if not h:
        return
    some = np.unique(np.linspace(0, x.shape[1] - 1, _NODES).astype(int))
    try:
        with np.errstate(all="ignore"):  # what is not finite tells nothing
            points = _on_surface(surface, x[:, some], h)
            # Shape (3, axes, places on each line, points).
            steps = h * np.eye(3)[:, :, None, None] * _ENDS[:, None]
            lines = points[:, None, None] + steps
            flat = lines.reshape(3, -1)
            level = surface.level(flat).reshape(1, *lines.shape[1:])
            gradient = surface.gradient(flat).reshape(lines.shape)
            hessian = surface.hessian(flat).reshape(3, *lines.shape)
    except NoEquilibriumError as error:
        if isinstance(error.__cause__, _UNDEFINED):
            return
        raise
    axis = np.arange(3)
    found = _contradiction(lines, level, gradient[axis, axis][None], h)
    if found is not None:
        along = _AXES[found.axis]
        raise ValueError(
            f"condition {name!r}: gradient of the surface differs from the slope of "
            f"level {_at(found)}: along {along} level changes by {found.slope:.4g} per "
            f"mm, and the {along} component of gradient is {found.derivative:.4g}; "
            f"{_over(h)}"
        )
    found = _contradiction(lines, gradient, hessian[:, axis, axis], h)
    if found is not None:
        raise ValueError(
            f"condition {name!r}: hessian of the surface differs from the slope of "
            f"gradient {_at(found)}: along {_AXES[found.axis]} the {_AXES[found.row]} "
            f"component of gradient changes by {found.slope:.4g} per mm, and "
            f"hessian[{found.row}, {found.axis}] is {found.derivative:.4g}; {_over(h)}"
        )


def _at(found: _Found) -> str:
    return f"at ({', '.join(f'{c:.6g}' for c in found.place)})"


def _over(h: float) -> str:
    """The length over which slopes were taken, and what it means."""
    return (
        f"slopes are over {h:.3g} mm: correct the derivative, or smooth waves that are "
        f"shorter than {3 * h:.3g} mm, which no ply of this size follows"
    )


def _on_surface(surface: Surface, x: ndarray, h: float) -> ndarray:
    """Points of a surface near others, without those that do not get there."""
    for _ in range(_MOST):
        ends = x[:, None, None] + h * np.eye(3)[:, :, None, None] * [[-1], [1]]
        back, there = (
            surface.level(ends.reshape(3, -1)).reshape(3, 2, -1).swapaxes(0, 1)
        )
        slope, level = (there - back) / (2 * h), surface.level(x)
        squared = (slope**2).sum(axis=0)
        near = np.abs(level) <= h * np.sqrt(squared)
        if near.all():
            break
        x = x - np.where(near, 0.0, level / squared) * slope
        finite = np.isfinite(x).all(axis=0)
        x, near = x[:, finite], near[finite]
    return x[:, near]


def _contradiction(
    lines: ndarray, whole: ndarray, derivative: ndarray, h: float
) -> _Found | None:
    """The largest contradiction on lines, if there is one.

    Parameters
    ----------
    lines
        Positions, shape (3, axes, places, points).
    whole, derivative
        Rows of what changes, and of its derivatives along the lines, shape (rows, axes,
        places, points).
    h
        Length of an interval.
    """
    size = np.abs(derivative).max(axis=(0, 1, 2))
    rounding = _ROUNDING * np.abs(lines).max(initial=0.0)
    slack = _OFF * size
    slack += (_NOISE * np.abs(whole).max(axis=(0, 1, 2)) + rounding * size) / h
    change = np.diff(whole, axis=2) / h
    low = np.minimum(derivative[:, :, :-1], derivative[:, :, 1:])
    high = np.maximum(derivative[:, :, :-1], derivative[:, :, 1:])
    excess = np.maximum(low - change, change - high) - slack
    off = excess > 0
    thrice = off[:, :, :-2] & off[:, :, 1:-1] & off[:, :, 2:]
    if not thrice.any():
        return None
    at = np.where(thrice, excess[:, :, 1:-1], 0.0).argmax()
    row, axis, place, point = (int(i) for i in np.unravel_index(at, thrice.shape))
    i = row, axis, place + 1, point
    middle = lines[:, axis, place + 1 : place + 3, point].mean(axis=1)
    return _Found(row, axis, middle, float(change[i]), float((low[i] + high[i]) / 2))
