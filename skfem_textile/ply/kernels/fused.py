"""scikit-fem forms whose numbers come from a kernel, where it knows the basis.

They are the forms that they are made of, ``form`` and all, and are assembled by `asm`
like any other; only what they are made of is not evaluated function by function.
"""

from typing import Any

import numpy as np
from numpy import ndarray
from skfem import BilinearForm, CellBasis, ElementVector, Functional, LinearForm

from ...forms import Forms
from .assembly import Part, element_forces, element_matrices, whole
from .kernel import Kernel
from .stencils import stencils


class FusedEnergy(Functional):
    """A functional with a kernel among its ``params``."""

    def _assemble(self, ubasis: Any, vbasis: Any = None, **kwargs: Any) -> Any:
        parts = _parts(self.params["kernel"], ubasis, kwargs)
        if not parts:
            return super()._assemble(ubasis, vbasis, **kwargs)
        return np.array([]), np.array([sum(part.energy() for part in parts)]), (), ()


class FusedResidual(LinearForm):
    """A linear form with a kernel among its ``params``."""

    def _assemble(self, ubasis: Any, vbasis: Any = None, **kwargs: Any) -> Any:
        kwargs.pop("tension", None)  # only the tangent may be given other tensions
        parts = _parts(self.params["kernel"], ubasis, kwargs)
        if not parts:
            return super()._assemble(ubasis, vbasis, **kwargs)
        f = np.zeros((ubasis.Nbfun, ubasis.nelems))
        for part in parts:
            own = element_forces([part])
            f[: 2 * len(own), part.at.elements] = own.reshape(-1, own.shape[-1])
        rows = np.array([ubasis.element_dofs.ravel()])
        return rows, f.ravel(), (ubasis.N,), (ubasis.Nbfun,)


class FusedTangent(BilinearForm):
    """A symmetric bilinear form with a kernel among its ``params``."""

    def _assemble(self, ubasis: Any, vbasis: Any = None, **kwargs: Any) -> Any:
        parts = _parts(self.params["kernel"], ubasis, kwargs)
        if not parts or vbasis not in (None, ubasis):
            return super()._assemble(ubasis, vbasis, **kwargs)
        n = ubasis.Nbfun
        K = np.zeros((n, n, ubasis.nelems))
        for part in parts:
            size, elements = 2 * len(part.at.nodes), part.at.elements
            K[:size, :size, elements] = whole(element_matrices([part]))
        dofs = ubasis.element_dofs
        rows, cols = np.broadcast_arrays(dofs[None], dofs[:, None])
        indices = np.array([rows.ravel(), cols.ravel()])
        return indices, K.ravel(), (ubasis.N, ubasis.N), (n, n)


def with_kernel(forms: Forms, kernel: Kernel) -> Forms:
    """The same forms, with their numbers from a kernel where it knows the basis."""
    energy, residual, tangent = forms
    return Forms(
        FusedEnergy(energy, kernel=kernel),
        FusedResidual(residual, kernel=kernel),
        FusedTangent(tangent, kernel=kernel),
    )


def knows(kernel: Kernel, basis: Any) -> bool:
    """Whether a kernel takes a basis, which must lie in the plane."""
    return _in_the_plane(basis) and kernel.takes(basis)


def _parts(kernel: Kernel, basis: Any, parameters: dict[str, Any]) -> list[Part]:
    """What the kernel sees; nothing where only the form itself will do."""
    u = parameters.get("u")
    if not isinstance(u, ndarray) or u.ndim != 1 or not knows(kernel, basis):
        return []
    return [
        Part(kernel, at, at.points, at.motions(u), parameters)
        for at in stencils(basis, kernel.fabric)
    ]


def _in_the_plane(basis: Any) -> bool:
    """Whether a basis has two components, unknowns 2k and 2k + 1 of each node."""
    if not isinstance(basis, CellBasis) or not isinstance(basis.elem, ElementVector):
        return False
    first, second = basis.element_dofs[::2], basis.element_dofs[1::2]
    return basis.elem.dim == 2 and bool(
        np.all((first % 2 == 0) & (second == first + 1))
    )
