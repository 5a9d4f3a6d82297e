"""scikit-fem forms with a kernel, which computes their entries where it can.

`asm` assembles them like any other form; on a basis that the kernel does not take the
form itself is evaluated.
"""

from typing import Any

import numpy as np
from numpy import ndarray
from skfem import BilinearForm, CellBasis, ElementVector, Functional, LinearForm

from ...forms import Forms
from ...mesh.scikit_fem import (
    Entries,
    OwnAssembly,
    matrix_entries,
    number_entries,
    vector_entries,
)
from .assembly import KernelOnGroup, element_forces, element_matrices, full_matrices
from .element_groups import Kernel, element_groups


class KernelEnergy(OwnAssembly, Functional):
    """A functional with a kernel among its ``params``."""

    def entries(
        self, ubasis: Any, vbasis: Any, parameters: dict[str, Any]
    ) -> Entries | None:
        """Energy of the kernel."""
        kernels = _kernels(self.params["kernel"], ubasis, parameters)
        return number_entries(sum(k.energy() for k in kernels)) if kernels else None


class KernelResidual(OwnAssembly, LinearForm):
    """A linear form with a kernel among its ``params``."""

    def entries(
        self, ubasis: Any, vbasis: Any, parameters: dict[str, Any]
    ) -> Entries | None:
        """Forces of the kernel."""
        parameters.pop("tension", None)  # only the tangent takes other tensions
        kernels = _kernels(self.params["kernel"], ubasis, parameters)
        if not kernels:
            return None
        f = np.zeros((ubasis.Nbfun, ubasis.nelems))
        for kernel in kernels:
            forces = element_forces([kernel])
            of_unknowns = forces.reshape(-1, forces.shape[-1])
            f[: len(of_unknowns), kernel.group.elements] = of_unknowns
        return vector_entries(ubasis, f)


class KernelTangent(OwnAssembly, BilinearForm):
    """A symmetric bilinear form with a kernel among its ``params``."""

    def entries(
        self, ubasis: Any, vbasis: Any, parameters: dict[str, Any]
    ) -> Entries | None:
        """Stiffness of the kernel."""
        kernels = _kernels(self.params["kernel"], ubasis, parameters)
        if not kernels or vbasis not in (None, ubasis):
            return None
        K = np.zeros((ubasis.Nbfun, ubasis.Nbfun, ubasis.nelems))
        for kernel in kernels:
            matrices = full_matrices(element_matrices([kernel]))
            K[: len(matrices), : len(matrices), kernel.group.elements] = matrices
        return matrix_entries(ubasis, K)


def with_kernel(forms: Forms, kernel: Kernel) -> Forms:
    """Forms with a kernel, which computes their entries where it can."""
    energy, residual, tangent = forms
    return Forms(
        KernelEnergy(energy, kernel=kernel),
        KernelResidual(residual, kernel=kernel),
        KernelTangent(tangent, kernel=kernel),
    )


def can_compute(kernel: Kernel, basis: Any) -> bool:
    """Whether a kernel takes a basis, which must have unknowns node by node."""
    return _node_by_node(basis) and kernel.takes(basis)


def _kernels(
    kernel: Kernel, basis: Any, parameters: dict[str, Any]
) -> list[KernelOnGroup]:
    """The kernel on each group of elements; empty if it cannot compute these."""
    u = parameters.get("u")
    if not isinstance(u, ndarray) or u.ndim != 1 or not can_compute(kernel, basis):
        return []
    return [
        KernelOnGroup(kernel, group, group.points, group.deformations(u), parameters)
        for group in element_groups(basis, kernel.fabric)
    ]


def _node_by_node(basis: Any) -> bool:
    """Whether a basis has d = 2 or 3 components, unknowns from dk on of each node k."""
    if not isinstance(basis, CellBasis) or not isinstance(basis.elem, ElementVector):
        return False
    if (d := basis.elem.dim) not in (2, 3):
        return False
    of_nodes = basis.element_dofs.reshape(-1, d, basis.nelems)
    first = of_nodes[:, :1]
    return bool(np.all((first % d == 0) & (of_nodes == first + np.arange(d)[:, None])))
