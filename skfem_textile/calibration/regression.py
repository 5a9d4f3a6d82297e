"""Parametric laws, and their parameters from measured curves, with confidence.

Curves are compared in the quantity that carries the noise: forces with forces.  Each
curve has its own noise level, estimated from its residuals.
"""

import importlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy import ndarray
from scipy import linalg, special

from ..fabric import (
    CrimpInterchange,
    CrimpToe,
    Linear,
    Locking,
    Polynomial,
    Sin2,
    Tabulated,
)
from ..fabric.law import RIGHT_ANGLE

# Relative extension of tables, so that rounding puts no point beyond the end.
_ROUNDING = 1e-12

# Ratio of the initial stiffness of crimped fabrics to the yarn stiffness.  Chosen:
# negligible in tension, and large enough for a positive definite tangent.
_AT_REST = 1e-4


@dataclass(frozen=True)
class Model:
    """Law with unknown parameters.

    Attributes
    ----------
    name
        Name of the law.
    parameters, units
        Names and units of the parameters, p of them.
    build
        Builds the law from p numbers.
    low, high
        Bounds of the parameters, shape (p,).
    start
        Initial parameters, as a function of the stiffness of the best linear law.  None
        if forces are linear in the parameters.
    """

    name: str
    parameters: tuple[str, ...]
    units: tuple[str, ...]
    build: Callable[[ndarray], Any]
    low: ndarray
    high: ndarray
    start: Callable[[float], ndarray] | None = None

    def bounded(self, bounds: Mapping[str, tuple[float, float]]) -> "Model":
        """Model with additional bounds of parameters, by name.

        Raises
        ------
        ValueError
            If a parameter is unknown, or its bounds contain no number.
        """
        low, high = self.low.copy(), self.high.copy()
        for name, (least, most) in bounds.items():
            if name not in self.parameters:
                raise ValueError(
                    f"the law {self.name} has no parameter {name!r}: choose one of "
                    f"{', '.join(self.parameters)}"
                )
            i = self.parameters.index(name)
            low[i], high[i] = max(low[i], least), min(high[i], most)
            if not low[i] < high[i]:
                raise ValueError(
                    f"the bounds of {name} and the limits of the law leave no number "
                    f"between {low[i]:g} and {high[i]:g}: change the bounds"
                )
        return replace(self, low=low, high=high)

    def extrapolated(self, extrapolation: str | None) -> "Model":
        """Model whose law is extrapolated beyond the data, see `Tabulated`.

        Without an argument the model is unchanged.

        Raises
        ------
        ValueError
            If the law is not tabulated, and hence does not end with the data.
        """
        if extrapolation is None:
            return self
        if self.name != "tabulated":
            raise ValueError(
                f"the law {self.name} is defined beyond the data by its formula: omit "
                "the extrapolation, or use the law tabulated"
            )

        return replace(
            self, build=lambda x: replace(self.build(x), extrapolation=extrapolation)
        )


def _of_numbers(law: Callable[..., Any]) -> Callable[[ndarray], Any]:
    """Function that builds a law whose arguments are its parameters."""
    return lambda values: law(*values.tolist())


def linear() -> Model:
    """`Linear`: C = G γ, or T = E ε."""
    build, ends = _of_numbers(Linear), np.array([[0.0], [np.inf]])
    return Model("linear", ("stiffness",), ("N/mm",), build, *ends)


def sin2() -> Model:
    """`Sin2`: C = ½ G sin 2γ."""
    return replace(linear(), name="sin2", build=_of_numbers(Sin2))


def polynomial(degree: int = 5) -> Model:
    """`Polynomial` of the odd powers of γ up to a degree: C = c₁ γ + c₃ γ³ + ...

    Raises
    ------
    ValueError
        If the degree is not odd or not between 1 and 15.
    """
    if degree not in range(1, 16, 2):
        raise ValueError(f"the degree must be an odd number up to 15, got {degree}")
    names = tuple(f"c{power}" for power in range(1, degree + 1, 2))

    def build(c: ndarray) -> Polynomial:
        every = np.zeros(degree)
        every[::2] = c
        return Polynomial(tuple(every))

    free = np.full(len(names), np.inf)
    return Model("polynomial", names, ("N/mm",) * free.size, build, -free, free)


def locking(largest: float) -> Model:
    """`Locking`, with the pole beyond the largest shear angle in radians."""

    def start(stiffness: float) -> ndarray:
        angle = min(1.3 * largest, 0.5 * (largest + RIGHT_ANGLE))
        return np.array([0.5 * stiffness, angle])

    low, high = np.array([[1e-12, 1.001 * largest], [np.inf, RIGHT_ANGLE]])
    names, units, build = ("stiffness", "angle"), ("N/mm", "rad"), _of_numbers(Locking)
    return Model("locking", names, units, build, low, high, start)


