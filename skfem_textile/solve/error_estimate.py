"""An estimate of the discretisation error: how much a finer mesh changes a state.

A kink of the shear angle lies between the nodes, and a mesh smears it.  The state is
carried over to the ply whose elements are split in four, and two linear systems tell to
where it moves.  What the stabilisation and deviations carry at a kink falls with the
element size so slowly that a finer mesh hardly tells of it: a share of it counts too.

A load is measured by the work of reactions and loads.
"""

from typing import Any

import numpy as np
from numpy import ndarray

from ..ply import Ply
from ..ply.parameters import PlyParameters
from .conditions import Conditions, Constraints, turned
from .linear import solver_named
from .newton import definite, within_laws
from .problem import Problem, Tangent
from .states import ErrorEstimate, NoEquilibriumError, State

#: Error of the shear angle over the change that halved elements make, and error of the
#: load over the share of the energy that stabilisation and deviations carry:
#: `python -m studies adaptive`, on the cases that calibrate.
SHEAR_ANGLE_OVER_CHANGE, LOAD_OVER_SHARE = 1.4, 0.4

#: Unknowns from which there is no estimate.  Chosen: the factors of the finer mesh, of
#: four times as many, then take some gigabytes.
MOST_UNKNOWNS = 250_000

# Increments at most until the load is settled, and the change from one to the next that
# counts as settled, as a share of the change in all.  Chosen: where no tangent had to
# be altered the second increment is within it in all cases of the study.
_MOST_INCREMENTS, _SETTLED = 4, 0.2

# The same where one had to be shortened, as a law ends.  Chosen: the ply with a hole
# takes 5, others up to 8.
_MOST_SHORTENED = 12

# Length of the step, as a share of the load factor, that tells how conditions move.
_STEP_BACK = 1e-3

# Work over the energy of a ply on a surface from which a load does it.  Nodes that hold
# a ply on a tool of triangles do up to 0.2 % of the energy in work as they follow the
# tool; an edge tension does several times the energy.
_OF_A_LOAD = 0.01

_NO_LOAD = "nothing that moves carries a load"


def estimated_error(
    ply: Ply, conditions: Conditions, solver: str, state: State
) -> ErrorEstimate:
    """Estimate the error of a state, with the linear solver of a name.

    Where a finer mesh has no state near it, there is none.  That of an earlier state
    would not do, for it may be several times smaller than the error.
    """
    if state.load_factor == 0:
        return ErrorEstimate(reason="there is no load yet")
    if ply.basis.N > MOST_UNKNOWNS:
        return ErrorEstimate(reason=f"more than {MOST_UNKNOWNS} unknowns")
    try:
        refuse_single_nodes(ply, conditions)
        with np.errstate(all="ignore"):  # what is not finite is caught
            return _estimate(ply, conditions, solver, state)
    except NoEquilibriumError as error:
        reason = (
            f"a finer mesh has no state near: {error}; compare a run with half the "
            "element size"
        )
    except MemoryError:
        reason = "there is not enough memory for a finer mesh"
    except ValueError as error:
        reason = str(error)
    except Exception as error:  # of a user's term; what was computed is not lost
        reason = f"{type(error).__name__} {error}".strip().partition("\n")[0]
    return ErrorEstimate(reason=reason)


