"""States of the plies of a stack."""

from dataclasses import replace
from typing import Any

import numpy as np
from numpy import ndarray

from .interval import OF_STACK, ErrorInterval
from .states import State


def of_ply(result: Any, number: int) -> Any:
    """See `Result.of_ply`."""
    stack, n = result.ply, len(getattr(result.ply, "plies", ()))
    if not n:
        raise ValueError("the result is of one ply: of_ply requires a Stack")
    if number not in range(1, n + 1):
        raise ValueError(f"the stack has plies 1 (lowest) to {n}, not {number!r}")
    states, later = (
        [_cut(stack, x, number) for x in some] for some in (result.states, result.later)
    )
    ply = stack.with_tools[number - 1]
    return replace(result, ply=ply, states=states, later=later, interval=_none)


def _none(state: State) -> ErrorInterval:
    """No interval."""
    return ErrorInterval(reason=OF_STACK)


def _cut(stack: Any, state: State, number: int) -> State:
    """State of one ply of a stack."""
    ply, t = stack.with_tools[number - 1], state.load_factor
    u: ndarray = stack.nodal(state.u)[:, stack.nodes_of(number)].T.ravel()
    p, least = stack.values_of(number, state.parameters), ply.least_area_ratio(u)
    verdict = replace(
        state.verdict,
        min_det_F=float(least.min()),
        max_fibre_strain=float(np.abs(ply.law_strain(u)).max()),
        mesh_fibre_strain=float(np.abs(ply.fibre_strain(u, ply.fine_points)).max()),
        work=0.0,
    )
    loads = [x for x in ply.terms if x.role == "load"]
    inner = [x for x in ply.terms if x.role != "load"]
    names = {x.name for x in loads}
    forces = {
        x.name: -ply.nodal(x.residual(u, t, p[x.name])).sum(axis=1) for x in loads
    }
    lost = ply.energy_lost(u, t, p)
    return replace(
        state,
        u=u,
        reactions=forces,
        forces=forces,
        displacements={k: x for k, x in state.displacements.items() if k in names},
        energies=ply.energies(u, t, p, inner),
        potentials={},
        shares={k: x for k, x in state.shares.items() if k in ("energy", "work")},
        verdict=verdict,
        parameters=p,
        energy_lost={k: x for k, x in lost.items() if k not in names},
    )
