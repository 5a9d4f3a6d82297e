"""Plain Newton iterations in equal load steps, with a clock, on NumPy alone."""

import warnings
from collections.abc import Callable
from dataclasses import dataclass
from time import perf_counter
from typing import Any, Protocol

import numpy as np
from numpy import ndarray

#: Numbers of equal load steps that are tried, one after the other.
STEPS = (1, 2, 5, 10, 20, 40, 80)

# Iterations in a step, and the share of the largest force that may be left.
_MOST, _LEFT = 30, 1e-8

# Round-off of the forces: of 2⁻⁵³ of the displacement, met by ten times the fibres'
# stiffness, which is about the largest sum of magnitudes in a row of the tangent.
_ROUND_OFF = 10 * 2.0**-53


class NotConvergedError(RuntimeError):
    """The iterations did not converge."""


class RivalSystem(Protocol):
    """A discretised ply, as a function of the displacement.

    Attributes
    ----------
    fixed
        Unknowns that are prescribed.
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
        """Their derivative, called after `forces` for the same ``u``."""
        ...

    def increment(self, K: Any, f: ndarray, du: ndarray) -> ndarray:
        """Solve K·du = −f for the free unknowns, given the fixed entries of du."""
        ...


@dataclass(frozen=True, eq=False)
class Run:
    """The end of the load, and the times of repeated runs.

    ``u`` and the nodal forces ``f`` in N are numbered as in `Task.nodes`.
    """

    u: ndarray
    f: ndarray
    linear_solves: int
    seconds: list[float]


def loaded(system: RivalSystem, values: ndarray) -> tuple[ndarray, ndarray, int]:
    """Displacement, nodal forces and number of linear solves at the end of the load.

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
            raise NotConvergedError(f"not converged in {_MOST} iterations")
    return u, f, solves


def timed(begin: Callable[[], RivalSystem], values: ndarray, repeats: int) -> Run:
    """Load a ply once to warm up, then several times with a clock.

    The clock runs from before ``begin`` makes the system.

    Raises
    ------
    NotConvergedError
        If a step does not converge.
    """
    # A singular tangent gives numbers that are not finite, which are caught.
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
    """Seconds of the assembly and of the solution in one iteration at ``u``."""
    start = perf_counter()
    f, K = system.forces(u), system.tangent(u)
    assembled = perf_counter()
    system.increment(K, f, np.zeros_like(u))
    return assembled - start, perf_counter() - assembled


def iterations(
    system: RivalSystem, u: ndarray, repeats: int
) -> list[tuple[float, float]]:
    """The same for several iterations, after one to warm up.

    The displacement changes a little each time, because factors might be kept.
    """
    shares = 1 + 1e-9 * np.arange(1 + repeats)
    return [one_iteration(system, share * u) for share in shares][1:]
