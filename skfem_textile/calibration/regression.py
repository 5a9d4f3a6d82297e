"""Parameters of laws from measured curves, with confidence.

Curves are compared in the quantity that carries the noise: forces with forces.  Each
curve has its own noise level, estimated from its residuals.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import combinations
from typing import Any

import numpy as np
from numpy import ndarray
from scipy import special

from .models import Model
from .solving import Sample, Unknowns, covariance_of, jacobian_of

#: Confidence level of all bands.
CONFIDENCE = 0.95

#: Probability below which differences between specimens are significant.
DIFFER = 0.01

# Number of iterations of the noise estimate.  Chosen: its change is then below 0.1 %.
_ROUNDS = 5

# Lower bound of the noise, relative to the largest value: rounding errors.
_LEAST_NOISE = 1e-9

# Threshold of the correlation of neighbouring residuals, times √n: exceeded by chance
# in one of a thousand curves.
_BELIEVED = 3.1


@dataclass(frozen=True, eq=False)
class Fit:
    """Parameters of a law fitted to curves.

    Attributes
    ----------
    model
        The law.
    samples
        The curves.
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
    singles
        Parameters fitted to each curve alone, where identifiable, shape (curves, p);
        None for fewer than two curves, or without comparison.
    differ
        Probability that curves of one law differ by this much; nan without ``singles``.
    alternatives
        Probabilities and fits with other free zeros, and of this fit, which is the most
        probable one; empty if no zero is unknown.
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
    singles: ndarray | None = None
    differ: float = np.nan
    alternatives: tuple[tuple[float, "Fit"], ...] = ()

    @property
    def law(self) -> Any:
        """Law with these parameters."""
        return self.model.build(self.values)

    def predicted(self, i: int) -> ndarray:
        """Predictions of the law for a curve."""
        return self.samples[i].predict(self.law, *self.offsets[i])

    @property
    def beyond_noise(self) -> bool:
        """True if the differences between curves are significant."""
        return bool(self.differ < DIFFER)

    @property
    def degrees_of_freedom(self) -> int:
        """Degrees of freedom of bands: points less parameters, or curves less one."""
        if self.beyond_noise:
            assert self.singles is not None
            return len(self.singles) - 1
        return len(self.jacobian) - int(np.sum(self._determined))

    @cached_property
    def correlations(self) -> ndarray:
        """Correlation of neighbouring residuals of each curve."""
        return np.array(
            [(r[1:] @ r[:-1] / (r @ r)) if r.any() else 0.0 for r in self.residuals]
        )

    @cached_property
    def systematic(self) -> ndarray:
        """Curves with significantly correlated residuals."""
        sizes = np.array([r.size for r in self.residuals])
        return self.correlations > _BELIEVED / np.sqrt(sizes)

    @property
    def covariance(self) -> ndarray:
        """Covariance of the parameters, shape (p, p).

        Covariance due to noise and to the free zeros, or of the mean of curves that
        differ significantly.  Correlated residuals count as fewer points: n (1 − ρ)/(1
        + ρ).  Weights estimated from the data increase it slightly, after Meier (1953,
        Biometrics 9:59): 4 Σ s (1 − s)/ν, where s is the share of a curve in the
        information, and ν the degrees of freedom of its noise.
        """
        p = self.values.size
        return self._covariance[:p, :p]

    @property
    def _determined(self) -> ndarray:
        """Mask of the columns of the Jacobian that are not at a bound."""
        zeros = self.jacobian.shape[1] - self.at_bound.size
        return np.concatenate([~self.at_bound, np.ones(zeros, dtype=bool)])

    @cached_property
    def _covariance(self) -> ndarray:
        """Covariance of the parameters and of the free zeros."""
        free = self._determined
        within, covariance = np.ix_(free, free), np.zeros((free.size, free.size))
        if not free.any():
            return covariance
        rho = np.where(self.systematic, self.correlations, 0.0)
        weights = _spread_out(self.samples, (1 - rho) / (1 + rho) / self.noise**2)
        known = _leverage(self.samples, self.jacobian[:, free], weights)
        share = known / known.sum()
        sizes = np.array([sample.measured.size for sample in self.samples])
        lost = 4 * np.sum(share * (1 - share) / (sizes - known))
        covariance[within] = (1 + lost) * covariance_of(self.jacobian[:, free], weights)
        if self.beyond_noise:
            assert self.singles is not None
            law = np.flatnonzero(~self.at_bound)
            spread = np.atleast_2d(np.cov(self.singles.T))
            covariance[np.ix_(law, law)] += spread[np.ix_(law, law)] / len(self.singles)
        return covariance

    @property
    def intervals(self) -> ndarray:
        """Confidence intervals of the parameters, shape (p, 2), within their bounds."""
        ends = self._interval(
            lambda fit: (fit.values, np.sqrt(np.diag(fit.covariance)))
        ).T
        return np.clip(ends, self.model.low[:, None], self.model.high[:, None])

    def band(self, value: Callable[[Any], ndarray]) -> ndarray:
        """Confidence band of predictions of the law, shape (2, n).

        Parameters
        ----------
        value
            Function of a law that returns n numbers.
        """

        def middle_and_deviation(fit: Fit) -> tuple[ndarray, ndarray]:
            slopes = jacobian_of(fit.model, fit.values, value)
            squares = np.einsum("ni,ij,nj->n", slopes, fit.covariance, slopes)
            return value(fit.law), np.sqrt(squares)

        return self._interval(middle_and_deviation)

    def zeros(self, i: int) -> dict[str, tuple[float, float, float]]:
        """Zeros of a curve by name: value, and ends of the confidence interval."""
        found = {}
        for j, offset in enumerate(self.samples[i].offsets):

            def of(fit: Fit, j: int = j) -> tuple[ndarray, ndarray]:
                return fit.offsets[i][j : j + 1], fit._deviation(i, j)

            low, high = self._interval(of)[:, 0]
            found[offset.name] = float(self.offsets[i][j]), float(low), float(high)
        return found

    def _deviation(self, i: int, j: int) -> ndarray:
        """Standard deviation of zero j of curve i; 0 unless it is free."""
        before = [o.name in self.free for s in self.samples[:i] for o in s.offsets]
        own = [offset.name in self.free for offset in self.samples[i].offsets]
        if not own[j]:
            return np.zeros(1)
        k = self.values.size + sum(before) + sum(own[:j])
        return np.sqrt(self._covariance[k : k + 1, k])

    def _interval(self, of: Callable[["Fit"], tuple[ndarray, ndarray]]) -> ndarray:
        """Ends of the confidence interval of the mixture of alternatives, (2, n)."""
        fits = self.alternatives or ((1.0, self),)
        weights = np.array([weight for weight, _ in fits])
        middles, deviations = np.swapaxes([of(fit) for _, fit in fits], 0, 1)
        freedom = np.array([fit.degrees_of_freedom for _, fit in fits])
        tail = 0.5 - 0.5 * CONFIDENCE
        half = -special.stdtrit(freedom, tail)[:, None] * deviations
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
    for _ in range(_BISECTIONS):
        x = 0.5 * (low + high)
        with np.errstate(over="ignore"):  # of a value without a deviation
            below = special.stdtr(freedom[:, None], (x - middles) / scale)
        less = weights @ below < p
        low, high = np.where(less, x, low), np.where(less, high, x)
    return 0.5 * (low + high)


