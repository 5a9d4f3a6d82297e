"""Nodes on surfaces: normals that are eliminated, forces along them, curvature.

A node on a surface φ = 0 moves in its tangent plane.  Where linear conditions hold
directions of it too, ∇φ counts without them: with the projector P onto what they leave,
the node moves along its surface across n = P∇φ/‖P∇φ‖.  The equilibrium is
∂E/∂x = λ∇φ across what is held, and its tangent is that of E less λ∇²φ.
"""

from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy import ndarray
from scipy.sparse import bsr_matrix, csr_matrix, identity
from skfem import CellBasis

from ..states import NoEquilibriumError
from .asked import Asked, SurfaceError
from .between_nodes import Gaps, gaps
from .geodesics import exponential_map
from .surface import OffSurfaceError, is_on, onto

if TYPE_CHECKING:
    from .on_surface import OnSurface

# Sine of the angle between a normal and what conditions hold below which they hold the
# node across its surface already.  Chosen: far above rounding.
_HELD_ACROSS = 1e-6

# Steps along geodesics by which a ply is carried.  Chosen: on a sphere, over a quarter
# of its circumference, they end within 1e-3 of the radius, enough for a start; each
# asks the surface at three places, which of triangles takes long.
_STEPS = 4


class Contact(NamedTuple):
    """Nodes on surfaces, and the surfaces at them.

    Attributes
    ----------
    nodes
        Their numbers, shape (n,).
    level, gradient
        φ, shape (n,), and ∇φ, (3, n).
    across, slope
        The unit vector n, (3, n), and n·∇φ, (n,).
    """

    nodes: ndarray
    level: ndarray
    gradient: ndarray
    across: ndarray
    slope: ndarray


