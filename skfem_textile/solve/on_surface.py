"""Condition that nodes lie on a surface, and validation of the surface.

Gradient and Hessian must be the derivatives of level and gradient.  The slope between
two points of a line must lie between the derivatives at its ends, also where the
derivative jumps.  This may fail where the derivative has an extremum, but a failure on
three consecutive intervals is a contradiction.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy import ndarray
from skfem import CellBasis

from ..mesh.bases import node_positions
from ..mesh.selection import Where, selected_nodes
from ..mesh.user_input import call_user_function, coords, keep_copies
from ..surfaces.surface import GrowingSurface, Surface
from .states import NoEquilibriumError

# Tolerances for contact of the surface with the plane of the ply: distance, relative to
# the largest coordinate, and sine of the angle between them.  They are above the
# rounding of surface meshes.
_TOUCHING = 1e-4

# Number of nodes near which a surface is checked, and the interval length relative to
# the extent of the nodes.  It is shorter than any fillet resolved by a mesh of the ply,
# and long enough for surfaces that are computed to ten digits.
_NODES, _INTERVAL = 12, 1e-3

# Ends of the intervals of a line, in intervals from its middle.
_ENDS = np.arange(-2, 3)

# Tolerances of slopes: relative to the derivative and, for round-off, to the function
# and the coordinates.  A smaller error of a derivative causes no additional iterations.
_OFF, _NOISE, _ROUNDING = 1e-2, 1e-9, 64 * 2.0**-53

# Exceptions that a function may raise at points outside its domain, beyond the nodes.
_UNDEFINED = (ValueError, ArithmeticError, LookupError, RuntimeError, AssertionError)

# Maximum number of steps to the surface.
_MOST = 20


def in_axes_of_ply(x: ndarray) -> ndarray:
    """Positions in messages, by default in the axes of the ply."""
    return x


@dataclass(frozen=True, eq=False)
class OnSurface:
    """Condition that nodes lie on a surface, along which they move freely.

    The surface grows out of the plane of the ply with the load factor: at the load
    factor t it is the surface enlarged by 1/t about the point where it touches the
    plane z = 0.  At 1 it is the given surface, and need not touch that plane.

    Parameters
    ----------
    surface
        The surface.
    where
        The nodes, see `Condition`; all nodes if not given.
    touch
        Coordinates x and y in mm of the point where the surface touches the ply.
    stated
        Function that converts positions, shape (3, n), to the axes of messages.

    Examples
    --------
    A square ply formed over a growing sphere with a radius of 100 mm, with the first
    node fixed at the pole and the lower edge in a plane of symmetry:

    >>> import numpy as np
    >>> from skfem import MeshQuad
    >>> from skfem_textile import Condition, Fabric, LoadStepper, OnSurface, Ply, drape
    >>> mesh = MeshQuad().refined(2).scaled(60.0).with_defaults()
    >>> ply = Ply(mesh, Fabric(1e4, 0.1), dimension=3)
    >>> conditions = {
    ...     "tool": OnSurface(drape.Sphere(100.0, (0, 0, -100))),
    ...     "x": Condition("left", (0.0, None, None)),
    ...     "y": Condition("bottom", (None, 0.0, None)),
    ... }
    >>> result = LoadStepper(ply, conditions, 1).run()
    >>> x = ply.positions(result.u)
    >>> bool(np.allclose(np.linalg.norm(x + [[0], [0], [100]], axis=0), 100))
    True
    """

    surface: Surface
    where: Where | None = None
    touch: tuple[float, float] = (0.0, 0.0)
    stated: Callable[[ndarray], ndarray] = in_axes_of_ply

    def __post_init__(self) -> None:
        keep_copies(self, "where", "touch")

    def place(self, position: ndarray) -> str:
        """Position in a message, given in the axes of the ply, shape (3,)."""
        return f"{coords(self.stated(position[:, None])[:, 0], 4)} mm"

    def nodes(self, name: str, basis: CellBasis) -> ndarray:
        """Numbers of the nodes on the surface, ascending.

        Raises
        ------
        ValueError
            If the nodes are not valid, or there are none.
        """
        if self.where is None:
            return np.arange(node_positions(basis).shape[1])
        return np.unique(selected_nodes(f"condition {name!r}", self.where, basis))

    def at(self, name: str, t: float) -> Surface:
        """Surface at a load factor.

        Raises
        ------
        ValueError
            If a growing surface fails or does not touch the plane of the ply.
        """
        if t == 1:
            return self.surface
        point = np.array([*self.touch, 0.0])
        what = f"condition {name!r}"
        surface = CheckedSurface(what, self.surface)
        level = float(surface.level(point[:, None])[0])
        normal = surface.gradient(point[:, None])[:, 0]
        length = float(np.linalg.norm(normal))
        if not (np.isfinite(level) and 0 < length < np.inf):
            off = "has no tangent plane"
        elif abs(level) / length > _TOUCHING * max(1.0, float(np.abs(point).max())):
            off = f"is {abs(level) / length:.3g} mm away"
        elif (sine := float(np.hypot(*normal[:2])) / length) > _TOUCHING:
            off = f"is inclined by {np.degrees(np.arcsin(min(sine, 1.0))):.2g}°"
        else:
            return GrowingSurface(self.surface, point, t)
        raise ValueError(
            f"{what}: the surface cannot be scaled with the load factor, "
            f"because it does not touch the plane z = 0 at {self.touch}, where it "
            f"{off}: move it, specify another point as touch, or start from positions "
            "on it with equilibrium_near"
        )


class SurfaceError(NoEquilibriumError, ValueError):
    """Surface failure: ValueError before a run, failed attempt during a run."""


@dataclass(frozen=True, eq=False)
class CheckedSurface:
    """Surface of a condition or tool, whose errors begin with ``what`` it is.

    Its methods raise a `SurfaceError` if an array has another shape, or if the user's
    function fails, with that exception as the cause.
    """

    what: str
    surface: Surface

    def level(self, x: ndarray) -> ndarray:
        """φ, shape (n,)."""
        return self._value("level", x, ())

    def gradient(self, x: ndarray) -> ndarray:
        """∇φ, shape (3, n)."""
        return self._value("gradient", x, (3,))

    def hessian(self, x: ndarray) -> ndarray:
        """∇²φ, shape (3, 3, n)."""
        return self._value("hessian", x, (3, 3))

    def _value(self, method: str, x: ndarray, rows: tuple[int, ...]) -> ndarray:
        what = f"{self.what}: {method} of the surface"
        try:
            value = call_user_function(what, getattr(self.surface, method), x)
        except ValueError as error:
            advice = "a surface that extends beyond the ply, or a smaller ply"
            raise SurfaceError(str(error), advice=advice) from error.__cause__
        shape = *rows, x.shape[1]
        if np.shape(value) != shape:
            raise SurfaceError(
                f"{what} must have the shape {shape}, not {np.shape(value)}"
            )
        return np.asarray(value)


def check_surface(what: str, surface: Surface, x: ndarray) -> None:
    """Refuse an invalid surface of a condition or tool.

    Parameters
    ----------
    what
        Condition or tool, at the beginning of messages.
    surface
        The surface.
    x
        Points in mm, shape (3, n), near some of which the surface is checked.

    Raises
    ------
    ValueError
        If a method is missing, fails, returns an array of another shape, or contradicts
        another.
    """
    methods = "level", "gradient", "hessian"
    if isinstance(surface, type) or not all(hasattr(surface, m) for m in methods):
        raise ValueError(
            f"{what}: surface must have the methods {', '.join(methods)}, as "
            f"drape.Sphere(100.0) has, not {surface!r}"
        )
    checked = CheckedSurface(what, surface)
    h = _INTERVAL * float(np.ptp(x, axis=1).max())
    x = x[:, np.unique(np.linspace(0, x.shape[1] - 1, _NODES).astype(int))]
    for method in methods:
        getattr(checked, method)(x)
    if h:
        _check_derivatives(checked, x, h)


def _check_derivatives(surface: CheckedSurface, x: ndarray, h: float) -> None:
    """Refuse a surface with inconsistent derivatives near a ply.

    Derivatives are compared with slopes at points of the surface near ``x``, over
    intervals of the length ``h``.  The message names the method, the position, both
    numbers and ``h``.  A function that fails with an exception other than a domain
    error also fails here.
    """
    try:
        with np.errstate(all="ignore"):  # values that are not finite are skipped
            points = _on_surface(surface, x, h)
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
    part, of = "gradient", "level"
    contradiction = _contradiction(lines, level, gradient[axis, axis][None], h)
    if contradiction is None:
        part, of = "hessian", "gradient"
        contradiction = _contradiction(lines, gradient, hessian[:, axis, axis], h)
    if contradiction is None:
        return
    row, i, point, slope, value = contradiction
    if part == "gradient":
        changing, derivative = "level", f"the {'xyz'[i]} component of gradient"
    else:
        changing = f"the {'xyz'[row]} component of gradient"
        derivative = f"hessian[{row}, {i}]"
    raise ValueError(
        f"{surface.what}: {part} of the surface differs from the slope of "
        f"{of} at ({', '.join(f'{c:.6g}' for c in point)}): along {'xyz'[i]} "
        f"{changing} changes by {slope:.4g} per mm, and {derivative} is {value:.4g}; "
        f"slopes are over {h:.3g} mm: correct the derivative, or smooth undulations "
        f"shorter than {3 * h:.3g} mm, which no ply of this size resolves"
    )


def _on_surface(surface: Surface, x: ndarray, h: float) -> ndarray:
    """Project points onto a surface by Newton's method; omits those that fail.

    Also those that move further than to the nearest point of the surface, whose
    distance is at most the one of another point plus the size of the ply.
    """
    start, size = x, h / _INTERVAL
    for _ in range(_MOST):
        ends = x[:, None, None] + h * np.eye(3)[:, :, None, None] * [[-1], [1]]
        back, ahead = np.moveaxis(
            surface.level(ends.reshape(3, -1)).reshape(3, 2, -1), 1, 0
        )
        slope, level = (ahead - back) / (2 * h), surface.level(x)
        squared = (slope**2).sum(axis=0)
        near = np.abs(level) <= h * np.sqrt(squared)
        if near.all():
            break
        x = x - np.where(near, 0.0, level / squared) * slope
        finite = np.isfinite(x).all(axis=0)
        x, near, start = x[:, finite], near[finite], start[:, finite]
    moved = np.linalg.norm(x - start, axis=0)
    near &= moved <= moved.min(initial=np.inf, where=near) + size
    return x[:, near]


def _contradiction(
    lines: ndarray, function: ndarray, derivative: ndarray, h: float
) -> tuple[int, int, ndarray, float, float] | None:
    """Largest difference of slope and derivative: row, axis, point and both; or None.

    ``whole`` and ``derivative`` are rows of a function and of its derivatives along the
    lines, shape (rows, axes, places, points), and h is the length of an interval.
    """
    size = np.abs(derivative).max(axis=(0, 1, 2))
    rounding = _ROUNDING * np.abs(lines).max(initial=0.0)
    slack = _OFF * size
    slack += (_NOISE * np.abs(function).max(axis=(0, 1, 2)) + rounding * size) / h
    change = np.diff(function, axis=2) / h
    low = np.minimum(derivative[:, :, :-1], derivative[:, :, 1:])
    high = np.maximum(derivative[:, :, :-1], derivative[:, :, 1:])
    excess = np.maximum(low - change, change - high) - slack
    off = excess > 0
    thrice = off[:, :, :-2] & off[:, :, 1:-1] & off[:, :, 2:]
    if not thrice.any():
        return None
    at = np.where(thrice, excess[:, :, 1:-1], 0.0).argmax()
    row, axis, step, point = (int(i) for i in np.unravel_index(at, thrice.shape))
    i = row, axis, step + 1, point
    middle = lines[:, axis, step + 1 : step + 3, point].mean(axis=1)
    return row, axis, middle, float(change[i]), float((low[i] + high[i]) / 2)
