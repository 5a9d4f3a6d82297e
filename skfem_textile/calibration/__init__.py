"""Calibration of fabric laws from shear, biaxial and bending tests."""

from ..scenes.shear_test import BiasExtension, PictureFrame, ShearTest
from .bending import BendingFit, CantileverTest, fit_bending, read_cantilever
from .biaxial import BiaxialCurve, TensionFit, fit_tension, read_biaxial
from .preparing import Preparation, Prepared, prepare
from .reading import Format, Recording, read_recordings
from .regression import Fit
from .shear import ShearFit, Simulation, fit_by_simulation, fit_shear
from .specimens import Specimen, Zeros, read_specimens

__all__ = [
    "BendingFit",
    "BiasExtension",
    "BiaxialCurve",
    "CantileverTest",
    "Fit",
    "Format",
    "PictureFrame",
    "Preparation",
    "Prepared",
    "Recording",
    "ShearFit",
    "ShearTest",
    "Simulation",
    "Specimen",
    "TensionFit",
    "Zeros",
    "fit_bending",
    "fit_by_simulation",
    "fit_shear",
    "fit_tension",
    "prepare",
    "read_biaxial",
    "read_cantilever",
    "read_recordings",
    "read_specimens",
]
