"""Problems with a known answer, geometry, conditions, solution."""

from .bias_extension import bias_extension
from .case import Case
from .picture_frame import picture_frame
from .scene import Scene
from .space.buckling import buckling
from .space.cantilever import cantilever
from .space.cylinder import cylinder
from .space.double_dome import double_dome
from .space.drape import drape
from .space.hemisphere import hemisphere
from .space.saddle import saddle
from .specimen import specimen
from .strip import strip
from .trellis import trellis

__all__ = [
    "Case",
    "Scene",
    "bias_extension",
    "buckling",
    "cantilever",
    "cylinder",
    "double_dome",
    "drape",
    "hemisphere",
    "picture_frame",
    "saddle",
    "specimen",
    "strip",
    "trellis",
]
