"""Vectorised evaluation of the forms for all elements, on a fixed sparsity pattern."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
