"""A ply of which every element is split in four, with a state of the one before."""

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
from numpy import ndarray

from ..mesh.bases import node_dofs
from ..mesh.splitting.finer import FinerMesh, finer_mesh


class FinerState(NamedTuple):
    """A finer ply, and what it takes over of a state: not in balance, but near one.

    Attributes
    ----------
    ply
        The ply.  It holds the stiffnesses that the ply before held.
    u
        The displacement, the same at the nodes that were there.
    tension
        Fibre tensions of the elements before, as `Ply.stiffness` takes them.
    parent
        For each of its elements the one before that it is part of, shape (n_elements,).
    """

    ply: Any
    u: ndarray
    tension: ndarray
    parent: ndarray


def finer_state(ply: Any, u: ndarray) -> FinerState:
    """Split every element of ``ply.mesh`` in four; see `Ply.finer`."""
    for term in ply.further_terms_as_given:
        if not hasattr(term, "on"):
            name = getattr(term, "name", term)
            raise ValueError(f"term {name!r} is of the mesh, and not of a finer one")
    if any(memory.depends_on != "state" for memory in ply.memories.values()):
        raise ValueError("the stabilisation depends on the steps")
    fine = finer_mesh(ply.mesh)
    arguments = ply.fabric, ply.formulation, ply.further_terms_as_given
    finer = type(ply)(fine.mesh, *arguments)
    carried = finer.basis.zeros()
    nodes = fine.nodal(ply.nodal(u), finer.nodes.shape[1])
    carried[node_dofs(finer.basis)] = nodes
    finer.remembered = _held(ply, fine, finer.remembered)
    T = ply.fibre_tension(u).mean(axis=2)[:, fine.parent, None]
    tension = np.broadcast_to(T, (*T.shape[:2], finer.basis.dx.shape[1]))
    return FinerState(finer, carried, finer.arranged(tension), fine.parent)


def _held(ply: Any, fine: FinerMesh, at_rest: Mapping[str, Any]) -> dict[str, Any]:
    """What a finer ply holds: the stiffnesses of the elements before.

    A stiffness is one of each element, or of each of the user's.
    """
    held = {}
    for name, (parameters, work) in ply.remembered.items():
        new, _ = at_rest[name]
        held[name] = (
            {
                key: _carried(values, new[key].shape[-2], ply.parent, fine)
                for key, values in parameters.items()
            },
            work,
        )
    return held


def _carried(values: ndarray, n: int, users: ndarray, fine: FinerMesh) -> ndarray:
    """Values of each element, or user's element, as ``n`` of finer ones."""
    if values.shape[-2] != len(users):
        values = values[..., users, :]
    of = fine.parent if n == len(fine.parent) else getattr(fine.mesh, "origin", None)
    return np.ascontiguousarray(values[..., of, :])
