"""Calibration of fabric laws from shear, biaxial and bending tests."""

from ..scenes.shear_test import BiasExtension, PictureFrame, ShearTest
from .bending import BendingFit, CantileverTest, fit_bending, read_cantilever
from .biaxial import BiaxialCurve, TensionFit, fit_tension, read_biaxial
from .curves import read_curve
from .regression import Fit
from .shear import (
    ShearFit,
    Simulation,
    Specimen,
    fit_by_simulation,
    fit_shear,
    read_specimen,
)

__all__ = [
    "BendingFit",
    "BiasExtension",
    "BiaxialCurve",
    "CantileverTest",
    "Fit",
    "PictureFrame",
    "ShearFit",
    "ShearTest",
    "Simulation",
    "Specimen",
    "TensionFit",
    "fit_bending",
    "fit_by_simulation",
    "fit_shear",
    "fit_tension",
    "read_biaxial",
    "read_cantilever",
    "read_curve",
    "read_specimen",
]
