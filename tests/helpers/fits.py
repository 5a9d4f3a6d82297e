"""Fits of a single kind of test, with the law as the second argument."""

from skfem_textile.calibration import Choice, fit_tests


def fit_shear(specimens, law="polynomial", simulation=None, **how):
    """Fit of shear tests."""
    return fit_tests(specimens, Choice(law, **how), simulation)


def of_shear(specimens, law="polynomial", **how):
    """Parameters of the shear law of such a fit."""
    return fit_shear(specimens, law, **how).parts["shear"]


def fit_tension(tests, law="crimp-toe", **how):
    """Fit of biaxial tests and strips."""
    return fit_tests(tests, Choice(tension=law, **how))
