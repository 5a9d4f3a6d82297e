"""A ply under conditions, its tangents, and where its iterations start."""

from .problem import Problem
from .start import Start
from .tangent import Tangent, reduced, tangent_at, turned

__all__ = ["Problem", "Start", "Tangent", "reduced", "tangent_at", "turned"]
