"""Displacement conditions, the constraints that they resolve to, and their forces."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, TypeAlias

import numpy as np
from numpy import ndarray
from numpy.typing import ArrayLike
from scipy.sparse import csr_matrix, identity
from skfem import CellBasis

from ..fabric import Direction, unit_vectors
from ..mesh.bases import components, node_dofs, node_positions
from ..mesh.selection import Where, selected_nodes, turned_where
from ..mesh.user_input import call_user_function, keep_copies, real_numbers, shortened
from ..ply.amount import SAME, Amount, AmountLike, proportional
from .on_surface import OnSurface
from .surface_nodes import PARALLEL_ANGLE, SurfaceNodes

Value: TypeAlias = (
    ArrayLike | Sequence[ArrayLike | None] | Callable[[ndarray, float], ndarray]
)

# Conditions agree at a node if their displacements differ by at most this share of the
# largest displacement and, for round-off, of the largest coordinate.
_AGREEING, _ROUND_OFF = 1e-9, 1e-15


@dataclass(frozen=True, eq=False)
class Condition:
    """Prescribed displacement of nodes, of all components or along one direction.

    Parameters
    ----------
    where
        The name of a boundary or of nodes of the mesh, a function of position ``(2, n)
        -> (n,) bool``, one bool per node of the ply (``ply.nodes``), or node numbers.
        The nodes of a ply are vertices, then edge midpoints if the element has nodes
        there.
    value
        Displacement in mm: with a direction, a scalar per node; without, a vector per
        node, shape (d, n), with d = 2 components in the plane and 3 in space.  Either a
        function ``value(X, t)`` of reference position and load factor, or a constant
        that is reached in proportion to the load factor.  Values per node are in the
        order of the given node numbers, or of ascending node numbers if none are given.
        Components of a constant that are None are free.
    direction
        The direction in which the displacement is fixed: a vector of d components or a
        function of position.  If not given, all components are fixed.
    factor
        Function of the load factor that takes its place, such as a `Programme`.
    until
        Load factor at which the condition ends.  There its forces on the ply decrease
        to zero, in as many steps as the part of the run has: the ply springs back.
    together
        True if all nodes have the same displacement along the directions that are not
        fixed, as in a rigid clamp that is guided or hangs free.  Such a clamp does not
        rotate; its load is the sum of the forces on its nodes.

    Examples
    --------
    A clamp, an edge displaced by 5 mm, a roller on a slope of 30°, and in space an edge
    that is displaced along y, fixed along x and free along z; a rigid clamp that is
    displaced along x and moves freely along y:

    >>> clamp = Condition("bottom")
    >>> pulled = Condition("top", 5.0, direction=(0, 1))
    >>> roller = Condition(lambda x: x[0] > 99.9, direction=(-0.5, 3**0.5 / 2))
    >>> in_space = Condition("top", (0.0, 5.0, None))
    >>> rigid = Condition("top", (5.0, None), together=True)
    """

    where: Where
    value: Value = 0.0
    direction: Direction | None = None
    together: bool = False
    factor: AmountLike = proportional
    until: float = 1.0

    def __post_init__(self) -> None:
        keep_copies(self, "where", "value", "direction")
        if not 0 < self.until <= 1:
            raise ValueError(
                "until must be a load factor above 0 and at most 1, got "
                f"{shortened(self.until)}"
            )

    def nodes(self, name: str, basis: CellBasis) -> ndarray:
        """Numbers of the nodes of the condition, in the order of its values.

        Raises
        ------
        ValueError
            If the boundary is unknown, the nodes are not valid, or there are none.
        """
        return selected_nodes(f"condition {name!r}", self.where, basis)

    def directions(self, name: str, X: ndarray, d: int = 2) -> ndarray:
        """Fixed directions at the nodes, shape (k, d, n), with k from 1 to d."""
        shape = d, X.shape[1]
        if self.direction is None:
            axes = np.eye(d)[self._axes(name, d)]
            return np.broadcast_to(axes[:, :, None], (len(axes), *shape))
        what = f"condition {name!r}: direction"
        n = unit_vectors(what, self.direction, X, d=d)
        return np.broadcast_to(n, shape)[None]

    def shared_directions(self, name: str, X: ndarray, d: int = 2) -> ndarray:
        """Directions along which the nodes move together, shape (k, d).

        Raises
        ------
        ValueError
            If all directions are fixed, or other ones at each node.
        """
        if not self.together:
            return np.empty((0, d))
        if self.direction is None:
            shared = np.delete(np.eye(d), self._axes(name, d), axis=0)
        else:
            fixed = self.directions(name, X, d)
            if np.ptp(fixed, axis=2).max() > PARALLEL_ANGLE:
                raise ValueError(
                    f"condition {name!r}: nodes that move together must be fixed in "
                    "one direction: give a vector, not a function of position"
                )
            shared = np.linalg.svd(fixed[..., 0])[2][1:]
        if not len(shared):
            raise ValueError(
                f"condition {name!r}: together has no effect, because every component "
                "is fixed: set the components that are free to None, or omit it"
            )
        return shared

    def values(self, name: str, X: ndarray, t: float, d: int = 2) -> ndarray:
        """Displacements along the fixed directions, shape (k, n)."""
        what, data = f"condition {name!r}: the value", self.value
        if self.factor is not proportional:
            t = self.amount(name)(t)
        axes, n_nodes = self._axes(name, d), X.shape[1]
        if callable(self.value):
            data = call_user_function(what, self.value, X, t)
        elif len(axes) < d:
            data = [x for x in self.value if x is not None]  # type: ignore[union-attr]
        value = real_numbers(what, data)
        if not np.all(np.isfinite(value)):
            raise ValueError(f"{what} is not finite at load factor {t:g}")
        if not callable(self.value):
            value = t * value
            if value.shape == (len(axes),) and self.direction is None:
                value = np.broadcast_to(value[:, None], (len(axes), n_nodes))
        shape = (len(axes), n_nodes) if self.direction is None else (n_nodes,)
        one_for_all = value.ndim == 0 and (self.direction is not None or value == 0)
        if value.shape != shape and not one_for_all:
            raise ValueError(f"{what} must have shape {shape}, not {value.shape}")
        return np.broadcast_to(value, shape).reshape(-1, n_nodes)

    def amount(self, name: str) -> Amount:
        """Factor of the condition."""
        return Amount(f"condition {name!r}: its factor", self.factor)

    def _axes(self, name: str, d: int) -> list[int]:
        """Numbers of the fixed components of a condition without direction."""
        value = self.value
        if not isinstance(value, list | tuple) or all(x is not None for x in value):
            return list(range(d))
        axes = [i for i, x in enumerate(value) if x is not None]
        any_fixed = bool(axes) or self.together
        if self.direction is not None or len(value) != d or not any_fixed:
            raise ValueError(
                f"condition {name!r}: a value with None must have {d} components, at "
                "least one of them a number unless the nodes move together, and cannot "
                f"be combined with a direction; got {shortened(value)}"
            )
        return axes

    def turned(self, Q: ndarray) -> "Condition":
        """The same condition after a rotation Q of the problem in its plane."""
        where, direction = turned_where(self.where, Q), self.direction
        if direction is None and len(axes := self._axes("turned", 2)) < 2:
            if not axes:
                return replace(self, where=where)
            (axis,), value = axes, self.value
            along: Any = np.eye(2)[axis]
            component: Any = value[axis]  # type: ignore[index]
            return replace(self, value=component, direction=along).turned(Q)
        if direction is not None:
            direction = partial(_turned_direction, direction=direction, Q=Q)
        turned_value: Any = partial(_turned_value, condition=self, Q=Q)
        return replace(
            self,
            where=where,
            value=turned_value,
            direction=direction,
            factor=proportional,  # which the value includes
        )


def _turned_value(X: ndarray, t: float, condition: Condition, Q: ndarray) -> ndarray:
    n = condition.values("turned", Q.T @ X, t)
    return Q @ n if condition.direction is None else n[0]


def _turned_direction(X: ndarray, direction: Direction, Q: ndarray) -> ndarray:
    return Q @ unit_vectors("direction", direction, Q.T @ X)


#: Conditions on a ply by name.
Conditions: TypeAlias = Mapping[str, Condition | OnSurface]


class Constraints:
    """Conditions of a ply, resolved into fixed unknowns.

    Where inclined directions are fixed at a node and others are free, the unknowns of
    that node are rotated so that the first ones lie along the fixed directions: u =
    turn @ q.  Nodes that move together have one free unknown per direction, √n times
    their displacement, and n − 1 fixed ones, orthogonal to it, that are zero. Repeated
    conditions are merged.

    Parameters
    ----------
    basis
        Basis of the displacement.
    conditions
        `Condition` and `OnSurface` by name.

    Attributes
    ----------
    turn
        Orthogonal matrix from the rotated to the Cartesian unknowns; None if every
        fixed direction lies along an axis, and no nodes move together.  Nodes on
        surfaces are rotated further.
    shared
        Numbers of the free unknowns of nodes that move together.
    rounding
        Round-off of a fixed unknown over the round-off of a displacement.
    supports
        `Supports` of the displacement conditions.
    prescribed
        Numbers of the (rotated) unknowns fixed by displacement conditions.
    surfaces
        Nodes on surfaces; None if there are none.
    fixed, free
        Numbers of the fixed unknowns, including those normal to surfaces, and of the
        free ones.
    nodes
        Node numbers of each condition, by name: ascending and unique.
    fixed_directions
        For each displacement condition, and each direction that it fixes, its name, its
        nodes (n,) and unit vectors (d, n).

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
                    f"condition {name!r} must be a Condition such as "
                    f"Condition('bottom'), not {type(condition).__name__}"
                )
        if not conditions:
            raise ValueError("there are no conditions: specify displacement conditions")
        self._X, self._d = node_positions(basis), components(basis)
        acting = {name: c.nodes(name, basis) for name, c in conditions.items()}
        self.nodes = {name: np.unique(nodes) for name, nodes in acting.items()}
        on = {k: c for k, c in conditions.items() if isinstance(c, OnSurface)}
        self._conditions = [
            (name, c, self._X[:, acting[name]])
            for name, c in conditions.items()
            if isinstance(c, Condition)
        ]
        # Each row fixes one direction at one node.
        self.fixed_directions = [
            (name, acting[name], n)
            for name, condition, X in self._conditions
            for n in condition.directions(name, X, self._d)
        ]
        rows = ("", np.empty(0, int), np.empty((self._d, 0))), *self.fixed_directions
        _, node, direction = zip(*rows, strict=True)
        self._node, self._direction = np.concatenate(node), np.hstack(direction)
        self.supports = Supports(self._node, self._direction, self._X.shape[1])
        self._resolve(basis)
        self._determined = self.prescribed
        self.shared, self.rounding = np.empty(0, dtype=int), 1.0
        for name, condition, X in self._conditions:
            if len(shared := condition.shared_directions(name, X, self._d)):
                self._join(basis, name, shared, [*on])
        if on and self._d != 3:
            raise ValueError(
                f"condition {next(iter(on))!r}: a surface requires a ply in space: use "
                "Ply(..., dimension=3)"
            )
        geometry = self._X, self.turn, self.prescribed
        self.surfaces = SurfaceNodes(on, acting, *geometry) if on else None
        self.fixed = self.prescribed
        if self.surfaces:
            self.fixed = np.union1d(self.prescribed, self.surfaces.eliminated)
        free = np.ones(basis.N, dtype=bool)
        free[self.fixed] = False
        self.free = np.flatnonzero(free)

    def _resolve(self, basis: CellBasis) -> None:
        """Choose the prescribed unknowns."""
        d, dofs = self._d, node_dofs(basis)[:, : self._X.shape[1]]
        directions, count = self.supports.directions, self.supports.count
        projector = np.einsum("jin,jkn->ikn", directions, directions)
        crossed = projector * (1 - np.eye(d))[:, :, None]
        along_axes = (crossed == 0).all(axis=(0, 1)) | (count == d)
        inclined = np.flatnonzero(~along_axes)
        self.turn = _turns(basis.N, dofs[:, inclined], directions[..., inclined])

        axes = np.einsum("iin->in", projector) > 0.5
        first = np.arange(d)[:, None] < count
        fixed = np.where(count == d, True, np.where(along_axes, axes, first))
        self.prescribed = np.sort(dofs[fixed])

    def _join(
        self, basis: CellBasis, name: str, directions: ndarray, surfaces: list[str]
    ) -> None:
        """Give the nodes of a condition one unknown along each direction, (k, d)."""
        if surfaces:
            raise ValueError(
                f"condition {name!r}: its nodes move together, which cannot be "
                f"combined with a surface ({surfaces[0]!r})"
            )
        nodes, k = self.nodes[name], len(directions)
        dofs = node_dofs(basis)[:, nodes]
        motions = np.zeros((k, basis.N))
        motions[:, dofs] = directions[:, :, None] / np.sqrt(len(nodes))
        q = np.stack([turned(motion, self.turn) for motion in motions], axis=1)
        moved = np.abs(q).max(axis=1) > PARALLEL_ANGLE / np.sqrt(len(nodes))
        bound = np.append(self.prescribed, self.shared)
        if moved[bound].any():
            node = bound[moved[bound].argmax()] // self._d
            others = [x for x, at in self.nodes.items() if x != name and node in at]
            raise ValueError(
                f"condition {name!r}: its nodes move together, but "
                f"{' and '.join(map(repr, others))} restrains this motion at node "
                f"{node}, position {tuple(self._X[:, node].round(6).tolist())}"
            )
        at = np.flatnonzero(moved)
        block = np.linalg.qr(q[at], mode="complete").Q
        block[:, :k] = q[at]
        joined = identity(basis.N, format="lil")
        joined[np.ix_(at, at)] = block
        self.turn = (joined if self.turn is None else self.turn @ joined).tocsr()
        self.prescribed = np.union1d(self.prescribed, at[k:])
        self.shared = np.append(self.shared, at[:k])
        self.rounding = max(self.rounding, float(np.sqrt(len(at))))

    @property
    def amounts(self) -> list[Amount]:
        """Factors of the conditions."""
        return [c.amount(name) for name, c, _ in self._conditions]

    def fixed_values(self, t: float) -> ndarray:
        """Values of the prescribed unknowns at the load factor ``t``.

        Raises an error if two conditions prescribe different displacements of a node or
        if a surface cannot grow.
        """
        if self.surfaces:
            self.surfaces.check(t)
        values = np.zeros(len(self.prescribed))
        if not len(self._node):
            return values
        g = np.concatenate(
            [c.values(name, X, t, self._d).ravel() for name, c, X in self._conditions]
        )
        u, n = np.zeros((self._X.shape[1], self._d)), self._direction
        np.add.at(u, self._node, (g * n).T)
        u = self.supports.divided(u.T)  # least squares where conditions disagree
        remainder = np.abs((n * u[:, self._node]).sum(axis=0) - g)
        allowed = _AGREEING * np.abs(g).max() + _ROUND_OFF * np.abs(self._X).max()
        if remainder.max() > allowed:
            node = self._node[remainder.argmax()]
            names = [name for name, nodes in self.nodes.items() if node in nodes]
            raise ValueError(
                f"the displacements prescribed by {' and '.join(map(repr, names))} "
                f"disagree at node {node}, position "
                f"{tuple(self._X[:, node].round(6).tolist())}, at load factor {t:g}"
            )
        q = turned(u.T.ravel(), self.turn)[self._determined]
        values[np.searchsorted(self.prescribed, self._determined)] = q
        return values


