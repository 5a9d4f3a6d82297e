"""Edges of cells, and connected components of a graph."""

from collections.abc import Sequence

import numpy as np
from numpy import ndarray


def components(n: int, pairs: ndarray | Sequence[ndarray]) -> ndarray:
    """Number of the connected component of each of n items, shape (n,).

    ``pairs`` are the joined items, shape (2, n_pairs).
    """
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    one, other = pairs
    graph = coo_array((np.ones(len(one)), (one, other)), shape=(n, n))
    return np.asarray(connected_components(graph, directed=False)[1])


def edges_once(
    cells: Sequence[ndarray],
) -> tuple[ndarray, ndarray, ndarray, ndarray]:
    """Directed edges of cells and their undirected counterparts.

    Parameters
    ----------
    cells
        Nodes of blocks of cells, shape (n_corners, n_cells) each.

    Returns
    -------
    edges
        Edges in the orientation of the cells, side by side of each block, (2, n).
    first
        Index in ``edges`` of the first occurrence of each undirected edge.
    number
        Undirected edge of each directed one, shape (n,).
    count
        Number of cells at each undirected edge.
    """
    pairs = [[cell.ravel(), np.roll(cell, -1, axis=0).ravel()] for cell in cells]
    edges = np.hstack(pairs)
    low, high = edges.min(axis=0).astype(np.int64), edges.max(axis=0)
    keys = low * (high.max(initial=0) + 1) + high
    _, first, number, count = np.unique(keys, True, True, True)
    return edges, first, number, count


def edges_of(cells: Sequence[ndarray]) -> tuple[ndarray, ndarray]:
    """Sorted ends of edges, shape (2, n), and the edge of each side of each cell."""
    edges, first, number, _ = edges_once(cells)
    return np.sort(edges[:, first], axis=0), number


def boundary_edges(cells: Sequence[ndarray]) -> ndarray:
    """Nodes of edges that belong to one cell only, in its orientation, (2, n)."""
    edges, first, _, count = edges_once(cells)
    return edges[:, first[count == 1]]
