"""Consistency of energy, value and tangent of a law.

Between two arguments a and b the energy difference must equal (b − a) times a number
between the values at a and b, and likewise for the value and the tangent.  This also
holds for kinks and jumps.  It may fail where a function has an extremum between a and
b; only a failure on three consecutive intervals is a contradiction.
"""

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy import ndarray

from ..mesh.user_input import error_text
from .fabric import Fabric, is_law
from .law import BiaxialLaw, Law, LawAlong, Linear, TwoLaws, is_zero, law_at

# Range of arguments at which a law without a domain is evaluated: strain, angle in
# radians, and curvature in 1/mm, of a radius of ten times the thickness of a ply.
_STRAIN, _ANGLE, _CURVATURE = 0.1, np.radians(80.0), 0.1

# Number of arguments: for a uniform law, and for one that varies by point.
_DENSE, _COARSE = 2000, 18

# Tolerances of a difference: relative to the derivative and, for round-off, to the
# largest magnitude of the function.
_OFF, _NOISE = 1e-3, 1e-9

_PARTS = ("energy", "value", "tangent")

# Lines of strains on which a biaxial law is evaluated: name, direction and start.
_LINES = (
    ("warp and weft", (1.0, 1.0), (0.0, 0.0)),
    ("warp and shortened weft", (1.0, -1.0), (0.0, 0.0)),
    ("warp", (1.0, 0.0), (0.0, 0.0)),
    ("weft", (0.0, 1.0), (0.0, 0.0)),
    ("warp with stretched weft", (1.0, 0.0), (0.0, 0.3 * _STRAIN)),
    ("weft with stretched warp", (0.0, 1.0), (0.3 * _STRAIN, 0.0)),
    ("warp with shortened weft", (1.0, 0.0), (0.0, -0.3 * _STRAIN)),
    ("weft with shortened warp", (0.0, 1.0), (-0.3 * _STRAIN, 0.0)),
)


class _Samples(NamedTuple):
    """Arguments in ascending order, and energy, value and tangent there, (n, ...)."""

    x: ndarray
    parts: list[ndarray]


def check_laws(fabric: Fabric, shape: tuple[int, ...]) -> None:
    """Refuse laws whose energy, value and tangent contradict each other.

    They are compared where they are finite, and must return arrays of real numbers of
    the shape of their argument.  The message names the fibre family, shear or
    bending, the method and the argument.  The integration points of a ply have the
    shape (n_elements, n_points): a law that varies by point is evaluated there, at
    fewer arguments.
    """
    warp, weft = fabric.families
    if not isinstance(fabric.tensions, TwoLaws):
        _check_tensions(fabric.tensions, shape)
    else:
        _check_law("warp", "ε", warp.tension, _STRAIN, shape)
        if weft.tension is not warp.tension:
            _check_law("weft", "ε", weft.tension, _STRAIN, shape)
    _check_law("shear", "Γ", fabric.shear_law, _ANGLE, shape)
    bending: tuple[Any, Any] = fabric.bending
    for family, law in zip(fabric.families, bending, strict=True):
        if is_law(law):
            name = f"bending of {family.name}"
            _check_law(name, "κ", law_at(law, None), _CURVATURE, shape)


def _check_tensions(law: BiaxialLaw, shape: tuple[int, ...]) -> None:
    """Check a law of both tensions on lines: one family or both are stretched.

    Value and tangent must be derivatives on all lines, and the tangent symmetric.
    """
    for name, direction, start in _LINES:
        _check_law(name, "ε", LawAlong(law, direction, start), _STRAIN, shape)
    strain = np.array([np.full(shape, 0.5 * _STRAIN), np.full(shape, 0.2 * _STRAIN)])
    with np.errstate(all="ignore"):
        (_, D_12), (D_21, _) = D = np.asarray(law.tangent(strain))
    off = np.abs(D_12 - D_21)
    if not (off <= _OFF * np.abs(D).max(axis=(0, 1)))[np.isfinite(off)].all():
        raise ValueError(
            "tension law, tangent: ∂T₁/∂ε₂ differs from ∂T₂/∂ε₁ at ε₁ = "
            f"{0.5 * _STRAIN:g}, ε₂ = {0.2 * _STRAIN:g}; value must be the derivative "
            "of energy, and tangent the derivative of value"
        )


