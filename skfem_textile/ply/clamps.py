"""Springs along an edge of a ply, which let go at a force.

A clamp of the stiffness k on an edge of the length L has the energy

    k/2L ∫ |P (u − a)|² ds

over its edge, with P = I, or P = n nᵀ for springs along the direction n only, and the
stretch a = n F₀/k of a preload F₀.  Its resultant is the sum of these forces, k P (ū −
a) with the mean displacement ū.  Where a step ends with a resultant of at least the
force of release, the clamp lets go: its energy is lost, and so is the energy that the
ply releases on its way to its equilibrium without the clamp.
"""

import logging
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy import ndarray
from scipy.sparse import csr_matrix
from skfem import BilinearForm, CellBasis, FacetBasis, LinearForm, asm
from skfem.helpers import dot

from .. import declarations as declared
from ..fabric import unit_vectors
from ..fabric.law import number
from ..mesh.bases import components, node_dofs
from ..mesh.selection import selected_nodes, turned_where
from ..mesh.splitting import was_split
from ..mesh.user_input import (
    call_user_function,
    keep_copies,
    real_numbers,
    refuse_in_files,
    shortened,
)
from .parameters import NO_VALUES, TermParameters, Values
from .terms import Term, named_edges

log = logging.getLogger(__name__)


@dataclass(frozen=True, eq=False)
class Clamp(declared.Clamp):
    """Springs along an edge of a ply: a gripper, which may let go; a term of a `Ply`.

    Parameters
    ----------
    edge
        Name of a boundary of the mesh; or nodes, as for `Condition`, whose edges of the
        boundary the clamp holds.
    stiffness
        Stiffness of the whole clamp in N/mm, shared by length along the edge.
    direction
        Direction, a vector of d components, in which the clamp pulls: the edge moves
        freely along the others.  By default springs in all directions.
    release
        Force in N, the magnitude of the resultant of the whole clamp on the computed
        part of the ply, at which it lets go.  By default it never does.
    preload
        Force in N along the direction with which the clamp pulls the undeformed edge.
    within
        Rectangle (smallest x and y, largest x and y) in mm, or a function of position
        ``(2, n) -> (n,) bool``: the clamp holds the edges within it.
    name
        Name of the term, of the force of the clamp, and of the travel of its edge.

    Examples
    --------
    A strip of 10 mm, pulled down by 1 mm, hangs on a clamp of 50 N/mm, which lets go at
    30 N:

    >>> from skfem import MeshQuad
    >>> from skfem_textile import Clamp, Condition, Fabric, LoadStepper, Ply
    >>> mesh = MeshQuad().refined(2).scaled(10.0).with_defaults()
    >>> clamp = Clamp("top", 50.0, release=30.0)
    >>> ply = Ply(mesh, Fabric(1e3, 1.0), terms=[clamp])
    >>> pulled = {"bottom": Condition("bottom", (0.0, -1.0))}
    >>> result = LoadStepper(ply, pulled, steps=2).run()
    >>> 30 <= result.summary()["clamp_release_force_N"] <= 1.01 * 30
    True
    >>> result.states[-1].reactions["clamp"].tolist()
    [0.0, 0.0]
    """

    def __post_init__(self) -> None:
        keep_copies(self, "edge", "direction", "within")

    def on(self, basis: CellBasis) -> "ClampTerm":
        """Term on a basis of the displacement.

        Raises
        ------
        ValueError
            If no edge of the boundary is selected, or a number or the direction is not
            valid.
        """
        what, d = f"clamp {self.name!r}", components(basis)
        refuse_in_files(what, self.name)
        k = number(f"{what}: stiffness", self.stiffness, above=0)
        preload = number(f"{what}: preload", self.preload)
        release = np.inf
        if self.release is not None:
            release = number(f"{what}: release", self.release, above=0)
        if preload >= release:
            raise ValueError(
                f"{what}: the preload of {preload:g} N reaches the release of "
                f"{release:g} N: the clamp would let go at once"
            )
        P, n = np.eye(d), np.zeros(d)
        if self.direction is not None:
            subject, X = f"{what}: direction", np.zeros((d, 1))
            n = unit_vectors(subject, self.direction, X, d=d)[:, 0]
            P = np.outer(n, n)
        elif preload:
            raise ValueError(f"{what}: a preload requires a direction: specify it too")
        facets = self._facets(what, basis)
        edges = FacetBasis(
            *(basis.mesh, basis.elem, basis.mapping), facets=facets, dofs=basis.dofs
        )
        weight = k / float(edges.dx.sum())

        @BilinearForm
        def springs(u, v, w):
            return weight * dot(np.tensordot(P, np.asarray(u), 1), v)

        K = csr_matrix(asm(springs, edges))
        K.eliminate_zeros()
        along = np.zeros(basis.N)
        along[node_dofs(basis)] = n[:, None]
        return ClampTerm(self.name, K, along * (preload / k), release, edges)

    def _facets(self, what: str, basis: CellBasis) -> ndarray:
        """Numbers of the edges that the clamp holds."""
        mesh: Any = basis.mesh
        if isinstance(self.edge, str) and self.edge in (mesh.boundaries or {}):
            facets = named_edges(what, mesh, self.edge)
        else:
            nodes = selected_nodes(what, self.edge, basis)
            facets = mesh.boundary_facets()
            if was_split(mesh):  # edges between selected nodes, at their midpoints
                corner, middle = mesh.facets[:, facets]
                both = np.bincount(middle, np.isin(corner, nodes)) == 2
                nodes = np.union1d(nodes, np.flatnonzero(both))
            facets = facets[np.isin(mesh.facets[:, facets], nodes).all(axis=0)]
        where, beside = "between the selected nodes", ""
        if isinstance(self.edge, str):
            where = f"on {self.edge!r}"
        if self.within is not None:
            beside = _extents(mesh.p[:, mesh.facets[:, facets]])
            where += " in the part that 'within' selects"
        facets = facets[self.inside(mesh.p)[mesh.facets[:, facets]].all(axis=0)]
        if not facets.size:
            raise ValueError(
                f"{what}: the mesh has no edge of the boundary {where}: choose at "
                f"least the two nodes of one edge{beside}"
            )
        return facets

    def inside(self, X: ndarray) -> ndarray:
        """True for positions, shape (2, n), within the rectangle if there is one."""
        what = f"clamp {self.name!r}: within"
        if self.within is None:
            return np.ones(X.shape[1], dtype=bool)
        if callable(self.within):
            chosen = np.asarray(call_user_function(what, self.within, X))
            if chosen.dtype != bool or chosen.shape != X.shape[1:]:
                raise ValueError(
                    f"{what} must return one bool for each position, shape "
                    f"{X.shape[1:]}, got {chosen.dtype} of shape {chosen.shape}"
                )
            return chosen
        box = real_numbers(what, self.within)
        if box.shape != (4,) or not (box[:2] < box[2:]).all():
            raise ValueError(
                f"{what} must be the smallest x and y and the largest x and y of a "
                f"rectangle, got {shortened(self.within)}"
            )
        return _in_rectangle(X, box)

    def turned(self, Q: ndarray) -> "Clamp":
        """The same clamp after a rotation Q of the problem in its plane."""
        within, direction = self.within, self.direction
        if within is not None:
            within = turned_where(self.inside, Q)
        if direction is not None:
            direction = Q @ direction
        edge = turned_where(self.edge, Q)
        return replace(self, edge=edge, direction=direction, within=within)


