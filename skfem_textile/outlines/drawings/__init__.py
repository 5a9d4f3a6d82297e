"""Curves of drawings in DXF and SVG files, and the rings that they form."""

from .curves import Curve
from .dxf import curves_of_dxf
from .rings import Ring, rings_of_curves, rings_of_segments
from .svg import curves_of_svg

__all__ = [
    "Curve",
    "Ring",
    "curves_of_dxf",
    "curves_of_svg",
    "rings_of_curves",
    "rings_of_segments",
]
