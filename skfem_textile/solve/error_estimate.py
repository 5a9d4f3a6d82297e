"""A posteriori estimate of the discretisation error by a finer mesh.

The shear angle jumps across lines that element edges do not follow, and the mesh smears
these jumps.  The state is transferred to the ply with each element split in four, and
two linear systems predict its change. The contribution of stabilisation and deviations
at a kink decreases so slowly with the element size that a finer mesh hardly reveals it;
a share of it is therefore added.  The load is measured by the work of reactions and
loads.
"""

from typing import Any

import numpy as np
from numpy import ndarray

from ..mesh.user_input import error_text
from ..ply import Ply
from ..ply.parameters import PlyParameters
from .conditions import Conditions, Constraints, turned
from .linear import solver_named
from .linear.solver import Clock
from .newton import definite, within_laws
from .problem import Problem, Tangent
from .states import ErrorEstimate, NoEquilibriumError, State

#: Ratio of the shear-angle error to the change on halved elements, and of the load
#: error to the energy share of stabilisation and deviations: `python -m studies
#: adaptive`, calibration cases.
SHEAR_ANGLE_OVER_CHANGE, LOAD_OVER_SHARE = 1.4, 0.4

#: Number of unknowns above which there is no estimate.  Chosen: the factors of the
#: finer mesh, with four times as many, then take some gigabytes.
MOST_UNKNOWNS = 250_000

# Maximum number of increments until the load has converged, and the relative change per
# increment that counts as converged.  Chosen: if no tangent is projected, the second
# increment is within it in all cases of the study.
_MOST_INCREMENTS, _SETTLED = 4, 0.2

# The same if an increment was shortened at the end of a law's domain.  Chosen: the ply
# with a hole takes 5, others up to 8.
_MOST_SHORTENED = 12

# Relative step of the load factor for the finite difference of the fixed values.
_STEP_BACK = 1e-3

# Ratio of work to energy, for a ply on a surface, above which the work is attributed to
# a load.  Supported nodes that follow a triangulated tool do work of up to 0.2 % of the
# energy; an edge tension does several times the energy.
_OF_A_LOAD = 0.01

_NO_LOAD = "no moving condition carries a load"


def estimated_error(
    problem: Problem, conditions: Conditions, solver: str, state: State
) -> ErrorEstimate:
    """Estimated error of a state of a problem, with a linear solver by name.

    There is none if the finer mesh has no state near it.  The estimate of an earlier
    state is not a substitute, because it may be several times too small.
    """
    if state.load_factor == 0:
        return ErrorEstimate(reason="the load is zero")
    ply = problem.ply
    if ply.basis.N > MOST_UNKNOWNS:
        return ErrorEstimate(reason=f"the ply has more than {MOST_UNKNOWNS} unknowns")
    try:
        refuse_single_nodes(ply, conditions)
        with np.errstate(all="ignore"):  # non-finite values are detected
            return _estimate(problem, conditions, solver, state)
    except NoEquilibriumError as error:
        reason = (
            f"no state was found near this one on a finer mesh: {error}; compare with "
            "a run at half the element size"
        )
    except MemoryError:
        reason = "there is not enough memory for a finer mesh"
    except ValueError as error:
        reason = str(error)
    except Exception as error:  # from a user's term; computed states are kept
        reason = error_text(error)
    return ErrorEstimate(reason=reason)


def refuse_single_nodes(ply: Ply, conditions: Conditions) -> None:
    """Refuse conditions on nodes, given by number, that share an edge.

    A finer mesh has further nodes between these.
    """
    named = getattr(ply.mesh, "named_nodes", {})
    for name, condition in conditions.items():
        where: Any = condition.where
        by_name = isinstance(where, str) and where not in named
        if where is None or callable(where) or by_name:
            continue
        nodes = condition.nodes(name, ply.basis)
        if np.isin(ply.mesh.facets, nodes).all(axis=0).any():
            raise ValueError(
                f"condition {name!r} selects nodes by number, but a finer mesh has "
                "further nodes between them: specify a boundary by name"
            )


