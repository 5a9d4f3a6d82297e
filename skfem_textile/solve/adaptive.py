"""Adaptive mesh refinement: solve, estimate the error, refine, up to a tolerance."""

import logging
from collections.abc import Callable, Collection, Sequence
from dataclasses import asdict, dataclass, fields
from numbers import Real
from typing import Any

import numpy as np

from ..mesh.progress import shown
from ..ply import Ply
from ..ply.refinement import (
    marked,
    refine,
    refuse_unrefinable,
    shear_angle_jumps,
)
from .conditions import Conditions, Constraints
from .error_estimate import (
    change_of,
    estimated_error,
    problem_at,
    refuse_single_nodes,
    work_of,
)
from .newton import Method
from .result import Result, StepError
from .search import equilibrium_near
from .states import ErrorEstimate, Iteration, NoEquilibriumError, State, UserError
from .stepper import DEFAULT_WARN_ONLY, LoadStepper

log = logging.getLogger(__name__)

#: Default limit of the number of unknowns.  A run that reaches it takes about 80 s on
#: one core, including all its meshes (`skfem-textile run bias_extension --mesh delaunay
#: --size 10x20 --tolerance 1e-6 --no-render --out DIR`).
MOST_UNKNOWNS = 50_000

# Safety factor on the estimate, which was up to a third too small on refined meshes:
# `python -m studies adaptive`.
_MARGIN = 1.5

# Bulk fraction (Dörfler marking): share of the sum of the squared jumps that the marked
# elements contain.  A smaller share takes more rounds; a larger one refines elements
# needlessly.
_SHARE = 0.5

# Limit of the number of rounds; each about doubles the number of unknowns.
_MOST_ROUNDS = 25


@dataclass(frozen=True)
class Round:
    """One refinement round: the mesh and the result on it.

    Attributes
    ----------
    unknowns
        Number of unknowns.
    linear_solves
        Number of linear solves for the state.
    whole_path
        True if the whole load path was computed on this mesh, not only its end.
    load_change
        Relative change of the load since the previous round; None in the first.
    estimated_load_error
        See `Result.summary`.
    error
        Error that is compared with the tolerance: the largest of 1.5 times the
        estimate, the change of the load, and half of this error on the last coarser
        mesh that has an estimate.  Infinite where there is no estimate.
    """

    unknowns: int
    linear_solves: int
    whole_path: bool
    load_change: float | None
    estimated_load_error: float | None
    error: float

    def __str__(self) -> str:
        shares = self.load_change, self.estimated_load_error
        change, error = ("none" if x is None else f"{x:.2%}" for x in shares)
        return (
            f"{self.unknowns} unknowns, {self.linear_solves} linear solves"
            f"{' for the whole load path' if self.whole_path else ''}, change of the "
            f"load: {change}, estimated error: {error}"
            + (f", error used: {self.error:.2%}" if self.error < np.inf else "")
        )


@dataclass(frozen=True, eq=False, repr=False)
class AdaptiveResult(Result):
    """Result on the last mesh, with the refinement rounds.

    Attributes
    ----------
    tolerance
        Relative tolerance of the load.
    rounds
        All rounds, including the one on the last mesh.
    """

    tolerance: float
    rounds: tuple[Round, ...]

    @property
    def tolerance_met(self) -> bool:
        """True if the whole load was applied and its error is within the tolerance."""
        last = self.rounds[-1:]
        met = any(one.whole_path and one.error <= self.tolerance for one in last)
        return self.converged and met

    def summary(self) -> dict[str, Any]:
        """As in `Result`, with ``tolerance``, ``tolerance_met`` and ``rounds``."""
        rows = [asdict(one).items() for one in self.rounds]
        return super().summary() | {
            "tolerance": self.tolerance,
            "tolerance_met": self.tolerance_met,
            "rounds": [{k: None if x == np.inf else x for k, x in row} for row in rows],
        }


def counted(
    rounds: Sequence[Round], unknowns: int, change: float | None, estimate: float | None
) -> float:
    """Error of a round, see `Round`."""
    if estimate is None:
        return np.inf
    at_once = [one.load_change for one in rounds if one.unknowns == unknowns]
    coarser = [one.error for one in rounds if one.unknowns < unknowns]
    before = [error for error in coarser if error < np.inf][-1:]
    changes = [x for x in (change, *at_once) if x is not None]
    return max([_MARGIN * estimate, *changes, *(error / 2 for error in before)])


