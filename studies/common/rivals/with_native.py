"""scikit-fem-native: assembly in C++ of forms as scikit-fem has them.

It takes no tensor of fourth order as a coefficient of vector fields.  The blocks of the
tangent are therefore assembled one by one, as forms of scalar fields.
"""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy import ndarray
from scipy.sparse import bmat

from skfem_textile.fabric import kinematics as kin

from .linear import Solve, SolverName, solver_of
from .newton import RivalSystem
from .rival import InProcess, Shape
from .task import Task


@dataclass(frozen=True, eq=False)
class Native(InProcess):
    """scikit-fem-native on one thread.

    Parameters
    ----------
    shape
        The element.
    solver
        The linear solver.
    """

    shape: Shape
    solver: SolverName = "SciPy"
    code: ClassVar[str] = "scikit-fem-native"

    @property
    def packages(self) -> dict[str, str]:
        """Packages to import."""
        return {"skfemntv": "scikit-fem-native"}

    def system(self, task: Task) -> RivalSystem:
        """The discretised ply."""
        return _System(task, solver_of(task, self.solver))


class _System:
    def __init__(self, task: Task, solver: Solve) -> None:
        import skfemntv as native
        from skfemntv.helpers import ddot, dot, grad, mul

        native.set_num_threads(1)
        mesh, element = task.scene.mesh, getattr(native, type(task.element).__name__)()
        mesh = getattr(native, "MeshQuad" if len(mesh.t) == 4 else "MeshTri")(
            mesh.p, mesh.t
        )
        self._scalar = native.Basis(mesh, element, quadrature=task.rule)
        vector = native.ElementVector(element)
        self._vector = native.Basis(mesh, vector, quadrature=task.rule)
        self._asm = native.asm

        @native.LinearForm
        def forces(v, w):
            return ddot(w.P, grad(v))

        @native.BilinearForm
        def block(u, v, w):
            return dot(mul(w.C, grad(u)), grad(v))

        self._forces, self._block = forces, block
        self._task, self._solve = task, solver
        self.fixed, self.stiffness, self.size = task.fixed, task.E, self._vector.N
        self._free = np.setdiff1d(np.arange(self.size), self.fixed)
        # The blocks number the unknowns by their direction first.
        node, direction = np.divmod(np.arange(self.size), 2)
        self._in_blocks = direction * (self.size // 2) + node

    def _gradient(self, u: ndarray) -> ndarray:
        field = [self._scalar.interpolate(u[i::2]) for i in range(2)]
        return kin.deformation_gradient(np.array([np.asarray(x.grad) for x in field]))

    def forces(self, u: ndarray) -> ndarray:
        P = self._task.stress(self._gradient(u))
        return self._asm(self._forces, self._vector, P=P)

    def tangent(self, u: ndarray):
        C = self._task.stiffness(self._gradient(u))

        def block(i: int, k: int):
            return self._asm(self._block, self._scalar, C=C[i, :, k]).copy()

        K01 = block(0, 1)
        K = bmat([[block(0, 0), K01], [K01.T, block(1, 1)]], format="csr")
        return K[self._in_blocks][:, self._in_blocks]

    def increment(self, K, f: ndarray, du: ndarray) -> ndarray:
        rows, du = K[self._free], du.copy()
        b = -(f[self._free] + rows @ du)
        du[self._free] = self._solve(rows[:, self._free], b)
        return du
