"""A ply under conditions, its tangents, and starts and goals of a search."""

from .problem import Problem, between
from .start import Goal, Start
from .tangent import Tangent, reduced, tangent_at, turned

__all__ = [
    "Goal",
    "Problem",
    "Start",
    "Tangent",
    "between",
    "reduced",
    "tangent_at",
    "turned",
]
