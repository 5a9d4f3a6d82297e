"""Fitted parameters of a law: covariance, confidence intervals and bands."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy import ndarray
from scipy import special

from ..fabric.scatter import FEWEST, band_of_further
from .models import Model
from .solving import Sample, jacobian_of, rows_of

#: Confidence level of all bands.
CONFIDENCE = 0.95

#: Probability below which differences between specimens are significant.
DIFFER = 0.01

# Threshold of the correlation of neighbouring residuals, times √n: exceeded by chance
# in one of a thousand curves.
_BELIEVED = 3.1


class Component(NamedTuple):
    """Covariance due to one source: the noise of a curve, or differences of curves.

    ``freedom`` are the degrees of freedom of its estimate.
    """

    covariance: ndarray
    freedom: float


@dataclass(frozen=True, eq=False)
class Fit:
    """Parameters of a law fitted to curves; the law may consist of laws by part.

    Attributes
    ----------
    model
        The law.
    samples
        The curves that determine it.
    values
        The parameters, shape (p,).
    offsets
        Zeros of each curve, in the order of `Sample.offsets`; those that are not
        `free` are 0.
    free
        Names of the zeros that were fitted.
    jacobian
        Derivatives of all predicted values with respect to the parameters, and then to
        the free zeros, shape (n, p + zeros).
    residuals
        Measured less predicted values of each curve.
    noise
        Standard deviation of the noise of each curve.
    at_bound
        Mask of parameters at a bound, shape (p,): they have no band.
    components
        Covariances of the parameters and the free zeros; their sum is the total.
    singles
        Parameters fitted to each curve alone, where identifiable, shape (curves, p);
        None for fewer than two curves, or without comparison.
    alone
        Names of the curves of ``singles``.
    differ
        Probability that curves of one law differ by this much; nan without ``singles``.
    alternatives
        Probabilities and fits of which the band is computed, with other free zeros;
        empty if this fit determines the band.
    """

    model: Model
    samples: tuple[Sample, ...]
    values: ndarray
    offsets: tuple[ndarray, ...]
    free: frozenset[str]
    jacobian: ndarray
    residuals: tuple[ndarray, ...]
    noise: ndarray
    at_bound: ndarray
    components: tuple[Component, ...]
    singles: ndarray | None = None
    alone: tuple[str, ...] = ()
    differ: float = np.nan
    alternatives: tuple[tuple[float, "Fit"], ...] = ()

    @property
    def law(self) -> Any:
        """Law with these parameters; of several parts a dictionary."""
        return self.model.build(self.values)

    def predicted(self, i: int) -> ndarray:
        """Predictions of the law for a curve."""
        return self.samples[i].measured - self.residuals[i]

    @property
    def beyond_noise(self) -> bool:
        """True if the differences between curves are significant."""
        return bool(self.differ < DIFFER)

    @property
    def correlations(self) -> ndarray:
        """Correlation of neighbouring residuals of each curve."""
        return correlations_of(self.residuals)

    @property
    def systematic(self) -> ndarray:
        """Curves with significantly correlated residuals."""
        return systematic_in(self.residuals)

    @property
    def covariance(self) -> ndarray:
        """Covariance of the parameters, shape (p, p).

        Covariance due to noise and to the free zeros, or of the mean of curves that
        differ significantly.  Correlated residuals count as fewer points: n (1 − ρ)/(1
        + ρ).  Weights estimated from the data increase it slightly, after Kenward and
        Roger (1997, Biometrics 53:983): by (4/ν) Φ (I − I Φ I) Φ for each curve with
        information I, where Φ is the inverse of their sum, and ν the degrees of freedom
        of its noise.  With several possible zeros, of this fit alone.
        """
        p = self.values.size
        return np.sum([one.covariance[:p, :p] for one in self.components], axis=0)

    @property
    def intervals(self) -> ndarray:
        """Confidence intervals of the parameters, shape (p, 2), within their bounds."""
        units = np.eye(self.values.size)
        ends = self._interval(lambda fit: (fit.values, units)).T
        return np.clip(ends, self.model.low[:, None], self.model.high[:, None])

    def band(self, value: Callable[[Any], ndarray]) -> ndarray:
        """Confidence band of predictions of the law, shape (2, n).

        Parameters
        ----------
        value
            Function of a law that returns n numbers.
        """
        return self._interval(
            lambda fit: (value(fit.law), jacobian_of(fit.model, fit.values, value))
        )

    def curve_band(self, i: int) -> ndarray:
        """Band of the predictions of a curve with its zeros, shape (2, n)."""
        rows = rows_of(self.samples)[i]
        return self._interval(lambda fit: (fit.predicted(i), fit.jacobian[rows]))

    def scatter(self, value: Callable[[Any], ndarray]) -> ndarray | None:
        """Band that contains predictions for another specimen, shape (2, n).

        Mean of the specimens ± t s √(1 + 1/m), with the standard deviation s of m
        specimens (`band_of_further`); None for fewer than three specimens.  Predictions
        may be 0 or negative; for laws, which are positive, `band_of_law` is the band of
        their logarithms.

        Parameters
        ----------
        value
            Function of a law that returns n numbers.
        """
        if self.singles is None or len(self.singles) < FEWEST:
            return None
        each = np.array([value(self.model.build(one)) for one in self.singles])
        return band_of_further(each, CONFIDENCE)

    def zeros(self, i: int) -> dict[str, tuple[float, float, float]]:
        """Zeros of a curve by name: value, and ends of the confidence interval."""
        found = {}
        for j, offset in enumerate(self.samples[i].offsets):

            def of(fit: Fit, j: int = j) -> tuple[ndarray, ndarray]:
                return fit.offsets[i][j : j + 1], fit._column_of_zero(i, j)

            low, high = self._interval(of)[:, 0]
            found[offset.name] = float(self.offsets[i][j]), float(low), float(high)
        return found

    def _column_of_zero(self, i: int, j: int) -> ndarray:
        """Derivative of zero j of curve i, (1, p + zeros); 0 unless it is free."""
        unit = np.zeros((1, self.jacobian.shape[1]))
        before = [o.name in self.free for s in self.samples[:i] for o in s.offsets]
        own = [offset.name in self.free for offset in self.samples[i].offsets]
        if own[j]:
            unit[0, self.values.size + sum(before) + sum(own[:j])] = 1.0
        return unit

    def deviation(self, slopes: ndarray) -> tuple[ndarray, ndarray]:
        """Standard deviations of linear functions, and degrees of freedom, (n,).

        Degrees of freedom after Satterthwaite (1946): V²/Σ(v²/ν) for the sum V of
        variances v.  With several possible zeros, functions of the parameters have the
        deviation of the smallest symmetric band that contains the one of the mixture of
        `alternatives`, and functions of the zeros the one of this fit.

        Parameters
        ----------
        slopes
            Derivatives of n functions with respect to the parameters, shape (n, p), in
            the order of `Model.parameters`, or also to the free zeros, shape (n, p +
            zeros).  `load_band` determines them for simulated loads.

        Returns
        -------
        deviation, freedom
            Standard deviations in the unit of the functions, and degrees of freedom,
            each of shape (n,).

        Examples
        --------
        The standard deviation of each parameter:

        >>> from skfem_textile import Sin2
        >>> from skfem_textile.calibration import Choice, PictureFrame, Specimen
        >>> from skfem_textile.calibration import fit_tests
        >>> test, gamma = PictureFrame(200.0, 160.0), np.radians(np.arange(1.0, 40.0))
        >>> force = test.force(Sin2(0.3), gamma) + 0.1 * (-1) ** np.arange(39)
        >>> one = Specimen("one", test, force, displacement=test.displacement(gamma))
        >>> fit = fit_tests([one], Choice("polynomial")).parts["shear"]
        >>> deviation, freedom = fit.deviation(np.eye(3))
        >>> bool(np.allclose(deviation**2, np.diag(fit.covariance))), freedom.shape
        (True, (3,))
        """
        k = slopes.shape[1]
        of_each = [
            np.einsum("ni,ij,nj->n", slopes, one.covariance[:k, :k], slopes)
            for one in self.components
        ]
        of_noise = [one.freedom for one in self.components]
        variance = np.maximum(of_each, 0.0)
        total = variance.sum(axis=0)
        share = variance / np.where(total > 0, total, 1.0)
        inverse = (share**2 / np.reshape(of_noise, (-1, 1))).sum(axis=0)
        deviation, freedom = np.sqrt(total), 1 / np.where(inverse > 0, inverse, 1.0)
        if self.alternatives and k == self.values.size:
            ends = self._interval(
                lambda fit: (slopes @ (fit.values - self.values), slopes)
            )
            quantile = special.stdtrit(freedom, 0.5 + 0.5 * CONFIDENCE)
            deviation = np.abs(ends).max(axis=0) / quantile
        return deviation, freedom

    def _interval(self, of: Callable[["Fit"], tuple[ndarray, ndarray]]) -> ndarray:
        """Ends of the confidence interval of the mixture of alternatives, (2, n).

        ``of`` returns values, (n,), and their derivatives with respect to the
        parameters, and perhaps to the free zeros.
        """
        fits = self.alternatives or ((1.0, self),)
        weights = np.array([weight for weight, _ in fits])
        found = [of(fit) for _, fit in fits]
        middles = np.array([middle for middle, _ in found])
        both = zip(fits, found, strict=True)
        spread = [fit.deviation(slopes) for (_, fit), (_, slopes) in both]
        deviations, freedom = np.swapaxes(spread, 0, 1)
        tail = 0.5 - 0.5 * CONFIDENCE
        half = -special.stdtrit(freedom, tail) * deviations
        low, high = (middles - half).min(axis=0), (middles + half).max(axis=0)
        if len(fits) == 1:
            return np.array([low, high])
        return np.array(
            [
                _quantile(p, weights, middles, deviations, freedom, low, high)
                for p in (tail, 1 - tail)
            ]
        )


# Bisections of a quantile: its error is below 1e-18 of the widest band.
_BISECTIONS = 60


def _quantile(
    p: float,
    weights: ndarray,
    middles: ndarray,
    deviations: ndarray,
    freedom: ndarray,
    low: ndarray,
    high: ndarray,
) -> ndarray:
    """Quantile of mixtures of Student's t-distributions, between low and high."""
    scale = np.maximum(deviations, np.finfo(float).tiny)
    error = (high - low) * 2.0**-_BISECTIONS
    for _ in range(_BISECTIONS):
        x = 0.5 * (low + high)
        with np.errstate(over="ignore"):  # of a value without a deviation
            below = special.stdtr(freedom, (x - middles) / scale)
        less = weights @ below < p
        low, high = np.where(less, x, low), np.where(less, high, x)
    x = 0.5 * (low + high)
    return np.where(np.abs(x) <= error, 0.0, x)


def correlations_of(residuals: Sequence[ndarray]) -> ndarray:
    """Correlation of neighbouring residuals of each curve."""
    return np.array([(r[1:] @ r[:-1] / (r @ r)) if r.any() else 0.0 for r in residuals])


def systematic_in(residuals: Sequence[ndarray]) -> ndarray:
    """Curves with significantly correlated residuals."""
    sizes = np.array([r.size for r in residuals])
    return correlations_of(residuals) > _BELIEVED / np.sqrt(sizes)


def independent_share(residuals: Sequence[ndarray]) -> ndarray:
    """Share of the points of each curve that are independent: (1 − ρ)/(1 + ρ).

    For the correlation ρ of neighbouring residuals; 1 if it is not significant.
    """
    rho = np.where(systematic_in(residuals), correlations_of(residuals), 0.0)
    return (1 - rho) / (1 + rho)