def constraints_after(
    basis: CellBasis,
    conditions: Conditions,
    load_factors: Sequence[float],
    nodes: dict[str, ndarray],
) -> dict[float, Constraints]:
    """Constraints after each load factor below 1 at which conditions end.

    Parameters
    ----------
    basis, conditions
        Basis of the displacement, and all conditions.
    load_factors
        Load factors at which steps end.
    nodes
        Nodes of all conditions, whose forces are reported.

    Raises
    ------
    ValueError
        If an end is not a load factor of a step, or no condition remains.
    """
    ends: dict[float, list[str]] = {}
    for name, condition in conditions.items():
        if (until := getattr(condition, "until", 1.0)) >= 1:
            continue
        near = min(load_factors, key=lambda t: abs(t - until))
        if abs(near - until) > SAME:
            raise ValueError(
                f"condition {name!r} ends at the load factor {until:g}, within a step: "
                f"choose steps such that one ends there, or {near:g}"
            )
        ends.setdefault(near, []).append(name)
    left, after = dict(conditions), dict[float, Constraints]()
    for end in sorted(ends):
        for name in ends[end]:
            del left[name]
        if not left:
            raise ValueError(
                f"no condition remains beyond the load factor {end:g}: hold the ply "
                "against motions without deformation, such as at two nodes"
            )
        after[end] = Constraints(basis, left)
        after[end].nodes = nodes
    return after


