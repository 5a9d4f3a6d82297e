"""Surfaces that constrain nodes, and geodesics on them."""

from .on_surface import OnSurface
from .surface import (
    GrowingSurface,
    OffSurfaceError,
    Surface,
    distance,
    gaps,
    is_on,
    onto,
)

__all__ = [
    "GrowingSurface",
    "OffSurfaceError",
    "OnSurface",
    "Surface",
    "distance",
    "gaps",
    "is_on",
    "onto",
]
