"""scikit-fem forms with a kernel, which computes their entries where possible.

`asm` assembles them like any other form; on a basis that the kernel does not support,
the form itself is evaluated.
"""

from collections.abc import Callable
from functools import wraps
from typing import Any, ParamSpec

import numpy as np
from numpy import ndarray
from skfem import BilinearForm, Functional, LinearForm

from ... import forms
from ...forms import Forms
from ...forms.form import builds_forms
from ...mesh.scikit_fem import (
    Entries,
    OwnAssembly,
    matrix_entries,
    number_entries,
    vector_entries,
)
from .elements import element_groups
from .kernel import (
    HourglassKernel,
    Kernel,
    KernelState,
    MeanTensionKernel,
    ShearKernel,
    TensionKernel,
    can_compute,
    element_forces,
    element_matrices,
    full_matrices,
)

_P = ParamSpec("_P")


class KernelEnergy(OwnAssembly, Functional):
    """A functional with a kernel among its ``params``."""

    def entries(
        self, ubasis: Any, vbasis: Any, parameters: dict[str, Any]
    ) -> Entries | None:
        """Energy of the kernel."""
        states = _states(self.params["kernel"], ubasis, parameters)
        energy = sum(x.kernel.energy(x) for x in states)
        return number_entries(energy) if states else None


class KernelResidual(OwnAssembly, LinearForm):
    """A linear form with a kernel among its ``params``."""

    def entries(
        self, ubasis: Any, vbasis: Any, parameters: dict[str, Any]
    ) -> Entries | None:
        """Forces of the kernel."""
        parameters.pop("tension", None)  # only the tangent accepts other tensions
        states = _states(self.params["kernel"], ubasis, parameters)
        if not states:
            return None
        f = np.zeros((ubasis.Nbfun, ubasis.nelems))
        for x in states:
            forces = element_forces([x])
            of_unknowns = forces.reshape(-1, forces.shape[-1])
            f[: len(of_unknowns), x.group.elements] = of_unknowns
        return vector_entries(ubasis, f)


class KernelTangent(OwnAssembly, BilinearForm):
    """A symmetric bilinear form with a kernel among its ``params``."""

    def entries(
        self, ubasis: Any, vbasis: Any, parameters: dict[str, Any]
    ) -> Entries | None:
        """Stiffness of the kernel."""
        states = _states(self.params["kernel"], ubasis, parameters)
        if not states or vbasis not in (None, ubasis):
            return None
        K = np.zeros((ubasis.Nbfun, ubasis.Nbfun, ubasis.nelems))
        for x in states:
            matrices = full_matrices(element_matrices([x]))
            K[: len(matrices), : len(matrices), x.group.elements] = matrices
        return matrix_entries(ubasis, K)


@builds_forms
def with_kernel(definition: Forms, kernel: Kernel) -> Forms:
    """Attach a kernel with the same arguments to the forms of a term."""
    energy, residual, tangent = definition
    return Forms(
        KernelEnergy(energy, kernel=kernel),
        KernelResidual(residual, kernel=kernel),
        KernelTangent(tangent, kernel=kernel),
    )


def _states(
    kernel: Kernel, basis: Any, parameters: dict[str, Any]
) -> list[KernelState]:
    """Kernel on each group of elements; empty if it does not support the basis."""
    u = parameters.get("u")
    if not isinstance(u, ndarray) or u.ndim != 1 or not can_compute(kernel, basis):
        return []
    return [
        KernelState(kernel, g, g.points, g.deformations(u, g.points), parameters)
        for g in element_groups(basis, kernel.fabric)
    ]


def _with_kernel_of(
    definition: Callable[_P, Forms], kernel: Callable[_P, Kernel]
) -> Callable[_P, Forms]:
    """Attach to the forms of a term a kernel that takes the same arguments."""

    @wraps(definition)
    def wrapped(*args: _P.args, **kwargs: _P.kwargs) -> Forms:
        return with_kernel(definition(*args, **kwargs), kernel(*args, **kwargs))

    return wrapped


tension = _with_kernel_of(forms.tension, TensionKernel)
shear = _with_kernel_of(forms.shear, ShearKernel)
hourglass = _with_kernel_of(forms.hourglass, HourglassKernel)
mean_tension = _with_kernel_of(forms.mean_tension, MeanTensionKernel)
