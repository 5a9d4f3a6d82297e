"""Specimens of known laws, and fits of a single kind of test."""

import numpy as np

from skfem_textile import Polynomial
from skfem_textile.calibration import (
    BiasExtension,
    Choice,
    PictureFrame,
    Specimen,
    Strip,
    Zeros,
    fit_tests,
)
from skfem_textile.calibration.report import shear_report

BIAS, FRAME = BiasExtension(100.0, 200.0), PictureFrame(200.0, 160.0)
QUINTIC = Polynomial((0.1, 0.0, -0.1, 0.0, 0.5))
UNKNOWN = Zeros(None, None)


def noisy(force, noise, seed):
    """Forces with noise, as a fraction of the largest one."""
    rng = np.random.default_rng(seed)
    return force + noise * force.max() * rng.standard_normal(force.shape)


def specimen(test, law, gamma, noise=0.0, seed=0, scale=1.0, **more):
    """A shear test at angles in radians; ``scale`` multiplies its forces."""
    force = noisy(scale * test.force(law, gamma), noise, seed)
    return Specimen("one", test, force, test.displacement(gamma), **more)


def pulled(test, law, moved, slack=0.0, noise=0.0, seed=0, zeros=UNKNOWN):
    """A shear test at displacements in mm, with a slack in mm."""
    force = test.force(law, test.shear_angle(np.maximum(moved - slack, 0.0)))
    return Specimen("one", test, noisy(force, noise, seed), moved, zeros=zeros)


def strip(law, moved, noise=0.0, seed=0, slack=0.0, unknown=False):
    """A strip of 50 mm × 200 mm along the warp, with a slack in mm."""
    strain = np.log1p(np.maximum(moved - slack, 0.0) / 200.0)
    force = noisy(50.0 * law.value(strain) / np.exp(strain), noise, seed)
    return Strip("one", "warp", 50.0, 200.0, moved, force, None if unknown else slack)


def fit_shear(specimens, law="polynomial", simulation=None, **how):
    """Fit of shear tests."""
    return fit_tests(specimens, Choice(law, **how), simulation)


def of_shear(specimens, law="polynomial", **how):
    """Parameters of the shear law of such a fit."""
    return fit_shear(specimens, law, **how).parts["shear"]


def fit_tension(tests, law="crimp-toe", **how):
    """Fit of biaxial tests and strips."""
    return fit_tests(tests, Choice(tension=law, **how))


def notes(fit):
    """Notes of the report of a shear law."""
    return " ".join(shear_report(fit)["notes"])
