"""Inextensibility constraints and the inf-sup constant of a formulation.

In the limit of stiff fibres, a formulation imposes ∫ φ δε_α = 0 for each fibre family α
and each tension φ of its tension space.  Tensions are polynomials on the elements on
which the law is evaluated: constant for one point, bilinear for quadrilaterals with 2×2
points, linear for triangles with three.  The quadrature integrates φ δε exactly.

Displacements have the H¹ norm on the unit square.  Tensions have the dual norm
sup_v ∫ T δε(v)/‖v‖ over the displacements of a finer mesh.  The inf-sup constant of the
continuous problem is then one.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy import ndarray
from scipy.linalg import cholesky, eigh, solve_triangular
from scipy.sparse import csr_matrix, diags, kron, vstack
from scipy.sparse.linalg import splu
from skfem import BilinearForm, CellBasis, Mesh, asm
from skfem.helpers import ddot, dot, grad

from skfem_textile.fabric import Fabric
from skfem_textile.fabric import kinematics as kin
from skfem_textile.mesh.bases import MeanBasis
from skfem_textile.ply.terms import Formulation

#: Integration order of norms.
ORDER = 6

# Squared singular values below this are zero; the study fails without a clear gap.
_ZERO = 1e-9

# Number of right-hand sides per solve, to limit memory.
_BLOCK = 512

# Exponents of the reference coordinates by the number of tension values per element.
_POWERS = {
    1: ((0, 0),),
    3: ((0, 0), (1, 0), (0, 1)),
    4: ((0, 0), (1, 0), (0, 1), (1, 1)),
}


@dataclass(frozen=True, eq=False)
class Constraints:
    """Constraints of a formulation about a homogeneous state with unstretched fibres.

    Attributes
    ----------
    mesh
        Working mesh of the formulation.
    fabric
        Fabric with the fibre directions.
    formulation
        Formulation with the quadrature points and the elements of strain averages.
    F
        Deformation gradient of the state, shape (2, 2).
    """

    mesh: Mesh
    fabric: Fabric
    formulation: Formulation
    F: ndarray

    @cached_property
    def basis(self) -> CellBasis:
        """Basis of the displacement."""
        return self.formulation.basis(self.mesh)

    @cached_property
    def _law_basis(self) -> Any:
        """Basis on the elements on which the law is evaluated."""
        return self.formulation.tension_term(self.basis, self.fabric).basis

    @cached_property
    def matrix(self) -> csr_matrix:
        """B, shape (n_constraints, n_unknowns): area-weighted strains of the law.

        Warp rows precede weft rows.  A row is the derivative of the strain at a point
        times its weight, or of the element average times the element area.
        """
        basis = self._law_basis
        n, points = basis.dx.shape
        if isinstance(basis, MeanBasis):
            return self._rows(basis, np.arange(n)[:, None], np.ones(1))
        values = np.eye(points)[:, None]
        return self._rows(basis, np.arange(n)[:, None], values)

    @cached_property
    def areas(self) -> ndarray:
        """Area weight of each row of B, shape (n_constraints,).

        This diagonal is the L² mass matrix of tensions, integrated exactly.
        """
        dx = self._law_basis.dx
        areas = dx.sum(axis=1) if isinstance(self._law_basis, MeanBasis) else dx.ravel()
        return np.tile(areas, 2)

    def on_finer_mesh(self, times: int) -> tuple[CellBasis, csr_matrix]:
        """A basis on the refined mesh, and B on it for the same tensions.

        Each refinement divides an element into four.
        """
        fine = self.formulation.basis(self.mesh.refined(times))
        element = np.tile(np.arange(self.mesh.nelements), 4**times)
        if isinstance(self._law_basis, MeanBasis):
            parent = self._elements_of_law()[element]
            return fine, self._rows(fine, parent[:, None], np.ones(1))
        powers = _POWERS[self.basis.X.shape[1]]

        def monomials(xi: ndarray) -> ndarray:
            return np.array([xi[0] ** i * xi[1] ** j for i, j in powers])

        x = np.asarray(fine.global_coordinates())
        inside = monomials(self.basis.mapping.invF(x, tind=element))
        coefficients = np.linalg.inv(monomials(self.basis.X))
        tensions = np.einsum("kp,pen->ken", coefficients, inside)
        return fine, self._rows(fine, element[:, None], tensions)

    def _elements_of_law(self) -> ndarray:
        """For each element of the mesh, the element on which the law is evaluated."""
        parts = self._law_basis.parts
        if parts is None:
            return np.arange(self.mesh.nelements)
        of_part = np.empty(self.mesh.nelements, dtype=int)
        numbers = np.broadcast_to(np.arange(len(parts))[:, None], parts.shape)
        of_part[parts[parts >= 0]] = numbers[parts >= 0]
        return of_part

    def _rows(self, basis: Any, element: ndarray, tensions: ndarray) -> csr_matrix:
        """∫ φ δε of warp and weft on a basis.

        Parameters
        ----------
        basis
            Displacement basis with quadrature exact for φ δε.
        element
            Tension element of each element of the basis, shape (n, 1).
        tensions
            Values of the tensions at the points, broadcastable to (n_tensions, n,
            n_points).
        """
        weights = (tensions * basis.dx).reshape(-1, *basis.dx.shape)
        n_tensions, n_rows = len(weights), (element.max() + 1) * len(weights)
        rows = element.T * n_tensions + np.arange(n_tensions)[:, None]
        families = []
        for A in self.fabric.directions(np.asarray(basis.global_coordinates())):
            d_eps = kin.fibre_strain_d(self.F[:, :, None, None], A)
            strains = np.array([ddot(d_eps, grad(field)) for (field,) in basis.basis])
            values = np.einsum("ken,ien->ike", weights, strains)
            columns = basis.element_dofs[:, None]
            entries = [
                np.broadcast_to(x, values.shape).ravel() for x in (rows, columns)
            ]
            matrix = csr_matrix((values.ravel(), entries), (n_rows, basis.N))
            families.append(matrix)
        return vstack(families, format="csr")


class Spectrum(NamedTuple):
    """Singular values and kernel of B.

    Attributes
    ----------
    values
        Non-zero singular values of B in ascending order.
    largest_zero
        The largest singular value that counts as zero.
    kernel
        Kernel of B, shape (n_unknowns, n), orthonormal in H¹.
    in_l2
        The smallest non-zero singular value with the L² norm of tensions.
    """

    values: ndarray
    largest_zero: float
    kernel: ndarray
    in_l2: float

    @property
    def inf_sup(self) -> float:
        """The smallest non-zero singular value."""
        return float(self.values[0])


def spectrum(constraints: Constraints, refined: int) -> Spectrum:
    """Singular values of B, with the tension norm from a mesh refined so many times."""
    B, M = constraints.matrix, gram(constraints.basis)
    fine, B_fine = constraints.on_finer_mesh(refined)
    factor = cholesky(dual_gram(B_fine, scalar_gram(fine)), lower=True)
    scaled = solve_triangular(factor, B.toarray(), lower=True)
    squares, motions = eigh(scaled.T @ scaled, M.toarray())
    zero = squares < _ZERO
    largest_zero = float(np.sqrt(np.abs(squares[zero]).max()))
    in_l2 = eigh(
        (B.T @ diags(1 / constraints.areas) @ B).toarray(),
        M.toarray(),
        eigvals_only=True,
        subset_by_index=[zero.sum(), zero.sum()],
    )
    return Spectrum(
        values=np.sqrt(squares[~zero]),
        largest_zero=largest_zero,
        kernel=motions[:, zero],
        in_l2=float(np.sqrt(in_l2[0])),
    )


def scalar_gram(basis: CellBasis) -> csr_matrix:
    """∫ u v + ∇u·∇v for one component, shape (n_nodes, n_nodes)."""
    vector: Any = basis.elem
    scalar = CellBasis(basis.mesh, vector.elem, intorder=ORDER)
    return asm(BilinearForm(lambda u, v, w: u * v + dot(grad(u), grad(v))), scalar)


def gram(basis: CellBasis) -> csr_matrix:
    """Matrix of the H¹ inner product, shape (n_unknowns, n_unknowns)."""
    return csr_matrix(kron(scalar_gram(basis), np.eye(2)))


def dual_gram(B: csr_matrix, scalar: csr_matrix) -> ndarray:
    """B M⁻¹ Bᵀ, the Gram matrix of tensions; M has the same block for x and y."""
    factors = splu(
        scalar.tocsc(),
        permc_spec="MMD_AT_PLUS_A",
        diag_pivot_thresh=0.0,
        options={"SymmetricMode": True},
    )
    total = np.zeros((B.shape[0], B.shape[0]))
    for component in range(2):
        B_i = B[:, component::2].tocsr()
        for first in range(0, B.shape[0], _BLOCK):
            rows = slice(first, first + _BLOCK)
            total[:, rows] += B_i @ factors.solve(B_i[rows].toarray().T)
    return (total + total.T) / 2
