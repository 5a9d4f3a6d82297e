"""Calibration of fabric laws from tests of strips, shear, biaxial tension, bending."""

from ..scenes.shear_test import BiasExtension, PictureFrame, ShearTest
from .bands import Fit
from .bending import CantileverTest, read_cantilever
from .biaxial import BiaxialCurve, read_biaxial
from .choice import Choice
from .fitting import FabricFit, fit_tests
from .preparing import Preparation, Prepared, prepare
from .reading import Format, Recording, read_recordings
from .regression import JointFit
from .simulation import Simulation
from .specimens import Specimen, Zeros, read_specimens
from .strip import Strip, read_strips
from .tests_file import read_tests
from .validation import LoadBand, Prediction, Validation, load_band, predict, validate

__all__ = [
    "BiasExtension",
    "BiaxialCurve",
    "CantileverTest",
    "Choice",
    "FabricFit",
    "Fit",
    "Format",
    "JointFit",
    "LoadBand",
    "PictureFrame",
    "Prediction",
    "Preparation",
    "Prepared",
    "Recording",
    "ShearTest",
    "Simulation",
    "Specimen",
    "Strip",
    "Validation",
    "Zeros",
    "fit_tests",
    "load_band",
    "predict",
    "prepare",
    "read_biaxial",
    "read_cantilever",
    "read_recordings",
    "read_specimens",
    "read_strips",
    "read_tests",
    "validate",
]
