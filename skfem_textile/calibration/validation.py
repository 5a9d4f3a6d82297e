"""Predictions of tests that were not used in a fit, with their uncertainty."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy import ndarray
from scipy import special

from ..fabric import Fabric
from ..fabric.law import RIGHT_ANGLE
from ..scenes.shear_test import ShearTest
from .bands import CONFIDENCE, Fit
from .choice import Choice, Test
from .fitting import FabricFit, fit_near
from .simulation import SimulatedTest, Simulation
from .solving import differences
from .specimens import Specimen

# Number of random draws of the parameters for a simultaneous band, and their seed: the
# quantile is then known to 2 %.
_DRAWS, _SEED = 4000, 1

#: Quantile of the normal distribution for two-sided bands.
NORMAL_95 = float(special.ndtri(0.5 + 0.5 * CONFIDENCE))

# Step of a derivative of loads, in standard deviations of a parameter: far above the
# tolerance of equilibria, and within the range in which loads are linear.  For a
# parameter at a bound, which has none, relative to it.
_STEP, _STEP_AT_BOUND = 0.1, 1e-3

# Largest interpolated share of the states without an interval.
_MISSING = 0.5


@dataclass(frozen=True, eq=False)
class LoadBand:
    """Loads computed with fitted laws, with the uncertainty due to their parameters.

    Attributes
    ----------
    force
        Loads, shape (n,), in N if they are forces.
    slopes
        Derivatives of the loads with respect to the parameters of `JointFit.joint`,
        shape (n, p).
    deviation, freedom
        Standard deviation of the loads in their unit, and its degrees of freedom, shape
        (n,); see `Fit.deviation`.
    simultaneous
        Number of standard deviations of a band that contains all loads.
    """

    force: ndarray
    slopes: ndarray
    deviation: ndarray
    freedom: ndarray
    simultaneous: float

    @property
    def pointwise(self) -> ndarray:
        """Half-width of the 95 % band of each load in its unit, (n,)."""
        quantile = special.stdtrit(self.freedom, 0.5 + 0.5 * CONFIDENCE)
        return quantile * self.deviation


@dataclass(frozen=True, eq=False)
class Prediction(LoadBand):
    """Force of a test by simulation with fitted laws.

    Attributes
    ----------
    simulated
        The simulation with the fitted laws.
    gamma
        Theoretical shear angles in radians, shape (n,).
    discretisation
        Half-width of the discretisation error in N, shape (n,).
    """

    simulated: SimulatedTest
    gamma: ndarray
    discretisation: ndarray


def load_band(
    result: FabricFit, base: Fabric, loads: Callable[[Fabric], ndarray]
) -> LoadBand:
    """Loads of a user-defined problem with the fitted laws, and their band.

    The problem is solved with the fitted parameters, and with each of them increased
    and decreased: 2 p + 1 times for p parameters.  Loads are assumed linear within the
    band, which does not contain the discretisation error: state the half-width of
    `Result.interval` beside it, or add it.

    Parameters
    ----------
    result
        Fitted laws.
    base
        Fabric with the fibre directions and the laws that were not fitted.
    loads
        Function that solves the problem for a fabric and returns n loads, or other
        results, such as the reaction at each load step.

    Examples
    --------
    >>> from skfem_textile import Sin2
    >>> from skfem_textile.calibration import BiasExtension, Choice, Specimen, fit_tests
    >>> test, gamma = BiasExtension(100.0, 250.0), np.radians(np.arange(1.0, 40.0))
    >>> force = test.force(Sin2(0.3), gamma)
    >>> force += 0.02 * force.max() * np.random.default_rng(1).normal(size=gamma.size)
    >>> specimen = Specimen("one", test, force, displacement=test.displacement(gamma))
    >>> result = fit_tests([specimen], Choice("sin2"))
    >>> band = load_band(result, Fabric(), lambda f: f.shear.value(gamma[[9, 19]]))
    >>> band.force.round(3), band.pointwise.round(3)
    (array([0.051, 0.096]), array([0.001, 0.001]))
    """
    fit = result.fit.joint

    def value(laws: Any) -> ndarray:
        return np.asarray(loads(result.fabric(base, laws)), dtype=float)

    own = np.sqrt(np.diag(fit.covariance))
    steps = np.where(own > 0, _STEP * own, _STEP_AT_BOUND * np.abs(fit.values))
    return LoadBand(*_banded(fit, value, steps))


def _banded(
    fit: Fit, value: Callable[[Any], ndarray], steps: ndarray | None = None
) -> tuple[ndarray, ndarray, ndarray, ndarray, float]:
    """Fields of a `LoadBand` of a function of the laws."""
    slopes = differences(fit.model, fit.values, value, steps)
    deviation, freedom = fit.deviation(slopes)
    quantile = _simultaneous([(fit, slopes)], freedom)
    return value(fit.law), slopes, deviation, freedom, quantile


def predict(
    result: FabricFit,
    base: Fabric,
    test: ShearTest,
    gamma: ndarray,
    simulation: Simulation | None = None,
) -> Prediction:
    """Predict the force of a shear test by simulation, with its uncertainty.

    Parameters
    ----------
    result
        Fitted laws; the shear law is one of them.
    base
        Fabric with the laws that were not fitted.
    test
        The test, with its dimensions.
    gamma
        Theoretical shear angles in radians.
    simulation
        Settings of the simulation.

    Raises
    ------
    ValueError
        If no shear law was fitted, or the simulation fails.
    """
    if "shear" not in result.parts:
        raise ValueError("a prediction requires a fitted shear law: fit a shear test")
    known: dict[str, Any] = {"both": base.tensions}
    if {"warp", "weft"} & set(result.laws):
        known = {family.name: family.tension for family in base.families}
    settings, end = simulation or Simulation(), float(gamma.max())
    return predict_near(result, settings.test(known | result.laws, test, end), gamma)


def predict_near(result: FabricFit, found: SimulatedTest, gamma: ndarray) -> Prediction:
    """Predict the force of a test that was simulated with laws near the fitted ones.

    Parameters
    ----------
    result
        Fitted laws.
    found
        The simulation, with laws of all parts that it depends on.
    gamma
        Theoretical shear angles in radians.
    """
    joint = result.fit.joint

    def value(laws: Any) -> ndarray:
        return found.force({**found.laws, **laws}, gamma)

    return Prediction(*_banded(joint, value), found, gamma, _interpolated(found, gamma))


def _interpolated(found: SimulatedTest, gamma: ndarray) -> ndarray:
    """Half-width of the discretisation error at shear angles; nan if unknown."""
    half = found.half_widths
    known = np.isfinite(half)
    if not known[1:].any() or np.mean(~known) > _MISSING:
        return np.full(gamma.shape, np.nan)
    return np.interp(gamma, found.angles[known], half[known])


def _simultaneous(parts: Sequence[tuple[Fit, ndarray]], freedom: ndarray) -> float:
    """Quantile of the largest deviation of a curve, in standard deviations.

    Parameters
    ----------
    parts
        Independent fits, with the derivatives of the curve with respect to their
        parameters.
    freedom
        Degrees of freedom of the curve, shape (n,).
    """
    rng, n = np.random.default_rng(_SEED), len(freedom)
    curves, variance = np.zeros((n, _DRAWS)), np.zeros(n)
    for fit, slopes in parts:
        values, vectors = np.linalg.eigh(fit.covariance)
        root = slopes @ vectors * np.sqrt(np.maximum(values, 0.0))
        curves += root @ rng.standard_normal((len(values), _DRAWS))
        variance += np.sum(root**2, axis=1)
    seen = variance > 0
    if not seen.any():
        return 0.0
    largest = np.abs(curves[seen] / np.sqrt(variance[seen, None])).max(axis=0)
    nu = float(np.min(freedom[seen]))
    largest *= np.sqrt(nu / rng.chisquare(nu, _DRAWS))
    return float(np.quantile(largest, CONFIDENCE))


@dataclass(frozen=True, eq=False)
class Validation:
    """A test that was not used in the fit, beside its prediction.

    Attributes
    ----------
    specimen
        The test, with the zeros of the machine by its own law.
    displacement, measured
        Displacement beyond the slack in mm and force in N, shape (n,).
    off
        Force of a polynomial law fitted to the test alone, the smooth measured force,
        less the predicted one.  Its band contains the parameters of both fits, and its
        slopes are their derivatives.
    noise
        Standard deviation of the measured force in N.
    prediction
        The prediction at these points.
    scatter
        Half-width in N of the scatter between specimens of the fit, shape (n,); 0 if
        they do not differ beyond noise.
    """

    specimen: Specimen
    displacement: ndarray
    measured: ndarray
    off: LoadBand
    noise: float
    prediction: Prediction
    scatter: ndarray

    @property
    def difference(self) -> ndarray:
        """Measured less predicted force in N, (n,)."""
        return self.measured - self.prediction.force

    def half_width(self, simultaneous: bool = False) -> ndarray:
        """Half-width of the band of each difference in N, shape (n,).

        Parameters
        ----------
        simultaneous
            Band of the whole smooth curve, instead of each measured point with its
            noise.
        """
        off, wider = self.off, np.maximum(self.off.pointwise, self.scatter)
        if simultaneous:
            quantile = special.stdtrit(off.freedom, 0.5 + 0.5 * CONFIDENCE)
            random = off.simultaneous / quantile * wider
        else:
            random = np.hypot(wider, NORMAL_95 * self.noise)
        return random + np.nan_to_num(self.prediction.discretisation)

    def share(self, simultaneous: bool = False) -> float:
        """Share of the points, or of the smooth curve, inside its band."""
        off = self.off.force if simultaneous else self.difference
        return float(np.mean(np.abs(off) <= self.half_width(simultaneous)))

    @property
    def confirmed(self) -> bool:
        """True if the smooth curve lies inside the band of a whole curve."""
        return self.share(simultaneous=True) == 1.0


def validate(
    result: FabricFit,
    base: Fabric,
    tests: Sequence[Test],
    simulation: Simulation | None = None,
) -> list[Validation]:
    """Compare tests that were not used in a fit with their prediction by simulation.

    Parameters
    ----------
    result, base, simulation
        See `predict`.
    tests
        Bias extensions and picture frames with displacements.

    Raises
    ------
    ValueError
        If a test is of another kind or has no displacement, or a simulation fails.
    """
    return [_validated(result, base, x, simulation) for x in refuse_others(tests)]


def _validated(
    result: FabricFit, base: Fabric, test: Specimen, simulation: Simulation | None
) -> Validation:
    """A test beside its prediction, with zeros and noise by a separate law."""
    test = replace(test, measured_angle=None)
    alone = fit_near([test], Choice(up_to=RIGHT_ANGLE), keep_zeros=True)
    one, own = alone.zeroed(0), alone.parts["shear"]
    assert one.displacement is not None
    used = one.used(RIGHT_ANGLE) & (one.angle > 0)
    order = np.argsort(one.angle[used], kind="stable")
    gamma = one.angle[used][order]
    measured = one.force[used][order] - (one.zeros.force or 0.0)
    prediction = predict(result, base, one.test, gamma, simulation)
    return Validation(
        *(one, one.test.displacement(gamma), measured),
        off=_off(own, one.test, prediction, result.fit.joint),
        noise=float(own.noise[0]),
        prediction=prediction,
        scatter=_scatter(result, one.test, prediction),
    )


def _off(own: Fit, test: ShearTest, prediction: Prediction, fit: Fit) -> LoadBand:
    """Force of a law fitted to a test less the predicted one."""
    smooth = LoadBand(*_banded(own, lambda law: test.force(law, prediction.gamma)))
    deviation = np.hypot(smooth.deviation, prediction.deviation)
    freedom = np.minimum(smooth.freedom, prediction.freedom)
    parts = [(own, smooth.slopes), (fit, -prediction.slopes)]
    return LoadBand(
        smooth.force - prediction.force,
        np.hstack([slopes for _, slopes in parts]),
        *(deviation, freedom, _simultaneous(parts, freedom)),
    )


def refuse_others(tests: Sequence[Test]) -> list[Specimen]:
    """Tests that can be predicted; an error if there are others."""
    found = []
    for one in tests:
        if not isinstance(one, Specimen) or one.displacement is None:
            raise ValueError(
                f"{one.name}: only bias extensions and picture frames with "
                "displacements are predicted"
            )
        found.append(one)
    return found


def _scatter(result: FabricFit, test: ShearTest, prediction: Prediction) -> ndarray:
    """Half-width of the scatter of specimens that differ beyond noise."""
    fit, gamma = result.parts["shear"], prediction.gamma
    band = fit.scatter(lambda law: test.force(law, gamma))
    if not fit.beyond_noise or band is None:
        return np.zeros(gamma.shape)
    return 0.5 * np.ptp(band, axis=0)