# Probability of a zero that is not expected, before the data: most machines are tared.
_UNEXPECTED = 0.1

# Smallest probability of an alternative that is kept: its share of a tail of 2.5 % is
# negligible.
_NEGLIGIBLE = 1e-3


def fit(model: Model, samples: Sequence[Sample], compare: bool = True) -> Fit:
    """Fit the parameters of a law to curves.

    Least squares, weighted by the noise of each curve; in closed form if the
    predictions are linear in the parameters.

    Zeros that are not expected are fitted in each of their combinations.  The
    probability of each follows from the Bayesian information criterion (Schwarz 1978);
    bands refer to the mixture (Hoeting et al. 1999, Statist. Sci. 14:382).

    Parameters
    ----------
    model
        The law.
    samples
        The curves.
    compare
        True if each curve is also fitted alone, to test for differences.

    Raises
    ------
    ValueError
        If there are not more points than parameters, or the parameters are not
        identifiable.
    """
    offsets = [offset for sample in samples for offset in sample.offsets]
    always = frozenset(offset.name for offset in offsets if offset.expected)
    optional = dict.fromkeys(o.name for o in offsets if not o.expected)
    fits = [_compared(_fit(model, samples, always), compare)]
    for free in (always | some for some in _subsets(tuple(optional))):
        try:
            fits.append(_compared(_fit(model, samples, free), compare))
        except ValueError:  # the data do not determine these zeros
            continue
    if len(fits) == 1:
        return fits[0]
    alone = any(one.beyond_noise for one in fits)
    criterion = np.array([_criterion(one, alone) for one in fits])
    unexpected = np.array([len(one.free - always) for one in fits])
    criterion += 2 * np.log(1 / _UNEXPECTED - 1) * unexpected
    weights = np.exp(-0.5 * (criterion - criterion.min()))
    weights /= weights.sum()
    kept = [i for i in range(len(fits)) if weights[i] > _NEGLIGIBLE]
    total = weights[kept].sum()
    alternatives = tuple((float(weights[i] / total), fits[i]) for i in kept)
    return replace(fits[int(weights.argmax())], alternatives=alternatives)


def _subsets(names: tuple[str, ...]) -> list[frozenset[str]]:
    """Subsets of one or more names."""
    sizes = range(1, len(names) + 1)
    return [frozenset(one) for n in sizes for one in combinations(names, n)]