class Supports:
    """Fixed directions n at each node, and their sums S of n⊗n.

    A displacement u has the components g = n·u along the directions: u = S⁻¹ Σ g n.

    Parameters
    ----------
    node, direction
        Node and unit vector of each fixed direction, shapes (k,) and (d, k).
    n_nodes
        Number of nodes.

    Attributes
    ----------
    directions, count
        Orthonormal fixed directions of each node, shape (d, d, n_nodes), padded with
        zeros, and their number, (n_nodes,).
    """

    def __init__(self, node: ndarray, direction: ndarray, n_nodes: int) -> None:
        d, of_nodes = len(direction), _fixed_directions(node, direction, n_nodes)
        self.directions, self.count = of_nodes
        self._nodes = np.flatnonzero(self.count)
        # S in the basis of the directions, and 1 for those that are missing.
        along = np.einsum("jik,ik->kj", self.directions[..., node], direction)
        sums = np.zeros((n_nodes, d, d))
        np.add.at(sums, node, along[:, :, None] * along[:, None])
        sums[:, range(d), range(d)] += np.arange(d) >= self.count[:, None]
        found = self.directions[..., self._nodes]
        inverse = np.linalg.inv(sums[self._nodes])
        self._inverse = np.einsum("jin,njk,kmn->nim", found, inverse, found)

    def divided(self, vectors: ndarray) -> ndarray:
        """S⁻¹ times nodal vectors, shape (d, n_nodes); zero at other nodes."""
        result, nodes = np.zeros_like(vectors), self._nodes
        result[:, nodes] = np.einsum("nij,jn->in", self._inverse, vectors[:, nodes])
        return result


