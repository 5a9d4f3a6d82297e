"""Problems with a known answer: geometry, conditions and exact solution."""

from .bias_extension import bias_extension
from .scene import Scene
from .strip import strip
from .trellis import picture_frame, trellis

__all__ = ["Scene", "bias_extension", "picture_frame", "strip", "trellis"]
