"""Form a ply with DOLFINx 0.5; run as a script by an interpreter with DOLFINx.

``python dolfinx_forming.py IN OUT`` reads a case of `forming.Forming`, the travels of
the punch and the name of the method from one .npz file, and writes the course to
another.

The elements are bilinear squares: fibres and shear at one point, the stabilisation of
`OnePoint` at 2×2 points, the tools at the nodes.  In a square the gradient at the
centre follows from the one at a point and the mixed second derivative, which is
constant.  Bending has the energy ½ D Σ W κ² with the weak curvatures κ at the nodes and
their areas W, as in `skfem_textile.forms.bending`.
"""

import sys
from functools import partial

import numpy as np
import ufl
from course import formed
from dolfinx import fem, mesh
from dolfinx.fem import petsc
from mpi4py import MPI
from petsc4py import PETSc
from scipy.sparse import csr_matrix, diags, kron

_POINT = ufl.dx(metadata={"quadrature_degree": 1})
_POINTS = ufl.dx(metadata={"quadrature_degree": 3})
_NODES = ufl.dx(metadata={"quadrature_rule": "GLL", "quadrature_degree": 1})
_FORM = partial(
    fem.form, jit_params={"cffi_extra_compile_args": ["-O3", "-march=native"]}
)

# Largest residual in N of a state, and largest number of iterations of a step.
_LEFT, _MOST = 1e-7, 150

# Shift of the tangent in N/mm³ with which the search for a definite one begins, and the
# factor between the shifts that are tried.
_SHIFT, _GROWTH = 1e-6, 4.0

# Longest motion of a node in an increment in mm, halvings of an increment, share of the
# predicted fall of the energy, and round-off of the energy in N·mm.
_LONGEST, _HALVINGS, _ARMIJO, _ROUND_OFF = 20.0, 20, 1e-4, 1e-10

# Square in mm² and pressure in N/mm² that keep divisors from zero.
_TINY = 1e-24

# The twist stiffness relative to the bending stiffness in `Formulation`.
_TWIST = 0.002


