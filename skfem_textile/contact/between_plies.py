"""Contact of two plies of a stack.

The gap of a contact point of one ply is its distance from the smooth surface through
the contact points of the other one (`PlySurface`), less half of both thicknesses.  The
points belong to the ply with the smaller elements, so that none of its nodes is between
points.  Forces act along the normal of the surface, on the point and, by the weights of
its foot, on the nodes around it.  The tangent contains the curvature of the surface,
which acts on both plies with opposite signs, and not its change with the weights: it is
the second derivative where both plies slide along one surface, as on a tool.
"""

from collections.abc import Callable, Sequence
from typing import Any, ClassVar, NamedTuple

import numpy as np
from numpy import ndarray
from scipy.sparse import bsr_matrix, csr_matrix, diags, kron

from ..mesh.pattern import padded
from ..ply.parameters import NO_VALUES, Values
from ..ply.terms import ContactTerm
from .friction import Friction
from .layers import Layers
from .obstacle import ToolParameters
from .ply_surface import Feet

# Depth of a chord that cuts a right angle, relative to its length: a node of the ply
# with the larger elements that is deeper inside the other one, by the size of its
# elements, is behind it.
_INSIDE = np.sqrt(2) / 4


# Weight of a node that is round-off: nodes that lie on each other would be coupled with
# all nodes around them.
_NO_WEIGHT = 1e-9


class _Feet(NamedTuple):
    """Contact points, their feet, and the weights of their relative motions."""

    x: ndarray
    feet: Feet
    relative: csr_matrix
    coupled: csr_matrix


class _Gaps(NamedTuple):
    """Gaps of all nodes and their unit normals, (n_nodes,) and (3, n_nodes)."""

    gap: ndarray
    normal: ndarray


