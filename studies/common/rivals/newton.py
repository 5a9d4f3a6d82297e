"""Timed Newton iterations in equal load steps; requires NumPy only."""

import warnings
from collections.abc import Callable
from dataclasses import dataclass
from time import perf_counter
from typing import Any, Protocol

import numpy as np
from numpy import ndarray

#: Numbers of equal load steps, tried in this order.
STEPS = (1, 2, 5, 10, 20, 40, 80)

# Maximum number of iterations, and tolerance relative to the largest force.
_MOST, _LEFT = 30, 1e-8

# Round-off of the forces: 2⁻⁵³ of the displacement times ten fibre stiffnesses, about
# the largest sum of magnitudes in a row of the tangent.
_ROUND_OFF = 10 * 2.0**-53


class NotConvergedError(RuntimeError):
    """The iterations did not converge."""


class RivalSystem(Protocol):
    """A discretised ply: forces and tangent as functions of the displacement.

    Attributes
    ----------
    fixed
        Prescribed unknowns.
    stiffness
        Fibre stiffness in N/mm.
    size
        Number of unknowns.
    """

    fixed: ndarray
    stiffness: float
    size: int

    def forces(self, u: ndarray) -> ndarray:
        """Internal nodal forces in N."""
        ...

    def tangent(self, u: ndarray) -> Any:
        """Derivative of the forces, called after `forces` with the same ``u``."""
        ...

    def increment(self, K: Any, f: ndarray, du: ndarray) -> ndarray:
        """Solve K·du = −f for the free entries of du, given the fixed entries."""
        ...


@dataclass(frozen=True, eq=False)
class Run:
    """The state at full load, and the times of repeated runs.

    ``u`` and the nodal forces ``f`` in N are numbered as in `Task.nodes`.
    """

    u: ndarray
    f: ndarray
    linear_solves: int
    seconds: list[float]


def loaded(system: RivalSystem, values: ndarray) -> tuple[ndarray, ndarray, int]:
    """Displacement, nodal forces and number of linear solves at full load.

    Parameters
    ----------
    system
        The discretised ply.
    values
        Prescribed values at the end of each step, shape (steps, n_fixed).

    Raises
    ------
    NotConvergedError
        If a step does not converge.
    """
    u, solves = np.zeros(system.size), 0
    free = np.ones(system.size, dtype=bool)
    free[system.fixed] = False
    f = system.forces(u)
    for prescribed in values:
        for _ in range(_MOST):
            du = np.zeros(system.size)
            du[system.fixed] = prescribed - u[system.fixed]
            u = u + system.increment(system.tangent(u), f, du)
            f, solves = system.forces(u), solves + 1
            left, largest = np.abs(f[free]).max(), np.abs(f).max()
            if not np.isfinite(largest):
                raise NotConvergedError("the forces are not finite")
            rounding = _ROUND_OFF * system.stiffness * np.abs(u).max()
            if left <= _LEFT * largest + rounding:
                break
        else:
            raise NotConvergedError(f"no convergence within {_MOST} iterations")
    return u, f, solves


def timed(begin: Callable[[], RivalSystem], values: ndarray, repeats: int) -> Run:
    """Load a ply once for warm-up, then several times with timing.

    The times include the call of ``begin``.

    Raises
    ------
    NotConvergedError
        If a step does not converge.
    """
    # A singular tangent yields non-finite numbers, which `loaded` detects.
    with np.errstate(all="ignore"), warnings.catch_warnings():
        warnings.simplefilter("ignore")
        end = loaded(begin(), values)
        seconds = []
        for _ in range(repeats):
            start = perf_counter()
            end = loaded(begin(), values)
            seconds.append(perf_counter() - start)
    return Run(*end, seconds)


def one_iteration(system: RivalSystem, u: ndarray) -> tuple[float, float]:
    """Assembly and solution times in s of one iteration at ``u``."""
    start = perf_counter()
    f, K = system.forces(u), system.tangent(u)
    assembled = perf_counter()
    system.increment(K, f, np.zeros_like(u))
    return assembled - start, perf_counter() - assembled


def iterations(
    system: RivalSystem, u: ndarray, repeats: int
) -> list[tuple[float, float]]:
    """The same for several iterations, after one for warm-up.

    The displacement changes slightly each time, because factors may be cached.
    """
    shares = 1 + 1e-9 * np.arange(1 + repeats)
    return [one_iteration(system, share * u) for share in shares][1:]
