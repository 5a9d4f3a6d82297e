"""Least squares of a law's parameters, with weights and within bounds."""

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy import ndarray
from scipy import linalg, optimize

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
