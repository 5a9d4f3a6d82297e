"""Two ways to equilibrium at a given load: mixed Newton, and descent on the energy."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from itertools import islice
from time import perf_counter
from typing import Any, NamedTuple

import numpy as np
from numpy import ndarray
from scipy.sparse import csr_matrix

from .conditions import Constraints
from .elements import GAUSS
from .linear import SingularMatrixError, solve_symmetric
from .ply import Ply

_ROUND_OFF = 2.0**-53
_HALVINGS_OF_AN_INCREMENT = 20


class NoEquilibriumError(Exception):
    """An attempt at a load factor failed; the message says why."""


@dataclass(eq=False)
class Clock:
    """Linear solves, and the time that they and the assembly took."""

    solves: int = 0
    seconds: dict[str, float] = field(default_factory=dict)

    def time(self, part: str, function: Callable, *args: Any) -> Any:
        """Call the function and add its time to that part."""
        start = perf_counter()
        try:
            return function(*args)
        finally:
            spent = self.seconds.get(part, 0.0) + perf_counter() - start
            self.seconds[part] = spent


class Problem:
    """A ply under conditions: what an iteration needs to know of them."""

    def __init__(self, ply: Ply, constraints: Constraints) -> None:
        self.ply = ply
        self.constraints = constraints
        self.clock = Clock()
        self._element_size = ply.mesh.param()

    def energy(self, u: ndarray) -> float:
        """Internal energy, on the clock."""
        return self.clock.time("assembly", self.ply.energy, u)

    def residual(self, u: ndarray) -> ndarray:
        """Internal nodal forces, on the clock."""
        return self.clock.time("assembly", self.ply.residual, u)

    def tangent(self, u: ndarray, tension: ndarray | None) -> csr_matrix:
        """Tangent with the given fibre tensions, on the clock."""
        return self.clock.time("assembly", self.ply.tangent, u, tension)

    def increment(
        self, K: csr_matrix, f: ndarray, u: ndarray, fixed_values: ndarray
    ) -> ndarray:
        """Solve K·du = −f, with the fixed unknowns brought to their values.

        Raises
        ------
        NoEquilibriumError
            If the tangent is singular.
        """
        turn, fixed = self.constraints.turn, self.constraints.fixed
        free = self.constraints.free
        dq = np.zeros_like(u)
        dq[fixed] = fixed_values - self._turned(u)[fixed]
        if turn is not None:
            K, f = turn.T @ K @ turn, turn.T @ f
        b = -(f + K @ dq)[free]
        self.clock.solves += 1
        try:
            dq[free] = self.clock.time("solve", solve_symmetric, K[free][:, free], b)
        except SingularMatrixError as error:
            raise NoEquilibriumError(str(error)) from None
        return dq if turn is None else turn @ dq

    def free(self, f: ndarray) -> ndarray:
        """Components of a DOF vector along the free unknowns."""
        return self._turned(f)[self.constraints.free]

    def unbalanced(self, f: ndarray) -> float:
        """Largest nodal force along the free unknowns.

        Raises
        ------
        NoEquilibriumError
            If it is not finite.
        """
        largest = float(np.abs(self.free(f)).max(initial=0.0))
        if not np.isfinite(largest):
            raise NoEquilibriumError("the forces are not finite")
        return largest

    def tolerance(self, K: csr_matrix, u: ndarray, f: ndarray) -> float:
        """A share of the largest force, and what round-off leaves in any case.

        Rounding moves nodes by 2⁻⁵³ of their displacement and changes gradients by
        2⁻⁵³; the stiffness turns both into forces.
        """
        rounding = _ROUND_OFF * (np.abs(u).max() + self._element_size)
        stiffness = float(abs(K).sum(axis=1).max())
        return float(1e-8 * np.abs(f).max() + rounding * stiffness)

    def smallest_area_ratio(self, u: ndarray) -> float:
        """Smallest det F at the 2×2 points; not positive where the ply folds."""
        gauss, _ = GAUSS
        return float(self.ply.area_ratio(u, gauss).min())

    def _turned(self, u: ndarray) -> ndarray:
        turn = self.constraints.turn
        return u if turn is None else turn.T @ u


@dataclass(frozen=True, eq=False)
class Equilibrium:
    """Where an iteration ended: displacement, forces, and how it converged."""

    u: ndarray
    f: ndarray
    residuals: tuple[float, ...]
    tolerance: float


class Iterate(NamedTuple):
    """A tangent, the displacement to which it led, and the forces there."""

    K: csr_matrix
    u: ndarray
    f: ndarray


def balanced(problem: Problem, iterates: Iterator[Iterate], most: int) -> Equilibrium:
    """Take iterates, ``most`` of them at most, until the forces balance.

    Raises
    ------
    NoEquilibriumError
        If the iteration gives up, or the forces never balance.
    """
    residuals: list[float] = []
    for K, u, f in islice(iterates, most):
        residuals.append(problem.unbalanced(f))
        tolerance = problem.tolerance(K, u, f)
        if residuals[-1] <= tolerance:
            return Equilibrium(u, f, tuple(residuals), tolerance)
    raise NoEquilibriumError(
        f"{residuals[-1]:.2g} N unbalanced after {most} iterations, "
        f"tolerance {tolerance:.2g} N"
    )


def mixed_newton(
    problem: Problem, u: ndarray, fixed_values: ndarray
) -> Iterator[Iterate]:
    """Mixed-integration-point Newton (Magisano, Leonetti & Garcea 2017).

    The geometric stiffness takes the fibre tensions that the previous iteration
    predicted, T(ε) + T′ ∂ε·∇du, not those of its displacement, which are far
    larger wherever nearly inextensible fibres turn.  The residual is unchanged.
    """
    tension, f = None, problem.residual(u)
    while True:
        K = problem.tangent(u, tension)
        du = problem.increment(K, f, u, fixed_values)
        tension = problem.ply.predicted_tension(u, du)
        u = u + du
        f = problem.residual(u)
        yield Iterate(K, u, f)


def descent(problem: Problem, u: ndarray, fixed_values: ndarray) -> Iterator[Iterate]:
    """Descent on the energy, which does not climb to a saddle as Newton may.

    The tangent leaves out the geometric stiffness of fibres in compression; its
    increment, or the opposite one where it is still indefinite, lowers the energy
    if it is short enough.  A line search shortens every increment but the first,
    which brings the fixed unknowns to their values.  Slower than Newton near the
    end.
    """
    f = problem.residual(u)
    search = False
    while True:
        pull = np.maximum(problem.ply.fibre_tension(u), 0.0)
        K = problem.tangent(u, pull)
        du = problem.increment(K, f, u, fixed_values)
        u = u + (_shortened(problem, u, du, f) if search else du)
        f = problem.residual(u)
        yield Iterate(K, u, f)
        search = True


def _shortened(problem: Problem, u: ndarray, du: ndarray, f: ndarray) -> ndarray:
    """The increment, halved until the energy falls enough (Armijo).

    It may not fold the ply, nor fold it further if it is folded.
    """
    energy = problem.energy(u)
    slope = float(problem.free(f) @ problem.free(du))
    if slope > 0:
        du, slope = -du, -slope
    unfolded = min(problem.smallest_area_ratio(u), 0.0)
    for _ in range(_HALVINGS_OF_AN_INCREMENT):
        allowed = energy + 1e-4 * slope + 1e-12 * abs(energy)
        if (
            problem.energy(u + du) <= allowed
            and problem.smallest_area_ratio(u + du) > unfolded
        ):
            return du
        du, slope = du / 2, slope / 2
    raise NoEquilibriumError("no descent of the energy")
