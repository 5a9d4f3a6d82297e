"""An estimate of what the mesh costs: how much a finer one changes a state.

A kink of the shear angle lies between the nodes, and a mesh smears it.  The error is
taken to fall with the first power of the element size, so that from a mesh to one of
half the size it changes by half of itself.  The state is carried over to
the ply whose elements are split in four, and two linear systems tell to where it moves.
"""

from collections.abc import Mapping
from functools import cached_property
from typing import Any

import numpy as np
from numpy import ndarray

from ..body import Body
from ..conditions import Condition, Constraints
from ..linear import solver_named
from ..problem import Problem, Tangent
from ..states import ErrorEstimate, NoEquilibriumError, State
from ..strategies import definite

#: Error over the change that halved elements make, of the load and of the shear angle:
#: `python -m studies adaptive`, on the cases that calibrate.
LOAD_OVER_CHANGE, SHEAR_ANGLE_OVER_CHANGE = 2.0, 1.3

#: Unknowns from which there is no estimate.  Chosen: the factors of the finer mesh, of
#: four times as many, then take some gigabytes.
MOST_UNKNOWNS = 250_000

# Increments at most until the load is settled, and the change from one to the next that
# counts as settled, as a share of the change in all.  Chosen: where no tangent had to
# be altered the second increment is within it in all cases of the study.
_MOST_INCREMENTS, _SETTLED = 4, 0.2

# Length of the step, as a share of the load factor, that tells how conditions move.
_STEP_BACK = 1e-3


def estimated_error(
    ply: Body, conditions: Mapping[str, Condition], solver: str, states: list[State]
) -> ErrorEstimate:
    """Estimate the error of the last state of a run.

    Parameters
    ----------
    ply, conditions
        The ply and its conditions.
    solver
        Name of the linear solver.
    states
        The states of the run.
    """
    end = states[-1].load_factor
    if end == 0:
        return ErrorEstimate(reason="there is no load yet")
    if ply.basis.N > MOST_UNKNOWNS:
        return ErrorEstimate(reason=f"more than {MOST_UNKNOWNS} unknowns")
    middle = min(states[1:], key=lambda state: abs(state.load_factor - end / 2))
    held = ply.remembered
    try:
        refuse_single_nodes(ply, conditions)
        with np.errstate(all="ignore"):  # what is not finite is caught
            meshes = _Meshes(ply, conditions, solver)
            for state in dict.fromkeys((states[-1], middle)):
                ply.settle(state.u)
                try:
                    return _at(meshes, state)
                except NoEquilibriumError as error:
                    reason = f"a finer mesh has no state near: {error}"
    except MemoryError:
        reason = "there is not enough memory for a finer mesh"
    except ValueError as error:
        reason = str(error)
    except Exception as error:  # of a user's term; what was computed is not lost
        reason = f"{type(error).__name__} {error}".strip().partition("\n")[0]
    finally:
        ply.remembered = held
    return ErrorEstimate(reason=reason)


class _Meshes:
    """The problem on both meshes, each built once and when it is asked for."""

    def __init__(
        self, ply: Body, conditions: Mapping[str, Condition], solver: str
    ) -> None:
        self._ply, self._conditions, self._solver = ply, conditions, solver

    def _problem(self, ply: Body) -> Problem:
        constraints = Constraints(ply.basis, self._conditions)
        return Problem(ply, constraints, solver_named(self._solver))

    @cached_property
    def coarse(self) -> Problem:
        return self._problem(self._ply)

    @cached_property
    def finer(self) -> Any:
        return self._ply.finer()

    @cached_property
    def fine(self) -> Problem:
        return self._problem(self.finer.ply)


def _at(meshes: _Meshes, state: State) -> ErrorEstimate:
    """The estimate from one state.

    Raises
    ------
    NoEquilibriumError
        If the finer ply has no state near.
    ValueError
        If there is no finer ply, or nothing that does work.
    """
    t, u = state.load_factor, state.u
    coarse = meshes.coarse.at(t)
    motion, forces = Tangent(coarse, u).settled(coarse.residual(u))
    before = _work(coarse, forces, u := u + motion)
    size, length = np.abs(before).sum(), np.abs(u).sum() + np.abs(_rate(coarse)).sum()
    if not size > state.tolerance * length:
        raise ValueError("nothing that moves carries a load")
    fine, parent = meshes.fine.at(t), meshes.finer.parent
    carried, tension = meshes.finer.carry(u)
    fine_u, after = _moved(fine, carried, tension, before)
    change = np.abs((after - before).sum()) / size
    angle, fine_angle = (
        of.ply.shear_angle(x).mean(axis=1) for of, x in ((coarse, u), (fine, fine_u))
    )
    off = fine_angle - angle[parent]
    rms = np.sqrt(np.average(off**2, weights=fine.ply.basis.dx.sum(axis=1)))
    if not np.isfinite([change, rms]).all():
        raise NoEquilibriumError("it is not finite")
    return ErrorEstimate(
        float(LOAD_OVER_CHANGE * change), float(SHEAR_ANGLE_OVER_CHANGE * rms), t
    )


def _moved(
    problem: Problem, u: ndarray, tension: ndarray, before: ndarray
) -> tuple[ndarray, ndarray]:
    """A displacement nearer to the equilibrium, and the work there to first order.

    Raises
    ------
    NoEquilibriumError
        If the increments do not settle.
    """
    ply, constraints = problem.ply, problem.constraints
    values, last = constraints.fixed_values(problem.load_factor), before
    for number in range(_MOST_INCREMENTS):
        tangent, f = definite(problem, u, tension), problem.residual(u)
        if number == 0:
            du = tangent.increment(f, u, values)
        else:
            du, forces = tangent.settled(f)
            work = _work(problem, forces, u + du)
            moved, change = (np.abs((work - x).sum()) for x in (last, before))
            calm = not tangent.altered and number == 1
            if not np.isfinite(work).all():
                break
            if calm or moved <= _SETTLED * change:
                return u + du, work
            last = work
        tension = ply.geometric_tension(u, du)
        u = u + du
        if number == 0:
            ply.settle(u)
    raise NoEquilibriumError("the load does not settle")


def _work(problem: Problem, f: ndarray, u: ndarray) -> ndarray:
    """Work of reactions in the motion of their conditions, and of loads, in N·mm."""
    of_reactions = problem.turned(f)[problem.constraints.fixed] @ _rate(problem)
    return np.array([of_reactions, problem.load(u) @ u])


def _rate(problem: Problem) -> ndarray:
    """How fixed unknowns move with the load factor, times the load factor, in mm."""
    constraints, t = problem.constraints, problem.load_factor
    now, before = (constraints.fixed_values(x) for x in (t, (1 - _STEP_BACK) * t))
    return (now - before) / _STEP_BACK


def refuse_single_nodes(ply: Body, conditions: Mapping[str, Condition]) -> None:
    """Refuse conditions on nodes of the mesh that would be on more of a finer one."""
    named = getattr(ply.mesh, "named_nodes", {})
    for name, condition in conditions.items():
        where: Any = condition.where
        if callable(where) or (isinstance(where, str) and where not in named):
            continue
        nodes = condition.nodes(name, ply.basis)
        if np.isin(ply.mesh.facets, nodes).all(axis=0).any():
            raise ValueError(
                f"condition {name!r} is on nodes by number, between which a finer mesh "
                "has others: name a boundary"
            )
