"""Loads on a ply: tractions, forces, body forces and pressures."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, TypeAlias

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
from ..mesh.bases import components, node_dofs
from ..mesh.selection import Where, selected_nodes
from ..mesh.user_input import call_user_function, real_numbers
from .terms import Factor, FormTerm, VectorTerm, factor_at, proportional

#: A vector, or a function of reference position (2, ...) -> (d, ...).
Vector: TypeAlias = ArrayLike | Callable[[ndarray], ndarray]


@dataclass(frozen=True)
class Traction:
    """A force per reference length of a named boundary.

    Parameters
    ----------
    boundary
        Name of the boundary.
    value
        N/mm: a vector, or a function of reference position.
    factor
        Function of the load factor by which it is multiplied: the load factor itself
        if none is given.  A number for a load that is there from the start.
    name
        Name of the term; that of the boundary if none is given.

    Examples
    --------
    A square ply of 10 mm, pulled upwards by 5 N/mm, carries 50 N:

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
    factor: Factor = proportional
    name: str = ""

    def on(self, basis: CellBasis) -> VectorTerm:
        """The term on a basis of the displacement.

        Raises
        ------
        ValueError
            If there is no boundary of that name, or the value is no finite vector.
        """
        name = self.name or f"traction on {self.boundary}"
        edges = _boundary(f"load {name!r}", self.boundary, basis)
        return VectorTerm(name, _spread(name, self.value, edges), self.factor)


@dataclass(frozen=True)
class Force:
    """A force in all, spread evenly over a boundary or shared by nodes.

    Parameters
    ----------
    where
        The name of a boundary, over whose reference length the force is spread; or what
        nodes of `Condition` may be, which share it in equal parts.
    total
        The whole force in N, a vector.
    factor, name
        As of `Traction`.
    """

    where: Where
    total: ArrayLike
    factor: Factor = proportional
    name: str = ""

    def on(self, basis: CellBasis) -> VectorTerm:
        """The term on a basis of the displacement.

        Raises
        ------
        ValueError
            If nothing of that name is there, or the force is no finite vector.
        """
        place = self.where if isinstance(self.where, str) else ""
        name = self.name or (f"force on {place}" if place else "force")
        total = _finite(f"load {name!r}", self.total, (components(basis),))
        if place in (basis.mesh.boundaries or {}):
            edges = _boundary(f"load {name!r}", place, basis)
            traction = total / edges.dx.sum()
            return VectorTerm(name, _spread(name, traction, edges), self.factor)
        nodes = np.unique(selected_nodes(f"load {name!r}", self.where, basis))
        vector = basis.zeros()
        vector[node_dofs(basis)[:, nodes]] = (total / len(nodes))[:, None]
        return VectorTerm(name, vector, self.factor)


@dataclass(frozen=True)
class BodyForce:
    """A force per reference area of the ply, such as its weight.

    Parameters
    ----------
    value
        N/mm²: a vector, or a function of reference position.
    factor
        As of `Traction`; 1.0 for a weight that is there from the start.
    name
        Name of the term.
    """

    value: Vector
    factor: Factor = proportional
    name: str = "body force"

    def on(self, basis: CellBasis) -> VectorTerm:
        """The term on a basis of the displacement.

        Raises
        ------
        ValueError
            If the value is no finite vector.
        """
        area = CellBasis(basis.mesh, basis.elem, basis.mapping, dofs=basis.dofs)
        return VectorTerm(self.name, _spread(self.name, self.value, area), self.factor)


def _boundary(what: str, name: str, basis: CellBasis) -> FacetBasis:
    mesh = basis.mesh
    if name not in (mesh.boundaries or {}):
        names = ", ".join(map(repr, mesh.boundaries or {})) or "none"
        raise ValueError(f"{what}: the mesh has no boundary {name!r} (it has: {names})")
    edges = np.unique(mesh.boundaries[name])
    if not edges.size:
        raise ValueError(f"{what}: the boundary {name!r} has no edge")
    return FacetBasis(mesh, basis.elem, basis.mapping, facets=edges, dofs=basis.dofs)


def _spread(name: str, value: Vector, basis: Any) -> ndarray:
    """Nodal forces of a force per length or area, given at the points of a basis."""
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
    """A finite real array of a shape."""
    array = real_numbers(what, value)
    if array.shape != shape or not np.isfinite(array).all():
        raise ValueError(
            f"{what}: its value must be finite numbers, shape {shape[:1]}, or a "
            f"function of position that gives these; got shape {array.shape}"
        )
    return array


