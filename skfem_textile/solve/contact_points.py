"""Stiffness of the open gaps of all contacts of a problem."""

from typing import Any

import numpy as np
from numpy import ndarray

from ..ply.parameters import PlyParameters
from ..ply.terms import STIFFNESS_OF_GAP


def with_open_gaps(
    problem: Any,
    u: ndarray,
    parameters: PlyParameters,
    blocks: ndarray,
    opposite: float,
) -> ndarray:
    """Add a small stiffness at open gaps if tools are on both sides of the ply.

    Tools on one side restrain only nodes that touch them.  ``opposite`` is the cosine
    of the angle between normals on both sides.
    """
    t = problem.load_factor
    gap = np.concatenate([x.gaps(u, t, parameters[x.name]) for x in problem.contacts])
    n = np.hstack([x.normals(u, t) for x in problem.contacts])
    force, stiffness = (
        np.concatenate([parameters[x.name][key] for x in problem.contacts])
        for key in ("force", "stiffness")
    )
    reached, nearest = np.isfinite(gap), n[:, gap.argmin()]
    if not (nearest @ n < opposite).any():
        return blocks
    off = reached & ~(force - stiffness * np.where(reached, gap, 0.0) > 0)
    n, kappa = n[:, off], STIFFNESS_OF_GAP * stiffness[off]
    nodes = np.flatnonzero(off) % problem.nodes.shape[1]
    diagonal = problem.ply.pattern.diagonal[nodes]
    np.add.at(blocks, diagonal, (kappa * n[:, None] * n).T)
    return blocks