def refuse_single_nodes(ply: Ply, conditions: Conditions) -> None:
    """Refuse conditions on nodes by number that share an edge.

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
                f"condition {name!r} is on nodes by number, between which a finer mesh "
                "has others: name a boundary"
            )


def problem_at(
    ply: Ply, conditions: Conditions, solver: str, load_factor: float
) -> Problem:
    """The problem of a ply at a load factor, with a linear solver by its name."""
    constraints = Constraints(ply.basis, conditions)
    problem = Problem(ply, constraints, solver_named(solver))
    problem.load_factor = load_factor
    return problem


def work_of(problem: Problem, state: State) -> ndarray:
    """Work at a state of reactions and of loads in N·mm, shape (2,).

    An error if nothing that moves carries a load.
    """
    u, p = state.u, state.parameters
    work = _work(problem, problem.residual(u, p), u, p)
    if not _is_of_load(work, problem, state):
        raise ValueError(_NO_LOAD)
    return work


def change_of(before: ndarray, after: ndarray) -> float:
    """Change of the work, as a share of what it was."""
    return float(np.abs((after - before).sum()) / np.abs(before).sum())


def _work(
    problem: Problem, f: ndarray, u: ndarray, parameters: PlyParameters
) -> ndarray:
    """Work of reactions in the motion of their conditions, and of loads.

    Each node of a condition counts with its own motion: an edge may turn.
    """
    constraints = problem.constraints
    moving = turned(f, constraints.turn)[constraints.prescribed]
    return np.array([moving @ _rate(problem), problem.load(u, parameters) @ u])


def _rate(problem: Problem) -> ndarray:
    """How fixed unknowns move with the load factor, times the load factor, in mm."""
    constraints, t = problem.constraints, problem.load_factor
    now, before = (constraints.fixed_values(x) for x in (t, (1 - _STEP_BACK) * t))
    return (now - before) / _STEP_BACK


def _is_of_load(work: ndarray, problem: Problem, state: State) -> bool:
    """Whether work is more than forces do that a state leaves unbalanced.

    On a surface, which shapes the ply as it grows, it is more than that of supports.
    """
    length = np.abs(state.u).sum() + np.abs(_rate(problem)).sum()
    least = state.tolerance * length
    if problem.surfaces is not None:
        least = max(least, _OF_A_LOAD * abs(sum(state.energies.values())))
    return bool(np.abs(work).sum() > least)


def _estimate(
    ply: Ply, conditions: Conditions, solver: str, state: State
) -> ErrorEstimate:
    """The estimate, of the shear angle alone where a surface shapes a ply without load.

    A ValueError says that there is no finer ply, or that nothing shapes the ply.
    """
    coarse, u = problem_at(ply, conditions, solver, state.load_factor), state.u
    p = ply.updated(state.parameters, u, state.load_factor)
    motion, forces = Tangent(coarse, u, p).settled(coarse.residual(u, p))
    before = _work(coarse, forces, u := u + motion, p)
    loaded = _is_of_load(before, coarse, state)
    if not loaded and coarse.surfaces is None:
        raise ValueError(_NO_LOAD)
    finer: Any = ply.finer()
    fine = problem_at(finer.ply, conditions, solver, state.load_factor)
    way = _Way(fine, *finer.carry(u, p))
    fine_u, after = _moved(way, before, loaded)
    angle, fine_angle = (
        of.shear_angle(x).mean(axis=1) for of, x in ((ply, u), (finer.ply, fine_u))
    )
    off = fine_angle - angle[finer.parent]
    rms = np.sqrt(np.average(off**2, weights=fine.ply.basis.dx.sum(axis=1)))
    change = change_of(before, after) if loaded else 0.0
    if not np.isfinite([change, rms]).all():
        raise NoEquilibriumError("it is not finite")
    shear_angle = float(SHEAR_ANGLE_OVER_CHANGE * rms)
    if not loaded:
        return ErrorEstimate(None, shear_angle, _NO_LOAD)
    carried = sum(state.shares.get("energy", {}).values())
    return ErrorEstimate(float(max(change, LOAD_OVER_SHARE * carried)), shear_angle)


class _Way:
    """Increments of a problem from a displacement, within its laws.

    It has displacement, parameters, forces and tangent after the ``number`` of
    increments so far, and says whether the last one was ``whole`` and whether any was
    ``shortened``.
    """

    def __init__(
        self, problem: Problem, u: ndarray, parameters: PlyParameters, tension: ndarray
    ) -> None:
        self.problem, self.number, self.whole, self.shortened = problem, 0, True, False
        u, self.parameters = problem.moved(u, np.zeros_like(u)), parameters
        if not problem.in_domain(u, parameters):
            raise NoEquilibriumError("this state is past the end of a law there")
        self._at(u, tension, 0.0)

    def _at(
        self, u: ndarray, tension: ndarray, contact: ndarray | float | None
    ) -> None:
        p, self.u = self.parameters, u
        self.tangent = definite(self.problem, u, p, tension, contact)
        self.f = self.problem.residual(u, p)

    def go(self, du: ndarray) -> None:
        """Make an increment, as long as the laws allow."""
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
        return du, _work(self.problem, forces, self.u + du, self.parameters)


def _moved(way: _Way, before: ndarray, loaded: bool) -> tuple[ndarray, ndarray]:
    """A displacement nearer to the equilibrium, and the work there to first order.

    A second increment whose tangent is not altered settles it, unless the first had to
    be shortened.  Otherwise the work decides, and without a load nothing does.
    """
    problem = way.problem
    values = problem.constraints.fixed_values(problem.load_factor)
    way.go(way.tangent.increment(way.f, way.u, values))
    if not loaded and way.shortened:
        raise NoEquilibriumError(
            "its first increment reaches the end of a law, and without a load nothing "
            "tells when further ones are enough"
        )
    if not loaded and way.tangent.altered:
        raise NoEquilibriumError("its tangent is not stable")
    if way.shortened or way.tangent.altered:
        return _settled(way, before)
    du, now = way.ahead()
    return problem.moved(way.u, du), now


def _settled(way: _Way, before: ndarray) -> tuple[ndarray, ndarray]:
    """Where the work is settled, as of `_moved`.

    Where a law ends, increments are shortened.  Then more of them are made, half as
    long as soon as the work goes to and fro, until it is settled at a whole one whose
    tangent is not altered.
    """
    last, moved, length, size = before, np.inf, 1.0, np.abs(before).sum()
    while way.number < (_MOST_SHORTENED if way.shortened else _MOST_INCREMENTS):
        du, now = way.ahead()
        moved_before = moved
        moved, change = (np.abs((now - x).sum()) for x in (last, before))
        if not np.isfinite(now).all():
            raise NoEquilibriumError("its load is not finite")
        near = way.whole and not way.tangent.altered and change < size
        if moved <= _SETTLED * change and (near or not way.shortened):
            return way.problem.moved(way.u, du), now
        if way.shortened and way.number > 1 and moved > moved_before / 2:
            length = 0.5
        last = now
        way.go(length * du)
    raise NoEquilibriumError(
        f"after {way.number} increments its load still changes by {moved / size:.1%}"
    )
