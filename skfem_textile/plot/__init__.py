"""Pictures of meshes and results: by matplotlib, and pixels in space by pyvista."""

import lazy_loader

from ..mesh.requirements import require

require("a picture", "plot", "matplotlib")

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
