"""Laws of a fabric from its tests: picture frame, bias extension and biaxial."""

from .curves import read_curve
from .inverse import Simulation, fit_by_simulation
from .regression import Fit
from .shear import ShearFit, Specimen, fit_shear, read_specimen
from .shear_tests import BiasExtension, PictureFrame, ShearTest

__all__ = [
    "BiasExtension",
    "Fit",
    "PictureFrame",
    "ShearFit",
    "ShearTest",
    "Simulation",
    "Specimen",
    "fit_by_simulation",
    "fit_shear",
    "read_curve",
    "read_specimen",
]
