"""Whether the parts of a term fit the ply, and agree with each other.

Every term beside those of fabric and formulation is asked once, when a ply is built: at
rest, and at two small displacements a and b, between which the energy must change by a
residual that lies between those of a and b, and the residual by the tangent in between.
"""

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy import ndarray
from scipy.sparse import csr_matrix, issparse
from skfem import CellBasis

from .term import Term, refuse_unsymmetric

# How far a and b are from rest, and from each other, as shares of the element size.
_AWAY, _APART = 1e-3, 1e-5

# How far a change may be off as a share of it, and, for round-off, of what changes.
_OFF, _NOISE = 1e-3, 1e-13

_ADVICE = "residual must be the derivative of energy, tangent that of residual"


def check_term(term: Term, basis: CellBasis, size: float) -> None:
    """Refuse a term with parts of another shape, not finite at rest, or at odds.

    What has a memory may store work that its residual knows nothing of: there energy,
    residual and tangent are not compared.

    Parameters
    ----------
    term
        A term.
    basis
        Basis of the displacement of the ply.
    size
        Size of its elements in mm.

    Raises
    ------
    ValueError
        With the name of the term, the part and what is wrong with it.
    """
    _refuse_infinite(term, "at rest", *_forces(term, basis.zeros(), 0.0))
    rng = np.random.default_rng(0)
    u, d = rng.uniform(-1.0, 1.0, (2, basis.N))
    low, high = (_AWAY * u + sign * 0.5 * _APART * d for sign in (-1, 1))
    E_low, r_low = _forces(term, size * low, 1.0)
    E_high, r_high = _forces(term, size * high, 1.0)
    step = size * (high - low)
    K = _tangent(term, size * 0.5 * (low + high), 1.0)
    _refuse_infinite(term, "near rest", E_low, r_low, K)
    refuse_unsymmetric(term.name, K - K.T, K)
    if term.memory is not None:
        return
    noise = _NOISE * (abs(E_low) + abs(E_high))
    _compare(term, "energy", E_high - E_low, (r_low @ step, r_high @ step), noise)
    change, noise = (r_high - r_low) @ step, _NOISE * np.abs(r_low) @ np.abs(step)
    _compare(term, "residual", change, (step @ (K @ step),), noise)


def _compare(
    term: Term, part: str, change: float, told: tuple[float, ...], noise: float
) -> None:
    """Refuse a change that lies beyond what the derivatives tell."""
    slack = _OFF * max(map(abs, told)) + noise
    if not min(told) - slack <= change <= max(told) + slack:
        derivative = {"energy": "residual", "residual": "tangent"}[part]
        raise ValueError(
            f"term {term.name!r}: its {part} changes by {change:.4g} where its "
            f"{derivative} says {np.mean(told):.4g}; {_ADVICE}"
        )


def _refuse_infinite(
    term: Term, where: str, energy: float, residual: ndarray, tangent: Any = 0.0
) -> None:
    values = tangent.data if issparse(tangent) else np.asarray(tangent)
    for part, x in (("energy", energy), ("residual", residual), ("tangent", values)):
        if not np.isfinite(x).all():
            raise ValueError(f"term {term.name!r}: its {part} is not finite {where}")


def _forces(term: Term, u: ndarray, t: float) -> tuple[float, ndarray]:
    """Energy and residual, refused if they are no number and no vector."""
    energy, residual = _asked(term, "energy", u, t), _asked(term, "residual", u, t)
    _refuse_shape(term, "energy", energy, (), "one real number")
    _refuse_shape(term, "residual", residual, u.shape, f"{u.size} real numbers")
    return float(energy), np.asarray(residual)


def _tangent(term: Term, u: ndarray, t: float) -> Any:
    """The tangent, refused if it is no matrix of the unknowns; zero for none."""
    K = _asked(term, "tangent", u, t)
    if K is None:
        return csr_matrix((u.size, u.size))
    size = u.size
    _refuse_shape(term, "tangent", K, (size, size), f"a real {size} × {size} matrix")
    return K


def _asked(term: Term, part: str, u: ndarray, t: float) -> Any:
    """One part of a term, whatever its own code raises told with its name."""
    function: Callable[[ndarray, float], Any] = getattr(term, part)
    try:
        with np.errstate(all="ignore"):
            return function(u.copy(), t)
    except Exception as error:  # a user's function may raise anything
        reason = f"{type(error).__name__} {error}".strip().partition("\n")[0]
        raise ValueError(f"term {term.name!r}: its {part} fails: {reason}") from error


def _refuse_shape(
    term: Term, part: str, value: Any, shape: tuple[int, ...], wanted: str
) -> None:
    array = value if issparse(value) else np.asarray(value)
    if array.shape != shape or array.dtype.kind not in "iuf":
        raise ValueError(
            f"term {term.name!r}: its {part} must be {wanted}, not of shape "
            f"{array.shape} and type {array.dtype}"
        )