class Ply:
    """Energy without friction, nodal forces and tangent of the ply between tools."""

    def __init__(self, case):
        side, parts = case["side"], case["parts"]
        corners = [[0.0, 0.0], [side, side]]
        quads = mesh.CellType.quadrilateral
        self.mesh = mesh.create_rectangle(MPI.COMM_WORLD, corners, [parts] * 2, quads)
        space = fem.VectorFunctionSpace(self.mesh, ("Lagrange", 1), dim=3)
        self.u = fem.Function(space)
        self.travel = fem.Constant(self.mesh, 0.0)
        self.nodes = space.tabulate_dof_coordinates()[:, :2]
        punch, *others = self._tools(case)
        X = ufl.SpatialCoordinate(self.mesh)
        self._x = ufl.as_vector([X[0] + self.u[0], X[1] + self.u[1], self.u[2]])
        depths = [tool(self._x) for tool in (punch, *others)]
        contact = [
            0.5 * case["penalty"] * ufl.conditional(ufl.lt(phi, 0), phi**2, 0)
            for phi in depths
        ]
        energy = self._fabric(case, X) + sum(contact) * _NODES
        energy -= self._work_of_edges(case)
        forces = ufl.derivative(energy, self.u, ufl.TestFunction(space))
        self._rubbing = []
        if case["friction"]:
            of_punch = Rubbing(case, self.mesh, punch, self._x, self.travel)
            of_others = [Rubbing(case, self.mesh, one, self._x) for one in others]
            self._rubbing = [of_punch, *of_others]
            rubs = sum(one.force for one in self._rubbing)
            forces += ufl.dot(rubs, ufl.TestFunction(space)) * _NODES
        tangent = ufl.derivative(forces, self.u, ufl.TrialFunction(space))
        self._energy, self._forces = _FORM(energy), _FORM(forces)
        self._tangent = _FORM(tangent)
        # The punch moves along z, so that its force is the derivative of its energy.
        height = ufl.variable(self.travel)
        phi = punch(self._x, height)
        deeper = ufl.diff(ufl.conditional(ufl.lt(phi, 0), phi**2, 0), height)
        force = 0.5 * case["penalty"] * deeper
        if self._rubbing:
            force -= self._rubbing[0].force[2]
        self._force = _FORM(force * _NODES)
        self._bending = bending(self.mesh, self.nodes, side, case["D"])
        self._vector = petsc.create_vector(self._forces)
        self._matrix = petsc.assemble_matrix(self._tangent)
        self._matrix.assemble()
        self._prepare(side, parts)

    def _tools(self, case):
        """Signed distances from punch, die and holder, negative inside a tool."""
        radius, fillet, half = case["radius"], case["fillet"], case["gap"] / 2
        opening = radius + case["clearance"] + fillet

        def punch(x, travel=self.travel):
            r = ufl.as_vector([x[0], x[1], x[2] - travel + radius + half])
            return ufl.sqrt(ufl.dot(r, r)) - radius

        def die(x):
            tiny = 1e-12  # mm²: the slope on the axis is then zero
            out = ufl.sqrt(x[0] ** 2 + x[1] ** 2 + tiny) - opening
            up = x[2] - half - fillet
            around = ufl.sqrt(out**2 + up**2 + tiny) - fillet
            wall = ufl.conditional(ufl.ge(up, 0), -out - fillet, around)
            return ufl.conditional(ufl.ge(out, 0), half - x[2], wall)

        return punch, die, lambda x: x[2] + half

    def _fabric(self, case, X):
        """Energy of fibres, shear and stabilisation."""
        h = case["side"] / case["parts"]
        centres = fem.Function(fem.VectorFunctionSpace(self.mesh, ("DG", 0)))
        at = centres.function_space.tabulate_dof_coordinates()[:, :2]
        centres.x.array[:] = at.ravel()
        gradient, second = ufl.grad(self.u), ufl.grad(ufl.grad(self.u))
        a, b = (gradient[:, i] + ufl.unit_vector(i, 3) for i in range(2))
        twist = ufl.as_vector([second[i, 0, 1] for i in range(3)])
        rises = [twist * (X[i] - centres[i]) for i in (1, 0)]
        a_0, b_0 = a - rises[0], b - rises[1]
        strains = [ufl.ln(ufl.dot(x, x)) / 2 for x in (a, b)]
        fibres = 0.5 * case["E"] * sum(strain**2 for strain in strains)
        angle = crossing(a, b)
        shear = 0.5 * case["G"] * (np.pi / 2 - angle) ** 2
        C_s = case["C_s"]
        C_o = min(C_s, _TWIST * 6 * case["D"] / h**2)
        normal = ufl.cross(a_0, b_0)
        held = 0.5 * C_s * (angle - crossing(a_0, b_0)) ** 2
        held += 0.5 * C_o * sum(ufl.dot(normal, rise) ** 2 for rise in rises)
        return (fibres + shear) * _POINT + held * _POINTS

    def _work_of_edges(self, case):
        edges = [
            mesh.locate_entities_boundary(
                self.mesh, 1, lambda x, i=i: np.isclose(x[i], case["side"])
            )
            for i in range(2)
        ]
        numbers = np.concatenate(edges)
        order = np.argsort(numbers)
        marks = np.repeat(
            np.array([0, 1], dtype=np.int32), [len(edge) for edge in edges]
        )
        tags = mesh.meshtags(self.mesh, 1, numbers[order], marks[order])
        ds = ufl.Measure("ds", self.mesh, subdomain_data=tags)
        return case["edge_tension"] * sum(self.u[i] * ds(i) for i in range(2))

    def _prepare(self, side, parts):
        """Pattern of the tangent with bending, fixed unknowns and places of others."""
        self.pattern = _ones(_csr(self._matrix)) + _ones(self._bending)
        self.pattern.sort_indices()
        self.size = self.pattern.shape[0]
        numbers = self.pattern.copy()
        numbers.data = np.arange(1.0, len(numbers.data) + 1)

        def places(of):
            chosen = numbers.multiply(_ones(of)).tocsr()
            chosen.sort_indices()
            return chosen.data.astype(int) - 1

        self._of_forms = places(_csr(self._matrix))
        self._of_bending = np.zeros(len(numbers.data))
        self._of_bending[places(self._bending)] = self._bending.data
        fixed = np.zeros((len(self.nodes), 3), dtype=bool)
        fixed[:, :2] = np.isclose(self.nodes, 0.0)
        self.fixed = fixed.ravel()
        row = np.repeat(np.arange(self.size), np.diff(self.pattern.indptr))
        self.diagonal = np.flatnonzero(row == self.pattern.indices)
        self._off = self.fixed[row] | self.fixed[self.pattern.indices]
        self.area = (side / parts) ** 2

    def energy(self, u):
        """Energy at a displacement."""
        self.u.x.array[:] = u
        return fem.assemble_scalar(self._energy) + 0.5 * u @ (self._bending @ u)

    @property
    def symmetric(self):
        """False with friction."""
        return not self._rubbing

    def advance(self, u):
        """Store places and friction forces of a state."""
        self.u.x.array[:] = u
        for one in self._rubbing:
            one.advance()

    def forces(self, u):
        """Derivative of the energy, zero at fixed unknowns."""
        self.u.x.array[:] = u
        with self._vector.localForm() as local:
            local.set(0.0)
        petsc.assemble_vector(self._vector, self._forces)
        f = self._vector.array + self._bending @ u
        f[self.fixed] = 0.0
        return f

    def tangent(self, u):
        """Entries of the tangent in the order of its pattern."""
        self.u.x.array[:] = u
        self._matrix.zeroEntries()
        petsc.assemble_matrix(self._matrix, self._tangent)
        self._matrix.assemble()
        entries = self._of_bending.copy()
        entries[self._of_forms] += self._matrix.getValuesCSR()[2]
        entries[self._off] = 0.0
        entries[self.diagonal[self.fixed]] = 1.0
        return entries

    def punch_force(self, u, travel):
        """Force of the punch on the ply at the current travel."""
        self.u.x.array[:] = u
        return fem.assemble_scalar(self._force)


