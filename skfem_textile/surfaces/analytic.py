"""Analytical surfaces: plane, cylinder, sphere, cone, torus, height field, punch, die.

Except for the plane, φ is positive outside.  Each is a function of the position
relative to a point and, except for the sphere, of the distance r from an axis and the
height z along it.

Around the axes of a punch and of a die, where points have no closest one on a wall, φ
is a smooth function instead of the distance, so that it has a gradient there: towards
the tip of the punch, and into the hole of the die.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any, NamedTuple, TypeAlias

import numpy as np
from numpy import ndarray
from numpy.typing import ArrayLike

from .. import declarations as declared
from ..mesh.user_input import real_numbers, shortened

#: Three components.
Vector: TypeAlias = ArrayLike

#: Lower bound in mm of a distance from an axis or a centre used as a divisor.
TINY = 1e-300

# Largest length in mm, whose square is finite.
_LARGEST = 1e100


class _Checked:
    """Surface whose parameters are checked by their names, see `_CHECKS`."""

    def __post_init__(self) -> None:
        for key, check in _CHECKS.items():
            if hasattr(self, key):
                what = f"{type(self).__name__.lower()}: {key}"
                object.__setattr__(self, key, check(what, getattr(self, key)))


@dataclass(frozen=True, eq=False)
class Plane(declared.Plane, _Checked):
    """Plane through a point, with φ as the height above it.

    Parameters
    ----------
    point
        A point of the plane in mm.
    normal
        Normal of any length.
    """

    def level(self, x: ndarray) -> ndarray:
        """φ, shape (n,)."""
        return self.normal @ (x - np.asarray(self.point)[:, None])

    def gradient(self, x: ndarray) -> ndarray:
        """∇φ, shape (3, n)."""
        return np.broadcast_to(np.asarray(self.normal)[:, None], x.shape)

    def hessian(self, x: ndarray) -> ndarray:
        """∇²φ, shape (3, 3, n)."""
        return np.zeros((3, *x.shape))


@dataclass(frozen=True, eq=False)
class Sphere(declared.Sphere, _Checked):
    """Sphere, with φ as the distance from it.

    Parameters
    ----------
    radius
        Radius in mm.
    centre
        Centre in mm.
    """

    @property
    def diameter(self) -> float:
        """Diameter in mm."""
        return 2 * self.radius

    def level(self, x: ndarray) -> ndarray:
        """φ, shape (n,)."""
        return np.linalg.norm(self._from_centre(x), axis=0) - self.radius

    def gradient(self, x: ndarray) -> ndarray:
        """∇φ, shape (3, n)."""
        r = self._from_centre(x)
        return r / np.maximum(np.linalg.norm(r, axis=0), TINY)

    def hessian(self, x: ndarray) -> ndarray:
        """∇²φ, shape (3, 3, n)."""
        n, length = self.gradient(x), np.linalg.norm(self._from_centre(x), axis=0)
        across = np.eye(3)[:, :, None] - n[:, None] * n[None]
        return across / np.maximum(length, TINY)

    def _from_centre(self, x: ndarray) -> ndarray:
        return x - np.asarray(self.centre)[:, None]


class OfRevolution(_Checked):
    """Surface of revolution, φ = f(r, z), by the derivatives of f.

    With the radial, axial and circumferential unit vectors e_r, e_z and e_t the Hessian
    is f_rr e_r e_r + f_rz (e_r e_z + e_z e_r) + f_zz e_z e_z + (f_r/r) e_t e_t.  On the
    axis f_r/r is f_rr, and e_r any direction.
    """

    point: Vector
    axis: Vector

    def _derivatives(self, r: ndarray, z: ndarray) -> tuple[ndarray, ...]:
        """The function f of distance from the axis and height, and its derivatives.

        In this order: f, ∂f/∂r, ∂f/∂z, ∂²f/∂r², ∂²f/∂r∂z and ∂²f/∂z².
        """
        raise NotImplementedError

    def level(self, x: ndarray) -> ndarray:
        """φ, shape (n,)."""
        r, z, _ = self._cylindrical(x)
        return self._derivatives(r, z)[0]

    def gradient(self, x: ndarray) -> ndarray:
        """∇φ, shape (3, n)."""
        r, z, across = self._cylindrical(x)
        _, of_r, of_z, *_ = self._derivatives(r, z)
        return of_r * across + of_z * np.asarray(self.axis)[:, None]

    def hessian(self, x: ndarray) -> ndarray:
        """∇²φ, shape (3, 3, n)."""
        r, z, across = self._cylindrical(x)
        _, of_r, _, rr, rz, zz = self._derivatives(r, z)
        axis = np.asarray(self.axis)
        along = np.broadcast_to(axis[:, None], x.shape)
        beside = np.cross(axis, np.eye(3)[np.abs(axis).argmin()])
        beside /= np.linalg.norm(beside)
        across = np.where(r > 0, across, beside[:, None])
        bend = np.where(r > 0, of_r / np.maximum(r, TINY), rr)
        around = np.cross(along, across, axis=0)
        mixed = across[:, None] * along[None]
        return (
            rr * across[:, None] * across[None]
            + rz * (mixed + mixed.swapaxes(0, 1))
            + zz * along[:, None] * along[None]
            + bend * around[:, None] * around[None]
        )

    def _cylindrical(self, x: ndarray) -> tuple[ndarray, ndarray, ndarray]:
        """Distance from the axis, height along it, and the unit vector e_r."""
        axis = np.asarray(self.axis)
        away = x - np.asarray(self.point)[:, None]
        z = axis @ away
        away = away - z * axis[:, None]
        r = np.linalg.norm(away, axis=0)
        return r, z, away / np.maximum(r, TINY)


@dataclass(frozen=True, eq=False)
class Cylinder(declared.Cylinder, OfRevolution):
    """Cylinder, with φ as the distance from it.

    Parameters
    ----------
    radius
        Radius in mm.
    point
        A point of the axis in mm.
    axis
        Direction of the axis.
    """

    def _derivatives(self, r: ndarray, z: ndarray) -> tuple[ndarray, ...]:
        zero = np.zeros_like(r)
        return r - self.radius, zero + 1, zero, zero, zero, zero


@dataclass(frozen=True, eq=False)
class Cone(declared.Cone, OfRevolution):
    """Cone that opens along its axis; φ is the distance on the opening side.

    Parameters
    ----------
    angle
        Half of the apex angle, between axis and surface, in radians.
    point
        Apex in mm.
    axis
        Direction from the apex along the axis into the cone.
    """

    def _derivatives(self, r: ndarray, z: ndarray) -> tuple[ndarray, ...]:
        c, s, zero = np.cos(self.angle), np.sin(self.angle), np.zeros_like(r)
        return r * c - z * s, zero + c, zero - s, zero, zero, zero


@dataclass(frozen=True, eq=False)
class Torus(declared.Torus, OfRevolution):
    """Torus, with φ as the distance from it.

    Parameters
    ----------
    radius
        Radius in mm of the centre line of the tube.
    tube
        Radius of the tube in mm, the smaller of the two.
    point
        Centre in mm.
    axis
        Direction of the axis.
    """

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.tube >= self.radius:
            raise ValueError(
                f"torus: tube must be smaller than radius, got {self.tube:g} mm and "
                f"{self.radius:g} mm"
            )

    def _derivatives(self, r: ndarray, z: ndarray) -> tuple[ndarray, ...]:
        off = r - self.radius
        away = np.maximum(np.hypot(off, z), TINY)
        c, s = off / away, z / away
        of_second = s * s / away, -c * s / away, c * c / away
        return away - self.tube, c, s, *of_second


def _acute(what: str, value: ArrayLike) -> float:
    """Angle between 0 and π/2."""
    angle = float(real_numbers(what, value))
    if not 0 < angle < np.pi / 2:
        raise ValueError(f"{what} must be between 0 and π/2 radians, got {angle:g}")
    return angle


def three_numbers(what: str, value: Vector) -> ndarray:
    """Finite vector of three components."""
    vector = real_numbers(what, value)
    if vector.shape != (3,) or not np.isfinite(vector).all():
        text = shortened(value)
        raise ValueError(f"{what} must be three finite numbers, got {text}")
    return vector


def _unit(what: str, value: Vector) -> ndarray:
    """Unit vector along a nonzero vector."""
    vector = three_numbers(what, value)
    if not vector.any():
        raise ValueError(f"{what} must not be zero")
    vector = vector / np.abs(vector).max()
    return vector / np.linalg.norm(vector)


def positive_length(what: str, value: ArrayLike) -> float:
    """Positive finite length in mm."""
    number = real_numbers(what, value)
    if number.shape or not (np.isfinite(number) and number > 0):
        raise ValueError(f"{what} must be a positive length in mm, got {value!r}")
    _refuse_huge(what, number)
    return float(number)


def _place(what: str, value: Vector) -> ndarray:
    """Point in mm."""
    point = three_numbers(what, value)
    _refuse_huge(what, point)
    return point


def _refuse_huge(what: str, lengths: ndarray) -> None:
    """Refuse lengths whose squares may not be finite."""
    if (most := float(np.abs(lengths).max())) > _LARGEST:
        raise ValueError(f"{what} is {most:g} mm: check its unit")


_CHECKS: dict[str, Callable[[str, Any], Any]] = {
    **dict.fromkeys(("radius", "tube", "fillet"), positive_length),
    **dict.fromkeys(("point", "centre"), _place),
    **dict.fromkeys(("axis", "normal"), _unit),
    "angle": _acute,
}


def points_in_space(what: str, value: ArrayLike) -> ndarray:
    """Finite points, shape (3, n)."""
    points = real_numbers(what, value)
    if points.ndim != 2 or len(points) != 3 or not np.isfinite(points).all():
        raise ValueError(f"{what} must be finite numbers of shape (3, n)")
    return points


class Height(NamedTuple):
    """Height and its derivatives, each of shape (n,)."""

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
    """Surface z = h(x, y), φ = z − h.

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
    """Smooth double dome, z = H (exp(−(x/a)⁴ − (y/b)⁴) − 1), with its top at z = 0.

    Its half width b = w (1 − s exp(−(x/v)²)) is smaller in the middle.

    Parameters
    ----------
    height
        H in mm.
    length, width
        Half length a and half width w in mm, at which the height is H/e.
    waist
        Relative reduction s of the width in the middle, from 0 to less than 1.
    valley
        Half length v of the waist in mm.

    Raises
    ------
    ValueError
        If a length is not positive, or the waist is not between 0 and 1.
    """
    lengths = height, length, width, valley
    if not (all(np.isfinite(x) and x > 0 for x in lengths) and 0 <= waist < 1):
        raise ValueError(
            "double dome: height, length, width and valley must be positive, and "
            f"waist at least 0 and less than 1, got {(*lengths, waist)}"
        )
    at = partial(
        _dome, height=height, length=length, width=width, waist=waist, valley=valley
    )
    return HeightField(at)


