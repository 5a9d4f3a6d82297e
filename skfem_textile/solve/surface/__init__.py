"""Surfaces that constrain nodes, and geodesics on them."""

from .on_surface import OnSurface
from .surface import Grown, OffSurfaceError, Surface, distance, gaps, is_on, onto

__all__ = [
    "Grown",
    "OffSurfaceError",
    "OnSurface",
    "Surface",
    "distance",
    "gaps",
    "is_on",
    "onto",
]
