"""Smooth patches over the holes of a triangulated surface."""

from itertools import compress

import numpy as np
from numpy import ndarray

from ..mesh.graph import components
from .tool_mesh import loops

# Distance of the vertices of a patch from its edge, relative to their spacing.
_INSIDE = 0.7

# Turning of the boundary along a hole: half way between −2π in a plane and 0 at an end
# of a tube.
_TURN = -np.pi

# Number of linear systems, with the cotangents of the previous position.
_ROUNDS = 3


def filled(x: ndarray, triangles: ndarray) -> tuple[ndarray, ndarray]:
    """Close all holes with patches; vertices and triangles.

    Ends of tubes do not count as holes, see `turning`; a part has at least one outer
    edge, the longest.  The vertices of a patch minimise ∫|Δx|², and with it the bending
    at its edge.

    Parameters
    ----------
    x
        Vertices in mm, shape (3, n).
    triangles
        Their numbers, shape (3, m), consistently oriented.

    Raises
    ------
    MeshError
        See `loops`.
    """
    edges = loops(x, [triangles])
    part, turn = parts_of(x.shape[1], triangles), turning(x, triangles)
    outer = of_outer_edges(
        np.array([turn[loop].sum() for loop in edges]),
        np.array([part[loop[0]] for loop in edges]),
    )
    for loop in compress(edges, ~outer):
        x, patch = _flat_patch(x, loop)
        around = triangles[:, np.isin(triangles, loop).any(axis=0)]
        free = np.setdiff1d(patch, loop)
        if free.size:
            x = _relaxed(x, np.hstack([patch, around]), loop, free)
        triangles = np.hstack([triangles, patch])
    return x, triangles


def turning(x: ndarray, triangles: ndarray) -> ndarray:
    """Turning of the boundary at each vertex: π less the angles there, shape (n,).

    By the theorem of Gauss and Bonnet the sum along a closed curve is 2π around a plane
    part, −2π around a hole in it, and 0 at an end of a tube, however rough the curve.
    """
    turn = np.full(x.shape[1], np.pi)
    for k in range(3):
        a, b, c = (x[:, triangles[(k + m) % 3]] for m in range(3))
        along, across = b - a, c - a
        sine = np.linalg.norm(np.cross(along, across, axis=0), axis=0)
        angle = np.arctan2(sine, (along * across).sum(axis=0))
        turn -= np.bincount(triangles[k], angle, minlength=x.shape[1])
    return turn


def of_outer_edges(turn: ndarray, part: ndarray) -> ndarray:
    """Mask of the closed curves that are outer edges, the others bound holes.

    Parameters
    ----------
    turn
        Sum of `turning` along each curve, shape (n,), the longest curve first.
    part
        Number of its part of the surface, shape (n,).
    """
    outer = turn >= _TURN
    for k in np.setdiff1d(part, part[outer]):
        outer[np.argmax(part == k)] = True
    return outer


def parts_of(n: int, triangles: ndarray) -> ndarray:
    """Number of the connected part of each of n vertices, shape (n,)."""
    return components(n, np.hstack([triangles[:2], triangles[1:]]))


def _flat_patch(x: ndarray, loop: ndarray) -> tuple[ndarray, ndarray]:
    """Add a flat patch in a loop: all vertices, and the triangles of the patch.

    They are triangles of a disk with the circumference of the loop.  New vertices are
    the last, in the middle of the loop.
    """
    from scipy.spatial import Delaunay

    steps = np.linalg.norm(np.roll(x[:, loop], -1, axis=1) - x[:, loop], axis=0)
    length, spacing = steps.sum(), steps.mean()
    radius = length / (2 * np.pi)
    # The patch runs along its edge in the opposite direction to its neighbours.
    around = -2 * np.pi * (np.cumsum(steps) - steps) / length
    rim = radius * np.array([np.cos(around), np.sin(around)])
    n = int(radius / spacing) + 1
    i, j = (a.ravel() for a in np.meshgrid(*[np.arange(-2 * n, 2 * n + 1)] * 2))
    lattice = spacing * np.array([i + j / 2, np.sqrt(0.75) * j])
    lattice = lattice[:, np.hypot(*lattice) < radius - _INSIDE * spacing]
    flat = np.hstack([rim, lattice])
    corners = Delaunay(flat.T).simplices.T  # anticlockwise
    new = x.shape[1] + np.arange(lattice.shape[1])
    middle = np.repeat(x[:, loop].mean(axis=1, keepdims=True), len(new), axis=1)
    return np.hstack([x, middle]), np.concatenate([loop, new])[corners]


def _relaxed(x: ndarray, triangles: ndarray, loop: ndarray, free: ndarray) -> ndarray:
    """Move the free vertices to minimise ∫|Δx|².

    Triangles are the patch and its neighbours.
    """
    from scipy.sparse import diags_array
    from scipy.sparse.linalg import spsolve

    nodes, local = np.unique(triangles, return_inverse=True)
    local = local.reshape(triangles.shape)
    own, rows = np.isin(nodes, free), np.isin(nodes, np.concatenate([free, loop]))
    position = x[:, nodes].T
    uniform, _ = laplacian(position, local, False)
    inside = uniform[own].tocsc()
    position[own] = -spsolve(inside[:, own], inside[:, ~own] @ position[~own])
    for _ in range(_ROUNDS):
        stiffness, area = laplacian(position, local, True)
        bend = (diags_array(1 / np.sqrt(area[rows])) @ stiffness[rows]).tocsc()
        right = bend[:, own].T @ (bend[:, ~own] @ position[~own])
        position[own] = -spsolve((bend[:, own].T @ bend[:, own]).tocsc(), right)
    x = x.copy()
    x[:, nodes] = position.T
    return x


def laplacian(x: ndarray, t: ndarray, cotangents: bool) -> tuple:
    """Laplacian with weights of one or by cotangents, and areas of the vertices."""
    from scipy.sparse import coo_array, diags_array

    weights, rows, columns = [], [], []
    for k in range(3):
        a, b, c = x[t[k]], x[t[(k + 1) % 3]], x[t[(k + 2) % 3]]
        area = np.linalg.norm(np.cross(b - a, c - a), axis=1)
        cotangent = ((b - a) * (c - a)).sum(axis=1) / np.maximum(area, 1e-12)
        weight = 0.5 * cotangent if cotangents else np.ones(t.shape[1])
        weights += [weight, weight]
        rows += [t[(k + 1) % 3], t[(k + 2) % 3]]
        columns += [t[(k + 2) % 3], t[(k + 1) % 3]]
    pairs = np.concatenate(rows), np.concatenate(columns)
    matrix = coo_array((np.concatenate(weights), pairs), shape=(len(x),) * 2).tocsr()
    around = np.bincount(t.ravel(), np.tile(area / 6, 3), minlength=len(x))
    return (diags_array(matrix.sum(axis=1)) - matrix).tocsr(), around
