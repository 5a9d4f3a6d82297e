"""Ply model: mesh, fabric, formulation and further terms as a function of
displacement.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
