"""Loads on a ply: tractions, forces and body forces, by the load factor."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np
from numpy import ndarray
from numpy.typing import ArrayLike
from skfem import CellBasis, FacetBasis, LinearForm, asm
from skfem.helpers import dot

from ..mesh.bases import components, node_dofs
from ..mesh.selection import Where, selected_nodes
from ..mesh.user_input import call_user_function, real_numbers
from .terms import Factor, VectorTerm, proportional

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
