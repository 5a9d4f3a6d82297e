"""Predictions of tests that were not used in a fit, with their uncertainty."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy import ndarray
from scipy import special

from ..fabric import Fabric
from ..scenes.shear_test import ShearTest
from .bands import CONFIDENCE
from .choice import Choice, Test
from .fitting import FabricFit, fit_near
from .simulation import SimulatedTest, Simulation
from .solving import differences
from .specimens import Specimen

# Number of random draws of the parameters for a simultaneous band, and their seed: the
# quantile is then known to 2 %.
_DRAWS, _SEED = 4000, 1

#: Share of the points inside the simultaneous band from which a test is confirmed.
CONFIRMED = CONFIDENCE

#: Quantile of the normal distribution for two-sided bands.
NORMAL_95 = float(special.ndtri(0.5 + 0.5 * CONFIDENCE))

# Largest interpolated share of the states without an interval.
_MISSING = 0.5


@dataclass(frozen=True, eq=False)
class Prediction:
    """Force of a test by simulation with fitted laws.

    Attributes
    ----------
    simulated
        The simulation with the fitted laws.
    gamma, force
        Theoretical shear angles in radians, and predicted forces in N, shape (n,).
    slopes
        Derivatives of the forces with respect to the parameters, shape (n, p).
    deviation, freedom
        Standard deviation of the forces due to the parameters in N, and its degrees of
        freedom, shape (n,).
    discretisation
        Half-width of the discretisation error in N, shape (n,).
    simultaneous
        Number of standard deviations of a band that contains the whole curve.
    """

    simulated: SimulatedTest
    gamma: ndarray
    force: ndarray
    slopes: ndarray
    deviation: ndarray
    freedom: ndarray
    discretisation: ndarray
    simultaneous: float

    @property
    def pointwise(self) -> ndarray:
        """Half-width of the band of the parameters at each point in N, (n,)."""
        quantile = special.stdtrit(self.freedom, 0.5 + 0.5 * CONFIDENCE)
        return quantile * self.deviation


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

    slopes = differences(joint.model, joint.values, value)
    deviation, freedom = joint.deviation(slopes)
    return Prediction(
        *(found, gamma, value(joint.law), slopes, deviation, freedom),
        discretisation=_interpolated(found, gamma),
        simultaneous=_simultaneous(joint.covariance, slopes, freedom),
    )


def _interpolated(found: SimulatedTest, gamma: ndarray) -> ndarray:
    """Half-width of the discretisation error at shear angles; nan if unknown."""
    half = found.half_widths
    known = np.isfinite(half)
    if not known[1:].any() or np.mean(~known) > _MISSING:
        return np.full(gamma.shape, np.nan)
    return np.interp(gamma, found.angles[known], half[known])


def _simultaneous(covariance: ndarray, slopes: ndarray, freedom: ndarray) -> float:
    """Quantile of the largest deviation of a curve, in standard deviations."""
    rng, p = np.random.default_rng(_SEED), len(covariance)
    values, vectors = np.linalg.eigh(covariance)
    root = vectors * np.sqrt(np.maximum(values, 0.0))
    curves = slopes @ root @ rng.standard_normal((p, _DRAWS))
    deviation = np.sqrt(np.einsum("ni,ij,nj->n", slopes, covariance, slopes))
    seen = deviation > 0
    largest = np.abs(curves[seen] / deviation[seen, None]).max(axis=0, initial=0.0)
    nu = float(np.min(freedom))
    largest *= np.sqrt(nu / rng.chisquare(nu, _DRAWS))
    return float(np.quantile(largest, CONFIDENCE))


@dataclass(frozen=True, eq=False)
class Validation:
    """A test that was not used in the fit, beside its prediction.

    Attributes
    ----------
    specimen
        The test.
    displacement, measured
        Displacement beyond the slack in mm and force in N, shape (n,).
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
    noise: float
    prediction: Prediction
    scatter: ndarray

    @property
    def difference(self) -> ndarray:
        """Measured less predicted force in N, (n,)."""
        return self.measured - self.prediction.force

    def half_width(self, simultaneous: bool = False) -> ndarray:
        """Half-width of the band of a measured point in N, (n,).

        Parameters and noise are independent; the discretisation error is added.
        """
        one = self.prediction
        law = one.simultaneous * one.deviation if simultaneous else one.pointwise
        random = np.sqrt(
            np.maximum(law, self.scatter) ** 2 + (NORMAL_95 * self.noise) ** 2
        )
        return random + np.nan_to_num(one.discretisation)

    def share(self, simultaneous: bool = False) -> float:
        """Share of the points inside the band."""
        inside = np.abs(self.difference) <= self.half_width(simultaneous)
        return float(np.mean(inside))

    @property
    def confirmed(self) -> bool:
        """True if the curve lies inside the simultaneous band, except for noise."""
        return self.share(simultaneous=True) >= CONFIRMED


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
    found = []
    for one in refuse_others(tests):
        assert one.displacement is not None
        one = _with_zeros(one)
        gamma = one.angle_at(one.displacement, one.slack)
        with np.errstate(invalid="ignore"):
            used = (gamma > 0) & (gamma <= one.last_angle(np.inf))
        if not used.any():
            raise ValueError(f"{one.name}: no displacement is within the test")
        order = np.argsort(gamma[used], kind="stable")
        at = gamma[used][order]
        force = one.force[used][order] - (one.zeros.force or 0.0)
        prediction = predict(result, base, one.test, at, simulation)
        found.append(
            Validation(
                *(one, one.test.displacement(at), force, _noise(force), prediction),
                scatter=_scatter(result, one.test, prediction),
            )
        )
    return found


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


def _with_zeros(test: Specimen) -> Specimen:
    """The test with its zeros, by a polynomial law of its own if they are unknown."""
    if test.assumes_slack or test.zeros.force is None:
        return fit_near([test], Choice()).zeroed(0)
    return test


def _noise(force: ndarray) -> float:
    """Standard deviation of the noise of a smooth curve, by third differences."""
    if force.size <= 3:
        return 0.0
    return float(np.sqrt(np.mean(np.diff(force, 3) ** 2) / 20))


def _scatter(result: FabricFit, test: ShearTest, prediction: Prediction) -> ndarray:
    """Half-width of the scatter of specimens that differ beyond noise."""
    fit, gamma = result.parts["shear"], prediction.gamma
    band = fit.scatter(lambda law: test.force(law, gamma))
    if not fit.beyond_noise or band is None:
        return np.zeros(gamma.shape)
    return 0.5 * np.ptp(band, axis=0)
