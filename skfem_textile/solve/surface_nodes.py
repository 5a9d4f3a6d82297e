"""Nodes constrained to surfaces: eliminated normals, contact forces, curvature.

A node on a surface φ = 0 moves in its tangent plane.  If linear conditions also fix
directions of the node, ∇φ is projected: with the projector P onto the remaining
directions, the fixed direction is n = P∇φ/‖P∇φ‖. The equilibrium is ∂E/∂x = λ∇φ along
the fixed directions, and its tangent is the second derivative of E less λ∇²φ.
"""

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from numpy import ndarray
from scipy.sparse import bsr_matrix, csr_matrix, identity
from skfem import CellBasis

from ..surfaces.surface import (
    OffSurfaceError,
    SurfaceGaps,
    distance,
    exponential_map,
    gaps,
    is_on,
    onto,
    triangle_sums,
)
from .on_surface import (
    CheckedSurface,
    OnSurface,
    SurfaceError,
    check_surface,
)
from .states import NoEquilibriumError

#: Angle in radians below which two directions at a node count as one, and fixed
#: directions include a normal.  A larger angle would merge intentionally different
#: directions; with a smaller one, round-off of normals would fix a node in a second
#: direction.
PARALLEL_ANGLE = 1e-6

# Number of steps along the geodesics that carry a ply.  Measured on a sphere, over a
# quarter of its circumference: the error is 1e-3 of the radius, sufficient for an
# initial guess; each step evaluates the surface three times, which is expensive for
# triangles.
_STEPS = 4


class _Values(NamedTuple):
    """φ, ∇φ and ∇φ/‖∇φ‖ at the nodes; the unit vector n of the module, and n·∇φ."""

    level: ndarray
    gradient: ndarray
    normals: ndarray
    across: ndarray
    slope: ndarray


