"""Punch with a hemispherical end, and die with a round hole.

Around their axes, where points have no closest one on a wall, φ is a smooth function
instead of the distance, so that it has a gradient there: towards the tip of the punch,
and into the hole of the die.
"""

from dataclasses import dataclass

import numpy as np
from numpy import ndarray

from .. import declarations as declared
from .analytic import TINY, OfRevolution, positive_length

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

    def __post_init__(self) -> None:
        radius = positive_length("punch: radius", self.radius)
        object.__setattr__(self, "radius", radius)
        self._prepare("punch")

    def _f(self, r: ndarray, z: ndarray) -> ndarray:
        away = np.hypot(r, np.maximum(z, 0.0))
        inside, _, _ = _core(away, self.radius)
        depth, _, _ = _depth(z, self.radius)
        return _rounded(away, self.radius)[0] - self.radius + inside * depth

    def _df(self, r: ndarray, z: ndarray) -> tuple[ndarray, ndarray]:
        away, n_r, n_z = self._direction(r, z)
        slope, _ = self._slopes(away, z)
        inside, _, _ = _core(away, self.radius)
        _, depth_z, _ = _depth(z, self.radius)
        return n_r * slope, n_z * slope + inside * depth_z

    def _ddf(self, r: ndarray, z: ndarray) -> tuple[ndarray, ndarray, ndarray]:
        away, n_r, n_z = self._direction(r, z)
        slope, bend = self._slopes(away, z)
        inside, inside_r, _ = _core(away, self.radius)
        _, depth_z, depth_zz = _depth(z, self.radius)
        around, mixed = np.where(z > 0, slope / away, 0.0), inside_r * depth_z
        return (
            bend * n_r**2 + around * n_z**2,
            (bend - around) * n_r * n_z + mixed * n_r,
            bend * n_z**2 + around * n_r**2 + 2 * mixed * n_z + inside * depth_zz,
        )

    def _direction(self, r: ndarray, z: ndarray) -> tuple[ndarray, ndarray, ndarray]:
        """Distance from the axis of the shaft or the centre, and its derivatives."""
        above = np.maximum(z, 0.0)
        away = np.maximum(np.hypot(r, above), TINY)
        return away, np.where(z > 0, r / away, 1.0), above / away

    def _slopes(self, away: ndarray, z: ndarray) -> tuple[ndarray, ndarray]:
        """First and second derivative of φ by this distance."""
        _, slope, bend = _rounded(away, self.radius)
        _, inside_r, inside_rr = _core(away, self.radius)
        depth, _, _ = _depth(z, self.radius)
        return slope + inside_r * depth, bend + inside_rr * depth


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

    def __post_init__(self) -> None:
        for name in ("radius", "fillet"):
            value = positive_length(f"die: {name}", getattr(self, name))
            object.__setattr__(self, name, value)
        self._prepare("die")

    def _f(self, r: ndarray, z: ndarray) -> ndarray:
        inside, _, _ = _core(r, self.radius)
        depth, _, _ = _depth(z, self.radius)
        return self._section(r, z)[0] - inside * depth

    def _df(self, r: ndarray, z: ndarray) -> tuple[ndarray, ndarray]:
        _, n_r, n_z, _ = self._section(r, z)
        _, slope, _ = _rounded(r, self.radius)
        inside, inside_r, _ = _core(r, self.radius)
        depth, depth_z, _ = _depth(z, self.radius)
        return n_r * slope - inside_r * depth, n_z - inside * depth_z

    def _ddf(self, r: ndarray, z: ndarray) -> tuple[ndarray, ndarray, ndarray]:
        _, n_r, n_z, curved = self._section(r, z)
        _, slope, bend = _rounded(r, self.radius)
        inside, inside_r, inside_rr = _core(r, self.radius)
        depth, depth_z, depth_zz = _depth(z, self.radius)
        return (
            curved * (n_z * slope) ** 2 + n_r * bend - inside_rr * depth,
            -curved * n_r * n_z * slope - inside_r * depth_z,
            curved * n_r**2 - inside * depth_zz,
        )

    def _section(self, r: ndarray, z: ndarray) -> tuple[ndarray, ...]:
        """Distance in the section, its derivatives by r and z, and its curvature."""
        r = _rounded(r, self.radius)[0] - (self.radius + self.fillet)
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
    s = z / radius
    slope = _SLOPE / (1 + s**2)
    bend = -2 * slope * s / (1 + s**2) / radius
    return _SLOPE * radius * np.arctan(s), slope, bend