def _dome(
    x: ndarray,
    y: ndarray,
    height: float,
    length: float,
    width: float,
    waist: float,
    valley: float,
) -> Height:
    x, y = (
        np.clip(at, -_BEYOND * a, _BEYOND * a) for at, a in ((x, length), (y, width))
    )
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


# Distance relative to a length beyond which functions have their limits: exp(−r⁴) is 0,
# and arctan and 1/(1 + r²) change by round-off.
_BEYOND = 1e20

# Slope of the level along the axis.  The level on the axis of a die remains above 0.7
# of the radius, and on the axis of a punch below -0.6 of it.
_SLOPE = 0.1


@dataclass(frozen=True, eq=False)
class Punch(declared.Punch, OfRevolution):
    """Cylindrical shaft with a hemispherical end; φ is the distance, positive outside.

    Within half of the radius from the axis of the shaft and from the centre of the
    hemisphere, φ is a smooth function instead of the distance.

    Parameters
    ----------
    radius
        Radius of the shaft and of the hemisphere in mm.
    point
        Centre of the hemisphere in mm.
    axis
        Direction from the shaft to the tip.

    Examples
    --------
    The distances of a point above the tip, and of one beside the shaft:

    >>> import numpy as np
    >>> from skfem_textile import drape
    >>> drape.Punch(30.0).level(np.array([[0.0, 34.0], [0.0, 0.0], [32.0, -50.0]]))
    array([2., 4.])
    """

    @property
    def diameter(self) -> float:
        """Diameter in mm."""
        return 2 * self.radius

    def _derivatives(self, r: ndarray, z: ndarray) -> tuple[ndarray, ...]:
        # Distance from the axis of the shaft, or from the centre above it.
        above = np.maximum(z, 0.0)
        away = np.maximum(np.hypot(r, above), TINY)
        n_r, n_z = np.where(z > 0, r / away, 1.0), above / away
        distance, slope, bend = _rounded(away, self.radius)
        inside, inside_r, inside_rr = _core(away, self.radius)
        depth, depth_z, depth_zz = _depth(z, self.radius)
        slope, bend = slope + inside_r * depth, bend + inside_rr * depth
        around, mixed = np.where(z > 0, slope / away, 0.0), inside_r * depth_z
        return (
            distance - self.radius + inside * depth,
            n_r * slope,
            n_z * slope + inside * depth_z,
            bend * n_r**2 + around * n_z**2,
            (bend - around) * n_r * n_z + mixed * n_r,
            bend * n_z**2 + around * n_r**2 + 2 * mixed * n_z + inside * depth_zz,
        )


