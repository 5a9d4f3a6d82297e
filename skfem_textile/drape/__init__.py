"""Draping: surfaces, and plies laid on them without mechanics."""

from .analytic import Cone, Cylinder, Plane, Sphere, Torus
from .geodesics import displacement, exponential_map
from .height_field import Height, HeightField, double_dome

__all__ = [
    "Cone",
    "Cylinder",
    "Height",
    "HeightField",
    "Plane",
    "Sphere",
    "Torus",
    "displacement",
    "double_dome",
    "exponential_map",
]
