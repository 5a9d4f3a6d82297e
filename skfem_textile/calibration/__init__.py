"""Calibration of fabric laws from tests of strips, shear, biaxial tension, bending."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
