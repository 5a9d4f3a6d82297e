"""Loads on a ply: tractions, forces, body forces and pressures."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, Self, TypeAlias

import numpy as np
from numpy import ndarray
from numpy.typing import ArrayLike
from scipy.sparse import csr_matrix
from skfem import (
    BilinearForm,
    CellBasis,
    ElementQuad1,
    FacetBasis,
    Functional,
    LinearForm,
    asm,
)
from skfem.helpers import dot, grad

from ..forms import Forms
from ..forms.form import builds_forms
from ..mesh.bases import components, node_dofs
from ..mesh.selection import Where, selected_nodes, turned_where
from ..mesh.user_input import call_user_function, keep_copies, real_numbers
from .amount import Amount, AmountLike, proportional
from .terms import FormTerm, VectorTerm, named_edges

#: A vector, or a function of reference position (2, ...) -> (d, ...).
Vector: TypeAlias = ArrayLike | Callable[[ndarray], ndarray]


class _Spread:
    """A force per length or area, a vector or a function of position."""

    value: Vector

    def __post_init__(self) -> None:
        keep_copies(self, "value")

    def turned(self, Q: ndarray) -> Self:
        """The same load after a rotation Q of the problem in its plane."""
        load: Any = self
        return replace(load, value=_turned(self.value, Q))


@dataclass(frozen=True)
class Traction(_Spread):
    """Force per reference length of a named boundary.

    Parameters
    ----------
    boundary
        Name of the boundary.
    value
        N/mm: a vector, or a function of reference position.
    factor
        Function of the load factor that scales the load; by default the load factor
        itself.  A number for a load that acts from the start.
    name
        Name of the term; derived from the boundary by default.

    Examples
    --------
    A traction of 5 N/mm on the upper edge of a square ply of 10 mm, 50 N in total:

    >>> from skfem import MeshQuad
    >>> from skfem_textile import Fabric, Full, Ply, Traction
    >>> mesh = MeshQuad().refined(2).scaled(10.0).with_defaults()
    >>> ply = Ply(mesh, Fabric(1e4), Full(), [Traction("top", (0.0, 5.0))])
    >>> load = ply.load(ply.basis.zeros(), 1.0)
    >>> [round(float(f), 9) for f in ply.nodal(load).sum(axis=1)]
    [0.0, 50.0]
    """

    boundary: str
    value: Vector
    factor: AmountLike = proportional
    name: str = ""

    def on(self, basis: CellBasis) -> VectorTerm:
        """Term on a basis of the displacement.

        Raises
        ------
        ValueError
            If there is no boundary of that name, or the value is not a finite vector.
        """
        name = self.name or f"traction on {self.boundary}"
        edges = _boundary(f"load {name!r}", self.boundary, basis)
        return VectorTerm(name, _spread(name, self.value, edges), self.factor)


@dataclass(frozen=True)
class Force:
    """Total force, distributed uniformly over a boundary or equally among nodes.

    Parameters
    ----------
    where
        Name of a boundary, over whose reference length the force is distributed; or
        nodes, as for `Condition`, which receive equal parts.
    total
        Total force vector in N.
    factor, name
        See `Traction`.
    """

    where: Where
    total: ArrayLike
    factor: AmountLike = proportional
    name: str = ""

    def __post_init__(self) -> None:
        keep_copies(self, "where", "total")

    def on(self, basis: CellBasis) -> VectorTerm:
        """Term on a basis of the displacement.

        Raises
        ------
        ValueError
            If there is no boundary or node set of that name, or the force is not a
            finite vector.
        """
        where = self.where if isinstance(self.where, str) else ""
        name = self.name or (f"force on {where}" if where else "force")
        total = _finite(f"load {name!r}", self.total, (components(basis),))
        if where in (basis.mesh.boundaries or {}):
            edges = _boundary(f"load {name!r}", where, basis)
            traction = total / edges.dx.sum()
            return VectorTerm(name, _spread(name, traction, edges), self.factor)
        nodes = np.unique(selected_nodes(f"load {name!r}", self.where, basis))
        vector = basis.zeros()
        vector[node_dofs(basis)[:, nodes]] = (total / len(nodes))[:, None]
        return VectorTerm(name, vector, self.factor)

    def turned(self, Q: ndarray) -> "Force":
        """The same load after a rotation Q of the problem in its plane."""
        where = turned_where(self.where, Q)
        return replace(self, where=where, total=_turned(self.total, Q))


@dataclass(frozen=True)
class BodyForce(_Spread):
    """Force per reference area of the ply, such as its weight.

    Parameters
    ----------
    value
        N/mm²: a vector, or a function of reference position.
    factor
        See `Traction`; 1.0 for a weight that acts from the start.
    name
        Name of the term.
    """

    value: Vector
    factor: AmountLike = proportional
    name: str = "body force"

    def on(self, basis: CellBasis) -> VectorTerm:
        """Term on a basis of the displacement.

        Raises
        ------
        ValueError
            If the value is not a finite vector.
        """
        area = CellBasis(basis.mesh, basis.elem, basis.mapping, dofs=basis.dofs)
        return VectorTerm(self.name, _spread(self.name, self.value, area), self.factor)


def _turned(value: Any, Q: ndarray) -> Any:
    """A vector, or a function of position that returns vectors, after a rotation."""
    if callable(value):
        return partial(_turned_field, value=value, Q=Q)
    return Q @ value


def _turned_field(x: ndarray, value: Callable[[ndarray], ndarray], Q: ndarray) -> Any:
    of_x = value(np.tensordot(Q.T, x, axes=1))
    return np.tensordot(Q, np.stack(np.broadcast_arrays(*of_x)), axes=1)


def _boundary(what: str, name: str, basis: CellBasis) -> FacetBasis:
    mesh, edges = basis.mesh, named_edges(what, basis.mesh, name)
    if not edges.size:
        raise ValueError(f"{what}: the boundary {name!r} has no edges")
    return FacetBasis(mesh, basis.elem, basis.mapping, facets=edges, dofs=basis.dofs)


def _spread(name: str, value: Vector, basis: Any) -> ndarray:
    """Nodal forces from a force per length or area at the points of a basis."""
    x = np.asarray(basis.global_coordinates())
    shape = (components(basis), *x.shape[1:])
    subject = f"load {name!r}"
    if callable(value):
        force = _finite(subject, call_user_function(subject, value, x), shape)
    else:
        vector = _finite(subject, value, shape[:1])
        force = np.broadcast_to(vector[:, None, None], shape)

    @LinearForm
    def work(v, w):
        return dot(w["force"], v)

    return asm(work, basis, force=force)


def _finite(what: str, value: Any, shape: tuple[int, ...]) -> ndarray:
    """Finite real array of a given shape."""
    array = real_numbers(what, value)
    if array.shape != shape or not np.isfinite(array).all():
        raise ValueError(
            f"{what}: its value must be a finite vector of shape {shape[:1]}, or a "
            f"function of position that returns such vectors; got shape {array.shape}"
        )
    return array


# Round-off tolerance for fixed directions.
_FREE = 1e-9


@dataclass(frozen=True)
class Pressure:
    """Pressure on a ply in space, normal to its deformed surface.

    It acts towards the side of positive z at rest.  Its energy is −p V with the volume
    V between the surface and the plane z = 0, so that its tangent is symmetric if no
    work is done on the vertical walls between the edges and that plane.  Each edge must
    therefore be fixed at z = 0, or must not move along its initial normal, as on a
    plane of symmetry; the reaction along that normal includes the pressure on the wall.

    Parameters
    ----------
    value
        Pressure in N/mm².
    factor
        Function of the load factor that scales the load; by default the load factor
        itself.
    name
        Name of the term.
    """

    value: float
    factor: AmountLike = proportional
    name: str = "pressure"

    def __post_init__(self) -> None:
        keep_copies(self, "value")

    def on(self, basis: CellBasis) -> "PressureTerm":
        """Term on a basis of the displacement.

        Raises
        ------
        ValueError
            If the ply is not in space, or the value is not a finite number.
        """
        value = real_numbers(f"load {self.name!r}", self.value)
        if value.shape or not np.isfinite(value):
            raise ValueError(
                f"load {self.name!r}: its value must be a finite number, got "
                f"{self.value}"
            )
        if components(basis) != 3:
            raise ValueError(
                f"load {self.name!r}: a pressure requires a ply in space: use "
                "Ply(..., dimension=3)"
            )
        quads = isinstance(basis.elem.elem, ElementQuad1)  # type: ignore[attr-defined]
        # The pressure is integrated at the points of the tension: with 2×2 points it
        # would load a mode that the tension at one point does not resist, and the ply
        # would buckle.
        rule = {"quadrature": basis.quadrature} if quads else {"intorder": 4}
        points = CellBasis(
            *(basis.mesh, basis.elem, basis.mapping), dofs=basis.dofs, **rule
        )
        factor = Amount(f"load {self.name!r}: its factor", self.factor)
        forms = _forms(float(value), factor)
        amounts = (factor,)
        return PressureTerm(self.name, forms, points, role="load", amounts=amounts)


@dataclass(frozen=True, eq=False, kw_only=True)
class PressureTerm(FormTerm):
    """Term of `Pressure`."""

    amounts: tuple[Amount, ...] = ()

    def unsupported(self, supports: Any) -> str:
        """Reason why there is no potential under the conditions; empty if there is one.

        Parameters
        ----------
        supports
            Conditions as fixed unknowns, see `Constraints`.
        """
        basis: Any = self.basis
        mesh, dofs = basis.mesh, node_dofs(basis)
        edges = mesh.boundary_facets()
        ends = mesh.p[:, mesh.facets[:, edges]]
        along = ends[:, 1] - ends[:, 0]
        N = np.pad(np.array([along[1], -along[0]]) / np.hypot(*along), ((0, 1), (0, 0)))
        nodes = [*mesh.facets[:, edges]]
        if len(dofs[0]) > mesh.nvertices:
            nodes.append(mesh.nvertices + edges)
        z = np.broadcast_to(np.eye(3)[2][:, None], N.shape)
        flat, upright = (
            np.all([_is_fixed(dofs, at, n, supports) for at in nodes], axis=0)
            for n in (z, N)
        )
        if not (flat | upright).all():
            return (
                "a pressure requires edges that are fixed normal to the ply, or do "
                "not move along their own normal: its work depends on the path at "
                f"{(~flat & ~upright).sum()} free edge(s) of the boundary"
            )
        on_edges = np.unique(dofs[2][np.concatenate([at[~upright] for at in nodes])])
        if on_edges.size and np.abs(_prescribed(supports, basis.N)[on_edges]).max() > 0:
            return (
                "a pressure requires edges that stay in the plane z = 0, or do not "
                "move along their normal"
            )
        return ""


def _is_fixed(dofs: ndarray, nodes: ndarray, n: ndarray, supports: Any) -> ndarray:
    """True where motions of nodes along directions n, shape (3, n_nodes), are fixed."""
    columns = np.arange(n.shape[1])
    entries = n.ravel(), (dofs[:, nodes].ravel(), np.tile(columns, 3))
    motion = csr_matrix(entries, shape=(dofs.size, len(columns)))
    if supports.turn is not None:
        motion = supports.turn.T @ motion
    free = abs(motion.tocsr()[supports.free])
    return np.asarray(free.max(axis=0).todense()).ravel() <= _FREE


def _prescribed(supports: Any, size: int) -> ndarray:
    """Prescribed displacements at the full load, zero for free unknowns."""
    q = np.zeros(size)
    q[supports.fixed] = supports.fixed_values(1.0)
    return q if supports.turn is None else supports.turn @ q


@builds_forms()
def _forms(value: float, factor: Amount) -> Forms:
    """−p V and its derivatives, V = ∫ z (∂x/∂X × ∂x/∂Y)_z."""

    def pressure(w: Any) -> float:
        return value * factor(w["t"])

    def x_and_y(w: Any) -> ndarray:
        return grad(w["u"])[:2] + np.eye(2)[:, :, None, None]

    @Functional
    def energy(w):
        F = x_and_y(w)
        return -pressure(w) * w["u"][2] * 0.5 * _mixed(F, F)

    @LinearForm
    def residual(v, w):
        F = x_and_y(w)
        change = v[2] * 0.5 * _mixed(F, F) + w["u"][2] * _mixed(F, grad(v))
        return -pressure(w) * change

    @BilinearForm
    def tangent(u, v, w):
        F = x_and_y(w)
        crossed = v[2] * _mixed(F, grad(u)) + u[2] * _mixed(F, grad(v))
        return -pressure(w) * (crossed + w["u"][2] * _mixed(grad(u), grad(v)))

    return Forms(energy, residual, tangent)


def _mixed(F: Any, G: Any) -> ndarray:
    """Derivative of det F along G, for 2×2 arrays; 2 det F if both are the same."""
    return F[0][0] * G[1][1] + F[1][1] * G[0][0] - F[0][1] * G[1][0] - F[1][0] * G[0][1]
