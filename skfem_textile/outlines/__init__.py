"""Outlines of plies, and fibres across which the shear angle may jump."""

import lazy_loader

from ..mesh.requirements import require

require("a mesh of an outline", "outlines", "shapely")

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
