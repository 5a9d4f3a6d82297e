"""Validation of the terms of a ply; loads become terms on its basis.

Every user-defined term is evaluated once when a ply is built: at rest, and at two small
displacements a and b.  The energy difference between them must lie between the values
predicted by the residuals at a and b, and the difference of the residuals between the
values predicted by the tangents.  The last state of a run is checked in the same way.
"""

from collections.abc import Callable, Iterable, Sequence
from typing import Any, get_args

import numpy as np
from numpy import ndarray
from scipy.sparse import csr_matrix, issparse
from skfem import CellBasis

from ..mesh.bases import components
from ..mesh.pattern import refuse_unsymmetric
from ..mesh.user_input import error_text
from .parameters import NO_VALUES, Values
from .terms import Load, Role, Term

# Members of a parameter declaration, and of a term.
_PARAMETERS_MEMBERS = "depends_on_steps", "at_rest", "updated", "advanced"
_TERM_MEMBERS = (
    *("name", "role", "parameters", "line_search"),
    *("energy", "residual", "tangent", "couples"),
)

# Distances of a and b from rest, and from each other, relative to the element size.
# Between them terms are nearly linear, and differences exceed round-off.
_FROM_REST, _BETWEEN = 1e-3, 1e-5

# Tolerances relative to the predicted difference and, for round-off, to the values.
_TOLERANCE, _ROUND_OFF = 1e-3, 1e-13

_ADVICE = (
    "residual must be the derivative of energy, and tangent the derivative of residual"
)


def terms_on_basis(terms: Iterable[Term | Load], basis: CellBasis) -> tuple[Term, ...]:
    """Terms of a ply, with loads as terms on its displacement basis.

    Raises an error if an object is not a term of this ply, or its name is not unique.
    """
    on_basis = [x.on(basis) if hasattr(x, "on") else x for x in terms]
    names: list[str] = []
    for term in on_basis:
        _check_members(term)
        if term.name in names:
            raise ValueError(
                f"two tools, clamps, loads or other terms have the name {term.name!r}: "
                "rename one of them"
            )
        names.append(term.name)
        misfit = getattr(term, "misfit", lambda basis: "")(basis)
        if misfit:
            raise ValueError(f"term {term.name!r}: {misfit}")
    return tuple(on_basis)


def _check_members(term: Any) -> None:
    """Reject an object that lacks a term member or has one of the wrong type."""
    missing = [name for name in _TERM_MEMBERS if not hasattr(term, name)]
    if isinstance(term, type):
        raise ValueError(f"{term!r} is a class, not a term: pass an instance")
    if missing:
        raise ValueError(f"{term!r} is not a term: it lacks {', '.join(missing)}")
    if not (isinstance(term.name, str) and term.name):
        raise ValueError(
            f"the name of a term must be a non-empty string, got {term.name!r}"
        )
    declared = term.parameters
    lacking = [name for name in _PARAMETERS_MEMBERS if not hasattr(declared, name)]
    if declared is not None and lacking:
        raise ValueError(
            f"term {term.name!r}: its parameters lack {', '.join(lacking)}"
        )
    if term.role not in get_args(Role):
        raise ValueError(
            f"term {term.name!r}: role must be one of {', '.join(get_args(Role))}, "
            f"got {term.role!r}"
        )


def coupled_nodes(term: Term, basis: CellBasis) -> Sequence[ndarray]:
    """Additional pairs of nodes that a term couples: as declared, or as found at rest.

    Arrays of shape (n_nodes, n): the nodes of a column are all coupled.
    """
    if (named := term.couples()) is not None:
        return named
    K = term.tangent(basis.zeros(), 1.0, _at_rest(term))
    if K is None:
        return ()
    row, col = np.array(K.nonzero()) // components(basis)
    below = row > col  # it is symmetric
    return (np.array([row[below], col[below]]),)


def check_term(term: Term, basis: CellBasis, size: float) -> None:
    """Reject terms with wrong shapes, non-finite values or inconsistencies.

    Terms whose parameters advance with the steps may be given by rates, without an
    energy: their energy, residual and tangent are not compared.  Tools with friction,
    which has kinks, are not compared either.  The message names the
    term, the method and the defect; ``size`` is the element size in mm.
    """
    p = _at_rest(term)
    _refuse_infinite(term, "at rest", *_forces(term, basis.zeros(), 0.0, p))
    u, d = np.random.default_rng(0).uniform(-1.0, 1.0, (2, basis.N))
    _check_near(term, "near rest", size * _FROM_REST * u, size * _BETWEEN * d, 1.0, p)