class PlyContact(ContactTerm):
    """Contact of two plies of a `Stack`.

    Attributes
    ----------
    between
        Numbers of the plies, the lower first, from 0.
    rows
        Nodes whose contact points have gaps.
    """

    of_plies: ClassVar[bool] = True
    amounts = ()

    def __init__(self, layers: Layers, between: tuple[int, int]) -> None:
        self.between = between
        self.name = "plies {} and {}".format(*(1 + i for i in between))
        finer = min(between, key=lambda i: layers.size_of[i])
        coarser = sum(between) - finer
        self._side = 1.0 if finer > coarser else -1.0
        bare = layers.bare(*between)
        self.rows = np.flatnonzero(bare & (layers.ply == finer))
        self._others = np.flatnonzero(bare & (layers.ply == coarser))
        self._surface, self._back = layers.surfaces[coarser], layers.surfaces[finer]
        self._size = layers.size_of[coarser]
        self._half = 0.5 * layers.size_of[finer] / self._size
        self._apart = 0.5 * layers.thickness[list(between)].sum()
        self._points = layers.points
        self.points = self._points.matrix
        self.areas = np.zeros(layers.ply.size)
        self.areas[self.rows] = layers.areas[self.rows]
        self.parameters = _Forces(self)
        self._layers = layers
        self._last: tuple[Any, _Gaps | None] = (), None
        self._last_placed: tuple[Any, Any] = None, None
        self._last_feet: tuple[bytes, _Feet | None] = b"", None

    @staticmethod
    def figures(result: Any) -> dict[str, Any]:
        """See `stack_figures.between_plies`."""
        from .stack_figures import between_plies

        return between_plies(result)

    def gaps(self, u: ndarray, t: float, p: Values = NO_VALUES) -> ndarray:
        """See `ContactTerm.gaps`; those beyond the edges are infinite."""
        at = self._at(u, t)
        within = p["within"] > 0 if "within" in p else self.within(u)
        return np.where(within, at.gap, np.inf)

    def within(self, u: ndarray) -> ndarray:
        """True for nodes of which at least half of the area is on the other ply."""
        within = np.zeros(self.areas.size, dtype=bool)
        within[self.rows] = self._on(u).feet.off <= self._half
        return within

    def normals(self, u: ndarray, t: float) -> ndarray:
        """See `ContactTerm.normals`."""
        return self._at(u, t).normal

    def relative(self, u: ndarray) -> csr_matrix:
        """See `ContactTerm.relative`."""
        return self._on(u).relative

    def coupled(self, u: ndarray, p: Values) -> Sequence[csr_matrix]:
        """See `ContactTerm.coupled`."""
        rubs = self.friction and p["bound"].any()
        return [self._on(u).coupled, *([self.friction.matrix(p)] if rubs else ())]

    def around(self, u: ndarray) -> csr_matrix:
        """See `ContactTerm.around`."""
        n, nodes = self.areas.size, self._on(u).feet.nodes
        every = np.vstack([nodes, self.rows])
        at = np.tile(self.rows, len(every)), every.ravel()
        return csr_matrix(csr_matrix((np.ones(every.size), at), (n, n)) @ self.points)

    def curved(self, u: ndarray, t: float, forces: ndarray) -> tuple[ndarray, ndarray]:
        """See `ContactTerm.curved`."""
        feet = self._on(u).feet
        turn = self._side * forces[self.rows] * feet.turn
        W = feet.matrix(self.rows, self.areas.size)[self.rows]
        blocks = np.zeros((3, 3, self.areas.size))
        blocks[..., self.rows] = turn
        blocks -= (W.T @ turn.reshape(9, -1).T).T.reshape(blocks.shape)
        nodes = np.flatnonzero(blocks.any(axis=(0, 1)))
        return nodes, blocks[..., nodes]

    def forces(self, u: ndarray, t: float, p: Values) -> ndarray:
        """See `ContactTerm.forces`."""
        gap, kappa = self.gaps(u, t, p), p["stiffness"]
        pressed = p["force"] - kappa * np.where(np.isfinite(gap), gap, 0.0)
        return np.where(np.isfinite(gap), np.maximum(pressed, 0.0), 0.0)

    def potential(self, u: ndarray, t: float, p: Values) -> float:
        """Σ (max(λ − κ g, 0)² − λ²)/2κ."""
        if not (kappa := p["stiffness"]).any():
            return 0.0
        force = self.forces(u, t, p)
        return float(((force**2 - p["force"] ** 2) / (2 * kappa)).sum())

    def energy(self, u: ndarray, t: float, p: Values = NO_VALUES) -> float:
        """The potential, and the incremental potential of friction."""
        energy = self.potential(u, t, p)
        return energy + self.friction.energy(u, t, p) if self.friction else energy

    def residual(self, u: ndarray, t: float, p: Values = NO_VALUES) -> ndarray:
        """Forces along the normals, opposite on both plies, and friction."""
        f = np.zeros_like(u)
        if p["stiffness"].any():
            pressed = self.forces(u, t, p) * self.normals(u, t)
            f -= np.ravel(self.relative(u).T @ pressed.T)
        if self.friction and p["bound"].any():
            f += np.ravel(self.friction.matrix(p).T @ self.friction.forces(u, t, p))
        return f

    def blocks(
        self, u: ndarray, t: float, p: Values
    ) -> Sequence[tuple[csr_matrix, ndarray]]:
        """See `ContactTerm.blocks`."""
        found = []
        if self.friction and p["bound"].any():
            rubs = self.friction.stiffness(u, t, p)
            found.append((self.friction.matrix(p), rubs))
        if (kappa := p["stiffness"]).any():
            touches, n = self.forces(u, t, p) > 0, self.normals(u, t)
            nodes, curved = self.curved(u, t, p["force"])
            every = np.zeros((3, 3, kappa.size))
            every[..., nodes] = -curved
            stiffness = np.where(touches, kappa, 0.0) * n[:, None] * n
            found += [(self._on(u).coupled, stiffness), (self.points, every)]
        return found

    def tangent(self, u: ndarray, t: float, p: Values = NO_VALUES) -> csr_matrix | None:
        """Derivative of the residual with the parameters and feet held fixed."""
        K = csr_matrix((len(u), len(u)))
        for weights, D in self.blocks(u, t, p):
            n = D.shape[2]
            whole = bsr_matrix((D.transpose(2, 0, 1), np.arange(n), np.arange(n + 1)))
            W = kron(weights, np.eye(3)).tocsr()
            K = K + W.T @ whole @ W
        return K if K.nnz else None

    def couples(self) -> Sequence[ndarray]:
        """Nodes of the plies on each other at rest."""
        rows = self._on(np.zeros(3 * self.areas.size)).coupled[self.rows]
        return [padded(rows)[0]]

    def gaps_at(self, x: ndarray, t: float) -> ndarray:
        """See `ContactTerm.gaps_at`: no tool limits any point."""
        return np.full(x.shape[1], np.inf)

    def travel(self, t: float) -> ndarray:
        """Zero: the plies are not driven."""
        return np.zeros(3)

    def rotation(self, t: float) -> float:
        """Zero."""
        return 0.0

    def passed(self, u_0: ndarray, t_0: float, u: ndarray, t: float) -> ndarray:
        """Nodes of the ply with the larger elements that are inside the other one."""
        x, nodes = self._points.in_planes(u), self._others
        if not (nodes.size and self.rows.size):
            return nodes[:0]
        feet = self._back.feet(x, x[:, nodes])
        depth = self._apart + self._side * feet.heights(x[:, nodes])
        inside = (feet.off == 0) & (depth > _INSIDE * self._size)
        return nodes[inside]

    def with_friction(self, coefficient: Callable[[float], float], slip: float) -> None:
        """Add Coulomb friction, see `Friction`."""
        of, at = lambda t: (np.eye(3), np.zeros(3)), self._points.in_planes
        self.friction = _FrictionOfPlies(coefficient, slip, of, at, constrains=False)
        self.friction._term = self

    def placed(self, x: ndarray) -> tuple[csr_matrix, csr_matrix]:
        """Weights of the nodes, and of their contact points x, in relative motions."""
        known, both = self._last_placed
        if known is not x:
            W = self._weights(self._surface.feet(x, x[:, self.rows]))
            both = csr_matrix(W @ self.points), W
            self._last_placed = x, both
        return both

    def _weights(self, feet: Feet, least: float = _NO_WEIGHT) -> csr_matrix:
        """Weights of contact points in motions relative to the other ply."""
        n = self.areas.size
        own = np.zeros(n)
        own[self.rows] = 1.0
        return csr_matrix(diags(own) - feet.matrix(self.rows, n, least))

    def _at(self, u: ndarray, t: float) -> _Gaps:
        """Gaps at a displacement; the last ones are kept."""
        key, (known, last) = (u.tobytes(), t), self._last
        if last is not None and key == known:
            return last
        (x, feet, *_), n = self._on(u), self.areas.size
        gap, normal = np.full(n, np.inf), np.zeros((3, n))
        gap[self.rows] = self._side * feet.heights(x[:, self.rows]) - self._apart
        normal[:, self.rows] = self._side * feet.normal
        self._last = key, (gaps := _Gaps(gap, normal))
        return gaps

    def _on(self, u: ndarray) -> _Feet:
        """Feet at a displacement; the last ones are kept."""
        key, (known, last) = u.tobytes(), self._last_feet
        if last is not None and key == known:
            return last
        x = self._points.in_planes(u)
        feet = self._surface.feet(x, x[:, self.rows])
        every = (self._weights(feet, least) for least in (0.0, _NO_WEIGHT))
        both = [csr_matrix(W @ self.points) for W in every]
        self._last_feet = key, (on := _Feet(x, feet, *both))
        return on


