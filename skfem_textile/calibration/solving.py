"""Least squares for the parameters of several laws and the zeros of curves."""

import importlib
from collections.abc import Callable, Mapping, Sequence
from itertools import pairwise
from typing import Any, NamedTuple, TypeAlias

import numpy as np
from numpy import ndarray
from scipy import linalg

from ..fabric import Linear
from ..mesh.user_input import errors_in
from .models import Model

#: Laws of a fabric by name, see `PARTS`.
Laws: TypeAlias = Mapping[str, Any]

#: Laws of a fabric that tests determine; ``both`` is a tension law of both strains.
PARTS = "warp", "weft", "both", "shear", "bending warp", "bending weft"


class Offset(NamedTuple):
    """Unknown zero of a machine: the force at rest, or the slack.

    The fit begins at ``start`` and stays between ``low`` and ``high``.  The zero is 0
    unless the data reject that.  The band always allows for one that is ``expected``,
    and for another one as far as it is probable.
    """

    name: str
    unit: str
    start: float
    low: float
    high: float
    expected: bool


class Sample(NamedTuple):
    """Name of a curve, measured values, (n,), and predictions of the laws of a fabric.

    ``predict(laws, *offsets)`` is called without offsets or with one number for each of
    ``offsets``.  ``part`` is the law that the curve determines; its predictions also
    depend on the laws ``others``, if any.
    """

    name: str
    measured: ndarray
    part: str
    predict: Callable[..., ndarray]
    offsets: tuple[Offset, ...] = ()
    others: tuple[str, ...] = ()


def rows_of(samples: Sequence[Sample]) -> list[slice]:
    """Rows of each curve in the vector of all measured values."""
    ends = np.cumsum([0, *(sample.measured.size for sample in samples)]).tolist()
    return [slice(*ends_of_curve) for ends_of_curve in pairwise(ends)]


def optimize() -> Any:
    """The module scipy.optimize, imported only for fits."""
    return importlib.import_module("scipy.optimize")


# Relative singular value below which parameters are not identifiable.
_SINGULAR = 1e-10


def solve_linear(
    model: Model,
    predict: Callable[[Any], ndarray],
    measured: ndarray,
    weights: ndarray,
) -> ndarray:
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
        values = optimize().lsq_linear(A, b, (low, high), method="bvls").x
    return np.clip(values / size, model.low, model.high)


def solve_nonlinear(
    model: Model,
    predict: Callable[[Any], ndarray],
    measured: ndarray,
    weights: ndarray,
    start: ndarray | None,
) -> ndarray:
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

    with errors_in(f"the fit of the law {model.name} failed: "):
        found = optimize().least_squares(
            residual, inside, bounds=(model.low, model.high), x_scale=scale
        )
        values = found.x
    return _at_bounds(model, values, scale)


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
    if model.is_linear:
        units = np.eye(values.size)
        return np.transpose([value(model.build(unit)) for unit in units])
    return differences(model, values, value)


def differences(
    model: Model,
    values: ndarray,
    value: Callable[[Any], ndarray],
    steps: ndarray | None = None,
) -> ndarray:
    """Derivatives with respect to parameters by finite differences, (n, p)."""
    if steps is None:
        steps = 1e-6 * np.maximum(np.abs(values), 1e-6)
    columns = []
    for i, (x, step) in enumerate(zip(values, steps, strict=True)):
        ends = np.repeat(values[None], 2, axis=0)
        ends[:, i] = np.clip([x - step, x + step], model.low[i], model.high[i])
        low, high = (value(model.build(end)) for end in ends)
        columns.append((high - low) / (ends[1, i] - ends[0, i]))
    return np.transpose(columns)


