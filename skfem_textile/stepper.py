"""Incremental solution: a growing load, in steps that are cut where they fail."""

from collections.abc import Callable, Mapping
from time import perf_counter

import numpy as np

from .conditions import Condition, Constraints
from .newton import (
    Clock,
    Equilibrium,
    NoEquilibriumError,
    Problem,
    balanced,
    descent,
    mixed_newton,
)
from .ply import Ply
from .result import Result, State

#: What a step tries, one after the other, and in how many iterations at most.
STRATEGIES = ((mixed_newton, 25), (descent, 200))


class StepError(RuntimeError):
    """No converged state was found; ``result`` holds every state before it."""

    def __init__(self, message: str, result: Result) -> None:
        super().__init__(message)
        self.result = result


class LoadStepper:
    """Load a ply in equal steps, halving the step where it does not converge.

    Each step tries mixed Newton, which takes large steps along nearly
    inextensible fibres, then descent on the energy.  A state with det F ≤ 0 at
    any 2×2 point is refused.

    Parameters
    ----------
    ply
        The ply to load.
    conditions
        Displacement conditions by name.
    steps
        Number of equal steps to the load factor 1.
    max_halvings
        How often a step may be halved before the run stops.
    progress
        Called with each converged `State`.

    Raises
    ------
    ValueError
        If a condition is not valid at some load factor, ``steps`` is no whole number
        of at least 1, or ``max_halvings`` is negative.

    Examples
    --------
    A square ply sheared by 45°:

    >>> from skfem import MeshQuad
    >>> from skfem_textile import Condition, Fabric, Full, LoadStepper, Ply
    >>> ply = Ply(MeshQuad().refined(2), Fabric(1e4, shear=1.0), Full())
    >>> def arc(X, t):
    ...     angle = np.full(X.shape[1], t * np.pi / 4)
    ...     return np.stack([np.sin(angle), np.cos(angle) - 1])
    >>> conditions = {
    ...     "clamp": Condition(lambda X: X[1] == 0),
    ...     "slide": Condition(lambda X: X[1] == 1, arc),
    ... }
    >>> stepper = LoadStepper(ply, conditions, steps=2)
    >>> result = stepper.run()
    >>> round(result.summary()["max_shear_angle_deg"], 1)
    45.0
    """

    def __init__(
        self,
        ply: Ply,
        conditions: Mapping[str, Condition],
        steps: int = 20,
        *,
        max_halvings: int = 8,
        progress: Callable[[State], None] | None = None,
    ) -> None:
        if steps != int(steps) or steps < 1:
            raise ValueError(f"steps must be at least 1, and whole; got {steps}")
        if max_halvings < 0:
            raise ValueError(f"max_halvings must be at least 0, got {max_halvings}")
        self.problem = Problem(ply, Constraints(ply.basis, conditions))
        self.load_factors = np.linspace(0.0, 1.0, int(steps) + 1)[1:].tolist()
        for t in self.load_factors:
            self.problem.constraints.fixed_values(t)  # refuses what is not valid
        self.max_halvings = max_halvings
        self.progress = progress

    def run(self) -> Result:
        """Apply the whole load.

        Raises
        ------
        StepError
            If a step fails however often it is halved.
        """
        start = perf_counter()
        self.problem.clock = Clock()
        self.problem.ply.reset()
        u = self.problem.ply.basis.zeros()
        rest = Equilibrium(u, self.problem.residual(u), (), 0.0)
        states = [self._state(0.0, rest, [])]
        try:
            for t in self.load_factors:
                self._advance(states, t, self.max_halvings)
        except (NoEquilibriumError, ValueError) as error:
            at = states[-1].load_factor
            raise StepError(
                f"stopped at load factor {at:.6g}: {error}", self._result(states, start)
            ) from None
        return self._result(states, start)

    def _result(self, states: list[State], start: float) -> Result:
        clock = self.problem.clock
        return Result(
            ply=self.problem.ply,
            states=states,
            converged=states[-1].load_factor == 1.0,
            newton_iterations=clock.solves,
            wall_time_s=perf_counter() - start,
            assembly_time_s=clock.seconds["assembly"],
            solve_time_s=clock.seconds.get("solve", 0.0),
        )

    def _advance(self, states: list[State], t: float, halvings: int) -> None:
        """Add the state at the load factor ``t``, and any needed on the way."""
        last = states[-1]
        try:
            state = self._equilibrium(states, t)
        except NoEquilibriumError as failure:
            if halvings == 0:
                raise NoEquilibriumError(
                    f"the step to {t:.6g} failed after {self.max_halvings} halvings "
                    f"({failure}); try a larger stabilisation or more steps"
                ) from None
            self._advance(states, 0.5 * (last.load_factor + t), halvings - 1)
            self._advance(states, t, halvings - 1)
        else:
            states.append(state)
            self.problem.ply.commit(state.u)
            if self.progress is not None:
                self.progress(state)

    def _equilibrium(self, states: list[State], t: float) -> State:
        """Converged state at the load factor ``t``, not folded."""
        problem, last, failures = self.problem, states[-1], []
        fixed_values = problem.constraints.fixed_values(t)
        for strategy, most in STRATEGIES:
            try:
                with np.errstate(all="ignore"):  # what is not finite is caught
                    iterates = strategy(problem, last.u, fixed_values)
                    found = balanced(problem, iterates, most)
                if not problem.smallest_area_ratio(found.u) > 0:
                    raise NoEquilibriumError("an element folds: det F <= 0")
                return self._state(t, found, states)
            except NoEquilibriumError as failure:
                failures.append(f"{strategy.__name__}: {failure}")
        raise NoEquilibriumError("; ".join(failures))

    def _state(self, t: float, found: Equilibrium, before: list[State]) -> State:
        ply, clock = self.problem.ply, self.problem.clock
        forces = ply.nodal(found.f)
        return State(
            load_factor=t,
            u=found.u,
            reactions={
                name: forces[:, nodes].sum(axis=1)
                for name, nodes in self.problem.constraints.nodes.items()
            },
            energies=clock.time("assembly", ply.energies, found.u),
            iterations=clock.solves - sum(state.iterations for state in before),
            residuals=found.residuals,
            tolerance=found.tolerance,
        )
