"""Least squares for the parameters of a law and the zeros of curves."""

import importlib
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy import ndarray
from scipy import linalg

from ..fabric import Linear
from .models import Model


class Offset(NamedTuple):
    """Unknown zero of a machine: the force at rest, or the slack.

    The fit begins at ``start`` and stays between ``low`` and ``high``.  If it is not
    ``expected``, it is 0 unless the data contradict it.
    """

    name: str
    unit: str
    start: float
    low: float
    high: float
    expected: bool


class Sample(NamedTuple):
    """Name of a curve, measured values, (n,), and predictions of a law.

    ``predict(law, *offsets)`` is called without offsets or with one number for each of
    ``offsets``.
    """

    name: str
    measured: ndarray
    predict: Callable[..., ndarray]
    offsets: tuple[Offset, ...] = ()


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
    values = _at_bounds(model, values, scale)
    return values, jacobian_of(model, values, predict)


def _at_bounds(model: Model, values: ndarray, scale: ndarray) -> ndarray:
    """Parameters, with those next to a bound moved to it."""
    near = np.maximum(np.abs(values), scale) * 1e-6
    low_end = np.isfinite(model.low) & (values - model.low < near)
    high_end = np.isfinite(model.high) & (model.high - values < near)
    return np.where(low_end, model.low, np.where(high_end, model.high, values))


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


class Unknowns:
    """Parameters of a law and free zeros of curves, as one vector.

    Parameters
    ----------
    model
        The law.
    samples
        The curves.
    free
        Names of the zeros that are unknown; the others are 0.

    Attributes
    ----------
    zeros
        Number of free zeros of all curves.
    """

    def __init__(
        self, model: Model, samples: Sequence[Sample], free: frozenset[str]
    ) -> None:
        self.model, self.samples = model, samples
        self._masks = [
            np.array([offset.name in free for offset in sample.offsets], dtype=bool)
            for sample in samples
        ]
        self.zeros = sum(int(mask.sum()) for mask in self._masks)

    def offsets(self, x: ndarray) -> list[ndarray]:
        """Zeros of each curve, also those that are not free."""
        found, begin = [], len(self.model.parameters)
        for mask in self._masks:
            of_curve = np.zeros(mask.size)
            of_curve[mask] = x[begin : begin + int(mask.sum())]
            found.append(of_curve)
            begin += int(mask.sum())
        return found

    def start(self, values: ndarray) -> ndarray:
        """Initial vector with given parameters of the law."""
        return np.concatenate([values, self._of_zeros("start")])

    def predict(self, x: ndarray) -> ndarray:
        """Predictions of all curves."""
        law = self.model.build(x[: len(self.model.parameters)])
        return self._of_law(law, self.offsets(x))

    def solve(
        self, measured: ndarray, weights: ndarray, x: ndarray | None
    ) -> tuple[ndarray, ndarray]:
        """Best vector and the Jacobian there, from a given one or from linear laws."""
        model, p = self.model, len(self.model.parameters)
        if x is not None and self.zeros:
            return self._solve_all(measured, weights, x)
        of_curves = self.offsets(self.start(np.zeros(p)))
        at_rest = self._of_law(Linear(0.0), of_curves)

        def predict(law: Any) -> ndarray:
            return self._of_law(law, of_curves) - at_rest

        solve = solve_linear if model.start is None else solve_nonlinear
        values, J = solve(model, predict, measured - at_rest, weights, x)
        if not self.zeros:
            return values, J
        return self._solve_all(measured, weights, self.start(values))

    def _solve_all(
        self, measured: ndarray, weights: ndarray, x: ndarray
    ) -> tuple[ndarray, ndarray]:
        root = np.sqrt(weights)
        low = np.concatenate([self.model.low, self._of_zeros("low")])
        high = np.concatenate([self.model.high, self._of_zeros("high")])
        try:
            found = _optimize().least_squares(
                lambda x: root * (self.predict(x) - measured),
                np.clip(x, low, high),
                lambda x: root[:, None] * self.jacobian(x),
                bounds=(low, high),
                x_scale="jac",
            )
        except (ValueError, np.linalg.LinAlgError) as error:
            raise ValueError(
                f"the fit of the law {self.model.name} failed: {error}"
            ) from None
        p = len(self.model.parameters)
        found.x[:p] = _at_bounds(self.model, found.x[:p], np.abs(x[:p]))
        return found.x, self.jacobian(found.x)

    def jacobian(self, x: ndarray) -> ndarray:
        """Derivatives of all predictions, shape (n, p + zeros)."""
        p, of_curves = len(self.model.parameters), self.offsets(x)
        at_rest = self._of_law(Linear(0.0), of_curves)

        def value(law: Any) -> ndarray:
            return self._of_law(law, of_curves) - at_rest

        J = np.zeros((at_rest.size, p + self.zeros))
        J[:, :p] = jacobian_of(self.model, x[:p], value)
        law, row, column = self.model.build(x[:p]), 0, p
        curves = zip(self.samples, of_curves, self._masks, strict=True)
        for sample, offsets, mask in curves:
            rows = slice(row, row := row + sample.measured.size)
            for j in np.flatnonzero(mask):
                offset = sample.offsets[j]
                step = _STEP * (offset.high - offset.low)
                ends = np.repeat(offsets[None], 2, axis=0)
                ends[:, j] += np.array([-step, step])
                low, high = (sample.predict(law, *end) for end in ends)
                J[rows, column] = (high - low) / (2 * step)
                column += 1
        return J

    def _of_law(self, law: Any, of_curves: Sequence[ndarray]) -> ndarray:
        pairs = zip(self.samples, of_curves, strict=True)
        return np.concatenate([sample.predict(law, *zeros) for sample, zeros in pairs])

    def _of_zeros(self, field: str) -> ndarray:
        """A field of each free zero."""
        pairs = zip(self.samples, self._masks, strict=True)
        return np.array(
            [
                getattr(offset, field)
                for sample, mask in pairs
                for offset, free in zip(sample.offsets, mask, strict=True)
                if free
            ]
        )


# Step of a numerical derivative, relative to the range of a zero.
_STEP = 1e-6