def covariance_of(J: ndarray, weights: ndarray) -> ndarray:
    """(JᵀWJ)⁻¹, with normalised columns."""
    if not J.size:
        return np.zeros((0, 0))
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
    """Parameters of all laws and free zeros of curves, as one vector.

    Parameters
    ----------
    models
        Laws with unknown parameters, by part.
    samples
        The curves, each of one of these parts.
    free
        Names of the zeros that are unknown; the others are 0.
    known
        Laws of other parts, with known parameters.

    Attributes
    ----------
    blocks
        Parameters of each part in the vector.
    parameters, zeros
        Number of parameters, and of free zeros of all curves.
    low, high
        Bounds of the vector.
    owners
        Part of each element of the vector: of a zero the part of its curve.
    """

    def __init__(
        self,
        models: Mapping[str, Model],
        samples: Sequence[Sample],
        free: frozenset[str],
        known: Laws | None = None,
    ) -> None:
        self.models, self.samples, self.free = models, samples, free
        self.known = dict(known or {})
        sizes = [len(model.parameters) for model in models.values()]
        ends = np.cumsum([0, *sizes]).tolist()
        self.blocks = {name: slice(*ends[i : i + 2]) for i, name in enumerate(models)}
        self._masks = [
            np.array([offset.name in free for offset in sample.offsets], dtype=bool)
            for sample in samples
        ]
        self.parameters = ends[-1]
        self.low, self.high = (
            np.concatenate(
                [*(getattr(m, end) for m in models.values()), self._of_zeros(end)]
            )
            for end in ("low", "high")
        )
        zeros = [int(mask.sum()) for mask in self._masks]
        parts = [*models, *(sample.part for sample in samples)]
        self.owners, self.zeros = np.repeat(parts, [*sizes, *zeros]), sum(zeros)

    def laws(self, x: ndarray) -> dict[str, Any]:
        """Laws by part."""
        found = {name: m.build(x[self.blocks[name]]) for name, m in self.models.items()}
        return self.known | found

    def offsets(self, x: ndarray) -> list[ndarray]:
        """Zeros of each curve, also those that are not free."""
        found = [np.zeros(mask.size) for mask in self._masks]
        ends = np.cumsum([mask.sum() for mask in self._masks])[:-1]
        free = np.split(x[self.parameters :], ends)
        for of_curve, mask, values in zip(found, self._masks, free, strict=True):
            of_curve[mask] = values
        return found

    def start(self, values: ndarray) -> ndarray:
        """Initial vector with given parameters of the laws."""
        return np.concatenate([values, self._of_zeros("start")])

    def predict(self, x: ndarray) -> ndarray:
        """Predictions of all curves."""
        every = range(len(self.samples))
        return self._joined(self.laws(x), self.offsets(x), every)

    def solve(self, weights: ndarray, x: ndarray | None) -> tuple[ndarray, ndarray]:
        """Best vector and the Jacobian there, from a given one or from linear laws."""
        joint = self.zeros or any(sample.others for sample in self.samples)
        if joint and x is not None:
            return self._solve_all(weights, x)
        x = self._solve_each(weights, x)
        return self._solve_all(weights, x) if joint else (x, self.jacobian(x))

    def _solve_each(self, weights: ndarray, x: ndarray | None) -> ndarray:
        """Best parameters of each part by its own curves, with zeros at their start.

        Curves that depend on several laws have the laws of the parts before theirs.
        """
        found = self.start(np.zeros(self.parameters))
        of_curves, known = self.offsets(found), dict(self.known)
        for name, model in self.models.items():
            own = [i for i, sample in enumerate(self.samples) if sample.part == name]
            at_rest, value = self._beyond_rest(name, known, of_curves, own)
            measured = np.concatenate([self.samples[i].measured for i in own])
            block, of_law = self.blocks[name], weights[self._rows(own)]
            if model.is_linear:
                values = solve_linear(model, value, measured - at_rest, of_law)
            else:
                start = None if x is None else x[block]
                values = solve_nonlinear(
                    model, value, measured - at_rest, of_law, start
                )
            found[block], known[name] = values, model.build(values)
        return found

    def _solve_all(self, weights: ndarray, x: ndarray) -> tuple[ndarray, ndarray]:
        root, low, high = np.sqrt(weights), self.low, self.high
        measured = np.concatenate([sample.measured for sample in self.samples])
        try:
            found = optimize().least_squares(
                lambda x: root * (self.predict(x) - measured),
                np.clip(x, low, high),
                lambda x: root[:, None] * self.jacobian(x),
                bounds=(low, high),
                x_scale="jac",
            )
        except (ValueError, np.linalg.LinAlgError) as error:
            names = " and ".join(model.name for model in self.models.values())
            raise ValueError(f"the fit of the law {names} failed: {error}") from None
        for name, block in self.blocks.items():
            scale = np.abs(x[block])
            found.x[block] = _at_bounds(self.models[name], found.x[block], scale)
        return found.x, self.jacobian(found.x)

    def jacobian(self, x: ndarray) -> ndarray:
        """Derivatives of all predictions, shape (n, parameters + zeros)."""
        of_curves, laws = self.offsets(x), self.laws(x)
        J = np.zeros((self._rows(range(len(self.samples))).size, x.size))
        for name, model in self.models.items():
            block = self.blocks[name]
            for derivatives, coupled in ((jacobian_of, False), (differences, True)):
                curves = [
                    i
                    for i, one in enumerate(self.samples)
                    if name in (one.part, *one.others) and bool(one.others) == coupled
                ]
                if curves:
                    _, value = self._beyond_rest(name, laws, of_curves, curves)
                    J[self._rows(curves), block] = derivatives(model, x[block], value)
        column = self.parameters
        pairs = zip(self.samples, of_curves, self._masks, strict=True)
        for i, (sample, offsets, mask) in enumerate(pairs):
            for j in np.flatnonzero(mask):
                offset = sample.offsets[j]
                step = _STEP * (offset.high - offset.low)
                ends = np.repeat(offsets[None], 2, axis=0)
                ends[:, j] += np.array([-step, step])
                low, high = (sample.predict(laws, *end) for end in ends)
                J[self._rows([i]), column] = (high - low) / (2 * step)
                column += 1
        return J

    def _beyond_rest(
        self,
        part: str,
        laws: Laws,
        of_curves: Sequence[ndarray],
        curves: Sequence[int],
    ) -> tuple[ndarray, Callable[[Any], ndarray]]:
        """Predictions at zero law, and the contribution of the law."""
        at_rest = self._joined({**laws, part: Linear(0.0)}, of_curves, curves)

        def value(law: Any) -> ndarray:
            return self._joined({**laws, part: law}, of_curves, curves) - at_rest

        return at_rest, value

    def _rows(self, curves: Sequence[int]) -> ndarray:
        """Rows of some curves in the vector of all predictions."""
        rows = rows_of(self.samples)
        return np.concatenate([np.r_[rows[i]] for i in curves])

    def _joined(
        self, laws: Laws, of_curves: Sequence[ndarray], curves: Sequence[int]
    ) -> ndarray:
        """Predictions of some curves."""
        return np.concatenate(
            [self.samples[i].predict(laws, *of_curves[i]) for i in curves]
        )

    def _of_zeros(self, field: str) -> ndarray:
        """A field of each free zero."""
        offsets = [offset for sample in self.samples for offset in sample.offsets]
        return np.array([getattr(x, field) for x in offsets if x.name in self.free])


# Step of a numerical derivative, relative to the range of a zero.
_STEP = 1e-6
