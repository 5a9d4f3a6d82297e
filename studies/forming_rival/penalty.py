"""Penalty tools as terms of a user, with the energy of the other codes."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy import ndarray
from scipy.sparse import bsr_matrix, csr_matrix
from skfem import CellBasis

from skfem_textile.drape import Cylinder, Plane, Torus
from skfem_textile.ply.terms import MatrixTerm, Role, Term


class Die:
    """Plane with a round opening that ends in a fillet; φ is positive below it."""

    def __init__(self, height: float, radius: float, fillet: float) -> None:
        self._radius, self._top = radius, height + fillet
        self._plane = Plane((0.0, 0.0, height), (0.0, 0.0, -1.0))
        self._fillet = Torus(radius, fillet, (0.0, 0.0, self._top))
        self._wall = Cylinder(radius - fillet)

    def level(self, x: ndarray) -> ndarray:
        """φ, shape (n,)."""
        return self._chosen(x, lambda surface: surface.level(x))

    def gradient(self, x: ndarray) -> ndarray:
        """∇φ, shape (3, n)."""
        return self._chosen(x, lambda surface: surface.gradient(x))

    def hessian(self, x: ndarray) -> ndarray:
        """∇²φ, shape (3, 3, n)."""
        return self._chosen(x, lambda surface: surface.hessian(x))

    def _chosen(self, x: ndarray, of: Callable[[Any], ndarray]) -> ndarray:
        flat, above = np.hypot(x[0], x[1]) >= self._radius, x[2] >= self._top
        inner = np.where(above, -of(self._wall), of(self._fillet))
        return np.where(flat, of(self._plane), inner)


@dataclass(frozen=True)
class Penalty:
    """Tool with the energy ½ k Σ A φ² over the nodes inside it.

    ``surface`` is a function of the load factor; ``stiffness`` is k in N/mm³.
    """

    name: str
    surface: Callable[[float], Any]
    stiffness: float

    def on(self, basis: CellBasis) -> "PenaltyTerm":
        """Term on a basis of the displacement."""
        return PenaltyTerm(self, basis)


class PenaltyTerm(Term):
    """Term of `Penalty`; ``tangents`` counts its evaluations."""

    role: Role = "internal"
    line_search = True

    def __init__(self, tool: Penalty, basis: CellBasis) -> None:
        self.name, self._tool = tool.name, tool
        self._rest = np.pad(basis.mesh.p, ((0, 1), (0, 0)))
        self._area = nodal_areas(basis)
        self.tangents = 0

    def energy(self, u: ndarray, t: float, p: Any = None) -> float:
        """½ k Σ A φ²."""
        depth = self._surface(u, t)[1]
        return float(0.5 * self._tool.stiffness * self._area @ depth**2)

    def residual(self, u: ndarray, t: float, p: Any = None) -> ndarray:
        """Derivative of the energy."""
        return -self.forces(u, t).ravel(order="F")

    def tangent(self, u: ndarray, t: float, p: Any = None) -> csr_matrix:
        """Second derivative of the energy."""
        self.tangents += 1
        surface, depth, x = self._surface(u, t)
        n = surface.gradient(x)
        blocks = (depth > 0) * n[:, None] * n[None] - depth * surface.hessian(x)
        blocks = self._tool.stiffness * self._area * blocks
        places = np.arange(depth.size), np.arange(depth.size + 1)
        of_nodes = np.ascontiguousarray(np.moveaxis(blocks, 2, 0))
        return bsr_matrix((of_nodes, *places), shape=(u.size, u.size)).tocsr()

    def couples(self) -> Sequence[ndarray]:
        """Each node with itself."""
        return [np.arange(self._area.size)[None]]

    def forces(self, u: ndarray, t: float) -> ndarray:
        """Forces of the tool on the nodes in N, shape (3, n_nodes)."""
        surface, depth, x = self._surface(u, t)
        return self._tool.stiffness * self._area * depth * surface.gradient(x)

    def push(self, u: ndarray, t: float) -> float:
        """Sum of the forces along z in N."""
        return float(self.forces(u, t)[2].sum())

    def _surface(self, u: ndarray, t: float) -> tuple[Any, ndarray, ndarray]:
        """Surface, depths of the nodes in it, and their positions."""
        surface, x = self._tool.surface(t), self._rest + u.reshape(-1, 3).T
        return surface, np.maximum(-surface.level(x), 0.0), x


@dataclass(frozen=True)
class Spring:
    """Foundation across the ply of a stiffness in N/mm³."""

    stiffness: float

    def on(self, basis: CellBasis) -> MatrixTerm:
        """Term on a basis of the displacement."""
        entries = np.zeros((basis.mesh.nvertices, 3))
        entries[:, 2] = self.stiffness * nodal_areas(basis)
        places = np.arange(basis.N), np.arange(basis.N + 1)
        return MatrixTerm("spring", csr_matrix((entries.ravel(), *places)))


def nodal_areas(basis: CellBasis) -> ndarray:
    """A quarter of the area of the elements at each node, shape (n_nodes,)."""
    quarter = np.tile(basis.dx.sum(axis=1) / 4, 4)
    return np.bincount(basis.mesh.t.ravel(), quarter)
