"""Conditions on displacements, nodes on surfaces, and what both leave free."""

from .condition import Condition
from .constraints import Conditions, Constraints
from .on_surface import OnSurface
from .surface import Surface

__all__ = ["Condition", "Conditions", "Constraints", "OnSurface", "Surface"]
