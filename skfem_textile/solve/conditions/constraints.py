"""Conditions resolved into fixed unknowns, and what they leave free."""

from collections.abc import Iterator, Mapping
from typing import TypeAlias

import numpy as np
from numpy import ndarray
from scipy.sparse import csr_matrix, identity
from scipy.sparse.linalg import splu
from skfem import CellBasis

from ...mesh.bases import components, node_dofs, node_positions
from .condition import Condition
from .on_surface import OnSurface
from .surface_nodes import SurfaceNodes

#: What a ply meets, by name.
Conditions: TypeAlias = Mapping[str, Condition | OnSurface]

# Two directions at a node closer than this (radians) are one.  A larger angle takes
# directions that differ on purpose for one.  A smaller one takes round-off of normals
# for a second direction, along which a node is then held.
_PARALLEL_ANGLE = 1e-6

# Conditions agree at a node if their displacements differ by no more than this share of
# the largest, and, for round-off, this share of the largest coordinate.
_AGREEING, _ROUND_OFF = 1e-9, 1e-15


class Constraints:
    """The conditions of a ply, resolved into fixed unknowns.

    Where inclined directions are fixed at a node and others are free, the unknowns of
    that node are turned so that the first lie along them: u = turn @ q.  Conditions
    that repeat one another are merged.

    Parameters
    ----------
    basis
        Basis of the displacement.
    conditions
        `Condition` and `OnSurface` by name.

    Attributes
    ----------
    turn
        Orthogonal matrix from the turned to the plain unknowns; None where every
        fixed direction lies along an axis.  Nodes on surfaces turn further.
    prescribed
        Numbers of the (turned) unknowns that conditions on displacements fix.
    surfaces
        The nodes on surfaces; None where there are none.
    fixed, free
        Numbers of the fixed unknowns, those across surfaces among them, and of the
        others.
    nodes
        Node numbers of each condition, by name: ascending, each of them once.

    Raises
    ------
    ValueError
        If a condition is not valid, or two of them disagree.
    """

    def __init__(self, basis: CellBasis, conditions: Conditions) -> None:
        if not isinstance(conditions, Mapping):
            raise ValueError(
                "conditions must be a mapping of names to Conditions, not "
                f"{type(conditions).__name__}"
            )
        for name, condition in conditions.items():
            if not isinstance(condition, Condition | OnSurface):
                raise ValueError(
                    f"condition {name!r} must be a Condition, like "
                    f"Condition('bottom'), not {type(condition).__name__}"
                )
        if not conditions:
            raise ValueError("no conditions: a ply must be held somewhere")
        on = {k: c for k, c in conditions.items() if isinstance(c, OnSurface)}
        self._conditions = {
            k: c for k, c in conditions.items() if isinstance(c, Condition)
        }
        self._X, self._d = node_positions(basis), components(basis)
        self._acting = {
            name: condition.nodes(name, basis)
            for name, condition in self._conditions.items()
        }
        on_surface = {
            name: condition.nodes(name, basis) for name, condition in on.items()
        }
        nodes = self._acting | on_surface
        self.nodes = {name: np.unique(nodes[name]) for name in conditions}

        node, direction = [np.empty(0, int)], [np.empty((self._d, 0))]
        for name, condition in self._conditions.items():
            n = condition.directions(name, self._X[:, self._acting[name]], self._d)
            node.append(np.tile(self._acting[name], len(n)))
            direction.append(n.transpose(1, 0, 2).reshape(self._d, -1))
        self._node = np.concatenate(node)
        self._direction = np.concatenate(direction, axis=1)
        self._resolve(basis)
        self.fixed, self.surfaces = self.prescribed, None
        if on:
            place = self._X, self._d, self.turn, self.prescribed
            self.surfaces = SurfaceNodes(on, on_surface, *place)
            self.fixed = np.union1d(self.prescribed, self.surfaces.eliminated)
        self.free = np.setdiff1d(np.arange(basis.N), self.fixed)

    def _resolve(self, basis: CellBasis) -> None:
        """Choose the fixed unknowns and the map from the rows' values to theirs.

        A row fixes one direction at one node; ``_rows @ q[prescribed] = values``.
        """
        d, dofs = self._d, node_dofs(basis)[:, : self._X.shape[1]]
        held, count = self._held_directions()
        projector = np.einsum("jin,jkn->ikn", held, held)
        crossed = projector * (1 - np.eye(d))[:, :, None]
        along_axes = (crossed == 0).all(axis=(0, 1))
        along_axes |= count == d
        inclined = np.flatnonzero(~along_axes)
        self.turn = _turns(basis.N, dofs[:, inclined], held[..., inclined])

        axes = np.einsum("iin->in", projector) > 0.5
        first = np.arange(d)[:, None] < count
        fixed = np.where(count == d, True, np.where(along_axes, axes, first))
        self.prescribed = np.sort(dofs[fixed])
        rows = np.tile(np.arange(len(self._node)), d)
        entries = self._direction.ravel(), (rows, dofs[:, self._node].ravel())
        N = csr_matrix(entries, shape=(len(self._node), basis.N))
        if self.turn is not None:
            N = N @ self.turn
        self._rows = N[:, self.prescribed]
        # The rows of a node couple its unknowns alone, of full rank by choice: least
        # squares, which leave a remainder where conditions disagree.
        normal = (self._rows.T @ self._rows).tocsc()
        self._normal = splu(normal) if len(self.prescribed) else None

    def _held_directions(self) -> tuple[ndarray, ndarray]:
        """Orthonormal directions held at each node, and how many there are.

        Shapes (d, d, n_nodes), zero where there are fewer, and (n_nodes,).
        """
        d, n_nodes = self._d, self._X.shape[1]
        held, count = np.zeros((d, d, n_nodes)), np.zeros(n_nodes, dtype=int)
        for rows in _one_at_each_node(self._node):
            node, n = self._node[rows], self._direction[:, rows]
            known = held[..., node]
            share = np.einsum("jin,in->jn", known, n)
            rest = n - np.einsum("jin,jn->in", known, share)
            length = np.linalg.norm(rest, axis=0)
            new = length >= _PARALLEL_ANGLE
            unit = np.where(count[node] > 0, rest / np.where(new, length, 1.0), n)
            place = count[node[new]], slice(None), node[new]
            held[place] = unit[:, new].T
            count[node[new]] += 1
        return held, count

    def fixed_values(self, t: float) -> ndarray:
        """Values of the prescribed unknowns at the load factor ``t``.

        Raises
        ------
        ValueError
            If two conditions ask a node for different displacements, or a surface
            cannot grow.
        """
        if self.surfaces:
            self.surfaces.check(t)
        if self._normal is None:
            return np.empty(0)
        g = np.concatenate(
            [
                condition.values(name, self._X[:, nodes], t, self._d).ravel()
                for (name, condition), nodes in zip(
                    self._conditions.items(), self._acting.values(), strict=True
                )
            ]
        )
        q = self._normal.solve(self._rows.T @ g)
        remainder = np.abs(self._rows @ q - g)
        allowed = _AGREEING * np.abs(g).max() + _ROUND_OFF * np.abs(self._X).max()
        if remainder.max() > allowed:
            node = self._node[remainder.argmax()]
            names = [name for name, nodes in self.nodes.items() if node in nodes]
            raise ValueError(
                f"conditions {' and '.join(map(repr, names))} disagree at node {node} "
                f"{tuple(self._X[:, node].round(6).tolist())}, load factor {t:g}"
            )
        return q