class Rubbing:
    """Friction with a tool as in `skfem_textile`, with the pressure of the penalty.

    The place X₀ and the force s at the last state are functions with values at the
    nodes.  Bound b and normal n follow the displacement, so that the tangent is not
    symmetric.
    """

    def __init__(self, case, domain, tool, x, travel=0.0):
        space = fem.VectorFunctionSpace(domain, ("Lagrange", 1), dim=3)
        self._start, self._shear = fem.Function(space), fem.Function(space)
        slip, at = float(case["slip"]), ufl.variable(x)
        phi = tool(at)
        n = ufl.diff(phi, at)
        b = float(case["friction"] * case["penalty"]) * ufl.max_value(-phi, 0)

        def along(v):
            return v - n * ufl.dot(n, v)

        def size(v):
            return ufl.sqrt(ufl.dot(v, v) + _TINY)

        place, s = x - travel * ufl.unit_vector(2, 3), along(self._shear)
        y = slip * s / ufl.max_value(b + _TINY, size(s)) + along(place - self._start)
        self.force = b * y / ufl.max_value(slip, size(y))
        points = space.element.interpolation_points()
        self._ends = [
            (self._shear, fem.Expression(self.force, points)),
            (self._start, fem.Expression(place, points)),
        ]
        self._start.interpolate(self._ends[1][1])

    def advance(self):
        """Store place and force at the displacement, for the next step."""
        for function, expression in self._ends:
            function.interpolate(expression)


def crossing(a, b):
    """Angle between two vectors in space."""
    normal = ufl.cross(a, b)
    return ufl.atan_2(ufl.sqrt(ufl.dot(normal, normal)), ufl.dot(a, b))


def bending(ply, nodes, side, D):
    """Matrix of bending of fibres along x and along y, with free and mirrored ends."""
    space = fem.FunctionSpace(ply, ("Lagrange", 1))
    w, v = ufl.TrialFunction(space), ufl.TestFunction(space)

    def matrix(form):
        assembled = petsc.assemble_matrix(fem.form(form))
        assembled.assemble()
        return _csr(assembled)

    area, adjacent = matrix(w * v * _NODES).diagonal(), matrix(w * v * _POINTS) != 0
    K = csr_matrix((3 * len(area),) * 2)
    for i in range(2):
        L = matrix(w.dx(i) * v.dx(i) * _POINTS)
        for component in range(3):
            out = np.isclose(nodes[:, i], side)
            if component == i:  # odd on the plane of symmetry
                out |= np.isclose(nodes[:, i], 0.0)
            # The areas of the ends belong to the other nodes of the same elements.
            receivers = adjacent[out][:, ~out].astype(float)
            shares = area[out] / np.asarray(receivers.sum(axis=1)).ravel()
            weights = area[~out] + receivers.T @ shares
            half = diags(np.sqrt(D * weights) / area[~out]) @ L[~out]
            place = np.zeros((3, 3))
            place[component, component] = 1.0
            K = K + kron(half.T @ half, place, "csr")
    K.sort_indices()
    return K


def _csr(matrix):
    indptr, indices, data = matrix.getValuesCSR()
    csr = csr_matrix((data, indices, indptr), matrix.getSize())
    csr.sort_indices()
    return csr


def _ones(matrix):
    ones = np.ones(len(matrix.data))
    return csr_matrix((ones, matrix.indices, matrix.indptr), matrix.shape)


