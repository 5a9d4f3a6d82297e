"""Entries of the forms for `asm`, computed by their kernels."""

from collections.abc import Iterable, Sequence
from functools import reduce
from typing import Any

import numpy as np
from numpy import ndarray
from skfem import CellBasis

from ...mesh.bases import components
from ...mesh.pattern import full_matrices
from ...mesh.scikit_fem import COOData, matrix_entries, number_entries, vector_entries
from .elements import ElementGroup, element_groups
from .kernel import Kernel, KernelState, element_forces, element_matrices


def states(
    kernels: Sequence[Kernel], basis: CellBasis, u: ndarray, w: dict[str, Any]
) -> list[list[KernelState]]:
    """States of kernels by group of elements, at a displacement u and parameters w."""
    groups, tension = dict[ElementGroup, list](), w.get("tension")
    for x in kernels:
        for g in element_groups(basis, x.fabric):
            state = KernelState(x, g, g.points, g.last_deformations(u), w, tension)
            groups.setdefault(g, []).append(state)
    return list(groups.values())


def energy_entries(states: list[list[KernelState]]) -> COOData:
    """Energy of all elements."""
    return number_entries(sum(x.kernel.energy(x) for group in states for x in group))


def force_entries(basis: CellBasis, states: list[list[KernelState]]) -> COOData:
    """Forces of elements."""
    parts = (f.reshape(-1, f.shape[-1]) for f in map(element_forces, states))
    shape = basis.Nbfun, basis.nelems
    return vector_entries(basis, _sum_of_groups(states, parts, shape))


def stiffness_entries(basis: CellBasis, states: list[list[KernelState]]) -> COOData:
    """Stiffness matrices of elements."""
    matrices = map(element_matrices, states)
    n_nodes = basis.Nbfun // components(basis)
    if all(x.group.nodes.shape == (n_nodes, basis.nelems) for (x, *_) in states):
        return matrix_entries(basis, reduce(np.add, matrices))
    shape = basis.Nbfun, basis.Nbfun, basis.nelems
    parts = map(full_matrices, matrices)
    return matrix_entries(basis, _sum_of_groups(states, parts, shape))


def _sum_of_groups(
    states: list[list[KernelState]], parts: Iterable[ndarray], shape: tuple[int, ...]
) -> ndarray:
    """Sum of the arrays of groups of elements, as one array of the whole basis.

    Groups may have fewer unknowns than the basis; the rest is zero.
    """
    whole = np.zeros(shape)
    for (x, *_), part in zip(states, parts, strict=True):
        unknowns = (slice(n) for n in part.shape[:-1])
        whole[*unknowns, x.group.elements] += part
    return whole