def problem_at(
    ply: Ply, conditions: Conditions, solver: str, load_factor: float
) -> Problem:
    """Problem of a ply at a load factor, with a linear solver by name."""
    constraints = Constraints(ply.basis, conditions)
    problem = Problem(ply, constraints, solver_named(solver))
    problem.load_factor = load_factor
    return problem


def work_of(problem: Problem, state: State) -> ndarray:
    """Work of reactions and of loads at a state in N·mm, shape (2,).

    Raises an error if no moving condition carries a load.
    """
    u, p = state.u, state.parameters
    rate = _rate(problem)
    work = _work(problem, problem.residual(u, p), u, p, rate)
    if not _is_of_load(work, problem, state, rate):
        raise ValueError(_NO_LOAD)
    return work


def change_of(before: ndarray, after: ndarray) -> float:
    """Relative change of the work."""
    return float(np.abs((after - before).sum()) / np.abs(before).sum())


def _work(
    problem: Problem, f: ndarray, u: ndarray, parameters: PlyParameters, rate: ndarray
) -> ndarray:
    """Work of the reactions through their prescribed motion, and work of the loads.

    Each node of a condition contributes with its own motion, as an edge may rotate;
    ``rate`` is the result of `_rate`.
    """
    constraints = problem.constraints
    moving = turned(f, constraints.turn)[constraints.prescribed]
    return np.array([moving @ rate, problem.load(u, parameters) @ u])


def _rate(problem: Problem) -> ndarray:
    """Load factor times the rate of the fixed unknowns with respect to it, in mm."""
    constraints, t = problem.constraints, problem.load_factor
    values, before = (constraints.fixed_values(x) for x in (t, (1 - _STEP_BACK) * t))
    return (values - before) / _STEP_BACK


def _is_of_load(work: ndarray, problem: Problem, state: State, rate: ndarray) -> bool:
    """True if the work exceeds the work of the unbalanced forces of a state.

    On a surface, whose growth deforms the ply, it must exceed the work of the supports.
    """
    length = np.abs(state.u).sum() + np.abs(rate).sum()
    least = state.tolerance * length
    if problem.surfaces is not None:
        least = max(least, _OF_A_LOAD * abs(sum(state.energies.values())))
    return bool(np.abs(work).sum() > least)


def _estimate(
    problem: Problem, conditions: Conditions, solver: str, state: State
) -> ErrorEstimate:
    """The estimate; of the shear angle alone if a surface deforms a ply without load.

    Raises a ValueError if there is no finer ply or no motion.
    """
    coarse, ply, u = problem.at(state.load_factor), problem.ply, state.u
    coarse.clock = Clock()
    p = ply.updated(state.parameters, u, state.load_factor)
    motion, forces = Tangent(coarse, u, p).settled(coarse.residual(u, p))
    rate = _rate(coarse)
    before = _work(coarse, forces, u := u + motion, p, rate)
    loaded = _is_of_load(before, coarse, state, rate)
    if not loaded and coarse.surfaces is None:
        raise ValueError(_NO_LOAD)
    finer: Any = ply.finer()
    fine = problem_at(finer.ply, conditions, solver, state.load_factor)
    trial = _Trial(fine, *finer.carry(u, p))
    fine_u, after = _update(trial, before, loaded)
    angle, fine_angle = (
        of.shear_angle(x).mean(axis=1) for of, x in ((ply, u), (finer.ply, fine_u))
    )
    off = fine_angle - angle[finer.parent]
    rms = np.sqrt(np.average(off**2, weights=fine.ply.basis.dx.sum(axis=1)))
    change = change_of(before, after) if loaded else 0.0
    if not np.isfinite([change, rms]).all():
        raise NoEquilibriumError("the estimate is not finite")
    shear_angle = float(SHEAR_ANGLE_OVER_CHANGE * rms)
    if not loaded:
        return ErrorEstimate(None, shear_angle, _NO_LOAD)
    carried = sum(state.shares.get("energy", {}).values())
    return ErrorEstimate(float(max(change, LOAD_OVER_SHARE * carried)), shear_angle)


