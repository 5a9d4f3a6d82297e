"""Input of meshes, fibre directions and fabrics, and output of results."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
