"""Edges of cells that are given as node numbers."""

from collections.abc import Sequence

import numpy as np
from numpy import ndarray

from ..checks import MeshError
from ..named_nodes import edge_numbers


def edges_of(cells: Sequence[ndarray]) -> tuple[ndarray, ndarray]:
    """Ends of each edge, shape (2, n), and the edge of each side of each cell."""
    ends = np.concatenate([_ends(cell) for cell in cells], axis=1)
    pairs, inverse = np.unique(np.sort(ends, axis=0), axis=1, return_inverse=True)
    return pairs, inverse.ravel()


def boundary_edges(cells: Sequence[ndarray]) -> ndarray:
    """Node numbers of the edges that belong to one cell only, shape (2, n)."""
    pairs, inverse = edges_of(cells)
    return pairs[:, np.bincount(inverse) == 1]


def _ends(cell: ndarray) -> ndarray:
    """Node numbers of the edges of cells, edge by edge, shape (2, k·n)."""
    return np.stack([cell.ravel(), np.roll(cell, -1, axis=0).ravel()])


def named_edges(name: str, points: ndarray, edges: ndarray, ends: ndarray) -> ndarray:
    """Numbers of the edges of a named boundary, given by their ends.

    Parameters
    ----------
    name
        Name of the boundary.
    points
        Nodes, shape (2, n).
    edges, ends
        As for `edge_numbers`.

    Raises
    ------
    MeshError
        If two of the nodes are not the ends of an edge.
    """
    numbers = edge_numbers(edges, ends)
    missing = ends[:, numbers < 0]
    if missing.size:
        a, b = missing[:, 0].tolist()
        more = missing.shape[1] - 1
        others = f", nor {more} more pair(s) of nodes that it names" if more else ""
        raise MeshError(
            f"boundary {name!r}: no edge of the mesh joins nodes {a} and {b} at "
            f"{_position(points, a)} and {_position(points, b)}{others}; name edges of "
            "cells"
        )
    return numbers


def _position(points: ndarray, node: int) -> str:
    x, y = points[:, node].tolist()
    return f"({x:g}, {y:g})"