class _Trial:
    """Newton increments from a displacement, within the domains of laws.

    Holds displacement, parameters, forces and tangent after ``number`` increments, and
    whether the last one was ``whole`` and any was ``shortened``.
    """

    def __init__(
        self, problem: Problem, u: ndarray, parameters: PlyParameters, tension: ndarray
    ) -> None:
        self.problem, self.number, self.whole, self.shortened = problem, 0, True, False
        self._rate = _rate(problem)
        u, self.parameters = problem.moved(u, np.zeros_like(u)), parameters
        if not problem.in_domain(u, parameters):
            raise NoEquilibriumError("this state is outside the domain of a law there")
        self._at(u, tension, 0.0)

    def _at(
        self, u: ndarray, tension: ndarray, contact: ndarray | float | None
    ) -> None:
        p, self.u = self.parameters, u
        self.tangent = definite(self.problem, u, p, tension, contact)
        self.f = self.problem.residual(u, p)

    def go(self, du: ndarray) -> None:
        """Apply an increment, halved until every law has a value."""
        problem, p = self.problem, self.parameters
        step = within_laws(problem, self.u, du, p)
        self.whole = np.array_equal(step, du)
        self.shortened = self.shortened or not self.whole
        tension = problem.ply.geometric_tension(self.u, step, p)
        contact = self.tangent.contact(self.f, step)
        u = problem.moved(self.u, step)
        if self.number == 0 or self.shortened:
            t = problem.load_factor
            self.parameters = problem.ply.updated(p, u, t, tension)
        self.number += 1
        self._at(u, tension, contact)

    def ahead(self) -> tuple[ndarray, ndarray]:
        """The next increment, and the work after it to first order."""
        du, forces = self.tangent.settled(self.f)
        u = self.u + du
        return du, _work(self.problem, forces, u, self.parameters, self._rate)


def _update(trial: _Trial, before: ndarray, loaded: bool) -> tuple[ndarray, ndarray]:
    """Displacement closer to the equilibrium, and the work there to first order.

    A second increment with an unprojected tangent is sufficient unless the first was
    shortened.  Otherwise the convergence of the work decides; without a load there is
    no criterion.
    """
    problem = trial.problem
    values = problem.constraints.fixed_values(problem.load_factor)
    trial.go(trial.tangent.increment(trial.f, trial.u, values))
    if not loaded and trial.shortened:
        raise NoEquilibriumError(
            "the first increment leaves the domain of a law, and without a load there "
            "is no criterion for further increments"
        )
    if not loaded and trial.tangent.projected:
        raise NoEquilibriumError("the tangent is not positive definite")
    if trial.shortened or trial.tangent.projected:
        return _converged(trial, before)
    du, parameters = trial.ahead()
    return problem.moved(trial.u, du), parameters


def _converged(trial: _Trial, before: ndarray) -> tuple[ndarray, ndarray]:
    """State at which the work has converged, see `_update`.

    Increments are shortened at the end of a law's domain.  Further increments follow,
    halved as soon as the work oscillates, until it converges at a whole increment with
    an unprojected tangent.
    """
    last, moved, length, size = before, np.inf, 1.0, np.abs(before).sum()
    while trial.number < (_MOST_SHORTENED if trial.shortened else _MOST_INCREMENTS):
        du, current = trial.ahead()
        moved_before = moved
        moved, change = (np.abs((current - x).sum()) for x in (last, before))
        if not np.isfinite(current).all():
            raise NoEquilibriumError("the load is not finite")
        near = trial.whole and not trial.tangent.projected and change < size
        if moved <= _SETTLED * change and (near or not trial.shortened):
            return trial.problem.moved(trial.u, du), current
        if trial.shortened and trial.number > 1 and moved > moved_before / 2:
            length = 0.5
        last = current
        trial.go(length * du)
    raise NoEquilibriumError(
        f"after {trial.number} increments the load still changes by {moved / size:.1%}"
    )