def _criterion(fit: Fit, alone: bool) -> float:
    """Bayesian information criterion, by the residuals of each curve.

    If curves differ, zeros would represent the difference: then each curve counts with
    a separate law.
    """
    residuals = fit.residuals
    if alone:
        residuals = tuple(_alone(fit, i).residuals[0] for i in range(len(fit.samples)))
    total = 0.0
    for sample, r in zip(fit.samples, residuals, strict=True):
        n, least = r.size, _LEAST_NOISE * np.abs(sample.measured).max()
        zeros = sum(offset.name in fit.free for offset in sample.offsets)
        total += n * np.log(max(float(r @ r) / n, least**2)) + zeros * np.log(n)
    return float(total)


def _alone(pooled: Fit, i: int) -> Fit:
    """Fit of one of the curves, with the noise of all of them."""
    noise = pooled.noise[i : i + 1]
    return _fit(pooled.model, [pooled.samples[i]], pooled.free, pooled.values, noise)


def _compared(pooled: Fit, compare: bool) -> Fit:
    """Fit with a test for differences between its curves."""
    samples = pooled.samples
    if len(samples) < 2 or not compare:
        return pooled
    alone = {}
    for i in range(len(samples)):
        try:
            alone[i] = _alone(pooled, i)
        except ValueError:  # this curve does not determine all parameters
            continue
    p = int(np.sum(~pooled.at_bound))
    points = sum(samples[i].measured.size for i in alone)
    zeros = sum(one.jacobian.shape[1] - one.values.size for one in alone.values())
    further, rest = p * (len(alone) - 1), points - p * len(alone) - zeros
    if further < 1 or rest < 1:
        return pooled
    weights = pooled.noise[list(alone)] ** -2
    of_all, of_each = (
        float(sum(w * r @ r for w, r in zip(weights, residuals, strict=True)))
        for residuals in (
            [pooled.residuals[i] for i in alone],
            [one.residuals[0] for one in alone.values()],
        )
    )
    F = (of_all - of_each) / further / (of_each / rest) if of_each else 0.0
    singles = np.array([one.values for one in alone.values()])
    return replace(
        pooled, singles=singles, differ=float(special.fdtrc(further, rest, F))
    )


def _fit(
    model: Model,
    samples: Sequence[Sample],
    free: frozenset[str] = frozenset(),
    start: ndarray | None = None,
    noise: ndarray | None = None,
) -> Fit:
    """Joint fit of some curves and their free zeros, with given or estimated noise."""
    unknowns = Unknowns(model, samples, free)
    measured = np.concatenate([sample.measured for sample in samples])
    n, p = measured.size, len(model.parameters)
    if n <= (number := p + unknowns.zeros):
        raise ValueError(
            f"{n} points are too few for the {number} parameters of the law "
            f"{model.name}: use a law with fewer parameters"
        )
    noise_is_known = noise is not None
    least = _LEAST_NOISE * np.abs(measured).max()
    weights = _spread_out(samples, noise**-2.0) if noise is not None else np.ones(n)
    x = None if start is None else unknowns.start(start)
    for _ in range(1 if noise_is_known else _ROUNDS):
        x, J = unknowns.solve(measured, weights, x)
        values = x[:p]
        at_bound = (values <= model.low) | (values >= model.high)
        residuals = _split(samples, measured - unknowns.predict(x))
        if noise is None or not noise_is_known:
            columns = np.concatenate([~at_bound, np.ones(unknowns.zeros, dtype=bool)])
            sizes = np.array([sample.measured.size for sample in samples])
            left = np.maximum(sizes - _leverage(samples, J[:, columns], weights), 1e-6)
            squares = np.array([r @ r for r in residuals])
            noise = np.maximum(np.sqrt(squares / left), least)
            weights = _spread_out(samples, noise**-2.0)
    assert x is not None
    assert noise is not None
    offsets = tuple(unknowns.offsets(x))
    of_fit = model, tuple(samples), values, offsets, free
    return Fit(*of_fit, J, residuals, noise, at_bound)


def _leverage(samples: Sequence[Sample], J: ndarray, weights: ndarray) -> ndarray:
    """Number of parameters determined by each curve."""
    covariance = covariance_of(J, weights)
    each = np.einsum("ni,ij,nj,n->n", J, covariance, J, weights)
    return np.array([block.sum() for block in _split(samples, each)])


def _spread_out(samples: Sequence[Sample], each: ndarray) -> ndarray:
    """A number per curve, repeated for each of its points."""
    return np.repeat(each, [sample.measured.size for sample in samples])


def _split(samples: Sequence[Sample], array: ndarray) -> tuple[ndarray, ...]:
    ends = np.cumsum([sample.measured.size for sample in samples])[:-1]
    return tuple(np.split(array, ends))