def _fixed_directions(
    node: ndarray, direction: ndarray, n_nodes: int
) -> tuple[ndarray, ndarray]:
    """Orthonormal fixed directions at each node, and their number; see `Supports`."""
    d = len(direction)
    directions, count = np.zeros((d, d, n_nodes)), np.zeros(n_nodes, dtype=int)
    # The number of each row among the rows of its node.
    order = np.argsort(node, kind="stable")
    _, start, counts = np.unique(node[order], return_index=True, return_counts=True)
    number = np.empty(len(node), dtype=int)
    number[order] = np.arange(len(node)) - np.repeat(start, counts)
    for i in range(counts.max(initial=0)):
        rows = number == i
        at, n = node[rows], direction[:, rows]
        known = directions[..., at]
        share = np.einsum("jin,in->jn", known, n)
        remainder = n - np.einsum("jin,jn->in", known, share)
        length = np.linalg.norm(remainder, axis=0)
        new = length >= PARALLEL_ANGLE
        unit = np.where(count[at] > 0, remainder / np.where(new, length, 1.0), n)
        directions[count[at[new]], :, at[new]] = unit[:, new].T
        count[at[new]] += 1
    return directions, count


def _turns(n_dofs: int, dofs: ndarray, n: ndarray) -> csr_matrix | None:
    """Rotation of the unknowns of some nodes to fixed directions; None for none."""
    if dofs.size == 0:
        return None
    turn = identity(n_dofs, format="lil")
    for dof, (first, *others) in zip(dofs.T, n.transpose(2, 0, 1), strict=True):
        if len(first) == 2:
            frame = [first, [-first[1], first[0]]]
        else:
            second = others[0]
            if not second.any():
                second = np.cross(first, np.eye(3)[np.abs(first).argmin()])
                second = second / np.linalg.norm(second)
            frame = [first, second, np.cross(first, second)]
        turn[np.ix_(dof, dof)] = np.transpose(frame)
    return turn.tocsr()