def tabulated(largest: float, points: int) -> Model:
    """`Tabulated` at 0 and at equidistant points up to the largest argument."""
    x = np.linspace(0.0, largest, points + 1) * (1 + _ROUNDING)

    def build(values: ndarray) -> Tabulated:
        return Tabulated(x, np.concatenate([[0.0], values]), odd=True)

    def start(stiffness: float) -> ndarray:
        return stiffness * x[1:]

    names = tuple(f"v{i}" for i in range(1, x.size))
    units, free = ("N/mm",) * points, np.full(points, np.inf)
    return Model("tabulated", names, units, build, -free, free, start)


def crimp_toe(largest: float) -> Model:
    """`CrimpToe`, with a toe of at most the largest strain."""

    def start(stiffness: float) -> ndarray:
        return np.array([1.5 * stiffness, 0.2 * largest, 1e-3 * stiffness])

    low, high = np.array([[1e-9, 1e-3 * largest, 0.0], [np.inf, largest, np.inf]])
    names, units = ("stiffness", "toe", "initial_stiffness"), ("N/mm", "-", "N/mm")
    return Model("crimp-toe", names, units, _of_numbers(CrimpToe), low, high, start)


def crimp_interchange(largest: float) -> Model:
    """`CrimpInterchange`: both tensions depend on both strains.

    The initial stiffness acts in compression and cannot be identified in tension; it is
    a small share of the stiffness.
    """
    names = (
        *("warp_stiffness", "weft_stiffness", "warp_crimp", "weft_crimp"),
        *("bending", "toe"),
    )
    low = np.array([1e-6, 1e-6, 1e-6, 1e-6, 1e-6, 1e-2 * largest])
    high = np.array([np.inf, np.inf, 0.2, 0.2, np.inf, largest])

    def build(values: ndarray) -> CrimpInterchange:
        E1, E2, c1, c2, K, e_0 = map(float, values)
        return CrimpInterchange((E1, E2), (c1, c2), K, e_0, _AT_REST * min(E1, E2))

    def start(stiffness: float) -> ndarray:
        E, c = 3 * stiffness, 0.5 * largest
        return np.array([E, E, c, c, 0.01 * stiffness, 0.1 * largest])

    units = ("N/mm", "N/mm", "-", "-", "N/mm", "-")
    return Model("crimp-interchange", names, units, build, low, high, start)


def _optimize() -> Any:
    """The module scipy.optimize, imported only for fits."""
    return importlib.import_module("scipy.optimize")


# Relative singular value below which parameters are not identifiable.
_SINGULAR = 1e-10


def solve_linear(
    model: Model,
    predict: Callable[[Any], ndarray],
    measured: ndarray,
    weights: ndarray,
    start: ndarray | None,
) -> tuple[ndarray, ndarray]:
    """Closed form, unless a bound is active."""
    units = np.eye(len(model.parameters))
    J = np.transpose([predict(model.build(unit)) for unit in units])
    root = np.sqrt(weights)
    size = np.linalg.norm(J * root[:, None], axis=0)
    if not np.all(size > 0):
        raise ValueError(_not_identifiable(model))
    A, b = J * root[:, None] / size, root * measured
    values, _, _, singular = np.linalg.lstsq(A, b)
    if singular[-1] < _SINGULAR * singular[0]:
        raise ValueError(_not_identifiable(model))
    low, high = model.low * size, model.high * size
    if np.any((values < low) | (values > high)):
        values = _optimize().lsq_linear(A, b, (low, high), method="bvls").x
    return np.clip(values / size, model.low, model.high), J


def solve_nonlinear(
    model: Model,
    predict: Callable[[Any], ndarray],
    measured: ndarray,
    weights: ndarray,
    start: ndarray | None,
) -> tuple[ndarray, ndarray]:
    """Nonlinear least squares from given parameters, or from the best linear law.

    The linear law determines the scale of each parameter, because a parameter at a
    bound may be 0.
    """
    assert model.start is not None
    unit = predict(Linear(1.0))
    square = float(unit @ unit)
    if not square > 0:
        raise ValueError(_not_identifiable(model))
    near_linear = model.start(max(float(unit @ measured) / square, 1e-12))
    scale = np.maximum(np.abs(near_linear), 1e-12)
    inside = np.clip(near_linear if start is None else start, model.low, model.high)
    root = np.sqrt(weights)

    def residual(values: ndarray) -> ndarray:
        return root * (predict(model.build(values)) - measured)

    try:
        found = _optimize().least_squares(
            residual, inside, bounds=(model.low, model.high), x_scale=scale
        )
        values = found.x
    except ValueError as error:
        raise ValueError(f"the fit of the law {model.name} failed: {error}") from None
    near = np.maximum(np.abs(values), scale) * 1e-6
    low_end = np.isfinite(model.low) & (values - model.low < near)
    high_end = np.isfinite(model.high) & (model.high - values < near)
    values = np.where(low_end, model.low, np.where(high_end, model.high, values))
    return values, jacobian_of(model, values, predict)


