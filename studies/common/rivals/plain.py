"""Plain scikit-fem: its own assembly of readable forms, `condense` and `solve`."""

from dataclasses import dataclass
from functools import partial
from typing import ClassVar

import numpy as np
from numpy import ndarray
from skfem import (
    BilinearForm,
    CellBasis,
    ElementVector,
    LinearForm,
    asm,
    condense,
    solve,
)

from skfem_textile.forms import Forms, shear, tension
from skfem_textile.forms.hourglass import hourglass
from skfem_textile.mesh.bases import CENTRE, HourglassBasis

from .linear import Solve, SolverName, solver_of
from .newton import RivalSystem
from .rival import QUAD4, InProcess, Shape
from .task import Task

#: The bilinear quadrilateral with one point.
QUAD4_CENTRE = Shape("Q4, one point", "quads", 1, QUAD4.element, CENTRE)


@dataclass(frozen=True, eq=False)
class Plain(InProcess):
    """The element and stabilisation of a straightforward script.

    Parameters
    ----------
    shape
        The element.
    C_s
        Stiffness of the hourglass energy, if there is one: as a multiple of 8 G, or of
        10⁻⁴ E without shear stiffness.
    solver
        The linear solver.
    """

    shape: Shape
    C_s: float = 0.0
    solver: SolverName = "SciPy"
    code: ClassVar[str] = "scikit-fem"

    def system(self, task: Task) -> RivalSystem:
        """The discretised ply."""
        return _System(
            task,
            self.C_s * (8 * task.G or 1e-4 * task.E),
            solver_of(task, self.solver),
        )


class _System:
    def __init__(self, task: Task, C_s: float, linear: Solve) -> None:
        self._linear = linear
        mesh, fabric = task.scene.mesh, task.fabric
        element = ElementVector(task.element)
        basis = CellBasis(mesh, element, quadrature=task.rule)
        self._terms = [_stock(tension(fabric), basis)]
        if task.G:
            self._terms.append(_stock(shear(fabric), basis))
        if C_s:
            self._terms.append(_stock(hourglass(fabric, C_s), HourglassBasis(mesh)))
        self.fixed, self.stiffness, self.size = task.fixed, task.E, basis.N

    def forces(self, u: ndarray) -> ndarray:
        return np.sum([asm(f, basis, u=u) for f, _, basis in self._terms], axis=0)

    def tangent(self, u: ndarray):
        return sum(asm(K, basis, u=u) for _, K, basis in self._terms)

    def increment(self, K, f: ndarray, du: ndarray) -> ndarray:
        solved = partial(solve, solver=self._linear)
        return np.asarray(solved(*condense(K, -f, x=du, D=self.fixed)))


def _stock(
    forms: Forms, basis: CellBasis
) -> tuple[LinearForm, BilinearForm, CellBasis]:
    """The same integrands in forms that scikit-fem assembles itself."""
    return LinearForm(forms.residual.form), BilinearForm(forms.tangent.form), basis
