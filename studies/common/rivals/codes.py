"""The other codes: plain scikit-fem, FElupe, scikit-fem-native and DOLFINx.

DOLFINx runs in a new process of the first interpreter that can import it: the current
one, or the system's with Debian's python3-dolfinx.
"""

import os
import subprocess
import sys
import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache, partial
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
from numpy import ndarray
from scipy.sparse import bmat
from skfem import (
    BilinearForm,
    CellBasis,
    ElementVector,
    LinearForm,
    asm,
    condense,
    solve,
)

from skfem_textile.fabric import kinematics as kin
from skfem_textile.forms import Forms, shear, tension
from skfem_textile.forms.hourglass import hourglass
from skfem_textile.mesh.bases import HourglassBasis

from ..running import ONE_THREAD
from .linear import Solve, solver_of
from .newton import NotConvergedError, RivalSystem, Run
from .rival import (
    QUAD4,
    QUAD4_CENTRE,
    QUAD9,
    QUAD9_REDUCED,
    TRIANGLE6,
    Rival,
    Task,
)

_CHILD = Path(__file__).with_name("dolfinx_child.py")


@dataclass(frozen=True, eq=False)
class Plain(Rival):
    """Element and stabilisation of a plain scikit-fem script.

    Uses scikit-fem's own assembly of readable forms, `condense` and `solve`.  ``C_s``
    is the stiffness of the hourglass energy, if any, as a multiple of 8 G, or of
    10⁻⁴ E without shear stiffness.
    """

    C_s: float = 0.0
    code: ClassVar[str] = "scikit-fem"

    def system(self, task: Task) -> RivalSystem:
        """The discretised ply."""
        C_s = self.C_s * (8 * task.G or 1e-4 * task.E)
        return _PlainSystem(task, C_s, solver_of(task, self.solver))


class _PlainSystem:
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
    """The same integrands as forms assembled by scikit-fem."""
    return LinearForm(forms.residual.form), BilinearForm(forms.tangent.form), basis


class FElupe(Rival):
    """FElupe on one thread: the same energy as a user material, FElupe's assembly."""

    packages: ClassVar[dict[str, str]] = {"felupe": "felupe"}

    @property
    def code(self) -> str:  # type: ignore[override]
        """FElupe, with PARDISO if selected as the solver."""
        return "FElupe with Pardiso" if self.solver == "pypardiso" else "FElupe"

    def system(self, task: Task) -> RivalSystem:
        """The discretised ply."""
        return _FElupeSystem(task, solver_of(task, self.solver))


class _FElupeSystem:
    def __init__(self, task: Task, solver: Solve) -> None:
        import felupe

        gauss, triangle = felupe.GaussLegendre, felupe.QuadraticTriangle()
        triangle.gradient = partial(_corrected, triangle.gradient)
        cell_type, element, rule = {
            4: ("quad", felupe.Quad(), gauss(order=1, dim=2)),
            6: ("triangle6", triangle, felupe.TriangleQuadrature(order=2)),
            9: ("quad9", felupe.BiQuadraticQuad(), gauss(order=2, dim=2)),
        }[len(task.cells)]
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
        return self._body.assemble.matrix()  # at the field values of `forces`

    def increment(self, K, f: ndarray, du: ndarray) -> ndarray:
        field, fixed = self._container, self.fixed
        parts = self._tools.partition(field, K, self._free, fixed, f)
        to = parts[1] + du[fixed]
        return self._tools.solve(*parts, ext0=to, solver=self._solve).ravel()


def _corrected(gradient: Callable, rs: ndarray) -> ndarray:
    """Gradients of the shape functions of the quadratic triangle.

    FElupe 11.3 has a wrong derivative with respect to s of the last function,
    4s(1 − r − s), and therefore of the two vertex functions.
    """
    dh, (r, s) = gradient(rs), rs
    change = 4 * (1 - r - 2 * s) - dh[5, 1]
    dh[[0, 2, 5], 1] += np.array([-0.5, -0.5, 1.0]) * change
    return dh


class Native(Rival):
    """scikit-fem-native on one thread: C++ assembly of forms with scikit-fem's syntax.

    It does not support fourth-order tensors as coefficients of vector fields.  The
    blocks of the tangent are therefore assembled separately, as forms of scalar fields.
    """

    code: ClassVar[str] = "scikit-fem-native"
    packages: ClassVar[dict[str, str]] = {"skfemntv": "scikit-fem-native"}

    def system(self, task: Task) -> RivalSystem:
        """The discretised ply."""
        return _NativeSystem(task, solver_of(task, self.solver))


