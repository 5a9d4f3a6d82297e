"""Surfaces with walls of 60°, each with two planes of symmetry through its top at 0."""

from dataclasses import dataclass

import numpy as np
from numpy import ndarray

from skfem_textile import Surface, drape

#: Slope of a wall of 60°, and the side of the quarter ply in mm.
STEEP, SIDE = np.sqrt(3.0), 100.0

# Radii in mm of what is not flat beside the walls.
_TIP, _BUMP, _WAVE = 40.0, 50.0, 40.0


def _rounded_cone(x: ndarray, y: ndarray) -> drape.Height:
    """Walls of 60° far from a tip that is rounded."""
    s = np.sqrt(x * x + y * y + _TIP**2)
    height = (_TIP - s, -x / s, -y / s)
    second = (x * x / s**3 - 1 / s, x * y / s**3, y * y / s**3 - 1 / s)
    return drape.Height(*(STEEP * a for a in (*height, *second)))


def _bump(x: ndarray, y: ndarray) -> drape.Height:
    """Gauss's bell, the steepest slope of which is 60°."""
    s, top = _BUMP, STEEP * _BUMP * np.exp(0.5)
    h = top * np.exp(-0.5 * (x * x + y * y) / s**2)
    second = ((x * x / s**2 - 1), x * y / s**2, (y * y / s**2 - 1))
    return drape.Height(
        h - top, -x / s**2 * h, -y / s**2 * h, *(a / s**2 * h for a in second)
    )


def _waves(x: ndarray, y: ndarray) -> drape.Height:
    """Waves along x, the steepest slope of which is 60°; nothing shears on them."""
    zero, a = np.zeros_like(x), STEEP * _WAVE
    c, s = np.cos(x / _WAVE), np.sin(x / _WAVE)
    return drape.Height(a * (c - 1), -STEEP * s, zero, -a / _WAVE**2 * c, zero, zero)


def _saddle(x: ndarray, y: ndarray) -> drape.Height:
    """A saddle, the slope of which is 60° at the distance of the side."""
    zero, a = np.zeros_like(x), 0.5 * STEEP / SIDE
    return drape.Height(
        a * (x * x - y * y), 2 * a * x, -2 * a * y, zero + 2 * a, zero, zero - 2 * a
    )


#: Surfaces by name; the sphere and the cylinder are steeper than 60° at the corner.
SURFACES: dict[str, Surface] = {
    "sphere": drape.Sphere(100.0, (0.0, 0.0, -100.0)),
    "cylinder": drape.Cylinder(60.0, (0.0, 0.0, -60.0)),
    "cone": drape.HeightField(_rounded_cone),
    "bump": drape.HeightField(_bump),
    "waves": drape.HeightField(_waves),
    "saddle": drape.HeightField(_saddle),
    "double dome": drape.double_dome(60.0, 180.0, 75.0, 0.25, 60.0),
}


@dataclass(frozen=True, eq=False)
class Mirrored:
    """A surface mirrored in the plane z = 0, and its two sides exchanged."""

    surface: Surface

    def level(self, x: ndarray) -> ndarray:
        """φ, shape (n,)."""
        return -self.surface.level(_mirrored(x))

    def gradient(self, x: ndarray) -> ndarray:
        """∇φ, shape (3, n)."""
        return -_mirrored(self.surface.gradient(_mirrored(x)))

    def hessian(self, x: ndarray) -> ndarray:
        """∇²φ, shape (3, 3, n)."""
        H = self.surface.hessian(_mirrored(x))
        return -_mirrored(_mirrored(H).swapaxes(0, 1)).swapaxes(0, 1)


def _mirrored(v: ndarray) -> ndarray:
    """Vectors with their last component turned round."""
    return np.concatenate([v[:2], -v[2:]])