@dataclass(frozen=True, eq=False)
class Die(declared.Die, OfRevolution):
    """Plane with a round hole and a fillet; φ is the distance, positive outside.

    Within half of the radius from the axis of the hole φ is a smooth function instead
    of the distance.

    Parameters
    ----------
    radius
        Radius of the hole in mm.
    fillet
        Radius of the fillet between plane and hole in mm.
    point
        Centre of the hole in the plane, in mm.
    axis
        Direction from the plane into the hole.

    Examples
    --------
    The distances of a point below the plane, and of one beside the fillet:

    >>> import numpy as np
    >>> from skfem_textile import drape
    >>> die = drape.Die(80.0, 10.0)
    >>> die.level(np.array([[120.0, 82.0], [0.0, 0.0], [-2.0, 2.0]])).round(4)
    array([2.    , 1.3137])
    """

    def _derivatives(self, r: ndarray, z: ndarray) -> tuple[ndarray, ...]:
        distance, slope, bend = _rounded(r, self.radius)
        level, n_r, n_z, curved = self._section(distance, z)
        inside, inside_r, inside_rr = _core(r, self.radius)
        depth, depth_z, depth_zz = _depth(z, self.radius)
        return (
            level - inside * depth,
            n_r * slope - inside_r * depth,
            n_z - inside * depth_z,
            curved * (n_z * slope) ** 2 + n_r * bend - inside_rr * depth,
            -curved * n_r * n_z * slope - inside_r * depth_z,
            curved * n_r**2 - inside * depth_zz,
        )

    def _section(self, r: ndarray, z: ndarray) -> tuple[ndarray, ...]:
        """Distance in the section, its derivatives by r and z, and its curvature."""
        r = r - (self.radius + self.fillet)
        z = z - self.fillet
        plane, wall = (r >= 0) & (z <= r), (z >= 0) & (r < z)
        away = np.maximum(np.hypot(r, z), TINY)
        distance = np.where(plane, -z, np.where(wall, -r, away)) - self.fillet
        n_r = np.where(plane, 0.0, np.where(wall, -1.0, r / away))
        n_z = np.where(plane, -1.0, np.where(wall, 0.0, z / away))
        return distance, n_r, n_z, np.where(plane | wall, 0.0, 1 / away)


