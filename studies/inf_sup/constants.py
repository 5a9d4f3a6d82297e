"""Inf-sup constant and kernel of a formulation, in norms in which the fabric has one.

The norm of a motion is that of H¹ on the unit square.  That of a tension T is what it
does on a motion of norm one, sup_v ∫ T δε(v)/‖v‖, taken over the motions of a finer
mesh.  The inf-sup constant of the fabric itself is then one.
"""

from typing import Any, NamedTuple

import numpy as np
from numpy import ndarray
from scipy.linalg import cholesky, eigh, solve_triangular
from scipy.sparse import csr_matrix, diags, kron
from scipy.sparse.linalg import splu
from skfem import BilinearForm, CellBasis, asm
from skfem.helpers import dot, grad

from .constraints import Constraints

#: Order to which norms are integrated.
ORDER = 6

# A squared singular value below this is zero.  The study complains where values near it
# leave a doubt.
_ZERO = 1e-9

# Right-hand sides that are solved for at a time, to bound the memory.
_BLOCK = 512


class Spectrum(NamedTuple):
    """Singular values of B and the motions that it does not see.

    Attributes
    ----------
    values
        Singular values of B that are not zero, from the smallest on.
    largest_zero
        The largest of those that count as zero.
    kernel
        Motions without strain that the law sees, shape (n_unknowns, n), orthonormal
        in H¹.
    in_l2
        The smallest singular value that is not zero with the norm of L² for tensions.
    """

    values: ndarray
    largest_zero: float
    kernel: ndarray
    in_l2: float

    @property
    def inf_sup(self) -> float:
        """The smallest singular value that is not zero."""
        return float(self.values[0])


def spectrum(constraints: Constraints, refined: int) -> Spectrum:
    """Singular values of B, with the norm of tensions from a mesh refined so often."""
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
    """∫ u v + ∇u·∇v of one component, shape (n_nodes, n_nodes)."""
    vector: Any = basis.elem
    scalar = CellBasis(basis.mesh, vector.elem, intorder=ORDER)
    return asm(BilinearForm(lambda u, v, w: u * v + dot(grad(u), grad(v))), scalar)


def gram(basis: CellBasis) -> csr_matrix:
    """The inner product of H¹, shape (n_unknowns, n_unknowns)."""
    return csr_matrix(kron(scalar_gram(basis), np.eye(2)))


def dual_gram(B: csr_matrix, scalar: csr_matrix) -> ndarray:
    """B M⁻¹ Bᵀ, the squared norm of tensions; M has the same block in x and in y."""
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
