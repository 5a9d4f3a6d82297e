"""Clamps that let go: the load factor of release, the energy lost, and the figures.

A clamp lets go at a state whose resultant lies between its force of release and
`MOST_OF_RELEASE` times this force.  A step that ends beyond is refused, and repeated up
to an estimate of the release.  At the load factor of the release the force of the clamp
then decreases to zero in steps, each of which is an equilibrium, so that the ply is in
equilibrium without the clamp before the next load step.  The energy of the springs is
lost, and the energy that the ply releases in these steps.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy import ndarray

from ..ply.clamps import ClampTerm, holds
from ..ply.parameters import NO_VALUES, Frozen, PlyParameters, Values
from .problem import Evaluation, Problem
from .quantities import Quantity
from .states import NoEquilibriumError, Overload, State

#: Resultant, relative to the force of release, above which a state is refused: the
#: clamp would have let go before.
MOST_OF_RELEASE = 1.01

# Resultant, relative to the force of release, at which a step is to end: the middle.
_AIM = 1.005

# Limits of work: the resultant, relative to the force of release, above which an
# estimate leaves at least the first share of the interval on both sides, else the
# second one.  Forces may increase in a small part of the interval only.
_FAR, _LEAST, _LEAST_NEAR = 2.0, 0.25, 0.01


def refuse_overload(problem: Problem, u: ndarray, p: PlyParameters) -> None:
    """Raise an error if a clamp carries more than its force of release."""
    every = [
        Overload(problem.load_factor, x.name, x.load(u, p[x.name]))
        for x in problem.clamps
        if np.isfinite(x.release)
    ]
    worst = max(every, key=lambda x: x.load, default=None)
    if worst and worst.load > MOST_OF_RELEASE:
        raise NoEquilibriumError(
            f"clamp {worst.name!r} carries {worst.load:.4g} times the force at which "
            "it lets go",
            advice="more steps, or a larger force of release",
            overload=worst,
        )


def estimated_release(
    problem: Problem, states: Sequence[State], overloads: Sequence[Overload]
) -> float:
    """Load factor at which a clamp will let go; infinite if none is overloaded ahead.

    Parameters
    ----------
    problem, states
        The problem, and the states so far.
    overloads
        Ends of steps that were refused since a clamp let go.
    """
    last = states[-1]
    ahead = sorted(x for x in overloads if x.load_factor > last.load_factor)
    if not ahead:
        return np.inf
    (end, name, load), *further = ahead
    clamp = next(x for x in problem.clamps if x.name == name)
    before, start = (
        (x.load_factor, clamp.load(x.u, x.parameters[name]))
        for x in (states[max(len(states) - 2, 0)], last)
    )
    step, rise = end - last.load_factor, load - start[1]
    # The polynomial 0 = −c + b x + a x² through start, end and a third point.
    third = next(((t, r) for t, of, r in further if of == name), before)
    a = 0.0
    if third[0] != start[0]:
        beyond = (third[1] - load) / (third[0] - end)
        a = (beyond - rise / step) / (third[0] - start[0])
    b, c = rise / step - a * step, _AIM - start[1]
    root = 2 * c / (b + np.sqrt(max(b**2 + 4 * a * c, 0.0)))
    least = step * (_LEAST if load > _FAR else _LEAST_NEAR)
    return float(last.load_factor + np.clip(root, least, step - least))


def with_energy_lost(found: Any, start: Evaluation, last: State) -> PlyParameters:
    """Parameters after clamps let go, with the energy lost.

    It is the decrease of the elastic energy, and the work of the loads, less the work
    spent on friction with tools; equal parts are attributed to the clamps.  A ply that
    lets go gains none: a negative result beyond round-off is a warning of the trial.

    Parameters
    ----------
    found
        The `Trial` without the clamps.
    start, last
        Evaluation of the last state without the clamps, and this state.
    """
    problem, p = found.problem, found.parameters
    loads, names = _loads(problem), problem.let_go(last.parameters, p)
    _, before = problem.energies(start.u, p)
    work = sum(before[name] - found.potentials[name] for name in loads)
    work -= _spent_on_friction(problem, found.u, p)
    work += _spent_on_friction(problem, last.u, last.parameters)
    lost = work + sum(start.energies.values()) - sum(found.energies.values())
    if lost < -found.tolerance * float(np.abs(found.u).sum()):
        found.warnings["work"] = (
            f"{message(names, p)}, with an energy lost by the ply of {lost:.3g} N·mm: "
            "it cannot be negative: the mesh or the steps are too coarse for it"
        )
    changed = {
        name: Values({**p[name], "work": p[name]["work"] + lost / len(names)})
        for name in names
    }
    return Frozen({**p, **changed})


def _loads(problem: Problem) -> list[str]:
    """Names of the loads other than tools, whose contact forces do no work."""
    names = [term.name for term in problem.ply.terms if term.role == "load"]
    return [name for name in names if name not in {x.name for x in problem.contacts}]


def _spent_on_friction(problem: Problem, u: ndarray, p: PlyParameters) -> float:
    """Work of sliding, and energy of elastic slips, on tools in N·mm."""
    t, rubbing = problem.load_factor, problem.rubbing
    lost = problem.ply.energy_lost(u, t, p)
    stored = (x.friction.stored(u, t, p[x.name]) for x in rubbing)
    return sum(lost[x.name] for x in rubbing) + sum(stored)


def message(names: Sequence[str], parameters: PlyParameters) -> str:
    """Message on clamps that let go, with the force of each."""
    return ", ".join(
        f"clamp {name!r} lets go at {parameters[name]['release_force']:.4g} N"
        for name in names
    )


def clamp_forces(clamps: Sequence[ClampTerm], state: State) -> dict[str, float]:
    """Magnitude of the force of each clamp in N, by column of a history."""
    return {
        f"{x.name}_force_N": float(np.linalg.norm(state.reactions[x.name]))
        for x in clamps
    }


def clamp_figures(
    clamps: Sequence[ClampTerm], states: Sequence[State]
) -> dict[str, Any]:
    """Figures of clamps in the summary of a result.

    Force and travel of each in the last state, ``NAME_force_N`` and ``NAME_travel_mm``;
    for one with a force of release also ``NAME_released_at``, its load factor, None
    while it holds, and ``NAME_release_force_N``.  ``max_clamp_force_N`` is the largest
    force in any state, and ``clamps_let_go`` a text on those that let go.
    """
    last, texts = states[-1], []
    figures: dict[str, Any] = clamp_forces(clamps, last)
    for clamp in clamps:
        name, p = clamp.name, last.parameters.get(clamp.name, NO_VALUES)
        travel = float(np.linalg.norm(last.displacements[name]))
        figures[f"{name}_travel_mm"] = travel
        if not p:
            continue
        at = force = None
        if not holds(p):
            at, force = float(p["released_at"]), float(p["release_force"])
            texts.append(f"{name!r} let go at load factor {at:.4g} with {force:.4g} N")
        figures |= {f"{name}_released_at": at, f"{name}_release_force_N": force}
    forces = (clamp_forces(clamps, state).values() for state in states)
    figures["max_clamp_force_N"] = max(map(max, forces))
    if texts:
        figures["clamps_let_go"] = "; ".join(texts)
    note = "".join(f"; {text}" for text in texts)
    first = Quantity("Largest clamp force", "max_clamp_force_N", "N", note=note)
    return figures | {"first": [first.declared()]}
