"""Forces of conditions on a ply, and their prescribed displacements.

Nodal forces are divided where conditions share nodes.  A condition exerts a force r on
a node along the directions n that it fixes there.  The reactions are the forces of the
smallest Σ‖r‖² that sum to the nodal force f: with S the sum of n⊗n over all conditions
at the node, each direction carries n (n·S⁻¹f).  Equal directions thus carry equal
shares, orthogonal ones their components of f.
"""

from typing import NamedTuple

import numpy as np
from numpy import ndarray

from .conditions import Constraints
from .surface_nodes import PARALLEL_ANGLE

# Smallest ratio of eigenvalues of S, (1 − cos θ)/(1 + cos θ) of two directions with the
# angle θ, that belongs to another direction.
_OTHER_DIRECTION = PARALLEL_ANGLE**2 / 4


class _Fixed(NamedTuple):
    """Fixed directions: name of the condition, nodes (n,), unit vectors (d, n)."""

    name: str
    nodes: ndarray
    directions: ndarray


def reactions(
    constraints: Constraints, forces: ndarray, u: ndarray, t: float
) -> dict[str, ndarray]:
    """Force of each condition on the ply in N, shape (d,).

    Parameters
    ----------
    constraints
        The conditions.
    forces
        Nodal forces in N, shape (d, n_nodes).
    u, t
        Displacement and load factor, on which the normals of surfaces depend.
    """
    on_surfaces = constraints.surfaces.fixed_directions(u, t)
    fixed = [_Fixed(*x) for x in (*constraints.fixed_directions, *on_surfaces)]
    d, n_nodes = forces.shape
    sums = np.zeros((n_nodes, d, d))
    for _, nodes, n in fixed:
        np.add.at(sums, nodes, np.einsum("in,jn->nij", n, n))
    supported = np.unique(np.concatenate([x.nodes for x in fixed]))
    inverse = np.linalg.pinv(sums[supported], _OTHER_DIRECTION, hermitian=True)
    weighted = np.zeros_like(forces)
    weighted[:, supported] = np.einsum("nij,jn->in", inverse, forces[:, supported])
    result = {name: np.zeros(d) for name in constraints.nodes}
    for name, nodes, n in fixed:
        result[name] += n @ (n * weighted[:, nodes]).sum(axis=0)
    return result


def travels(constraints: Constraints, u: ndarray) -> dict[str, ndarray]:
    """Prescribed displacement of each displacement condition in mm, shape (d,).

    It is the mean over its nodes along the directions that it fixes, of the nodal
    displacements ``u``, shape (d, n_nodes).
    """
    result: dict[str, ndarray] = {}
    for name, nodes, n in constraints.fixed_directions:
        along = (n * (n * u[:, nodes]).sum(axis=0)).mean(axis=1)
        result[name] = result.get(name, 0.0) + along
    return result
