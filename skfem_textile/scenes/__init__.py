"""Problems with a known answer: geometry, conditions and exact solution."""

from .scene import Scene
from .strip import strip

__all__ = ["Scene", "strip"]