def jacobian_of(
    model: Model, values: ndarray, value: Callable[[Any], ndarray]
) -> ndarray:
    """Derivatives with respect to parameters, (n, p): exact if they are linear."""
    if model.start is None:
        units = np.eye(values.size)
        return np.transpose([value(model.build(unit)) for unit in units])
    columns = []
    for i, x in enumerate(values):
        step = 1e-6 * max(abs(x), 1e-6)
        ends = np.repeat(values[None], 2, axis=0)
        ends[:, i] = np.clip([x - step, x + step], model.low[i], model.high[i])
        low, high = (value(model.build(end)) for end in ends)
        columns.append((high - low) / (ends[1, i] - ends[0, i]))
    return np.transpose(columns)


def covariance_of(J: ndarray, weights: ndarray) -> ndarray:
    """(JᵀWJ)⁻¹, with normalised columns."""
    root = J * np.sqrt(weights)[:, None]
    size = np.linalg.norm(root, axis=0)
    if not np.all(size > 0):
        raise ValueError(
            "the data do not determine all parameters: use a law with fewer parameters"
        )
    triangle = linalg.qr(root / size, mode="economic")[1]
    if not np.all(np.abs(np.diag(triangle)) > _SINGULAR):
        raise ValueError(
            "the parameters are not identifiable from these data: use a law with fewer "
            "parameters"
        )
    inverse = np.linalg.inv(triangle) / size[:, None]
    return inverse @ inverse.T


def _not_identifiable(model: Model) -> str:
    return (
        f"the {len(model.parameters)} parameters of the law {model.name} are not "
        "identifiable from these data: use a law with fewer parameters"
    )


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


class Sample(NamedTuple):
    """Name of a curve, measured values, (n,), and predictions of a law."""

    name: str
    measured: ndarray
    predict: Callable[[Any], ndarray]


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
    jacobian
        Derivatives of all predicted values with respect to the parameters, shape (n,
        p).
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
    """

    model: Model
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
        """Law with these parameters."""
        return self.model.build(self.values)

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
        return len(self.jacobian) - int(np.sum(~self.at_bound))

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

    @cached_property
    def covariance(self) -> ndarray:
        """Covariance of the parameters, shape (p, p).

        Covariance due to noise, or of the mean of curves that differ significantly.
        Correlated residuals count as fewer points: n (1 − ρ)/(1 + ρ).  Weights
        estimated from the data increase it slightly, after Meier (1953, Biometrics
        9:59): 4 Σ s (1 − s)/ν, where s is the share of a curve in the information, and
        ν the degrees of freedom of its noise.
        """
        free = ~self.at_bound
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
            spread = np.cov(self.singles.T).reshape(covariance.shape)
            covariance[within] += spread[within] / len(self.singles)
        return covariance

    @property
    def intervals(self) -> ndarray:
        """Confidence intervals of the parameters, shape (p, 2), within their bounds."""
        half = self._quantile * np.sqrt(np.diag(self.covariance))
        ends = np.transpose([self.values - half, self.values + half])
        return np.clip(ends, self.model.low[:, None], self.model.high[:, None])

    def band(self, value: Callable[[Any], ndarray]) -> ndarray:
        """Confidence band of predictions of the law, shape (2, n).

        Parameters
        ----------
        value
            Function of a law that returns n numbers.
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


def fit(model: Model, samples: Sequence[Sample], compare: bool = True) -> Fit:
    """Fit the parameters of a law to curves.

    Least squares, weighted by the noise of each curve; in closed form if the
    predictions are linear in the parameters.

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
    pooled = _fit(model, samples)
    if len(samples) < 2 or not compare:
        return pooled
    alone = {}
    for i, one in enumerate(samples):
        try:
            alone[i] = _fit(model, [one], pooled.values, pooled.noise[i : i + 1])
        except ValueError:  # this curve does not determine all parameters
            continue
    p = int(np.sum(~pooled.at_bound))
    points = sum(samples[i].measured.size for i in alone)
    further, rest = p * (len(alone) - 1), points - p * len(alone)
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
    start: ndarray | None = None,
    noise: ndarray | None = None,
) -> Fit:
    """Joint fit of some curves, with given or estimated noise."""
    measured = np.concatenate([sample.measured for sample in samples])
    n, p = measured.size, len(model.parameters)
    if n <= p:
        raise ValueError(
            f"{n} points are too few for the {p} parameters of the law {model.name}: "
            "use a law with fewer parameters"
        )
    noise_is_known = noise is not None
    least = _LEAST_NOISE * np.abs(measured).max()
    weights = _spread_out(samples, noise**-2.0) if noise is not None else np.ones(n)

    def predict(law: Any) -> ndarray:
        return np.concatenate([sample.predict(law) for sample in samples])

    solve = solve_linear if model.start is None else solve_nonlinear
    values = start
    for _ in range(1 if noise_is_known else _ROUNDS):
        values, J = solve(model, predict, measured, weights, values)
        at_bound = (values <= model.low) | (values >= model.high)
        residuals = _split(samples, measured - predict(model.build(values)))
        if noise is None or not noise_is_known:
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
