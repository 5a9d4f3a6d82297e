"""Tangent blocks of forces at the contact points of nodes."""

from typing import Any

import numpy as np
from numpy import ndarray

from ..ply import Ply
from ..ply.parameters import PlyParameters
from ..ply.terms import STIFFNESS_OF_GAP, ContactTerm

#: Cosine of the angle between the normals of two tools below which they are on opposite
#: sides of a ply.  The angle, 120°, guards the walls and the bottom of a box, which
#: overlap beneath each other.
OPPOSITE = -0.5


def curved(
    ply: Ply, u: ndarray, t: float, blocks: ndarray, contact: Any, force: Any
) -> ndarray:
    """Tangent blocks less λ∇²g, with contact forces λ of shape (n_nodes,).

    ``contact`` is a `ContactTerm` or the `SurfaceNodes`.
    """
    if contact is None or force is None or not np.any(force):
        return blocks
    nodes, curvatures = contact.curved(u, t, np.asarray(force))
    every = np.zeros((3, 3, contact.points.shape[0]))
    every[..., nodes] = curvatures
    return blocks - ply.pattern.summed(contact.points, every)


def couple(
    ply: Ply, contacts: list[ContactTerm], u: ndarray, parameters: PlyParameters
) -> None:
    """Extend the sparsity pattern by the nodes of plies that are now on each other.

    By all nodes of their elements, so that it is not extended at each displacement.
    """
    plies = [x for x in contacts if x.of_plies]
    needed = [m for x in plies for m in x.coupled(u, parameters[x.name])]
    if not all(map(ply.pattern.covers, needed)):
        ply.couple([x.around(u) for x in plies] + needed)


def between_tools(
    ply: Ply,
    contacts: list[ContactTerm],
    u: ndarray,
    t: float,
    parameters: PlyParameters,
    blocks: ndarray,
) -> ndarray:
    """Add a small stiffness at open gaps if tools are on both sides of the ply.

    Tools on one side restrain only nodes that touch them.
    """
    tools = [x for x in contacts if not x.of_plies]
    gap = np.concatenate([x.gaps(u, t, parameters[x.name]) for x in tools])
    n = np.hstack([x.normals(u, t) for x in tools])
    force, stiffness = (
        np.concatenate([parameters[x.name][key] for x in tools])
        for key in ("force", "stiffness")
    )
    reached, nearest = np.isfinite(gap), n[:, gap.argmin()]
    if not (nearest @ n < OPPOSITE).any():
        return blocks
    off = reached & ~(force - stiffness * np.where(reached, gap, 0.0) > 0)
    n, kappa = n[:, off], STIFFNESS_OF_GAP * stiffness[off]
    nodes = np.flatnonzero(off) % ply.nodes.shape[1]
    np.add.at(blocks, ply.pattern.diagonal[nodes], (kappa * n[:, None] * n).T)
    for x in contacts:
        if x.of_plies:
            n, p = x.normals(u, t), parameters[x.name]
            kappa = np.where(np.isfinite(x.gaps(u, t, p)), p["stiffness"], 0.0)
            stiffness = STIFFNESS_OF_GAP * kappa * n[:, None] * n
            blocks = blocks + ply.pattern.summed(x.coupled(u, p)[0], stiffness)
    return blocks