def _in_rectangle(X: ndarray, box: ndarray) -> ndarray:
    """True for points within a rectangle or, within round-off, on its sides."""
    off = 1e-9 * float(np.ptp([*X.ravel(), *box[np.isfinite(box)]]))
    low, high = box[:2, None] - off, box[2:, None] + off
    return np.asarray(((low <= X) & (high >= X)).all(axis=0))


def _extents(X: ndarray) -> str:
    """Where edges are, at the end of a message; positions of shape (2, 2, n)."""
    if not X.size:
        return ""
    low, high = X.min(axis=(1, 2)), X.max(axis=(1, 2))
    along = (
        f"{x} from {a:g} to {b:g} mm" for x, a, b in zip("xy", low, high, strict=True)
    )
    return f", which extend over {' and '.join(along)} in the axes of the ply"


class ClampTerm(Term):
    """Term of `Clamp`.

    Attributes
    ----------
    what
        The clamp, at the beginning of messages.
    """

    role = "internal"
    release: float

    def __init__(
        self,
        name: str,
        springs: csr_matrix,
        stretch: ndarray,
        release: float,
        edges: FacetBasis,
    ) -> None:
        self.name, self.what, self.release = name, f"clamp {name!r}", release
        self._springs, self._stretch, self._size = springs, stretch, edges.N
        self._d, mesh = components(edges), edges.mesh
        self._edges = mesh.facets[:, edges.find]
        weights = asm(LinearForm(lambda v, w: v[0]), edges)
        self._weights = weights[:: self._d] / float(edges.dx.sum())
        if np.isfinite(release):
            self.parameters = _Release(self)

    def energy(self, u: ndarray, t: float, p: Values = NO_VALUES) -> float:
        """Energy of the springs; after they let go, the energy lost."""
        if not holds(p):
            return float(p["work"])
        stretch = u - self._stretch
        return 0.5 * float(stretch @ (self._springs @ stretch))

    def residual(self, u: ndarray, t: float, p: Values = NO_VALUES) -> ndarray:
        """Nodal forces of the springs; zero after they let go."""
        if not holds(p):
            return np.zeros(self._size)
        return np.asarray(self._springs @ (u - self._stretch))

    def tangent(self, u: ndarray, t: float, p: Values = NO_VALUES) -> csr_matrix | None:
        """Stiffness of the springs; None after they let go."""
        return self._springs if holds(p) else None

    def misfit(self, basis: CellBasis) -> str:
        """Reason why the term does not fit a basis; empty if it does."""
        return "" if self._size == basis.N else "it belongs to another basis"

    def force(self, u: ndarray, p: Values) -> ndarray:
        """Resultant on the ply in N, shape (d,)."""
        of_nodes: ndarray = self.residual(u, 0.0, p).reshape(-1, self._d)
        return 0.0 - of_nodes.sum(axis=0)

    def travel(self, u: ndarray) -> ndarray:
        """Mean displacement of the edge in mm, shape (d,)."""
        moved: ndarray = self._weights @ u.reshape(-1, self._d)
        return moved

    def load(self, u: ndarray, p: Values) -> float:
        """Magnitude of the resultant relative to the force of release."""
        return float(np.linalg.norm(self.force(u, p))) / self.release

    def unsupported(self, supports: Any) -> str:
        """Reason why conditions leave the clamp without effect; empty if they do not.

        A clamp that conditions hold in part is valid, with a warning if this part is
        not just the end of an edge, as on a plane of symmetry.

        Parameters
        ----------
        supports
            Conditions as fixed unknowns, see `Constraints`.
        """
        K, turn = self._springs, supports.turn
        if turn is not None:
            K = csr_matrix(turn.T @ K @ turn)
        free = np.zeros(self._size)
        free[supports.free] = K.diagonal()[supports.free]
        held = ~np.asarray((free.reshape(-1, self._d) > 0).any(axis=1))[self._edges]
        names = [
            repr(name)
            for name, nodes in supports.nodes.items()
            if np.isin(self._edges[held], nodes).any()
        ]
        by = f"held by the condition {' and '.join(names)}"
        if held.all():
            return f"its edge is {by}: omit the clamp or the condition"
        if n := int(held.all(axis=0).sum()):
            log.warning(
                "%s: %d of its %d edges are %s", self.what, n, held.shape[1], by
            )
        return ""


def holds(p: Values) -> bool:
    """True while a clamp with these parameter values holds."""
    return bool(p.get("released_at", np.inf) == np.inf)


class _Release(TermParameters):
    """Release of a clamp, and the energy that it lost.

    The values are ``released_at``, the load factor at which it let go, infinite before;
    ``release_force``, its resultant there in N; and ``work``, the energy lost in N·mm.
    """

    def __init__(self, clamp: ClampTerm) -> None:
        self._clamp = clamp

    def at_rest(self) -> Values:
        """Values of a clamp that holds."""
        none = np.zeros(())
        return Values(
            {"released_at": none + np.inf, "release_force": none, "work": none}
        )

    def advanced(self, values: Values, u: ndarray, t: float) -> Values:
        """Values after a step: the clamp lets go if it carries its force of release."""
        clamp = self._clamp
        if not holds(values) or clamp.load(u, values) < 1:
            return values
        force, work = np.linalg.norm(clamp.force(u, values)), clamp.energy(u, t, values)
        arrays = {"released_at": t, "release_force": force, "work": work}
        return Values({name: np.array(x, dtype=float) for name, x in arrays.items()})
