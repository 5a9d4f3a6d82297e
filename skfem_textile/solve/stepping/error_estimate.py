"""An estimate of what the mesh costs: how much a finer one changes a state.

A kink of the shear angle lies between the nodes, and a mesh smears it.  The state is
carried over to the ply whose elements are split in four, and two linear systems tell to
where it moves.  What the stabilisation and deviations carry at a kink falls with the
element size so slowly that a finer mesh hardly tells of it: a share of it counts too.
"""

from typing import Any

import numpy as np
from numpy import ndarray

from ..body import Body
from ..conditions import Conditions, Constraints
from ..linear import solver_named
from ..problem import Problem, Tangent
from ..states import ErrorEstimate, NoEquilibriumError, State
from ..strategies import definite, no_contact, within_laws
from .work import NO_LOAD, carries_load, change_of, work

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


def estimated_error(
    ply: Body, conditions: Conditions, solver: str, state: State
) -> ErrorEstimate:
    """Estimate the error of a state.

    Where a finer mesh has no state near it, there is none.  That of an earlier state
    would not do, for it may be several times smaller than the error.

    Parameters
    ----------
    ply, conditions
        The ply and its conditions.
    solver
        Name of the linear solver.
    state
        The state.
    """
    if state.load_factor == 0:
        return ErrorEstimate(reason="there is no load yet")
    if ply.basis.N > MOST_UNKNOWNS:
        return ErrorEstimate(reason=f"more than {MOST_UNKNOWNS} unknowns")
    held = ply.remembered
    try:
        refuse_single_nodes(ply, conditions)
        with np.errstate(all="ignore"):  # what is not finite is caught
            ply.settle(state.u)
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
    finally:
        ply.remembered = held
    return ErrorEstimate(reason=reason)


def problem_at(
    ply: Body, conditions: Conditions, solver: str, load_factor: float
) -> Problem:
    """The problem of a ply at a load factor, with a linear solver by its name."""
    constraints = Constraints(ply.basis, conditions)
    problem = Problem(ply, constraints, solver_named(solver))
    problem.load_factor = load_factor
    return problem


def _estimate(
    ply: Body, conditions: Conditions, solver: str, state: State
) -> ErrorEstimate:
    """The estimate; of the shear angle alone where a surface shapes a ply without load.

    Raises
    ------
    NoEquilibriumError
        If the finer ply has no state near.
    ValueError
        If there is no finer ply, or nothing shapes the ply.
    """
    coarse, u = problem_at(ply, conditions, solver, state.load_factor), state.u
    motion, forces = Tangent(coarse, u).settled(coarse.residual(u))
    before = work(coarse, forces, u := u + motion)
    loaded = carries_load(before, coarse, state)
    if not loaded and coarse.surfaces is None:
        raise ValueError(NO_LOAD)
    finer: Any = ply.finer()
    fine = problem_at(finer.ply, conditions, solver, state.load_factor)
    carried, tension = finer.carry(u)
    fine_u, after = _moved(fine, carried, tension, before, loaded)
    angle, fine_angle = (
        of.ply.shear_angle(x).mean(axis=1) for of, x in ((coarse, u), (fine, fine_u))
    )
    off = fine_angle - angle[finer.parent]
    rms = np.sqrt(np.average(off**2, weights=fine.ply.basis.dx.sum(axis=1)))
    change = change_of(before, after) if loaded else 0.0
    if not np.isfinite([change, rms]).all():
        raise NoEquilibriumError("it is not finite")
    shear_angle = float(SHEAR_ANGLE_OVER_CHANGE * rms)
    if not loaded:
        return ErrorEstimate(None, shear_angle, NO_LOAD)
    carried = sum(state.shares.get("energy", {}).values())
    return ErrorEstimate(float(max(change, LOAD_OVER_SHARE * carried)), shear_angle)


def _moved(
    problem: Problem, u: ndarray, tension: ndarray, before: ndarray, loaded: bool
) -> tuple[ndarray, ndarray]:
    """A displacement nearer to the equilibrium, and the work there to first order.

    Where a law ends, increments are shortened.  Then more of them are made, half as
    long as soon as the work goes to and fro, until it is settled at a whole one whose
    tangent is not altered.  Without a load, work tells nothing: a second increment
    whose tangent is not altered settles it.

    Raises
    ------
    NoEquilibriumError
        If the increments do not settle.
    """
    ply, constraints = problem.ply, problem.constraints
    values, size = constraints.fixed_values(problem.load_factor), np.abs(before).sum()
    contact = no_contact(problem)
    u = problem.moved(u, np.zeros_like(u))
    if not problem.in_domain(u):
        raise NoEquilibriumError("this state is past the end of a law there")
    last, moved, length, whole, shortened = before, np.inf, 1.0, True, False
    number = 0
    while number < (_MOST_SHORTENED if shortened else _MOST_INCREMENTS):
        tangent, f = definite(problem, u, tension, contact), problem.residual(u)
        if number == 0:
            du = tangent.increment(f, u, values)
        else:
            du, forces = tangent.settled(f)
            now = work(problem, forces, u + du)
            moved_before = moved
            moved, change = (np.abs((now - x).sum()) for x in (last, before))
            if not np.isfinite(now).all():
                raise NoEquilibriumError("its load is not finite")
            calm = number == 1 and not tangent.altered
            near = whole and not tangent.altered and change < size
            settled = loaded and moved <= _SETTLED * change
            if (settled and near) if shortened else (settled or calm):
                return problem.moved(u, du), now
            if shortened and number > 1 and moved > moved_before / 2:
                length = 0.5
            last = now
        step = within_laws(problem, u, length * du)
        whole = np.array_equal(step, length * du)
        shortened = shortened or not whole
        tension, contact = ply.geometric_tension(u, step), tangent.contact(f, step)
        u = problem.moved(u, step)
        if number == 0 or shortened:
            ply.settle(u, tension)
        number += 1
    if not loaded:
        raise NoEquilibriumError("its tangent is not stable")
    raise NoEquilibriumError(
        f"after {number} increments its load still changes by {moved / size:.1%}"
    )


def refuse_single_nodes(ply: Body, conditions: Conditions) -> None:
    """Refuse conditions on nodes of the mesh that would be on more of a finer one."""
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
