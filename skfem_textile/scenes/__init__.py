"""Problems with a known answer: geometry, conditions and exact solution."""

from .scene import Scene
from .strip import strip
from .trellis import picture_frame, trellis

__all__ = ["Scene", "picture_frame", "strip", "trellis"]
