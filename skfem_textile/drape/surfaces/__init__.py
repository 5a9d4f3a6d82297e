"""Surfaces to drape on: with a formula, height fields, and smoothed triangles."""

from .analytic import (
    Cone,
    Cylinder,
    Height,
    HeightField,
    Plane,
    Sphere,
    Torus,
    double_dome,
)
from .triangle_mesh import TriangleMesh

__all__ = [
    "Cone",
    "Cylinder",
    "Height",
    "HeightField",
    "Plane",
    "Sphere",
    "Torus",
    "TriangleMesh",
    "double_dome",
]
