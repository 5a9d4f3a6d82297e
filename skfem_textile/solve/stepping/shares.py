"""What the discretisation carries of what is reported of a state.

A stabilisation and deviations from the mean stretch are not of the fabric.  They share
three things with it: the energy, the work of reactions and loads in the motion of a
step, and the nodal forces that make up a reaction.  The force that drives an edge is
the rate of the energy, so that the share of the work is that of the force, wherever in
the ply it is carried.  The nodal forces tell of the elements along the edge alone.
"""

from collections.abc import Callable, Collection, Mapping, Sequence

import numpy as np
from numpy import ndarray

from ...mesh.user_input import printable
from ..states import Equilibrium

#: Roles of `Body.parts` that are of the discretisation.
ROLES = "stabilisation", "deviation"

# Shares that pass without a warning, of energy and work and of the nodal forces of a
# reaction.  Measured by `pytest tests/solve/test_shares.py`: ordinary runs stay below
# both, and with a tenth of the energy the load is more than a tenth too large.
_MOST, _MOST_OF_REACTION = {"energy": 0.1, "work": 0.1}, 0.25

# Smallest whole of which there are shares.
_TINY = 1e-300


def shares(
    parts: Sequence[tuple[str, float, ndarray]],
    equilibrium: Equilibrium,
    move: ndarray,
    held_forces: Callable[[ndarray], Mapping[str, ndarray]],
) -> dict[str, dict[str, float]]:
    """Shares from 0 to 1 in energy, work and reactions, of each of `ROLES`.

    A whole is the sum of the magnitudes of its parts, of a reaction at each of its
    nodes.  Of a whole that the tolerance of the equilibrium may have made nobody has a
    share.

    Parameters
    ----------
    parts
        What `Body.parts` gives at the equilibrium.
    equilibrium
        The equilibrium.
    move
        Displacement in the step.
    held_forces
        As of `Problem`.

    Returns
    -------
    dict
        Shares by role, by what they are of: ``energy``, ``work`` and, for each
        condition, ``CONDITION_reaction``.
    """
    u, force = equilibrium.u, equilibrium.tolerance
    roles, *columns = zip(*parts, strict=True)
    energies, forces = map(np.array, columns)
    work = (forces * move).sum(axis=1)
    found = {
        "energy": _shares(roles, energies[:, None, None], force * np.abs(u).sum()),
        "work": _shares(roles, work[:, None, None], force * np.abs(move).sum()),
    }
    held = [held_forces(f) for f in forces]
    for name, first in held[0].items():
        at_nodes = np.array([of_part[name] for of_part in held])
        least = force * first.shape[1]
        found[f"{name}_reaction"] = _shares(roles, at_nodes, least)
    return found


def excess(
    found: Mapping[str, Mapping[str, float]], role: str, supports: Collection[str] = ()
) -> str:
    """Words for the shares of a role that are too large; empty if there are none.

    Nothing is said of the reactions of ``supports``, conditions by name.
    """
    passed = {f"{name}_reaction" for name in supports}
    return ", ".join(
        f"{share[role]:.0%} of {printable(whole)}"
        for whole, share in found.items()
        if whole not in passed and share[role] > _MOST.get(whole, _MOST_OF_REACTION)
    )


def _shares(roles: Sequence[str], parts: ndarray, least: float) -> dict[str, float]:
    """Sums over each role over the sum of all magnitudes, at least ``least``.

    ``parts`` are vectors at nodes or, of one component at one place, numbers; shape
    (n_parts, n_components, n_nodes).
    """
    whole = max(float(np.linalg.norm(parts, axis=1).sum()), least, _TINY)
    of_role = {role: parts[np.array(roles) == role] for role in ROLES}
    sums = {role: own.sum(axis=(0, 2)) for role, own in of_role.items()}
    return {role: float(np.linalg.norm(x) / whole) for role, x in sums.items()}
