"""Refinement of a ply where its mesh is too coarse."""

from .indicator import marked, shear_angle_jumps
from .refine import Refinement, refine

__all__ = ["Refinement", "marked", "refine", "shear_angle_jumps"]
