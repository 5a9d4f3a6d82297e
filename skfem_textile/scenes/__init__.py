"""Scenes: problems with geometry, conditions and, where known, an exact solution."""

from .bias_extension import bias_extension
from .case import Case
from .drape import drape
from .forming import double_dome_forming, forming, hemisphere_forming
from .scene import Scene
from .specimen import specimen
from .strip import strip
from .strips_in_space import buckling, cantilever
from .tools import cylinder, double_dome, hemisphere, saddle
from .trellis import picture_frame, trellis

__all__ = [
    "Case",
    "Scene",
    "bias_extension",
    "buckling",
    "cantilever",
    "cylinder",
    "double_dome",
    "double_dome_forming",
    "drape",
    "forming",
    "hemisphere",
    "hemisphere_forming",
    "picture_frame",
    "saddle",
    "specimen",
    "strip",
    "trellis",
]