class Mumps:
    """The tangent as a matrix of PETSc, factorised by MUMPS as LDLᵀ or LU."""

    def __init__(self, ply):
        self.pattern = ply.pattern.indptr.astype("i4"), ply.pattern.indices.astype("i4")
        csr = *self.pattern, ply.pattern.data
        self.matrix = PETSc.Mat().createAIJ(ply.pattern.shape, csr=csr)
        self.matrix.setOption(PETSc.Mat.Option.SYMMETRIC, ply.symmetric)
        self._factors = "cholesky" if ply.symmetric else "lu"
        options = PETSc.Options()
        # As in `dolfinx_child`; of the orderings, PORD is the fastest here.
        options.setValue("mat_mumps_icntl_12", 1)
        options.setValue("mat_mumps_icntl_7", 4)

    def configure(self, ksp):
        """Select MUMPS as a direct solver."""
        ksp.setType("preonly")
        ksp.getPC().setType(self._factors)
        ksp.getPC().setFactorSolverType("mumps")

    def set(self, entries):
        """Set the entries, in the order of the pattern."""
        self.matrix.setValuesCSR(*self.pattern, entries)
        self.matrix.assemble()


class Snes:
    """PETSc's Newton method with its l2 line search."""

    def __init__(self, ply):
        self._ply, self._mumps = ply, Mumps(ply)
        PETSc.Options().setValue("snes_linesearch_type", "l2")
        self._snes = PETSc.SNES().create()
        self._x, f = self._mumps.matrix.createVecs()
        self._snes.setFunction(self._function, f)
        self._snes.setJacobian(self._jacobian, self._mumps.matrix)
        self._mumps.configure(self._snes.getKSP())
        self._snes.setType("newtonls")
        self._snes.setTolerances(rtol=0.0, atol=_LEFT, stol=0.0, max_it=_MOST)
        self._snes.setFromOptions()

    def _function(self, snes, x, f):
        f.array[:] = self._ply.forces(x.array_r)

    def _jacobian(self, snes, x, J, P):
        self._mumps.set(self._ply.tangent(x.array_r))

    def __call__(self, u):
        """State near a displacement, None if there is none, and linear solves."""
        self._x.array[:] = u
        self._snes.solve(None, self._x)
        found = self._snes.getConvergedReason() > 0
        solves = self._snes.getIterationNumber()
        return self._x.array.copy() if found else None, solves


class Descent:
    """Newton's method with a definite tangent and a line search on the energy.

    Without friction, whose tangent has no energy.  MUMPS counts the negative
    pivots; the tangent is shifted until there are none.
    """

    def __init__(self, ply):
        self._ply, self._mumps = ply, Mumps(ply)
        self._ksp = PETSc.KSP().create()
        self._ksp.setOperators(self._mumps.matrix)
        self._mumps.configure(self._ksp)
        self._du, self._b = self._mumps.matrix.createVecs()

    def _negative_pivots(self, entries, shift):
        entries = entries.copy()
        entries[self._ply.diagonal] += shift * self._ply.area
        self._mumps.set(entries)
        self._ksp.setOperators(self._mumps.matrix)
        self._ksp.setUp()
        return self._ksp.getPC().getFactorMatrix().getMumpsInfog(12)

    def __call__(self, u):
        """State near a displacement, None if there is none, and linear solves."""
        shift, energy, f = 0.0, self._ply.energy(u), self._ply.forces(u)
        for solves in range(_MOST):
            if np.abs(f).max() <= _LEFT:
                return u, solves
            entries = self._ply.tangent(u)
            shift = shift / _GROWTH if shift > _SHIFT else 0.0
            while self._negative_pivots(entries, shift):
                shift = max(_GROWTH * shift, _SHIFT)
            self._b.array[:] = -f
            self._ksp.solve(self._b, self._du)
            du = self._du.array * min(1.0, _LONGEST / np.abs(self._du.array).max())
            for share in 0.5 ** np.arange(_HALVINGS):
                after = self._ply.energy(u + share * du)
                if after - energy <= _ARMIJO * share * (f @ du) + _ROUND_OFF:
                    break
            u, energy = u + share * du, after
            f = self._ply.forces(u)
        return None, _MOST


METHODS: dict[str, type] = {"snes": Snes, "descent": Descent}


def main(source, target):
    """Form the ply of the input file and write its course."""
    case = {name: value[()] for name, value in np.load(source).items()}
    ply = Ply(case)
    solve = METHODS[str(case["method"])](ply)

    def search(u, travel):
        ply.travel.value = travel
        found, solves = solve(u)
        if found is not None:
            ply.advance(found)
        return found, solves

    rows, failure = formed(ply.nodes, search, ply.punch_force, case["travels"])
    np.savez(target, rows=rows, failure=failure)


if __name__ == "__main__":
    main(*sys.argv[1:])