class _NativeSystem:
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
        # The block matrix orders the unknowns by direction first.
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


class DolfinxError(RuntimeError):
    """The DOLFINx process failed; the message is its last line."""


@dataclass(frozen=True, eq=False)
class Dolfinx(Rival):
    """DOLFINx 0.5 on one thread: the same energy in UFL, solved by MUMPS LDLᵀ.

    The times exclude mesh, function space and form compilation.  ``shape`` is `QUAD4`
    or `TRIANGLE6`.
    """

    solver: str = "MUMPS"
    code: ClassVar[str] = "DOLFINx"

    def missing(self) -> str:
        """DOLFINx, if no interpreter can import it."""
        return "" if interpreter() else "dolfinx 0.5 (Debian's python3-dolfinx)"

    def run(self, task: Task, steps: int, repeats: int) -> Run:
        """Load a ply in equal steps; see `Rival`.

        Raises
        ------
        NotConvergedError
            If a step does not converge.
        DolfinxError
            If the DOLFINx process fails.
        """
        data = _loaded(task, values=task.values(steps), repeats=repeats)
        if "failure" in data:
            raise NotConvergedError(str(data["failure"]))
        linear_solves, seconds = int(data["linear_solves"]), data["seconds"].tolist()
        return Run(data["u"], data["f"], linear_solves, seconds)

    def iterations(
        self, task: Task, u: ndarray, repeats: int
    ) -> list[tuple[float, float]]:
        """Time Newton iterations; see `Rival`."""
        return _loaded(task, u=u, repeats=repeats)["iterations"].tolist()


@cache
def interpreter() -> tuple[str, str] | None:
    """The first interpreter that can import DOLFINx, with its version and BLAS."""
    for python in (sys.executable, "/usr/bin/python3"):
        try:
            return python, _run(python, _CHILD, timeout=60)
        except (OSError, DolfinxError, subprocess.TimeoutExpired):
            continue
    return None


def _loaded(task: Task, **more: Any) -> dict[str, ndarray]:
    """Results of the DOLFINx process for a task."""
    return in_dolfinx(
        _CHILD,
        nodes=task.nodes,
        cells=task.cells,
        warp=task.scene.warp,
        weft=task.scene.weft,
        E=task.E,
        G=task.G,
        fixed=task.fixed,
        **more,
    )


def in_dolfinx(script: Path, **data: Any) -> dict[str, ndarray]:
    """Results of a script that reads its data from one .npz file and writes another.

    Raises
    ------
    DolfinxError
        If no interpreter can import DOLFINx, or the script fails.
    """
    if (python := interpreter()) is None:
        raise DolfinxError("DOLFINx: no Python interpreter can import it")
    with tempfile.TemporaryDirectory() as folder:
        source, target = Path(folder, "task.npz"), Path(folder, "results.npz")
        np.savez(source, **data)
        _run(python[0], script, str(source), str(target))
        with np.load(target) as results:
            return dict(results)


def _run(
    python: str, script: Path, *arguments: str, timeout: float | None = None
) -> str:
    """Output of a script."""
    environment = {k: v for k, v in os.environ.items() if k != "PYTHONPATH"}
    environment |= ONE_THREAD
    child = subprocess.run(
        [python, str(script), *arguments],
        capture_output=True,
        text=True,
        env=environment,
        timeout=timeout,
    )
    if child.returncode:
        lines = child.stderr.strip().splitlines() or [f"exit code {child.returncode}"]
        raise DolfinxError(f"DOLFINx: {lines[-1]}")
    return child.stdout.strip()


def _in_process(solver: str) -> tuple[Rival, ...]:
    quad4, triangle6 = (QUAD4, solver), (TRIANGLE6, solver)
    return (
        *(FElupe(*quad4), FElupe(*triangle6), FElupe(QUAD9, solver)),
        *(Plain(*quad4), Plain(QUAD4_CENTRE, solver, C_s=1.0), Plain(*triangle6)),
        *(Plain(QUAD9, solver), Plain(QUAD9_REDUCED, solver)),
        *(Native(*quad4), Native(*triangle6)),
    )


#: Each code and element with the fastest linear solver, and with the required one;
#: DOLFINx with MUMPS only.
RIVALS: tuple[Rival, ...] = (
    *_in_process("fastest"),
    *(Dolfinx(QUAD4), Dolfinx(TRIANGLE6)),
    *_in_process("required"),
)
