"""Parameters of a law from measured curves, with their confidence.

Curves are compared where their noise is: forces with forces.  Each has noise of its own
size, which its residuals tell.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy import ndarray
from scipy import special

from .least_squares import covariance_of, jacobian_of, solve_linear, solve_nonlinear

if TYPE_CHECKING:
    from .models import Model

#: Confidence of all bands.
CONFIDENCE = 0.95

#: Probability below which specimens are said to differ beyond their noise.
DIFFER = 0.01

# Times that the noise of each curve is found anew.  Chosen: it no longer changes by
# 0.1 % then.
_ROUNDS = 5

# Noise at least, over the largest value: below it are errors of rounding.
_ROUNDING = 1e-9

# Correlation of neighbouring residuals over 1/√n from which it is believed: chance
# exceeds it in one of a thousand curves.
_BELIEVED = 3.1


class Sample(NamedTuple):
    """A measured curve.

    Attributes
    ----------
    name
        What it is called.
    measured
        Measured values, shape (n,).
    predict
        What a law gives for them.
    """

    name: str
    measured: ndarray
    predict: Callable[[Any], ndarray]


@dataclass(frozen=True, eq=False)
class Fit:
    """Parameters of a law that were found from curves.

    Attributes
    ----------
    model
        The law.
    samples
        The curves.
    values
        The parameters, shape (p,).
    jacobian
        Derivatives of all predicted values by the parameters, shape (n, p).
    residuals
        Measured less predicted values of each curve.
    noise
        Standard deviation of the noise of each curve.
    at_bound
        Which parameters are at a bound, shape (p,): they have no band.
    singles
        Parameters of each curve alone that tells them, shape (curves, p); None where
        fewer than two do, or they were not compared.
    differ
        Probability that curves of one law differ by as much; nan without ``singles``.
    """

    model: "Model"
    samples: tuple[Sample, ...]
    values: ndarray
    jacobian: ndarray
    residuals: tuple[ndarray, ...]
    noise: ndarray
    at_bound: ndarray
    singles: ndarray | None = None
    differ: float = np.nan

    @property
    def law(self) -> Any:
        """The law with these parameters."""
        return self.model.build(self.values)

    @property
    def beyond_noise(self) -> bool:
        """Whether the curves differ by more than their noise."""
        return bool(self.differ < DIFFER)

    @property
    def degrees_of_freedom(self) -> int:
        """Those of the bands, points less parameters, or curves less one."""
        if self.beyond_noise:
            assert self.singles is not None
            return len(self.singles) - 1
        return len(self.jacobian) - int(np.sum(~self.at_bound))

    @cached_property
    def correlations(self) -> ndarray:
        """Correlation of neighbouring residuals of each curve."""
        return np.array([_correlation(r) for r in self.residuals])

    @cached_property
    def systematic(self) -> ndarray:
        """Whether neighbouring residuals of a curve hang together, unlike noise."""
        sizes = np.array([r.size for r in self.residuals])
        return self.correlations > _BELIEVED / np.sqrt(sizes)

    @cached_property
    def covariance(self) -> ndarray:
        """Covariance of the parameters, shape (p, p).

        That of the noise, and that of the mean of curves that differ beyond it.
        Residuals that hang together count as fewer points: n (1 − ρ)/(1 + ρ).  Weights
        that are found from the data lose a little, after Meier (1953, Biometrics 9:59):
        4 Σ s (1 − s)/ν, where s is the share of a curve in what is known, and ν are the
        degrees of freedom of its noise.
        """
        free = ~self.at_bound
        within, found = np.ix_(free, free), np.zeros((free.size, free.size))
        if not free.any():
            return found
        rho = np.where(self.systematic, self.correlations, 0.0)
        weights = _spread_out(self.samples, (1 - rho) / (1 + rho) / self.noise**2)
        known = _leverage(self.samples, self.jacobian[:, free], weights)
        share = known / known.sum()
        sizes = np.array([sample.measured.size for sample in self.samples])
        lost = 4 * np.sum(share * (1 - share) / (sizes - known))
        found[within] = (1 + lost) * covariance_of(self.jacobian[:, free], weights)
        if self.beyond_noise:
            assert self.singles is not None
            spread = np.cov(self.singles.T).reshape(found.shape)
            found[within] += spread[within] / len(self.singles)
        return found

    @property
    def intervals(self) -> ndarray:
        """Confidence intervals of the parameters, shape (p, 2), within their bounds."""
        half = self._quantile * np.sqrt(np.diag(self.covariance))
        ends = np.transpose([self.values - half, self.values + half])
        return np.clip(ends, self.model.low[:, None], self.model.high[:, None])

    def band(self, value: Callable[[Any], ndarray]) -> ndarray:
        """Confidence band of what a law gives, shape (2, n).

        Parameters
        ----------
        value
            Takes a law and returns n numbers.
        """
        slopes = jacobian_of(self.model, self.values, value)
        half = self._quantile * np.sqrt(
            np.einsum("ni,ij,nj->n", slopes, self.covariance, slopes)
        )
        middle = value(self.law)
        return np.array([middle - half, middle + half])

    @property
    def _quantile(self) -> float:
        return float(special.stdtrit(self.degrees_of_freedom, 0.5 + 0.5 * CONFIDENCE))


def fit(model: "Model", samples: Sequence[Sample], compare: bool = True) -> Fit:
    """Find the parameters of a law from curves.

    Least squares, weighted by the noise of each curve.  Where the predicted values are
    linear in the parameters that is a closed form.

    Parameters
    ----------
    model
        The law.
    samples
        The curves.
    compare
        Whether each curve is also fitted alone, to see whether they differ.

    Raises
    ------
    ValueError
        If there are no more points than parameters, or the parameters cannot be told
        apart.
    """
    whole = _fit(model, samples)
    if len(samples) < 2 or not compare:
        return whole
    alone = {}
    for i, one in enumerate(samples):
        try:
            alone[i] = _fit(model, [one], whole.values, whole.noise[i : i + 1])
        except ValueError:  # this curve does not tell all parameters
            continue
    p = int(np.sum(~whole.at_bound))
    points = sum(samples[i].measured.size for i in alone)
    further, rest = p * (len(alone) - 1), points - p * len(alone)
    if further < 1 or rest < 1:
        return whole
    weights = whole.noise[list(alone)] ** -2
    of_all = _sum_of_squares([whole.residuals[i] for i in alone], weights)
    of_each = _sum_of_squares([one.residuals[0] for one in alone.values()], weights)
    F = (of_all - of_each) / further / (of_each / rest) if of_each else 0.0
    singles = np.array([one.values for one in alone.values()])
    return replace(
        whole, singles=singles, differ=float(special.fdtrc(further, rest, F))
    )


def _fit(
    model: "Model",
    samples: Sequence[Sample],
    start: ndarray | None = None,
    noise: ndarray | None = None,
) -> Fit:
    """The fit of some curves together; of a noise that is given, or found."""
    measured = np.concatenate([sample.measured for sample in samples])
    n, p = measured.size, len(model.parameters)
    if n <= p:
        raise ValueError(f"{n} points are too few for {p} parameters of {model.name}")
    given = noise is not None
    least = _ROUNDING * np.abs(measured).max()
    weights = _spread_out(samples, noise**-2.0) if noise is not None else np.ones(n)

    def predict(law: Any) -> ndarray:
        return np.concatenate([sample.predict(law) for sample in samples])

    solve = solve_linear if model.start is None else solve_nonlinear
    values = start
    for _ in range(1 if given else _ROUNDS):
        values, J = solve(model, predict, measured, weights, values)
        at_bound = (values <= model.low) | (values >= model.high)
        residuals = _split(samples, measured - predict(model.build(values)))
        if noise is None or not given:
            free = J[:, ~at_bound]
            sizes = np.array([sample.measured.size for sample in samples])
            left = np.maximum(sizes - _leverage(samples, free, weights), 1e-6)
            squares = np.array([r @ r for r in residuals])
            noise = np.maximum(np.sqrt(squares / left), least)
            weights = _spread_out(samples, noise**-2.0)
    assert values is not None
    assert noise is not None
    return Fit(model, tuple(samples), values, J, residuals, noise, at_bound)


def _leverage(samples: Sequence[Sample], J: ndarray, weights: ndarray) -> ndarray:
    """How many of the parameters each curve tells."""
    covariance = covariance_of(J, weights)
    each = np.einsum("ni,ij,nj,n->n", J, covariance, J, weights)
    return np.array([own.sum() for own in _split(samples, each)])


def _spread_out(samples: Sequence[Sample], each: ndarray) -> ndarray:
    """A number of each curve at each of its points."""
    return np.repeat(each, [sample.measured.size for sample in samples])


def _split(samples: Sequence[Sample], whole: ndarray) -> tuple[ndarray, ...]:
    ends = np.cumsum([sample.measured.size for sample in samples])[:-1]
    return tuple(np.split(whole, ends))


def _sum_of_squares(residuals: Sequence[ndarray], weights: ndarray) -> float:
    return float(sum(w * r @ r for w, r in zip(weights, residuals, strict=True)))


def _correlation(residual: ndarray) -> float:
    square = residual @ residual
    return float(residual[1:] @ residual[:-1] / square) if square else 0.0