def _one_at_each_node(node: ndarray) -> Iterator[ndarray]:
    """Rows of which no two are at the same node, those that come first at first."""
    order = np.argsort(node, kind="stable")
    _, start, counts = np.unique(node[order], return_index=True, return_counts=True)
    number = np.empty(len(node), dtype=int)
    number[order] = np.arange(len(node)) - np.repeat(start, counts)
    return (np.flatnonzero(number == i) for i in range(counts.max(initial=0)))


def _turns(n_dofs: int, dofs: ndarray, held: ndarray) -> csr_matrix | None:
    """Identity, but for nodes whose first unknowns are to lie along what is held."""
    if dofs.size == 0:
        return None
    turn = identity(n_dofs, format="lil")
    for own, directions in zip(dofs.T, held.transpose(2, 0, 1), strict=True):
        turn[np.ix_(own, own)] = _frame(directions)
    return turn.tocsr()


def _frame(held: ndarray) -> ndarray:
    """Orthonormal columns that begin with the held directions, rows that are not 0."""
    if len(held) == 2:
        c, s = held[0]
        return np.array([[c, -s], [s, c]])
    first, second, _ = held
    if not second.any():
        second = np.cross(first, np.eye(3)[np.abs(first).argmin()])
        second = second / np.linalg.norm(second)
    return np.transpose([first, second, np.cross(first, second)])