# Of a held direction this share may be free: the round-off of directions.
_FREE = 1e-9


@dataclass(frozen=True)
class Pressure:
    """A pressure on a ply in space, along the normal of its deformed surface.

    It pushes to the side to which z points at rest.  Its energy is −p V with the volume
    V between the surface and the plane z = 0, so that it has a symmetric tangent where
    no work is done on the walls below the edges.  A ply is refused unless each edge is
    held at z = 0, or may not move along its normal at rest, as on a plane of symmetry.
    There the reaction along the normal includes the pressure on the wall.

    Parameters
    ----------
    value
        Pressure in N/mm².
    factor
        Function of the load factor by which it is multiplied: the load factor itself
        if none is given.
    name
        Name of the term.
    """

    value: float
    factor: Factor = proportional
    name: str = "pressure"

    def on(self, basis: CellBasis) -> "PressureTerm":
        """The term on a basis of the displacement.

        Raises
        ------
        ValueError
            If the ply is not in space, or the value is no finite number.
        """
        value = real_numbers(f"load {self.name!r}", self.value)
        if value.shape or not np.isfinite(value):
            raise ValueError(
                f"load {self.name!r}: its value must be a finite number, got "
                f"{self.value}"
            )
        if components(basis) != 3:
            raise ValueError(
                f"load {self.name!r}: a pressure acts across a ply in space: give the "
                "ply dimension=3"
            )
        quads = isinstance(basis.elem.elem, ElementQuad1)  # type: ignore[attr-defined]
        # Quadrilaterals are pushed where tension holds them: 2×2 points would push a
        # motion that tension at one point does not see, and the ply buckles.
        rule = {"quadrature": basis.quadrature} if quads else {"intorder": 4}
        points = CellBasis(
            *(basis.mesh, basis.elem, basis.mapping), dofs=basis.dofs, **rule
        )
        forms = _forms(self.name, float(value), self.factor)
        return PressureTerm(self.name, forms, points, role="load")


@dataclass(frozen=True, eq=False, kw_only=True)
class PressureTerm(FormTerm):
    """The term of `Pressure`."""

    def unsupported(self, supports: Any) -> str:
        """Why conditions leave it no potential; empty where it has one.

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
            np.all([_held(dofs[:, at], n, supports) for at in nodes], axis=0)
            for n in (z, N)
        )
        if not (flat | upright).all():
            return (
                "a pressure needs edges that are held across the ply, or do not move "
                f"along their normal: {(~flat & ~upright).sum()} edge(s) of the "
                "boundary are free, where its work depends on the path"
            )
        on_edges = np.unique(dofs[2][np.concatenate([at[~upright] for at in nodes])])
        if on_edges.size and np.abs(_prescribed(supports)[on_edges]).max() > 0:
            return (
                "a pressure needs edges that stay in the plane z = 0, or do not move "
                "along their normal"
            )
        return ""


def _held(dofs: ndarray, n: ndarray, supports: Any) -> ndarray:
    """Whether motions of nodes along directions n are fixed; shapes (3, n_nodes)."""
    columns = np.arange(n.shape[1])
    entries = n.ravel(), (dofs.ravel(), np.tile(columns, 3))
    motion = csr_matrix(entries, shape=(_size(supports), len(columns)))
    if supports.turn is not None:
        motion = supports.turn.T @ motion
    free = abs(motion.tocsr()[supports.free])
    return np.asarray(free.max(axis=0).todense()).ravel() <= _FREE


def _size(supports: Any) -> int:
    return len(supports.free) + len(supports.fixed)


def _prescribed(supports: Any) -> ndarray:
    """Displacements that are prescribed at the full load, zero where none are."""
    q = np.zeros(_size(supports))
    q[supports.fixed] = supports.fixed_values(1.0)
    return q if supports.turn is None else supports.turn @ q


def _forms(name: str, value: float, factor: Factor) -> Forms:
    """−p V and its derivatives, V = ∫ z (∂x/∂X × ∂x/∂Y)_z."""

    def pressure(w: Any) -> float:
        return value * factor_at(f"load {name!r}", factor, w["t"])

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
    """Derivative of det F along G, of 2×2 arrays; 2 det F where both are the same."""
    return F[0][0] * G[1][1] + F[1][1] * G[0][0] - F[0][1] * G[1][0] - F[1][0] * G[0][1]
