"""Geometry of the unknowns: elimination order and rigid-body motions.

The order is a geometric nested dissection, which keeps factors sparse (George 1973):
the nodes of a part are bisected along its longer side, and the separator is eliminated
after both halves.  The separator is the smallest vertex cover of the node pairs across
the cut, obtained by König's theorem from a maximum matching (Hopcroft & Karp 1973).
"""

from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from itertools import combinations
from typing import Any

import numpy as np
from numpy import ndarray
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import maximum_bipartite_matching

# Number of nodes up to which a part is not divided.  Smaller parts take longer to
# order; larger ones leave more entries in the factors.
_LEAF_NODES = 32


@dataclass(frozen=True, eq=False)
class Unknowns:
    """Free unknowns of a system, for solvers that use their geometry.

    Parameters
    ----------
    positions, pairs
        See `nested_dissection`.
    dimension
        Number of unknowns per node, consecutive in the numbering of all unknowns.
    free
        Numbers of the free unknowns, shape (n,).
    shared
        Numbers of free unknowns of several nodes, which are eliminated last.
    """

    positions: ndarray
    pairs: Any
    dimension: int
    free: ndarray
    shared: ndarray = field(default_factory=partial(np.empty, 0, int))

    @cached_property
    def order(self) -> ndarray:
        """Indices into ``free`` in elimination order, shape (n,)."""
        nodes = nested_dissection(self.positions, np.asarray(self.pairs))
        components = np.arange(self.dimension)
        unknowns = (self.dimension * nodes[:, None] + components).ravel()
        is_shared = np.isin(unknowns, self.shared)
        unknowns = np.append(unknowns[~is_shared], unknowns[is_shared])
        index = np.full(len(unknowns), -1)
        index[self.free] = np.arange(len(self.free))
        ordered = index[unknowns]
        return ordered[ordered >= 0]

    @cached_property
    def motions(self) -> ndarray:
        """Rigid-body motions, shape (n_motions, n)."""
        return rigid_motions(self.positions, self.dimension)[:, self.free]

    def first(self, n: int) -> "Unknowns":
        """The first ``n`` of the free unknowns."""
        return replace(self, free=self.free[:n])


def rigid_motions(positions: ndarray, dimension: int) -> ndarray:
    """Rigid-body motions of nodes in a plane, shape (n_motions, n_unknowns).

    Examples
    --------
    >>> rigid_motions(np.array([[0.0, 2.0], [0.0, 1.0]]), 2)
    array([[ 1.,  0.,  1.,  0.],
           [ 0.,  1.,  0.,  1.],
           [-0.,  0., -1.,  2.]])
    """
    x = np.pad(positions, ((0, dimension - 2), (0, 0)))
    planes = list(combinations(range(dimension), 2))
    motions = np.zeros((dimension + len(planes), x.shape[1], dimension))
    motions[range(dimension), :, range(dimension)] = 1
    for motion, (i, j) in zip(motions[dimension:], planes, strict=True):
        motion[:, [i, j]] = np.stack([-x[j], x[i]], axis=1)
    return motions.reshape(len(motions), -1)


def nested_dissection(positions: ndarray, pairs: ndarray) -> ndarray:
    """Nodes in elimination order, shape (n_nodes,).

    Parameters
    ----------
    positions, pairs
        Positions of the nodes, shape (2, n_nodes), and pairs of coupled nodes, shape
        (2, n_pairs).

    Examples
    --------
    The middle one of collinear nodes comes last.

    >>> x = np.stack([np.arange(65.0), np.zeros(65)])
    >>> int(nested_dissection(x, np.stack([np.arange(64), np.arange(1, 65)]))[-1])
    32
    """
    n, n_parts = positions.shape[1], 1
    part = np.zeros(n, dtype=np.int64)  # of each node; −1 for separator nodes
    place = np.zeros(n, dtype=np.int64)  # in the order, one ternary digit per division
    while True:
        size = np.bincount(part[part >= 0], minlength=n_parts)
        if size.max(initial=0) <= _LEAF_NODES:
            return np.argsort(place, kind="stable")
        upper = _upper_halves(positions, part, size)
        pairs = pairs[:, (part[pairs[0]] == part[pairs[1]]) & (part[pairs[0]] >= 0)]
        across = pairs[:, upper[pairs[0]] != upper[pairs[1]]]
        first, second = np.where(upper[across[0]], across[::-1], across)
        between = np.zeros(n, dtype=bool)
        between[_cover(first, second)] = True
        place = 3 * place + np.where(part < 0, 0, np.where(between, 2, upper))
        part = np.where((part < 0) | between, -1, 2 * part + upper)
        n_parts *= 2


def _upper_halves(positions: ndarray, part: ndarray, size: ndarray) -> ndarray:
    """Mask of the nodes above the middle of their part, along its longer side."""
    nodes = np.flatnonzero(part >= 0)
    part_of, x = part[nodes], positions[:, nodes]
    low, high = np.full((2, 2, len(size)), [[[np.inf]], [[-np.inf]]])
    for axis in range(2):
        np.minimum.at(low[axis], part_of, x[axis])
        np.maximum.at(high[axis], part_of, x[axis])
    longer = (high - low).argmax(axis=0)
    order = np.lexsort((x[longer[part_of], np.arange(len(nodes))], part_of))
    rank = np.arange(len(nodes)) - (np.cumsum(size) - size)[part_of[order]]
    upper = np.zeros(len(part), dtype=bool)
    upper[nodes[order]] = 2 * rank >= size[part_of[order]]
    return upper


def _cover(first: ndarray, second: ndarray) -> ndarray:
    """Minimum vertex cover of pairs of nodes, one on each side."""
    lower, i = np.unique(first, return_inverse=True)
    upper, j = np.unique(second, return_inverse=True)
    pairs = csr_matrix((np.ones(len(i)), (i, j)), shape=(len(lower), len(upper)))
    mate = maximum_bipartite_matching(pairs, perm_type="column")
    matched = np.flatnonzero(mate >= 0)
    back = np.full(len(upper), -1)
    back[mate[matched]] = matched
    # Nodes reached by alternating paths from unmatched nodes of the lower side.
    reached, new, passed = mate < 0, mate < 0, np.zeros(len(upper), dtype=bool)
    while new.any():
        ahead = (pairs.T @ new > 0) & ~passed
        passed |= ahead
        new = np.zeros_like(reached)
        new[back[ahead]] = True
        reached |= new
    return np.concatenate([lower[~reached], upper[passed]])
