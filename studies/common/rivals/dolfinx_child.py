"""Load a ply with DOLFINx 0.5; run as a script by an interpreter with DOLFINx.

``python dolfinx_child.py IN OUT`` reads the task from one .npz file and writes the
state at full load and its times, or the times of iterations, to another.  Without
arguments it only imports its dependencies and prints the version.
"""

import sys

import dolfinx
import numpy as np
import ufl
from dolfinx import fem, mesh
from dolfinx.fem import petsc
from mpi4py import MPI
from newton import NotConvergedError, iterations, timed
from petsc4py import PETSc
from scipy.spatial import KDTree

# Cell, vertices in DOLFINx order, element and quadrature degree by nodes per cell.
_ELEMENTS = {
    4: ("quadrilateral", [0, 1, 3, 2], 1, 3),
    6: ("triangle", [0, 1, 2], 2, 2),
}


class Forms:
    """Mesh, function space and compiled forms of a task."""

    def __init__(self, task):
        cell, vertices, degree, rule = _ELEMENTS[len(task["cells"])]
        cells = np.ascontiguousarray(task["cells"][vertices].T.astype(np.int64))
        used, flat = np.unique(cells, return_inverse=True)
        domain = ufl.Mesh(ufl.VectorElement("Lagrange", cell, 1))
        points = task["nodes"].T[used]
        cells = flat.reshape(cells.shape)
        ply = mesh.create_mesh(MPI.COMM_WORLD, cells, points, domain)
        self.space = fem.VectorFunctionSpace(ply, ("Lagrange", degree))
        self.u = fem.Function(self.space)
        energy = density(self.u, task) * ufl.dx(metadata={"quadrature_degree": rule})
        residual = ufl.derivative(energy, self.u, ufl.TestFunction(self.space))
        tangent = ufl.derivative(residual, self.u, ufl.TrialFunction(self.space))
        options = {"cffi_extra_compile_args": ["-O3", "-march=native"]}
        self.residual = fem.form(residual, jit_params=options)
        self.tangent = fem.form(tangent, jit_params=options)
        # Node of this mesh for each node of the task.
        coordinates = self.space.tabulate_dof_coordinates()[:, :2]
        off, self.node = KDTree(coordinates).query(task["nodes"].T)
        assert off.max() < 1e-9 * np.ptp(coordinates)

    def dofs(self):
        """Unknown of this space for each unknown of the task."""
        return (2 * self.node[:, None] + np.arange(2)).ravel()


def density(u, task):
    """½ E (ε₁² + ε₂²) + ½ G Γ²."""
    F = ufl.Identity(2) + ufl.grad(u)
    A = [ufl.as_vector(task[name].tolist()) for name in ("warp", "weft")]
    E, G = float(task["E"]), float(task["G"])
    a, b = (F * A_i for A_i in A)
    strains = [ufl.ln(ufl.dot(x, x)) / 2 for x in (a, b)]
    psi = E / 2 * sum(strain**2 for strain in strains)
    if G:
        c, s = ufl.dot(a, b), a[0] * b[1] - a[1] * b[0]
        (p, q), (r, t) = task["warp"], task["weft"]
        shear = float(np.arctan2(p * t - q * r, p * r + q * t)) - ufl.atan_2(s, c)
        psi += G / 2 * shear**2
    return psi


class DolfinxSystem:
    """The discretised ply, solved by MUMPS LDLᵀ."""

    def __init__(self, forms, task):
        self._forms, dofs = forms, forms.dofs()
        self.fixed, self.stiffness = dofs[task["fixed"]].astype(np.int32), task["E"]
        self._K = petsc.create_matrix(forms.tangent)
        self._K.setOption(PETSc.Mat.Option.SYMMETRIC, True)
        self._f = petsc.create_vector(forms.residual)
        self._du, self._b = self._f.duplicate(), self._f.duplicate()
        self.size = self._f.getSize()
        # MUMPS by default orders indefinite matrices for pivoting: twice the time.
        PETSc.Options().setValue("mat_mumps_icntl_12", 1)
        self._solver = PETSc.KSP().create(MPI.COMM_WORLD)
        self._solver.setType("preonly")
        self._solver.getPC().setType("cholesky")
        self._solver.getPC().setFactorSolverType("mumps")

    def forces(self, u):
        """Internal nodal forces."""
        self._forms.u.x.array[:] = u
        with self._f.localForm() as local:
            local.set(0.0)
        petsc.assemble_vector(self._f, self._forms.residual)
        return self._f.array.copy()

    def tangent(self, u):
        """Derivative of the forces."""
        self._K.zeroEntries()
        petsc.assemble_matrix(self._K, self._forms.tangent)
        self._K.assemble()
        return self._K

    def increment(self, K, f, du):
        """Solve K·du = −f, given the fixed entries of du."""
        self._b.array[:], self._du.array[:] = -f, du
        K.zeroRowsColumns(self.fixed, 1.0, self._du, self._b)
        self._solver.setOperators(K)
        self._solver.solve(self._b, self._du)
        if self._solver.getConvergedReason() < 0:
            raise NotConvergedError("the tangent is singular")
        return self._du.array.copy()


def blas():
    """File of the loaded BLAS, with its folder."""
    with open("/proc/self/maps") as maps:
        files = [line.split("/")[-2:] for line in maps if "blas" in line]
    known = ("/".join(file).strip() for file in files if file[-1].startswith("lib"))
    return next(known, "an unknown BLAS")


def main(source, target):
    """Load the ply of the input file and write the results."""
    task = dict(np.load(source))
    forms = Forms(task)
    dofs = forms.dofs()
    results = {}
    if "u" in task:
        u = np.empty(len(dofs))
        u[dofs] = task["u"]
        results["iterations"] = iterations(
            DolfinxSystem(forms, task), u, int(task["repeats"])
        )
    else:
        try:
            run = timed(
                lambda: DolfinxSystem(forms, task), task["values"], int(task["repeats"])
            )
        except NotConvergedError as error:
            results["failure"] = str(error)
        else:
            results |= {"u": run.u[dofs], "f": run.f[dofs], "seconds": run.seconds}
            results["linear_solves"] = run.linear_solves
    np.savez(target, **results)


if __name__ == "__main__":
    if len(sys.argv) > 1:
        main(*sys.argv[1:])
    else:
        print(dolfinx.__version__, "on", blas())
