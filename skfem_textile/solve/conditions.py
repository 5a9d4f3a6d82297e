"""Displacement conditions along any direction, and what they leave free."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from numpy import ndarray
from numpy.typing import ArrayLike
from scipy.sparse import csr_matrix, identity
from scipy.sparse.linalg import splu
from skfem import CellBasis

from ..fabric import Direction, unit_vectors
from ..mesh.bases import node_dofs, node_positions
from ..mesh.selection import Where, selected_nodes
from ..mesh.user_input import call_user_function, real_numbers

Value: TypeAlias = ArrayLike | Callable[[ndarray, float], ndarray]

# Two directions at a node closer than this (radians) are one.  A larger angle takes
# directions that differ on purpose for one.  A smaller one takes round-off of normals
# for a second direction, along which a node is then held.
_PARALLEL_ANGLE = 1e-6

# Conditions agree at a node if their displacements differ by no more than this share of
# the largest, and, for round-off, this share of the largest coordinate.
_AGREEING, _ROUND_OFF = 1e-9, 1e-15


@dataclass(frozen=True, eq=False)
class Condition:
    """A displacement fixed on some nodes, whole or along one direction.

    Parameters
    ----------
    where
        The name of a boundary or of nodes of the mesh, a function of position
        ``(2, n) -> (n,) bool``, one bool per node of
        the ply (``ply.nodes``), or node numbers.  The nodes are
        those of the ply: vertices, then middles of edges if the element has nodes
        there.
    value
        Displacement in mm: with a direction, a scalar per node; without, a vector
        per node, shape (2, n).  Either a function ``value(X, t)`` of reference
        position and load factor, or a constant that is reached in proportion to
        the load factor.  Values per node are in the order in which the node numbers
        are given, and of ascending numbers where none are.
    direction
        The direction in which the displacement is fixed: a vector or a function
        of position.  Without it the whole displacement is fixed.

    Examples
    --------
    A clamp, an edge pulled by 5 mm, and a roller on a slope of 30°:

    >>> clamp = Condition("bottom")
    >>> pulled = Condition("top", 5.0, direction=(0, 1))
    >>> roller = Condition(lambda x: x[0] > 99.9, direction=(-0.5, 3**0.5 / 2))
    """

    where: Where
    value: Value = 0.0
    direction: Direction | None = None

    def nodes(self, name: str, basis: CellBasis) -> ndarray:
        """Numbers of the nodes on which the condition acts, in the order of its values.

        Raises
        ------
        ValueError
            If the boundary is unknown, the nodes are not valid, or there are none.
        """
        return selected_nodes(f"condition {name!r}", self.where, basis)

    def directions(self, name: str, X: ndarray) -> ndarray:
        """Fixed directions at the nodes, shape (k, 2, n), with k = 1 or 2."""
        if self.direction is None:
            return np.broadcast_to(np.eye(2)[:, :, None], (2, *X.shape))
        n = unit_vectors(f"condition {name!r}: direction", self.direction, X)
        return np.broadcast_to(n, X.shape)[None]

    def values(self, name: str, X: ndarray, t: float) -> ndarray:
        """Displacements along the fixed directions, shape (k, n)."""
        what, function = f"condition {name!r}: the value", self.value
        given = (
            call_user_function(what, function, X, t) if callable(function) else function
        )
        value = real_numbers(what, given)
        if not np.all(np.isfinite(value)):
            raise ValueError(f"{what} is not finite at load factor {t:g}")
        if not callable(function):
            value = t * value
            if value.shape == (2,) and self.direction is None:
                value = np.broadcast_to(value[:, None], X.shape)
        shape = X.shape if self.direction is None else X.shape[1:]
        one_for_all = value.ndim == 0 and (self.direction is not None or value == 0)
        if value.shape != shape and not one_for_all:
            raise ValueError(
                f"condition {name!r}: the value must have shape {shape}, "
                f"not {value.shape}"
            )
        return np.broadcast_to(value, shape).reshape(-1, X.shape[1])

    def turned(self, Q: ndarray) -> "Condition":
        """The same condition in a problem turned by the rotation Q."""
        where, direction = self.where, self.direction

        def turned_value(X: ndarray, t: float) -> ndarray:
            plain = Q.T @ X
            n = self.values("turned", plain, t)
            return Q @ n if direction is None else n[0]

        def turned_where(X: ndarray) -> ndarray:
            return where(Q.T @ X)  # type: ignore[operator]

        def turned_direction(X: ndarray) -> ndarray:
            return Q @ unit_vectors("direction", direction, Q.T @ X)  # type: ignore[arg-type]

        return Condition(
            turned_where if callable(where) else where,
            turned_value,
            None if direction is None else turned_direction,
        )


class Constraints:
    """The conditions of a ply, resolved into fixed unknowns.

    Where one inclined direction is fixed at a node, the two unknowns of that node
    are turned so that the first lies along it: u = turn @ q.  Conditions that
    repeat one another are merged.

    Parameters
    ----------
    basis
        Basis of the displacement.
    conditions
        Conditions by name.

    Attributes
    ----------
    turn
        Orthogonal matrix from the turned to the plain unknowns; None where every
        fixed direction lies along an axis.
    fixed, free
        Numbers of the fixed and of the other (turned) unknowns.
    nodes
        Node numbers of each condition, by name: ascending, each of them once.

    Raises
    ------
    ValueError
        If a condition is not valid, or two of them disagree.
    """

    def __init__(self, basis: CellBasis, conditions: Mapping[str, Condition]) -> None:
        if not isinstance(conditions, Mapping):
            raise ValueError(
                "conditions must be a mapping of names to Conditions, not "
                f"{type(conditions).__name__}"
            )
        for name, condition in conditions.items():
            if not isinstance(condition, Condition):
                raise ValueError(
                    f"condition {name!r} must be a Condition, like "
                    f"Condition('bottom'), not {type(condition).__name__}"
                )
        if not conditions:
            raise ValueError("no conditions: a ply must be held somewhere")
        self._conditions = dict(conditions)
        self._X = node_positions(basis)
        self._acting = {
            name: condition.nodes(name, basis)
            for name, condition in self._conditions.items()
        }
        self.nodes = {name: np.unique(nodes) for name, nodes in self._acting.items()}

        node, direction = [], []
        for name, condition in self._conditions.items():
            n = condition.directions(name, self._X[:, self._acting[name]])
            node.append(np.tile(self._acting[name], len(n)))
            direction.append(n.transpose(1, 0, 2).reshape(2, -1))
        self._node = np.concatenate(node)
        self._direction = np.concatenate(direction, axis=1)
        self._resolve(basis)

    def _resolve(self, basis: CellBasis) -> None:
        """Choose the fixed unknowns and the map from the rows' values to theirs.

        A row fixes one direction at one node; ``_rows @ q[fixed] = values``.
        """
        dofs, n = node_dofs(basis)[:, self._node], self._direction
        first = self._first_rows()
        along = np.abs(n[0] * n[1, first] - n[1] * n[0, first]) < _PARALLEL_ANGLE
        whole = np.zeros(self._X.shape[1], dtype=bool)
        whole[self._node[~along]] = True

        axis = np.abs(n[:, first]).argmax(axis=0)
        on_axis = np.abs(n[:, first]).min(axis=0) == 0
        inclined = ~whole[self._node] & ~on_axis
        self.turn = _turns(basis.N, dofs[:, inclined], n[:, first][:, inclined])

        one = ~whole[self._node]
        kept = np.where(on_axis, axis, 0)[one]
        self.fixed = np.unique(
            np.concatenate([dofs[:, ~one].ravel(), dofs[kept, np.flatnonzero(one)]])
        )
        self.free = np.setdiff1d(np.arange(basis.N), self.fixed)
        rows = np.tile(np.arange(len(self._node)), 2)
        N = csr_matrix(
            (n.ravel(), (rows, dofs.ravel())), shape=(len(self._node), basis.N)
        )
        if self.turn is not None:
            N = N @ self.turn
        self._rows = N[:, self.fixed]
        # The rows of a node couple at most two unknowns, of full rank by choice: least
        # squares, which leave a remainder where conditions disagree.
        self._normal = splu((self._rows.T @ self._rows).tocsc())

    def _first_rows(self) -> ndarray:
        """For each row, the first row at the same node."""
        _, first, inverse = np.unique(
            self._node, return_index=True, return_inverse=True
        )
        return first[inverse]

    def fixed_values(self, t: float) -> ndarray:
        """Values of the fixed unknowns at the load factor ``t``.

        Raises
        ------
        ValueError
            If two conditions ask a node for different displacements.
        """
        g = np.concatenate(
            [
                condition.values(name, self._X[:, self._acting[name]], t).ravel()
                for name, condition in self._conditions.items()
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


def _turns(n_dofs: int, dofs: ndarray, n: ndarray) -> csr_matrix | None:
    """Identity, but for the nodes whose first unknown is to lie along ``n``."""
    if dofs.size == 0:
        return None
    turn = identity(n_dofs, format="lil")
    for (i, j), (c, s) in zip(dofs.T, n.T, strict=True):
        turn[i, i], turn[i, j], turn[j, i], turn[j, j] = c, -s, s, c
    return turn.tocsr()