def turned(u: ndarray, turn: csr_matrix | None) -> ndarray:
    """Transform a DOF vector to rotated unknowns."""
    return u if turn is None else turn.T @ u


def plain(q: ndarray, turn: csr_matrix | None) -> ndarray:
    """Transform a vector of rotated unknowns to a DOF vector."""
    return q if turn is None else turn @ q


def reactions(
    constraints: Constraints, forces: ndarray, u: ndarray, t: float
) -> dict[str, ndarray]:
    """Force of each condition on the ply in N, shape (d,).

    Nodal forces are divided where conditions share nodes. A condition exerts a
    force r on a node along the directions n that it fixes there. The reactions are
    the forces of the smallest Σ‖r‖² that sum to the nodal force f: with S the sum
    of n⊗n over all conditions at the node, each direction carries n (n·S⁻¹f). Equal
    directions thus carry equal shares, orthogonal ones their components of f.

    Parameters
    ----------
    constraints
        The conditions.
    forces
        Nodal forces in N, shape (d, n_nodes).
    u, t
        Displacement and load factor, on which the normals of surfaces depend.
    """
    supports, fixed = constraints.supports, constraints.fixed_directions
    if surfaces := constraints.surfaces:
        fixed = [*fixed, *surfaces.fixed_directions(u, t)]
        _, node, direction = zip(*fixed, strict=True)
        n = np.hstack(direction)
        supports = Supports(np.concatenate(node), n, forces.shape[1])
    weighted = supports.divided(forces)
    result = {name: np.zeros(len(forces)) for name in constraints.nodes}
    for name, nodes, n in fixed:
        result[name] += n @ (n * weighted[:, nodes]).sum(axis=0)
    return result


def travels(constraints: Constraints, u: ndarray) -> dict[str, ndarray]:
    """Prescribed displacement of each displacement condition in mm, shape (d,).

    It is the mean over its nodes along the directions that it fixes, of the nodal
    displacements ``u``, shape (d, n_nodes).
    """
    result: dict[str, ndarray] = {}
    for name, nodes, n in constraints.fixed_directions:
        along = (n * (n * u[:, nodes]).sum(axis=0)).mean(axis=1)
        result[name] = result.get(name, 0.0) + along
    return result
