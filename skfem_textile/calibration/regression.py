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
from scipy import linalg, optimize, special

if TYPE_CHECKING:
    from .models import Model


# Its functions bear the names of private modules, for which a type checker takes them.
_scipy: Any = optimize

# Singular values below this share of the largest: parameters cannot be told apart.
_SINGULAR = 1e-10


def solve_linear(
    model: "Model",
    predict: Callable[[Any], ndarray],
    measured: ndarray,
    weights: ndarray,
    start: ndarray | None,
) -> tuple[ndarray, ndarray]:
    """Closed form, unless a bound is met."""
    units = np.eye(len(model.parameters))
    J = np.transpose([predict(model.build(unit)) for unit in units])
    root = np.sqrt(weights)
    size = np.linalg.norm(J * root[:, None], axis=0)
    if not np.all(size > 0):
        raise ValueError(_not_told_apart(model))
    A, b = J * root[:, None] / size, root * measured
    values, _, _, singular = np.linalg.lstsq(A, b)
    if singular[-1] < _SINGULAR * singular[0]:
        raise ValueError(_not_told_apart(model))
    low, high = model.low * size, model.high * size
    if np.any((values < low) | (values > high)):
        values = _scipy.lsq_linear(A, b, (low, high), method="bvls").x
    return np.clip(values / size, model.low, model.high), J


def solve_nonlinear(
    model: "Model",
    predict: Callable[[Any], ndarray],
    measured: ndarray,
    weights: ndarray,
    start: ndarray | None,
) -> tuple[ndarray, ndarray]:
    """Least squares from a start, or from the linear law that is nearest.

    The size of each parameter is that of this linear law: one at a bound tells none.
    """
    from ..fabric import Linear

    assert model.start is not None
    unit = predict(Linear(1.0))
    square = float(unit @ unit)
    if not square > 0:
        raise ValueError(_not_told_apart(model))
    near_linear = model.start(max(float(unit @ measured) / square, 1e-12))
    scale = np.maximum(np.abs(near_linear), 1e-12)
    inside = np.clip(near_linear if start is None else start, model.low, model.high)
    root = np.sqrt(weights)

    def residual(values: ndarray) -> ndarray:
        return root * (predict(model.build(values)) - measured)

    try:
        values = _scipy.least_squares(
            residual, inside, bounds=(model.low, model.high), x_scale=scale
        ).x
    except ValueError as error:
        raise ValueError(f"no {model.name} law fits the data: {error}") from None
    near = np.maximum(np.abs(values), scale) * 1e-6
    low_end = np.isfinite(model.low) & (values - model.low < near)
    high_end = np.isfinite(model.high) & (model.high - values < near)
    values = np.where(low_end, model.low, np.where(high_end, model.high, values))
    return values, jacobian_of(model, values, predict)


def jacobian_of(
    model: "Model", values: ndarray, value: Callable[[Any], ndarray]
) -> ndarray:
    """Derivatives by the parameters, shape (n, p): exact where they are linear."""
    if model.start is None:
        units = np.eye(values.size)
        return np.transpose([value(model.build(unit)) for unit in units])
    columns = []
    for i, own in enumerate(values):
        step = 1e-6 * max(abs(own), 1e-6)
        ends = np.repeat(values[None], 2, axis=0)
        ends[:, i] = np.clip([own - step, own + step], model.low[i], model.high[i])
        low, high = (value(model.build(end)) for end in ends)
        columns.append((high - low) / (ends[1, i] - ends[0, i]))
    return np.transpose(columns)


def covariance_of(J: ndarray, weights: ndarray) -> ndarray:
    """(JᵀWJ)⁻¹, with columns of one size."""
    root = J * np.sqrt(weights)[:, None]
    size = np.linalg.norm(root, axis=0)
    if not np.all(size > 0):
        raise ValueError("the data do not tell all parameters")
    triangle = linalg.qr(root / size, mode="economic")[1]
    if not np.all(np.abs(np.diag(triangle)) > _SINGULAR):
        raise ValueError("the data do not tell the parameters apart")
    inverse = np.linalg.inv(triangle) / size[:, None]
    return inverse @ inverse.T


def _not_told_apart(model: "Model") -> str:
    return (
        f"the data do not tell the {len(model.parameters)} parameters of the law "
        f"{model.name} apart: take a law with fewer"
    )


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
        """Whether neighbouring residuals of a curve are alike, which noise is not."""
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