def _rounded(r: ndarray, radius: float) -> tuple[ndarray, ndarray, ndarray]:
    """Distance r from an axis, an even polynomial near it, and its derivatives."""
    half = 0.5 * radius
    s = np.minimum(r / half, 1.0)
    even = half * (3 + 6 * s**2 - s**4) / 8
    return np.where(s < 1, even, r), 1.5 * s - 0.5 * s**3, 1.5 * (1 - s**2) / half


def _core(r: ndarray, radius: float) -> tuple[ndarray, ndarray, ndarray]:
    """Weight of `_depth` and its derivatives: 1 on the axis, 0 at half the radius."""
    half = 0.5 * radius
    s = np.minimum(r / half, 1.0)
    c = 1 - s**2
    return c**3, -6 * s * c**2 / half, (24 * s**2 * c - 6 * c**2) / half**2


def _depth(z: ndarray, radius: float) -> tuple[ndarray, ndarray, ndarray]:
    """Bounded function of the position along an axis, and its derivatives.

    It is so small that φ does not change its sign on the axis, and its slope is not
    zero there.
    """
    s = np.clip(z / radius, -_BEYOND, _BEYOND)
    slope = _SLOPE / (1 + s**2)
    bend = -2 * slope * s / (1 + s**2) / radius
    return _SLOPE * radius * np.arctan(s), slope, bend
