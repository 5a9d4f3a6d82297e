"""Task and protocol of the other codes."""

from dataclasses import dataclass
from functools import cached_property
from importlib.util import find_spec
from typing import ClassVar

import numpy as np
from numpy import ndarray
from skfem import (
    CellBasis,
    Element,
    ElementQuad1,
    ElementQuad2,
    ElementTriP1,
    ElementTriP2,
    ElementVector,
)
from skfem.quadrature import get_quadrature

from skfem_textile.fabric import Fabric
from skfem_textile.fabric import kinematics as kin
from skfem_textile.mesh.bases import CENTRE, GAUSS, THREE, node_dofs
from skfem_textile.scenes import Scene
from skfem_textile.solve.conditions import Constraints

from .newton import RivalSystem, Run, iterations, timed


@dataclass(frozen=True, eq=False)
class Shape:
    """A scikit-fem element with its quadrature rule.

    ``mesh`` is ``quads`` or ``triangles``; ``parts`` is the number of intervals between
    nodes on an edge.
    """

    name: str
    mesh: str
    parts: int
    element: Element
    rule: tuple[ndarray, ndarray]


QUAD4 = Shape("Q4, 2×2", "quads", 1, ElementQuad1(), GAUSS)
QUAD4_CENTRE = Shape("Q4, one point", "quads", 1, QUAD4.element, CENTRE)
TRIANGLE6 = Shape("P2, 3 points", "triangles", 2, ElementTriP2(), THREE)
QUAD9 = Shape("Q9, 3×3", "quads", 2, ElementQuad2(), get_quadrature(ElementQuad2, 5))
QUAD9_REDUCED = Shape("Q9, 2×2", "quads", 2, ElementQuad2(), GAUSS)


@dataclass(frozen=True, eq=False)
class Task:
    """A scene discretised with an element, and a fabric with linear laws.

    Parameters
    ----------
    scene
        The scene.
    element
        A scalar scikit-fem element for the cells of its mesh.
    rule
        Reference coordinates and weights of the quadrature points.
    E, G
        Fibre and shear stiffness in N/mm, T = E ε and M_s = G Γ.
    """

    scene: Scene
    element: Element
    rule: tuple[ndarray, ndarray]
    E: float
    G: float

    @cached_property
    def basis(self) -> CellBasis:
        """Basis of the displacement."""
        vector = ElementVector(self.element)
        return CellBasis(self.scene.mesh, vector, quadrature=self.rule)

    @property
    def fabric(self) -> Fabric:
        """The fabric."""
        return Fabric(self.E, self.G, self.scene.warp, self.scene.weft)

    @cached_property
    def nodes(self) -> ndarray:
        """Node positions, (2, n_nodes); node i has the unknowns 2i and 2i + 1."""
        return self.basis.doflocs[:, ::2]

    @cached_property
    def cells(self) -> ndarray:
        """Nodes of each element anticlockwise, (n, n_elements).

        Vertices, midpoints of the edges 0-1, 1-2, ..., then the centre.
        """
        cells = self.basis.element_dofs[::2] // 2
        if self.scene.mesh.elem is not ElementTriP1:
            return cells
        x, y = self.nodes[:, cells[:3]]
        clockwise = (x[1] - x[0]) * (y[2] - y[0]) < (x[2] - x[0]) * (y[1] - y[0])
        mirrored = cells[[0, 2, 1, 5, 4, 3][: len(cells)]]
        return np.where(clockwise, mirrored, cells)

    @cached_property
    def _constraints(self) -> Constraints:
        return Constraints(self.basis, self.scene.conditions)

    @property
    def fixed(self) -> ndarray:
        """Prescribed unknowns."""
        return self._constraints.fixed

    def values(self, steps: int) -> ndarray:
        """Prescribed values at the end of each equal step, (steps, n_fixed)."""
        factors = np.linspace(0.0, 1.0, steps + 1)[1:]
        return np.array([self._constraints.fixed_values(t) for t in factors])

    def reaction(self, f: ndarray) -> ndarray:
        """Resultant of nodal forces on the driven edge in N, shape (2,)."""
        driven = self._constraints.nodes[self.scene.driven]
        return f[node_dofs(self.basis)[:, driven]].sum(axis=1)

    def stress(self, F: ndarray) -> ndarray:
        """Derivative of ½ E (ε₁² + ε₂²) + ½ G Γ² w.r.t. F, of shape (2, 2, n, m)."""
        A, E, G = self._directions, self.E, self.G
        P = sum(E * kin.fibre_strain(F, a) * kin.fibre_strain_d(F, a) for a in A)
        if G:
            P = P + G * kin.shear_angle(F, *A) * kin.shear_angle_d(F, *A)
        return np.asarray(P)

    def stiffness(self, F: ndarray) -> ndarray:
        """The second derivative, shape (2, 2, 2, 2, n, m)."""
        A, E, G = self._directions, self.E, self.G
        C = np.zeros(1)
        for a in A:
            d = kin.fibre_strain_d(F, a)
            C = C + E * _outer(d, d)
            C = C + E * kin.fibre_strain(F, a) * kin.fibre_strain_dd(F, a)
        if G:
            d = kin.shear_angle_d(F, *A)
            C = C + G * _outer(d, d)
            C = C + G * kin.shear_angle(F, *A) * kin.shear_angle_dd(F, *A)
        return C

    @property
    def _directions(self) -> tuple[ndarray, ndarray]:
        warp, weft = self.scene.warp, self.scene.weft
        return np.reshape(warp, (2, 1, 1)), np.reshape(weft, (2, 1, 1))


def _outer(S: ndarray, T: ndarray) -> ndarray:
    return np.einsum("iJ...,kL...->iJkL...", S, T)


@dataclass(frozen=True, eq=False)
class Rival:
    """A code with an element and a linear solver, which uses Newton's method.

    Attributes
    ----------
    shape
        The element.
    solver
        A name of `linear.solver_of`, or the name of the code's own solver.
    code
        The code.
    packages
        Required packages: import name and installation name.
    """

    shape: Shape
    solver: str = "required"
    code: ClassVar[str] = ""
    packages: ClassVar[dict[str, str]] = {}

    def missing(self) -> str:
        """Missing packages; empty if none is missing."""
        pardiso = {"pypardiso": "pypardiso"} if self.solver == "pypardiso" else {}
        needed = (self.packages | pardiso).items()
        return ", ".join(name for module, name in needed if find_spec(module) is None)

    def system(self, task: Task) -> RivalSystem:
        """The discretised ply, for a code that runs in this process."""
        raise NotImplementedError

    def run(self, task: Task, steps: int, repeats: int) -> Run:
        """Load a ply in equal steps, once for warm-up, then timed.

        Parameters
        ----------
        task
            The task, with the element of `shape`.
        steps
            Number of load steps.
        repeats
            Number of timed runs, from mesh and fabric in memory to the full load.

        Raises
        ------
        NotConvergedError
            If a step does not converge.
        """
        return timed(lambda: self.system(task), task.values(steps), repeats)

    def iterations(
        self, task: Task, u: ndarray, repeats: int
    ) -> list[tuple[float, float]]:
        """Assembly and solution times in s of Newton iterations at ``u``."""
        return iterations(self.system(task), u, repeats)