def _check_law(
    name: str, symbol: str, law: Law, reach: float, shape: tuple[int, ...]
) -> None:
    if is_zero(law) or type(law) is Linear:
        return  # consistent for every stiffness
    low, high = _domain(name, law, reach)
    arguments = _sampled(name, law, np.linspace(low, high, _DENSE), shape)
    of_value = _contradiction(arguments.x, *arguments.parts[:2])
    of_tangent = _contradiction(arguments.x, *arguments.parts[1:])
    if of_value is not None:
        part = "energy" if of_tangent is None else "value"
        (x, change, value), integral, derivative = of_value, "energy", "value"
    elif of_tangent is not None:
        part = "tangent"
        (x, change, value), integral, derivative = of_tangent, "value", "tangent"
    else:
        return
    raise ValueError(
        f"{name} law, {part}: at {symbol} = {x:.4g} the {derivative} is {value:.4g}, "
        f"but the derivative of the {integral} is {change:.4g}; value must be the "
        "derivative of energy, and tangent the derivative of value"
    )


def _domain(name: str, law: Law, reach: float) -> tuple[float, float]:
    """Ends of the arguments: the ends of the domain, if finite."""
    stated = getattr(law, "domain", None)
    if stated is None:
        return -reach, reach
    try:
        lowest, highest = stated
        low, high = float(np.max(lowest)), float(np.min(highest))
        if not low < high:
            raise ValueError
    except (TypeError, ValueError):
        raise ValueError(
            f"{name} law: domain must be two numbers (low, high), got {stated!r}"
        ) from None
    shown = getattr(law, "shown", None) or (-reach, reach)
    return (
        low if np.isfinite(low) else min(shown[0], high - 2 * reach),
        high if np.isfinite(high) else max(shown[1], low + 2 * reach),
    )


def _sampled(name: str, law: Law, x: ndarray, shape: tuple[int, ...]) -> _Samples:
    """Evaluate all arguments at once, or one by one for a law that varies by point."""
    try:
        parts = [_result(name, law, part, x[None])[0] for part in _PARTS]
    except ValueError:
        x = np.linspace(x[0], x[-1], _COARSE)
        points = [np.full(shape, one) for one in x]
        parts = [
            np.array([_result(name, law, part, at) for at in points]) for part in _PARTS
        ]
    return _Samples(x, _finite_range(x, parts))


def _result(name: str, law: Law, part: str, x: ndarray) -> ndarray:
    """Result of a method of a law, validated as an array of real numbers."""
    prefix, argument = f"{name} law, {part}: ", x.copy()
    function: Callable[[ndarray], Any] = getattr(law, part)
    try:
        with np.errstate(all="ignore"):
            values = function(argument)
    except Exception as error:  # a user's function may raise anything
        raise ValueError(
            f"{prefix}an argument of shape {x.shape} raised {error_text(error)}"
        ) from None
    if not isinstance(values, ndarray):
        raise ValueError(
            f"{prefix}must return an array of the shape of its argument, not "
            f"{type(values).__name__}"
        )
    if values.shape != x.shape:
        raise ValueError(
            f"{prefix}must return an array of the shape of its argument, {x.shape}, "
            f"not {values.shape}"
        )
    if values.dtype.kind not in "iuf":
        raise ValueError(f"{prefix}must return real numbers, not {values.dtype}")
    if not np.array_equal(argument, x):
        raise ValueError(f"{prefix}must not modify its argument")
    return values.copy()


def _finite_range(x: ndarray, parts: list[ndarray]) -> list[ndarray]:
    """Results, NaN outwards from the first argument where one is not finite."""
    finite = np.all([np.isfinite(part) for part in parts], axis=0)
    start = np.searchsorted(x, 0.0)
    below = np.logical_and.accumulate(finite[:start][::-1])[::-1]
    above = np.logical_and.accumulate(finite[start:])
    inside = np.concatenate([below, above])
    return [np.where(inside, part, np.nan) for part in parts]


def _contradiction(
    x: ndarray, integral: ndarray, derivative: ndarray
) -> tuple[float, float, float] | None:
    """Position, slope of ``integral`` and derivative at a contradiction, or None."""
    h = np.diff(x).reshape(-1, *(1,) * (integral.ndim - 1))
    with np.errstate(all="ignore"):  # NaN beyond the end of the law
        change = np.diff(integral, axis=0) / h
        low = np.minimum(derivative[:-1], derivative[1:])
        high = np.maximum(derivative[:-1], derivative[1:])
        kind = np.finfo(integral.dtype)
        noise = max(_NOISE, 64 * float(kind.eps)) * np.fmax.reduce(np.abs(integral))
        slack = _OFF * np.maximum(np.abs(low), np.abs(high))
        slack += (noise + float(kind.tiny)) / h
        excess = np.maximum(low - change, change - high) - slack
    off = excess > 0
    thrice = off[:-2] & off[1:-1] & off[2:]
    if not thrice.any():
        return None
    at = np.unravel_index(np.where(thrice, excess[1:-1], 0.0).argmax(), thrice.shape)
    i = (at[0] + 1, *at[1:])
    middle = (low[i] + high[i]) / 2
    return float(x[i[0]] + x[i[0] + 1]) / 2, float(change[i]), float(middle)