class AdaptiveStepper:
    """Load stepper with adaptive mesh refinement to a tolerance of the load.

    The load is first applied on the given mesh.  Each round then refines the elements
    at which the shear angle jumps, transfers the last state to the refined mesh,
    restores equilibrium and estimates the error of the load.  If no equilibrium is
    found from the transferred state, and always on the last mesh, the whole load is
    applied again, so that every state of the result is on the last mesh.

    The error of a round is the largest of 1.5 times the estimate, the change of the
    load since the previous mesh, and half of the previous error, because a single
    estimate may be small by chance.  Without an estimate the tolerance is not met.

    Parameters
    ----------
    ply
        The ply, on triangles or quadrilaterals; refined meshes consist of triangles.
    conditions
        Displacement conditions by name, on boundaries or given by functions.
    tolerance
        Relative tolerance of the load, between 0 and 1.
    most_unknowns
        Limit of the number of unknowns of a mesh.
    on_round
        Called with each `Round`.
    steps, method, warn_only, solver, on_iteration, on_step
        As for `LoadStepper`.

    Raises
    ------
    ValueError
        See `LoadStepper`.  Also if the tolerance or ``most_unknowns`` is not valid, if
        the ply cannot be refined or has no error estimate, or if a condition acts on
        nodes, given by number or name, that share an edge.

    Examples
    --------
    >>> from skfem_textile.scenes import bias_extension
    >>> from skfem_textile import AdaptiveStepper, Fabric, Ply
    >>> scene = bias_extension(size=(4, 8))
    >>> ply = Ply(scene.mesh, Fabric(1e5, 0.5, scene.warp, scene.weft))
    >>> result = AdaptiveStepper(ply, scene.conditions, 0.1, steps=4).run()
    >>> result.tolerance_met
    True
    """

    checkpoint = None

    def __init__(
        self,
        ply: Ply,
        conditions: Conditions,
        tolerance: float,
        steps: int = 20,
        *,
        most_unknowns: int = MOST_UNKNOWNS,
        on_round: Callable[[Round], None] | None = None,
        method: str | Method = "newton",
        warn_only: Collection[str] = DEFAULT_WARN_ONLY,
        solver: str = "auto",
        on_iteration: Callable[[Iteration], None] | None = None,
        on_step: Callable[[State], None] | None = None,
    ) -> None:
        if not _is_number(tolerance) or not 0 < tolerance < 1:
            raise ValueError(
                f"the tolerance must be between 0 and 1, got {tolerance!r}"
            )
        if not _is_number(most_unknowns):
            raise ValueError(
                f"most_unknowns must be a real number, got {most_unknowns!r}"
            )
        if not most_unknowns >= ply.basis.N:
            raise ValueError(
                f"the ply has {ply.basis.N} unknowns, more than most_unknowns, "
                f"{most_unknowns}"
            )
        self._ply, self._conditions, self._steps = ply, conditions, steps
        self.tolerance, self.most_unknowns = tolerance, most_unknowns
        self._search = dict[str, Any](method=method, warn_only=warn_only, solver=solver)
        self.on_iteration, self.on_step, self.on_round = on_iteration, on_step, on_round
        self._stepper = self._stepper_of(ply)
        self._estimate: ErrorEstimate | None = None
        self._rounds: list[Round] = []
        self._work = np.zeros(2)  # of the last round
        _refuse_what_cannot_be_refined(ply, conditions)

    @shown("preparing the load steps")
    def run(self, resume: bool = False) -> AdaptiveResult:
        """Refine and load until the tolerance is met.

        Parameters
        ----------
        resume
            Not supported: adaptive runs have no checkpoint.

        Raises
        ------
        StepError
            If the load cannot be applied, if no moving condition carries a load, or if
            the tolerance is not met within ``most_unknowns``.  Its ``result`` is the
            result on the last mesh on which the whole load was applied, if there is
            one.
        """
        if resume:
            raise ValueError(
                "an adaptive run writes no checkpoint and cannot be resumed"
            )
        self._rounds = []
        first: tuple[Ply, State] | None = None
        try:
            first = self._apply(self._ply)
            self._refine_from(*first)
        except StepError:
            raise
        except MemoryError:
            if first is None:
                raise
            raise self._error("there is not enough memory for a finer mesh") from None
        except Exception as error:  # a user's function may raise anything
            if not self.states:
                raise
            # Input that is valid on the first mesh may raise a ValueError on a finer
            # one.
            named = isinstance(error, ValueError | UserError)
            why = error if named else UserError(error)
            where = "on a finer mesh: " if first else ""
            raise self._error(f"{where}{why}") from error
        result = self.result
        if result.tolerance_met:
            return result
        last = self._rounds[-1].error
        error_text = f"is about {last:.2%}"
        advice = "; increase most_unknowns or the tolerance"
        if last == np.inf:
            error_text = f"cannot be estimated ({result.estimated_error.reason})"
            advice = ""
        raise self._error(
            f"the tolerance is not met with at most {self.most_unknowns} unknowns: "
            f"the error of the load {error_text}, but {100 * self.tolerance:g}% was "
            f"requested{advice}"
        )

    @property
    def states(self) -> tuple[State, ...]:
        """States on the last mesh on which the whole load was applied.

        Before there is such a mesh, the states so far.
        """
        return self._stepper.states

    @property
    def result(self) -> AdaptiveResult:
        """Result so far."""
        result = self._stepper.result
        values = {field.name: getattr(result, field.name) for field in fields(Result)}
        rounds, estimate = tuple(self._rounds), self._estimate
        if estimate is not None:
            values["estimate"] = lambda _: estimate
        return AdaptiveResult(**values, tolerance=self.tolerance, rounds=rounds)

    def _error(self, why: str) -> StepError:
        return StepError(why, self.result, np.empty(0, dtype=int))

    def _stepper_of(self, ply: Ply) -> LoadStepper:
        return LoadStepper(
            *(ply, self._conditions, self._steps),
            on_iteration=self.on_iteration,
            on_step=self.on_step,
            **self._search,
        )

    def _refine_from(self, ply: Ply, state: State) -> None:
        """Refine until the tolerance is met or the limit of unknowns is reached."""
        finer: tuple[Ply, State] | None = (ply, state)
        while finer is not None:
            ply, state = finer
            last = self._rounds[-1]
            if last.error > self.tolerance:
                finer = self._refined(ply, state)
            elif last.whole_path:
                return
            else:
                finer = self._apply(ply)
        if not self._rounds[-1].whole_path:
            self._apply(ply)

    def _apply(self, ply: Ply) -> tuple[Ply, State]:
        """Apply the whole load in a new round; on failure the last round is kept."""
        stepper = self._stepper_of(ply)
        if not self._rounds:  # what a failure or an interruption leaves
            self._stepper, self._estimate = stepper, None
        try:
            state = stepper.run().states[-1]
        except StepError as error:
            if self._rounds:
                where = f"on a finer mesh with {ply.basis.N} unknowns: "
                raise self._error(f"{where}{error}") from None
            blamed = error.elements, error.quantity
            raise StepError(str(error), self.result, *blamed) from None
        self._stepper, self._estimate = stepper, None
        self._finish_round(ply, state, whole_path=True)
        return ply, state

    @shown("refining the mesh")
    def _refined(self, ply: Ply, state: State) -> tuple[Ply, State] | None:
        """Transfer the state to a refined mesh; None if that is too large."""
        if len(self._rounds) >= _MOST_ROUNDS:
            return None
        refinement = refine(ply, marked(shear_angle_jumps(ply, state.u), _SHARE))
        if not ply.basis.N < refinement.ply.basis.N <= self.most_unknowns:
            return None
        u = refinement.carry(state.u)
        try:
            after = equilibrium_near(
                refinement.ply, self._conditions, u, **self._search
            )
        except NoEquilibriumError as error:
            log.info("the load is applied again from zero on the finer mesh: %s", error)
            return self._apply(refinement.ply)
        self._finish_round(refinement.ply, after, whole_path=False)
        return refinement.ply, after

    @shown("estimating the error")
    def _finish_round(self, ply: Ply, state: State, whole_path: bool) -> None:
        """Estimate the error of a state and record its round."""
        conditions, solver = self._conditions, self._stepper.result.solver.name
        problem = problem_at(ply, conditions, solver, state.load_factor)
        try:
            work = work_of(problem, state)
        except ValueError as none:
            why = f"the tolerance is relative to the load, but there is no load: {none}"
            raise self._error(why) from None
        change = change_of(self._work, work) if self._rounds else None
        self._work, errors = work, estimated_error(problem, conditions, solver, state)
        estimate, solves, unknowns = errors.load, state.linear_solves, int(ply.basis.N)
        if whole_path:
            self._estimate, solves = errors, self._stepper.result.linear_solves
        error = counted(self._rounds, unknowns, change, estimate)
        one = Round(unknowns, solves, whole_path, change, estimate, error)
        self._rounds.append(one)
        log.info("round %d: %s", len(self._rounds), one)
        if self.on_round is not None:
            self.on_round(one)


def _refuse_what_cannot_be_refined(ply: Ply, conditions: Conditions) -> None:
    """Refuse a ply or conditions that cannot be refined.

    The ply needs a refined version and an error estimate, and the conditions need valid
    values on it.  Nodes given by number must be vertices that share no edge.
    """
    refine(ply, [])
    try:
        refuse_unrefinable(ply)
    except ValueError as error:
        raise ValueError(f"the error cannot be estimated: {error}") from None
    refuse_single_nodes(ply, conditions)
    n_vertices = ply.users_mesh.nvertices
    for name, condition in conditions.items():
        where = condition.where
        by_number = not (where is None or callable(where) or isinstance(where, str))
        if by_number and condition.nodes(name, ply.basis).max() >= n_vertices:
            raise ValueError(
                f"condition {name!r} selects nodes by number, some of which are not "
                "vertices of the mesh and change their positions on refinement: "
                "specify a function of position"
            )
    finer = refine(ply, np.arange(ply.users_mesh.nelements)).ply
    try:
        Constraints(finer.basis, conditions).fixed_values(1.0)
    except ValueError as error:
        raise ValueError(f"on a refined mesh: {error}") from None


def _is_number(value: Any) -> bool:
    return isinstance(value, Real)