class SurfaceNodes:
    """Nodes constrained to surfaces by conditions.

    Contact forces and curvatures are defined as in `ContactTerm`.

    Parameters
    ----------
    conditions
        `OnSurface` by name.
    nodes
        Nodes of each condition, by name.
    X
        Reference positions of all nodes, shape (2, n_nodes).
    turn
        Matrix from the unknowns of linear conditions to the Cartesian ones, or None.
    prescribed
        Numbers of the unknowns fixed by linear conditions.

    Attributes
    ----------
    nodes
        Numbers of the nodes on a surface that linear conditions do not fix completely.
    eliminated
        Number of the unknown fixed by the surface, for each of them.

    Raises
    ------
    ValueError
        If a surface is not valid, or a node is on two surfaces.
    """

    def __init__(
        self,
        conditions: Mapping[str, OnSurface],
        nodes: Mapping[str, ndarray],
        X: ndarray,
        turn: csr_matrix | None,
        prescribed: ndarray,
    ) -> None:
        self.conditions = dict(conditions)
        self._parts: list[tuple[str, OnSurface, ndarray]] = []
        self._X = np.pad(X, ((0, 1), (0, 0)))
        self.points = csr_matrix(identity(X.shape[1]))
        n_nodes = X.shape[1]
        every = identity(3 * n_nodes, format="csr") if turn is None else turn
        self._frames = every.tobsr((3, 3)).data
        free = np.ones(3 * n_nodes, dtype=bool)
        free[prescribed] = False
        self._free = free.reshape(-1, 3)
        for name, condition in conditions.items():
            at = self._X[:, nodes[name]]
            check_surface(f"condition {name!r}", condition.surface, at)
        is_assigned = np.zeros(n_nodes, dtype=bool)
        for name, condition in conditions.items():
            free_nodes = nodes[name][self._free[nodes[name]].any(axis=1)]
            if is_assigned[free_nodes].any():
                node = free_nodes[is_assigned[free_nodes]].min()
                raise ValueError(
                    f"condition {name!r}: node {node} is also on another surface; a "
                    "node can be on one surface only"
                )
            is_assigned[free_nodes] = True
            self._parts.append((name, condition, free_nodes))
        self.nodes = np.concatenate([free_nodes for _, _, free_nodes in self._parts])
        first = self._free[self.nodes].argmax(axis=1)
        self.eliminated = 3 * self.nodes + first
        columns = self._frames[self.nodes] * self._free[self.nodes][:, None]
        self._projector = columns @ columns.swapaxes(1, 2)
        self._u, self._t = np.empty(0), 0.0
        self._last: _Values | None = None
        self._turn: csr_matrix | None = None
        self._laid: dict[float, ndarray] = {}

    def check(self, t: float) -> None:
        """Refuse surfaces that cannot grow out of the plane of the ply."""
        for name, condition, _ in self._parts:
            condition.at(name, t)

    def _at(self, u: ndarray, t: float) -> _Values:
        """Values at a displacement; the last evaluation is kept.

        Raises an error if conditions already fix the normal of a node.
        """
        if self._last and t == self._t and np.array_equal(u, self._u):
            return self._last
        x = self._positions(u)
        surfaces = [(s, x[:, nodes]) for s, nodes in self._surfaces(t)]
        level = np.concatenate([s.level(at) for s, at in surfaces])
        gradient = np.concatenate([s.gradient(at) for s, at in surfaces], axis=1)
        along = np.einsum("nij,jn->in", self._projector, gradient)
        length = np.linalg.norm(along, axis=0)
        lost = length <= PARALLEL_ANGLE * np.linalg.norm(gradient, axis=0)
        if lost.any():
            node = self.nodes[lost.argmax()]
            raise NoEquilibriumError(
                f"other conditions already fix node {node} normal to its surface",
                advice="fewer conditions there",
            )
        self._u, self._t, self._turn = u.copy(), t, None
        normals = gradient / np.linalg.norm(gradient, axis=0)
        self._last = _Values(level, gradient, normals, along / length, length)
        return self._last

    def fixed_directions(
        self, u: ndarray, t: float
    ) -> list[tuple[str, ndarray, ndarray]]:
        """See `Constraints.fixed_directions`: the normals of each condition."""
        normals = np.full(self._X.shape, np.nan)
        normals[:, self.nodes] = self._at(u, t).normals
        return [(name, nodes, normals[:, nodes]) for name, _, nodes in self._parts]

    def forces(self, u: ndarray, t: float, f: ndarray) -> ndarray:
        """Contact forces that balance nodal forces (3, n_nodes), shape (n_nodes,)."""
        forces = np.zeros(f.shape[1])
        forces[self.nodes] = (f[:, self.nodes] * self._at(u, t).across).sum(axis=0)
        return forces

    def curved(self, u: ndarray, t: float, forces: ndarray) -> tuple[ndarray, ndarray]:
        """Forces times ∇²φ over n·∇φ at the nodes on which they act, see `ContactTerm`.

        Shapes (n,) and (3, 3, n).
        """
        x, curvatures = self._positions(u), np.zeros((3, 3, self._X.shape[1]))
        for surface, on in self._surfaces(t):
            curvatures[..., on] = surface.hessian(x[:, on])
        curvatures[..., self.nodes] /= self._at(u, t).slope
        nodes = np.flatnonzero(forces)
        return nodes, forces[nodes] * curvatures[..., nodes]

    def turn(self, u: ndarray, t: float) -> csr_matrix:
        """Matrix from the unknowns, of which ``eliminated`` are normal to surfaces."""
        values = self._at(u, t)
        if self._turn is None:
            frames, nodes = self._frames.copy(), self.nodes
            across = np.einsum("nij,in->nj", frames[nodes], values.across)
            # Householder reflection with n as its column ``first``.
            mirror = np.where(self._free[nodes], across, 0.0)
            row, first = np.arange(len(nodes)), self.eliminated - 3 * nodes
            mirror[row, first] += np.copysign(1.0, mirror[row, first])
            squared = (mirror**2).sum(axis=1)[:, None, None]
            reflection = np.eye(3) - 2 * mirror[:, :, None] * mirror[:, None] / squared
            frames[nodes] = frames[nodes] @ reflection
            n = len(frames)
            blocks = frames, np.arange(n), np.arange(n + 1)
            self._turn = bsr_matrix(blocks, shape=(3 * n, 3 * n)).tocsr()
        return self._turn

    def motion(self, u: ndarray, t: float, du: ndarray, along: bool = False) -> ndarray:
        """Increment corrected so that nodes move onto surfaces to first order.

        If ``along``, they move along surfaces.
        """
        at, moved, nodes = self._at(u, t), du.reshape(-1, 3).T.copy(), self.nodes
        missing = (at.gradient * moved[:, nodes]).sum(axis=0)
        missing += 0.0 if along else at.level
        moved[:, nodes] -= missing / at.slope * at.across
        return moved.T.ravel()

    def onto(self, u: ndarray, t: float) -> ndarray:
        """Displacement with nodes projected onto surfaces; an error if this fails."""
        x, first = self._positions(u), 0
        for (_, condition, _), (surface, nodes) in zip(
            self._parts, self._surfaces(t), strict=True
        ):
            free = self._projector[first : first + len(nodes)]
            first += len(nodes)
            try:
                x[:, nodes] = onto(surface, x[:, nodes], free, self._X[:, nodes])
            except OffSurfaceError as error:
                raise NoEquilibriumError(
                    f"{surface.what}: {error.what} at "
                    f"{condition.place(error.position)}",
                    advice="more steps, or an initial guess closer to the surface",
                ) from None
        return (x - self._X).T.ravel()

    def farthest(self, t: float) -> float:
        """Largest distance in mm by which projection moves a node of the flat ply.

        Infinite if the projection fails.
        """
        try:
            return float(np.abs(self.onto(np.zeros(self._X.size), t)).max())
        except NoEquilibriumError:
            return np.inf

    def carried(self, u: ndarray, before: float, t: float) -> ndarray | None:
        """Displacement carried from the surface at one load factor to that at another.

        Each node moves by the difference of the ends of its geodesics on the two
        surfaces.  None if geodesics do not reach every node.
        """
        if self._parts[0][1].where is not None:
            return None
        name, condition, _ = self._parts[0]
        X, touch = self._X[:2], condition.touch
        try:
            self._laid = {
                s: self._laid[s]
                if s in self._laid
                else exponential_map(
                    CheckedSurface(f"condition {name!r}", condition.at(name, s)),
                    *(X, touch),
                    steps=_STEPS,
                )
                for s in (before, t)
            }
            carried = self._laid[t] - self._laid[before]
            return self.onto(u + carried.T.ravel(), t)
        except (OffSurfaceError, NoEquilibriumError):
            return None

    def are_on(self, u: ndarray, t: float) -> bool:
        """True if the nodes are on their surfaces."""
        surfaces = self._surfaces(t)
        return all(is_on(s, self._positions(u)[:, nodes]) for s, nodes in surfaces)

    def gaps(self, u: ndarray, t: float, basis: CellBasis) -> SurfaceGaps:
        """Distance of elements from their surfaces between nodes."""
        return gaps(self._surfaces(t), self._positions(u), basis)

    def place(self, position: ndarray) -> str:
        """Position in a message, see `OnSurface.place`."""
        return self._parts[0][1].place(position)

    def levels(self, t: float) -> ndarray:
        """Numbers that identify surfaces: φ and ∇φ at positions, and triangles."""
        probe = self._X + 0.1 * np.sin(np.arange(self._X.size)).reshape(self._X.shape)
        surfaces = [(s, probe[:, nodes]) for s, nodes in self._surfaces(t)]
        try:
            values = [[*s.level(x), *s.gradient(x).flat] for s, x in surfaces]
        except SurfaceError as error:
            raise ValueError(str(error)) from error.__cause__
        triangles = [triangle_sums(one.surface) for _, one, _ in self._parts]
        return np.concatenate([np.empty(0), *values, *triangles])

    def facing(self, u: ndarray, t: float, elements: ndarray, n: ndarray) -> ndarray:
        """1 for elements oriented to their surface like most, −1 for the others.

        Elements that are not completely on surfaces count as 1.  ``elements`` are the
        nodes of each element, and ``n`` the normals (a₁×a₂), shape (3, n_elements).
        """
        normals = np.full(self._X.shape, np.nan)
        normals[:, self.nodes] = self._at(u, t).normals
        height = (normals[:, elements].mean(axis=1) * n).sum(axis=0)
        most = np.nansum(height)
        return np.where(height * np.copysign(1.0, most) < 0, -1.0, 1.0)

    def distances(self, centres: ndarray, elements: ndarray, t: float) -> ndarray:
        """Signed distances of the centres of elements from their surface.

        Zero for elements that are not completely on one surface.  ``elements`` are the
        nodes of each element, shape (n, n_elements).  Shape (n_elements,).
        """
        away = np.zeros(elements.shape[1])
        for surface, nodes in self._surfaces(t):
            on = np.flatnonzero(np.isin(elements, nodes).all(axis=0))
            away[on] = distance(surface, centres[:, on])
        return away

    def off(self, u: ndarray, t: float, distance: ndarray) -> ndarray:
        """Motion of the nodes off their surfaces by distances, shape (n_nodes,)."""
        at, moved = self._at(u, t), np.zeros(self._X.shape)
        far = distance[self.nodes] * np.linalg.norm(at.gradient, axis=0)
        moved[:, self.nodes] = far / at.slope * at.across
        return moved.T.ravel()

    def _surfaces(self, t: float) -> list[tuple[CheckedSurface, ndarray]]:
        """Surfaces at a load factor, and the nodes on each."""
        return [
            (CheckedSurface(f"condition {name!r}", c.at(name, t)), nodes)
            for name, c, nodes in self._parts
        ]

    def _positions(self, u: ndarray) -> ndarray:
        return self._X + u.reshape(-1, 3).T
