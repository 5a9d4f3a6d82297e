"""Displacement conditions along any direction."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np
from numpy import ndarray
from numpy.typing import ArrayLike
from skfem import CellBasis

from ...fabric import Direction, unit_vectors
from ...mesh.selection import Where, selected_nodes
from ...mesh.user_input import call_user_function, real_numbers

Value: TypeAlias = (
    ArrayLike | Sequence[ArrayLike | None] | Callable[[ndarray, float], ndarray]
)


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
        per node, shape (d, n), with d = 2 components in the plane and 3 in space.
        Either a function ``value(X, t)`` of reference
        position and load factor, or a constant that is reached in proportion to
        the load factor.  Values per node are in the order in which the node numbers
        are given, and of ascending numbers where none are.  Of constant components
        those that are None stay free.
    direction
        The direction in which the displacement is fixed: a vector of d components or a
        function of position.  Without it the whole displacement is fixed.

    Examples
    --------
    A clamp, an edge pulled by 5 mm, a roller on a slope of 30°, and in space an edge
    that is pulled along y, does not move along x and is free along z:

    >>> clamp = Condition("bottom")
    >>> pulled = Condition("top", 5.0, direction=(0, 1))
    >>> roller = Condition(lambda x: x[0] > 99.9, direction=(-0.5, 3**0.5 / 2))
    >>> in_space = Condition("top", (0.0, 5.0, None))
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

    def directions(self, name: str, X: ndarray, d: int = 2) -> ndarray:
        """Fixed directions at nodes, shape (k, d, n), with k from 1 to d."""
        shape = d, X.shape[1]
        if self.direction is None:
            axes = np.eye(d)[self._axes(name, d)]
            return np.broadcast_to(axes[:, :, None], (len(axes), *shape))
        what = f"condition {name!r}: direction"
        n = unit_vectors(what, self.direction, X, d=d)
        return np.broadcast_to(n, shape)[None]

    def values(self, name: str, X: ndarray, t: float, d: int = 2) -> ndarray:
        """Displacements along the fixed directions, shape (k, n)."""
        what, function = f"condition {name!r}: the value", self.value
        axes, n_nodes = self._axes(name, d), X.shape[1]
        given: Any = function
        if callable(function):
            given = call_user_function(what, function, X, t)
        elif len(axes) < d:
            given = [x for x in given if x is not None]
        value = real_numbers(what, given)
        if not np.all(np.isfinite(value)):
            raise ValueError(f"{what} is not finite at load factor {t:g}")
        if not callable(function):
            value = t * value
            if value.shape == (len(axes),) and self.direction is None:
                value = np.broadcast_to(value[:, None], (len(axes), n_nodes))
        shape = (len(axes), n_nodes) if self.direction is None else (n_nodes,)
        one_for_all = value.ndim == 0 and (self.direction is not None or value == 0)
        if value.shape != shape and not one_for_all:
            raise ValueError(
                f"condition {name!r}: the value must have shape {shape}, "
                f"not {value.shape}"
            )
        return np.broadcast_to(value, shape).reshape(-1, n_nodes)

    def _axes(self, name: str, d: int) -> list[int]:
        """Numbers of the components that are fixed where there is no direction."""
        value = self.value
        if not isinstance(value, list | tuple) or all(x is not None for x in value):
            return list(range(d))
        axes = [i for i, x in enumerate(value) if x is not None]
        if self.direction is not None or len(value) != d or not axes:
            raise ValueError(
                f"condition {name!r}: the value {value} must have {d} components, some "
                "of them numbers and None where it is free, and no direction beside it"
            )
        return axes

    def turned(self, Q: ndarray) -> "Condition":
        """The same condition in a problem turned in its plane by the rotation Q."""
        if self.direction is None and len(axes := self._axes("turned", 2)) < 2:
            (axis,), value = axes, self.value
            along: Any = np.eye(2)[axis]
            return Condition(self.where, value[axis], along).turned(Q)  # type: ignore[index, arg-type]
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
