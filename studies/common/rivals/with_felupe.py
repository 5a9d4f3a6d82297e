"""FElupe: the same energy as a user material, on the assembly of FElupe."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy import ndarray

from .linear import Solve, SolverName, solver_of
from .newton import RivalSystem
from .rival import InProcess, Shape
from .task import Task


@dataclass(frozen=True, eq=False)
class FElupe(InProcess):
    """FElupe on one thread.

    Parameters
    ----------
    shape
        The element.
    solver
        The linear solver.
    """

    shape: Shape
    solver: SolverName = "SciPy"

    @property
    def code(self) -> str:
        """FElupe, and PARDISO if that is its solver."""
        return "FElupe with Pardiso" if self.solver == "pypardiso" else "FElupe"

    @property
    def packages(self) -> dict[str, str]:
        """Packages to import."""
        needed = {"felupe": "felupe"}
        pardiso = {"pypardiso": "pypardiso"} if self.solver == "pypardiso" else {}
        return needed | pardiso

    def system(self, task: Task) -> RivalSystem:
        """The discretised ply."""
        return _System(task, solver_of(task, self.solver))


class _System:
    def __init__(self, task: Task, solver: Solve) -> None:
        import felupe

        cell_type, element, rule = _elements(felupe)[len(task.cells)]
        mesh = felupe.Mesh(task.nodes.T, task.cells.T, cell_type)
        field = felupe.Field(felupe.Region(mesh, element, rule), dim=2)
        self._container = felupe.FieldContainer([field])
        material = felupe.Material(
            lambda x, **_: [task.stress(x[0]), x[-1]],
            lambda x, **_: [task.stiffness(x[0])],
        )
        self._body = felupe.SolidBody(material, self._container)
        self._solve, self._tools = solver, felupe.solve
        self.fixed, self.stiffness, self.size = task.fixed, task.E, task.nodes.size
        self._free = np.setdiff1d(np.arange(self.size), self.fixed)

    def forces(self, u: ndarray) -> ndarray:
        self._container[0].values[:] = u.reshape(-1, 2)
        return self._body.assemble.vector(self._container).toarray()[:, 0]

    def tangent(self, u: ndarray):
        return self._body.assemble.matrix()  # of the field of the forces

    def increment(self, K, f: ndarray, du: ndarray) -> ndarray:
        field, fixed = self._container, self.fixed
        parts = self._tools.partition(field, K, self._free, fixed, f)
        to = parts[1] + du[fixed]
        return self._tools.solve(*parts, ext0=to, solver=self._solve).ravel()


def _elements(felupe):
    """Cell type, element and rule by the number of nodes of a cell."""
    gauss, triangle = felupe.GaussLegendre, felupe.QuadraticTriangle()
    triangle.gradient = partial(_corrected, triangle.gradient)
    return {
        4: ("quad", felupe.Quad(), gauss(order=1, dim=2)),
        6: ("triangle6", triangle, felupe.TriangleQuadrature(order=2)),
        9: ("quad9", felupe.BiQuadraticQuad(), gauss(order=2, dim=2)),
    }


def _corrected(gradient: Callable, rs: ndarray) -> ndarray:
    """Gradients of the functions of the quadratic triangle.

    FElupe 11.3 differentiates the last one, 4s(1 − r − s), wrongly by s, and with it
    those of the two vertices.
    """
    dh, (r, s) = gradient(rs), rs
    change = 4 * (1 - r - 2 * s) - dh[5, 1]
    dh[[0, 2, 5], 1] += np.array([-0.5, -0.5, 1.0]) * change
    return dh