class _Forces(ToolParameters):
    """Contact forces and stiffnesses, the nodes that may touch in a step, friction."""

    _term: Any

    def at_rest(self) -> Values:
        """No contact."""
        zero = np.zeros(self._term.areas.size)
        within = self._term.within(np.zeros(3 * zero.size)).astype(float)
        values = {"force": zero, "stiffness": zero, "within": within}
        return self.with_friction_at_rest(values)

    def advanced(self, values: Values, u: ndarray, t: float) -> Values:
        """Also nodes above or below the other ply, by their positions after a step."""
        within = self._term.within(u).astype(float)
        return Values({**super().advanced(values, u, t), "within": within})

    def _without_friction(self, values: Values, u: ndarray, t: float) -> Values:
        """Multipliers max(λ − κ g, 0)."""
        return Values({**values, "force": self._term.forces(u, t, values)})


class _FrictionOfPlies(Friction):
    """Friction of the contact points of one ply on another one.

    ``slips_from`` are the contact points of both plies at the last state, and
    ``placed`` those for which the feet are computed, which are updated together with
    the normals.
    """

    _term: Any

    def at_rest(self, u: ndarray) -> dict[str, Any]:
        """See `Friction.at_rest`."""
        return {**super().at_rest(u), "placed": self._positions(u)}

    def matrix(self, p: Values) -> csr_matrix:
        """Weights of the nodes in the slips, shape (n_nodes, n_nodes)."""
        return self._term.placed(p["placed"])[0]

    def _over(self, motion: ndarray, p: Values) -> ndarray:
        return np.asarray((self._term.placed(p["placed"])[1] @ motion.T).T)

    def bounded(
        self, p: Values, u: ndarray, t: float, normals: ndarray, bound: ndarray
    ) -> Values:
        """See `Friction.bounded`."""
        after = super().bounded(p, u, t, normals, bound)
        return Values({**after, "placed": self._positions(u)})
