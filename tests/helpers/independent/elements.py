"""A cloth, its elements and their points."""

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from numpy import ndarray

from .laws import Biaxial, Law


class Cloth(NamedTuple):
    """Nodes (2, n_nodes), nodes of each element, fibres and laws.

    Elements are bilinear quadrilaterals, four nodes in either sense of rotation, or
    straight triangles of six: vertices, then middles of the edges 01, 12, 20.
    ``fibres(element, position)`` gives unit vectors A₁, A₂.  What has no stiffness has
    the law None; a pair of laws may be a `Biaxial` one.
    """

    X: ndarray
    elements: Sequence[ndarray]
    fibres: Callable
    tension: tuple[Law | None, Law | None] | Biaxial
    shear: Law | None


class Point(NamedTuple):
    """A point of an element: its nodes, ∂N_a/∂X, (n, 2), fibres and area."""

    nodes: ndarray
    dN_dX: ndarray
    A: tuple[ndarray, ndarray]
    area: float


CORNERS = ((-1, -1), (1, -1), (1, 1), (-1, 1))
GAUSS = tuple((a / np.sqrt(3), b / np.sqrt(3)) for a, b in CORNERS)
EDGE_MIDDLES = ((0, -1), (1, 0), (0, 1), (-1, 0))  # of the edges 01, 12, 23, 30
THREE = ((1 / 6, 1 / 6), (2 / 3, 1 / 6), (1 / 6, 2 / 3))
SIX_NODES = ((0, 0), (1, 0), (0, 1), (1 / 2, 0), (1 / 2, 1 / 2), (0, 1 / 2))


def bilinear(xi, eta):
    """N_a and ∂N_a/∂(ξ, η) on the square [−1, 1]²."""
    N = [(1 + a * xi) * (1 + b * eta) / 4 for a, b in CORNERS]
    dN = [(a * (1 + b * eta) / 4, (1 + a * xi) * b / 4) for a, b in CORNERS]
    return np.array(N), np.array(dN)


def quadratic(s, t):
    """N_a and ∂N_a/∂(s, t) on the triangle (0, 0), (1, 0), (0, 1)."""
    r = 1 - s - t
    N = [r * (2 * r - 1), s * (2 * s - 1), t * (2 * t - 1)]
    N += [4 * r * s, 4 * s * t, 4 * t * r]
    dN = [(1 - 4 * r, 1 - 4 * r), (4 * s - 1, 0), (0, 4 * t - 1)]
    dN += [(4 * (r - s), -4 * s), (4 * t, 4 * s), (-4 * t, 4 * (r - t))]
    return np.array(N), np.array(dN)


def shape(nodes, at):
    return (bilinear if len(nodes) == 4 else quadratic)(*at)


def gradients(x, dN):
    """∂N_a/∂x, shape (n, 2), on an element with nodes at x, shape (2, n)."""
    return dN @ np.linalg.inv(x @ dN)


def polygon(x):
    """Area of a polygon with the corners x, shape (2, n)."""
    following = np.roll(x, -1, axis=1)
    return abs(np.sum(x[0] * following[1] - x[1] * following[0])) / 2


def area(cloth, e):
    nodes = cloth.elements[e]
    return polygon(cloth.X[:, nodes[: 4 if len(nodes) == 4 else 3]])


def point(cloth, e, at, area=0.0):
    nodes = cloth.elements[e]
    N, dN = shape(nodes, at)
    X = cloth.X[:, nodes]
    return Point(nodes, gradients(X, dN), cloth.fibres(e, X @ N), area)


def points_of(cloth, e, rule):
    """Points of an element.

    ``gauss``: 2×2 with their Jacobians; ``centre``: one with the whole area;
    ``three``: of a triangle, with a third of the area each.
    """
    if rule == "centre":
        return [point(cloth, e, (0, 0), area(cloth, e))]
    if rule == "three":
        return [point(cloth, e, at, area(cloth, e) / 3) for at in THREE]
    X = cloth.X[:, cloth.elements[e]]
    jacobians = [abs(np.linalg.det(X @ bilinear(*at)[1])) for at in GAUSS]
    return [point(cloth, e, *p) for p in zip(GAUSS, jacobians, strict=True)]


def points(cloth, rule):
    return [p for e in range(len(cloth.elements)) for p in points_of(cloth, e, rule)]