def contradiction(term: Term, u: ndarray, t: float, p: Values, size: float) -> str:
    """Contradiction between the methods of a term at a state; empty if there is none.

    Parameters
    ----------
    term
        Term of a ply.
    u, t, p
        Displacement, load factor, and parameters of the term.
    size
        Element size in mm.
    """
    d = np.random.default_rng(0).uniform(-1.0, 1.0, u.size)
    try:
        _check_near(term, "at the last state", u, size * _BETWEEN * d, t, p)
    except ValueError as error:
        return f"at load factor {t:g}, {error}"
    return ""


def _check_near(
    term: Term, where: str, u: ndarray, step: ndarray, t: float, p: Values
) -> None:
    """Refuse a term that is inconsistent over a short step with the middle ``u``."""
    E_low, r_low = _forces(term, u - 0.5 * step, t, p)
    E_high, r_high = _forces(term, u + 0.5 * step, t, p)
    K = _tangent(term, u, t, p)
    _refuse_infinite(term, where, E_low, r_low, K)
    refuse_unsymmetric(term.name, K - K.T, K)
    has_kinks = bool(getattr(term, "friction", None))
    if has_kinks or (term.parameters and term.parameters.depends_on_steps):
        return
    noise = _ROUND_OFF * (abs(E_low) + abs(E_high))
    _compare(term, "energy", E_high - E_low, (r_low @ step, r_high @ step), noise)
    change, noise = (r_high - r_low) @ step, _ROUND_OFF * np.abs(r_low) @ np.abs(step)
    _compare(term, "residual", change, (step @ (K @ step),), noise)


def _compare(
    term: Term, part: str, change: float, predicted: tuple[float, ...], noise: float
) -> None:
    """Reject a difference that is not predicted by the derivatives."""
    slack = _TOLERANCE * max(map(abs, predicted)) + noise
    if not min(predicted) - slack <= change <= max(predicted) + slack:
        derivative = {"energy": "residual", "residual": "tangent"}[part]
        raise ValueError(
            f"term {term.name!r}: its {part} changes by {change:.4g}, but its "
            f"{derivative} predicts {np.mean(predicted):.4g}; {_ADVICE}"
        )


def _refuse_infinite(
    term: Term, where: str, energy: float, residual: ndarray, tangent: Any = 0.0
) -> None:
    values = tangent.data if issparse(tangent) else np.asarray(tangent)
    for part, x in (("energy", energy), ("residual", residual), ("tangent", values)):
        if not np.isfinite(x).all():
            raise ValueError(f"term {term.name!r}: its {part} is not finite {where}")


def _forces(term: Term, u: ndarray, t: float, p: Values) -> tuple[float, ndarray]:
    """Energy and residual, which must be a number and a vector."""
    energy, residual = (_checked(term, x, u, t, p) for x in ("energy", "residual"))
    _refuse_shape(term, "energy", energy, (), "one real number")
    _refuse_shape(term, "residual", residual, u.shape, f"{u.size} real numbers")
    return float(energy), np.asarray(residual)


def _tangent(term: Term, u: ndarray, t: float, p: Values) -> Any:
    """Tangent, a square matrix with one row per unknown; zero if there is none."""
    K = _checked(term, "tangent", u, t, p)
    if K is None:
        return csr_matrix((u.size, u.size))
    size = u.size
    _refuse_shape(term, "tangent", K, (size, size), f"a real {size} × {size} matrix")
    return K


def _checked(term: Term, part: str, u: ndarray, t: float, p: Values) -> Any:
    """Result of one term method; the term name is added to exceptions."""
    function: Callable[[ndarray, float, Values], Any] = getattr(term, part)
    try:
        with np.errstate(all="ignore"):
            return function(u.copy(), t, p)
    except Exception as error:  # a user's function may raise anything
        raise ValueError(
            f"term {term.name!r}: its {part} raised {error_text(error)}"
        ) from error


def _refuse_shape(
    term: Term, part: str, value: Any, shape: tuple[int, ...], expected: str
) -> None:
    array = value if issparse(value) else np.asarray(value)
    if array.shape != shape or array.dtype.kind not in "iuf":
        raise ValueError(
            f"term {term.name!r}: its {part} must be {expected}, but has shape "
            f"{array.shape} and type {array.dtype}"
        )


def _at_rest(term: Term) -> Values:
    """Values of a term's parameters at rest."""
    return NO_VALUES if term.parameters is None else term.parameters.at_rest()
