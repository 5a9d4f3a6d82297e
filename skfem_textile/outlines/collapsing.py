"""Collapse of short edges of a triangle mesh, with nodes on lines kept on them."""

from typing import NamedTuple

import numpy as np
from numpy import ndarray

# Kinds of nodes: free, on one line along which they may move, and fixed.
FREE, ON_LINE, FIXED = 0, 1, 2

# Angle in degrees below which a triangle is improved.
_POOR = 15.0


class Nodes(NamedTuple):
    """Nodes of a triangle mesh, whose arrays `collapse` changes.

    Attributes
    ----------
    p
        Positions, shape (2, n).
    kind
        `FREE`, `ON_LINE` or `FIXED`, shape (n,).
    line
        Number of the line of a node of the kind `ON_LINE`, −1 for the outline; (n,).
    on
        True for nodes on each of the other lines, shape (n_lines, n).
    """

    p: ndarray
    kind: ndarray
    line: ndarray
    on: ndarray


def smallest_angles(p: ndarray, t: ndarray) -> ndarray:
    """Smallest angle of each triangle in degrees, negative if it is turned over."""
    side = p[:, np.roll(t, -1, axis=0)] - p[:, t]
    length = np.hypot(*side)
    after = np.roll(side, -1, axis=1)
    area = side[0] * after[1] - side[1] * after[0]
    sine = area / np.maximum(length * np.roll(length, -1, axis=0), 1e-300)
    angle = np.degrees(np.arcsin(np.clip(sine, -1, 1)))
    # The arcsine is right for acute angles, and the smallest angle is acute.
    return angle.min(axis=0)


def collapse(nodes: Nodes, t: ndarray, n_kept: int) -> tuple[ndarray, ndarray]:
    """Collapse the shortest edges of poor triangles where this increases the angles.

    Nodes on a line move along it only, the outline and the lines remain edges, and the
    first ``n_kept`` nodes remain.

    Parameters
    ----------
    nodes
        The nodes; their arrays are changed.
    t
        Triangles, anticlockwise, shape (3, n_elements).

    Returns
    -------
    kept
        Numbers of the triangles that remain.
    becomes
        Node of the changed triangles that replaces each node, shape (n,): itself, or
        the node with which it was merged.
    """
    becomes, alive = np.arange(nodes.p.shape[1]), np.ones(t.shape[1], dtype=bool)
    angles = smallest_angles(nodes.p, t)
    queue = list(np.argsort(angles)[: np.sum(angles < _POOR)])
    while queue:
        k = queue.pop(0)
        if not alive[k] or angles[k] >= _POOR:
            continue
        for a, b in _short_first(nodes.p, t[:, k]):
            if max(a, b) < n_kept or not _may_move(nodes, t[:, alive], a, b):
                continue
            around = alive & ((t == a) | (t == b)).any(axis=0)
            gone = around & (t == a).any(axis=0) & (t == b).any(axis=0)
            rest = np.flatnonzero(around & ~gone)
            moved = np.where(t[:, rest] == a, b, t[:, rest])
            after = smallest_angles(nodes.p, moved)
            if after.min() <= angles[around].min():
                continue
            keep, drop = min(a, b), max(a, b)
            for values in nodes:
                values[..., keep] = values[..., b]
            becomes[becomes == drop] = keep
            t[:, rest] = np.where(moved == drop, keep, moved)
            alive &= ~gone
            angles[rest] = after
            queue += rest[after < _POOR].tolist()
            break
    return np.flatnonzero(alive), becomes


def _short_first(p: ndarray, corners: ndarray) -> list[tuple[int, int]]:
    """Pairs (a, b) of corners, those at the ends of the shortest edge first."""
    ends = np.stack([corners, np.roll(corners, -1)])
    order = np.argsort(np.hypot(*(p[:, ends[0]] - p[:, ends[1]])))[:2]
    pairs = ends[:, order].T.tolist()
    return [pair for a, b in pairs for pair in ((a, b), (b, a))]


def _may_move(nodes: Nodes, t: ndarray, a: int, b: int) -> bool:
    """True if node a may be merged with its neighbour b at the position of b."""
    has_a, has_b = (t == a).any(axis=0), (t == b).any(axis=0)
    both = has_a & has_b
    of_a, of_b = np.unique(t[:, has_a]), np.unique(t[:, has_b])
    if np.intersect1d(of_a, of_b).size != 2 + both.sum():
        return False
    if nodes.kind[a] == ON_LINE:
        i = nodes.line[a]
        return bool(both.sum() == 1 if i < 0 else nodes.on[i, [a, b]].all())
    return bool(nodes.kind[a] == FREE)