class SurfaceNodes:
    """The nodes that conditions keep on surfaces.

    Parameters
    ----------
    conditions
        `OnSurface` by name.
    nodes
        Nodes of each, by name.
    X
        Reference positions of all nodes, shape (2, n_nodes).
    turn
        The map from the unknowns of linear conditions to the plain ones, or None.
    prescribed
        Numbers of the unknowns that linear conditions fix.

    Attributes
    ----------
    nodes
        Numbers of the nodes on a surface that linear conditions do not hold whole.
    eliminated
        For each of them the number of the unknown that the surface fixes.

    Raises
    ------
    ValueError
        If the ply is no ply in space, what is given is no surface, or a node is to be
        on two surfaces.
    """

    def __init__(
        self,
        conditions: Mapping[str, "OnSurface"],
        nodes: Mapping[str, ndarray],
        X: ndarray,
        d: int,
        turn: csr_matrix | None,
        prescribed: ndarray,
    ) -> None:
        if d != 3:
            raise ValueError(
                f"condition {next(iter(conditions))!r}: only a ply in space lies on a "
                "surface: Ply(..., dimension=3)"
            )
        self._X = np.pad(X, ((0, 1), (0, 0)))
        n_nodes = X.shape[1]
        every = identity(3 * n_nodes, format="csr") if turn is None else turn
        self._frames = every.tobsr((3, 3)).data
        free = np.ones(3 * n_nodes, dtype=bool)
        free[prescribed] = False
        self._free = free.reshape(-1, 3)
        movable: ndarray = np.any(self._free, axis=1)
        for name, condition in conditions.items():
            condition.check(name, self._X[:, nodes[name]])
        self._parts = [
            (name, condition, nodes[name][movable[nodes[name]]])
            for name, condition in conditions.items()
        ]
        self.nodes = np.concatenate([own for _, _, own in self._parts])
        _refuse_two(self._parts, n_nodes)
        first = self._free[self.nodes].argmax(axis=1)
        self.eliminated = 3 * self.nodes + first
        columns = self._frames[self.nodes] * self._free[self.nodes][:, None]
        self._projector = columns @ columns.swapaxes(1, 2)
        self._kept: tuple[ndarray, float, dict[str, Any]] = np.empty(0), 0.0, {}
        self._laid: dict[float, ndarray] = {}

    def check(self, t: float) -> None:
        """Refuse surfaces that are not valid at a load factor.

        Raises
        ------
        ValueError
            If one cannot grow out of the plane of the ply.
        """
        for name, condition, _ in self._parts:
            condition.at(name, t)

    def contact(self, u: ndarray, t: float) -> Contact:
        """The surfaces at the nodes of a displacement.

        Raises
        ------
        NoEquilibriumError
            If a node is held across its surface already.
        """
        return self._keep("contact", u, t, self._found_contact)

    def _found_contact(self, u: ndarray, t: float) -> Contact:
        x = self._positions(u)
        surfaces = [(s, x[:, own]) for s, own in self._surfaces(t)]
        level = np.concatenate([s.level(at) for s, at in surfaces])
        gradient = np.concatenate([s.gradient(at) for s, at in surfaces], axis=1)
        along = np.einsum("nij,jn->in", self._projector, gradient)
        length = np.linalg.norm(along, axis=0)
        lost = length <= _HELD_ACROSS * np.linalg.norm(gradient, axis=0)
        if lost.any():
            node = self.nodes[lost.argmax()]
            raise NoEquilibriumError(
                f"conditions hold node {node} across its surface already",
                advice="fewer conditions there",
            )
        return Contact(self.nodes, level, gradient, along / length, length)

    def hessian(self, u: ndarray, t: float) -> ndarray:
        """∇²φ at the nodes, shape (n, 3, 3)."""
        x = self._positions(u)
        parts = [s.hessian(x[:, own]) for s, own in self._surfaces(t)]
        return np.concatenate(parts, axis=2).transpose(2, 0, 1)

    def turn(self, u: ndarray, t: float) -> csr_matrix:
        """The map from unknowns of which ``eliminated`` lie across surfaces."""
        return self._keep("turn", u, t, self._found_turn)

    def _found_turn(self, u: ndarray, t: float) -> csr_matrix:
        frames, own = self._frames.copy(), self.nodes
        across = np.einsum("nij,in->nj", frames[own], self.contact(u, t).across)
        across = np.where(self._free[own], across, 0.0)
        row = np.arange(len(own))
        first = self.eliminated - 3 * own
        mirror = across.copy()  # Householder: its reflection has n as column `first`
        mirror[row, first] += np.copysign(1.0, across[row, first])
        squared = (mirror**2).sum(axis=1)[:, None, None]
        reflection = np.eye(3) - 2 * mirror[:, :, None] * mirror[:, None] / squared
        frames[own] = frames[own] @ reflection
        n = len(frames)
        blocks = frames, np.arange(n), np.arange(n + 1)
        return bsr_matrix(blocks, shape=(3 * n, 3 * n)).tocsr()

    def motion(self, u: ndarray, t: float, du: ndarray) -> ndarray:
        """A motion of conditions, and what brings nodes onto surfaces to first order.

        Parameters
        ----------
        u
            Displacement.
        t
            Load factor.
        du
            Motion of what linear conditions fix, a DOF vector.
        """
        contact, moved = self.contact(u, t), du.reshape(-1, 3).T.copy()
        own = contact.nodes
        missing = contact.level + (contact.gradient * moved[:, own]).sum(axis=0)
        moved[:, own] -= missing / contact.slope * contact.across
        return moved.T.ravel()

    def onto(self, u: ndarray, t: float) -> ndarray:
        """The displacement with the nodes brought onto their surfaces.

        Raises
        ------
        NoEquilibriumError
            If a node does not get there.
        """
        x, place = self._positions(u), 0
        for surface, own in self._surfaces(t):
            free = self._projector[place : place + len(own)]
            place += len(own)
            try:
                x[:, own] = onto(surface, x[:, own], free)
            except OffSurfaceError as error:
                raise NoEquilibriumError(
                    f"condition {surface.name!r}: {error}",
                    advice="more steps, or a start that is nearer to the surface",
                ) from None
        return (x - self._X).T.ravel()

    def carried(self, u: ndarray, before: float, t: float) -> ndarray | None:
        """A displacement of the ply carried to its surface at another load factor.

        Each node moves by the difference of the ends of its geodesics on the two.  None
        where geodesics do not lay the whole ply.

        Parameters
        ----------
        u
            Displacement.
        before, t
            Load factors of the surface on which the ply is, and of the other.
        """
        name, condition, _ = self._parts[0]
        if condition.where is not None:
            return None
        X, touch = self._X[:2], condition.touch
        try:
            self._laid = {
                s: self._laid[s]
                if s in self._laid
                else exponential_map(
                    Asked(name, condition.at(name, s)), X, touch, steps=_STEPS
                )
                for s in (before, t)
            }
            carried = self._laid[t] - self._laid[before]
            return self.onto(u + carried.T.ravel(), t)
        except (OffSurfaceError, NoEquilibriumError):
            return None

    def are_on(self, u: ndarray, t: float) -> bool:
        """Whether the nodes are on their surfaces."""
        x = self._positions(u)
        return all(is_on(s, x[:, own]) for s, own in self._surfaces(t))

    def gaps(self, u: ndarray, t: float, basis: CellBasis) -> Gaps:
        """How far elements lie off their surfaces between nodes."""
        return gaps(self._surfaces(t), self._positions(u), basis)

    def levels(self, t: float) -> ndarray:
        """φ and ∇φ of each surface at a probe of positions, to tell surfaces apart.

        Raises
        ------
        ValueError
            If a surface fails there.
        """
        probe = self._X + 0.1 * np.sin(np.arange(self._X.size)).reshape(self._X.shape)
        surfaces = [(s, probe[:, own]) for s, own in self._surfaces(t)]
        try:
            found = [[*s.level(x), *s.gradient(x).flat] for s, x in surfaces]
        except SurfaceError as error:
            raise ValueError(str(error)) from error.__cause__
        return np.concatenate(found)

    def facing(self, u: ndarray, t: float, elements: ndarray, n: ndarray) -> ndarray:
        """1 for elements that face their surface as most do, −1 for the others.

        Elements that are not wholly on surfaces face it as most do.

        Parameters
        ----------
        u, t
            Displacement and load factor.
        elements
            Nodes of the elements, shape (n_nodes_of_element, n_elements).
        n
            Normals (a₁×a₂) of the elements, shape (3, n_elements).
        """
        contact, normals = self.contact(u, t), np.full(self._X.shape, np.nan)
        unit = contact.gradient / np.linalg.norm(contact.gradient, axis=0)
        normals[:, contact.nodes] = unit
        height = (normals[:, elements].mean(axis=1) * n).sum(axis=0)
        most = np.nansum(height)
        return np.where(height * np.copysign(1.0, most) < 0, -1.0, 1.0)

    def _keep(self, name: str, u: ndarray, t: float, found: Callable) -> Any:
        """What was found of the last displacement: an iteration asks several times."""
        last_u, last_t, kept = self._kept
        if t != last_t or not np.array_equal(u, last_u):
            kept = {}
            self._kept = u.copy(), t, kept
        if name not in kept:
            kept[name] = found(u, t)
        return kept[name]

    def _surfaces(self, t: float) -> list[tuple[Asked, ndarray]]:
        """The surfaces at a load factor, and the nodes on each."""
        return [(Asked(name, c.at(name, t)), own) for name, c, own in self._parts]

    def _positions(self, u: ndarray) -> ndarray:
        return self._X + u.reshape(-1, 3).T


def _refuse_two(
    parts: Sequence[tuple[str, "OnSurface", ndarray]], n_nodes: int
) -> None:
    """Refuse a node on two surfaces."""
    count = np.zeros(n_nodes, dtype=int)
    for name, _, own in parts:
        count[own] += 1
        if (count > 1).any():
            raise ValueError(
                f"condition {name!r}: node {count.argmax()} is on another surface too"
            )
