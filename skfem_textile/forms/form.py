"""Common parts of all forms.

The internal energy of a ply is

    Ψ(u) = ∫ Σ_α ψ(ε_α) dΩ + ∫ w(Γ) dΩ + stabilisation.

The modules named after terms define the energy, residual (first derivative) and tangent
(second derivative) of each term, as scikit-fem forms with the displacement as their
parameter ``u``: ``asm(tension(fabric).residual, basis, u=u)``.
"""

from collections.abc import Callable, Iterable, Mapping
from functools import cache, partial, wraps
from inspect import signature
from operator import add, call
from typing import TYPE_CHECKING, Any, NamedTuple, Never, ParamSpec

import numpy as np
from numpy import ndarray
from skfem import (
    AbstractBasis,
    BilinearForm,
    CellBasis,
    DiscreteField,
    Functional,
    LinearForm,
)
from skfem.helpers import ddot, grad

from ..fabric import Fabric, is_zero
from ..fabric import kinematics as kin
from ..mesh.scikit_fem import FormExtraParams
from ..mesh.user_input import parameter
from . import kernels
from .assembly import EnergyForm, ResidualForm, TangentForm, is_displacement

if TYPE_CHECKING:
    from .kernels.kernel import Kernel


class Forms(NamedTuple):
    """Energy, residual and tangent of one term, with the parameter ``u``.

    The forms of this library can be assembled on any basis of the displacement: on all
    or some elements, and in composite elements, of which the first vector field is the
    displacement.  ``u`` is a DOF vector of the basis, or an interpolated field.

    The directions of the fabric may be replaced by parameters ``warp`` and ``weft``:
    DOF vectors of the basis, or arrays of shape (2, n_elements, n_points).

    Forms of terms on one basis add, ``tension(fabric) + shear(fabric)``: their sum is
    assembled at once, which takes less time.
    """

    energy: Functional
    residual: LinearForm
    tangent: BilinearForm

    @property
    def kernel(self) -> "Kernel | None":
        """Kernel of all three forms; None if they have none in common."""
        first, *others = (getattr(form, "kernel", None) for form in self)
        return first if all(kernel is first for kernel in others) else None

    def __add__(self, other: object) -> "Forms":
        """Forms of the sum of both terms, on one basis."""
        if not isinstance(other, Forms):
            return NotImplemented
        params = [forms.energy.params for forms in (self, other)]
        with_kernel, fabrics = (
            [x.get(k, ()) for x in params] for k in ("kernels", "fabrics")
        )
        kinds = {x.get("basis", CellBasis) for x in params}
        if len(kinds) > 1:
            raise ValueError(
                "forms on bases of different classes are assembled before they are "
                "added: asm(a.residual, basis, u=u) + asm(b.residual, jumps, u=u)"
            )
        energies, residuals, tangents = (
            (x.form, y.form) for x, y in zip(self, other, strict=True)
        )
        return _built(
            partial(add, self, other),
            Forms(
                Functional(lambda w: _total(energies, w)),
                LinearForm(lambda v, w: _total(residuals, v, w)),
                BilinearForm(lambda u, v, w: _total(tangents, u, v, w)),
            ),
            basis=kinds.pop(),
            fabrics=(*fabrics[0], *fabrics[1]),
            kernels=(*with_kernel[0], *with_kernel[1]) if all(with_kernel) else (),
        )

    @property
    def form(self) -> Never:
        """Not defined: `asm` takes one of the three forms."""
        raise ValueError(
            "asm assembles one form: pass forms.energy, forms.residual or forms.tangent"
        )


_P = ParamSpec("_P")

# Arguments of forms that are numbers in N/mm.
_STIFFNESSES = ("C_s", "C_j", "stiffness")


class _BuiltForms(Forms):
    """Forms that are pickled and copied as the call that builds them.

    The functions of forms are local to this call and cannot be pickled.
    """

    built_by: Callable[[], Forms]

    def __reduce__(self) -> tuple[Callable, tuple]:
        return call, (self.built_by,)


def _total(functions: Iterable[Callable | None], *fields: Any) -> Any:
    """Sum of the functions of forms."""
    return sum(function(*fields) for function in functions if function)


def _built(built_by: Callable[[], Forms], forms: Forms, **params: Any) -> Forms:
    """The forms with the parameters of `OfDisplacement`."""
    built = _BuiltForms(
        EnergyForm(forms.energy, **params),
        ResidualForm(forms.residual, **params),
        TangentForm(forms.tangent, **params),
    )
    built.built_by = built_by
    return built


def builds_forms(
    kernel: str = "",
    basis: type[AbstractBasis] = CellBasis,
) -> Callable[[Callable[_P, Forms]], Callable[_P, Forms]]:
    """Decorate a function that defines the forms of a term.

    The forms can be assembled on any basis (`assembly`), and pickled.

    Parameters
    ----------
    kernel
        Class in `kernels`, with the same arguments, that computes the same values.  It
        is imported at the first assembly.
    basis
        Class of the bases on which the forms are integrals; others are refused.
    """

    def decorate(function: Callable[_P, Forms]) -> Callable[_P, Forms]:
        @wraps(function)
        def build(*args: _P.args, **kwargs: _P.kwargs) -> Forms:
            arguments = _checked_arguments(function, *args, **kwargs)

            @cache
            def built_kernel() -> "Kernel":
                return getattr(kernels, kernel)(*args, **kwargs)

            return _built(
                partial(build, *args, **kwargs),
                function(*args, **kwargs),
                basis=basis,
                fabrics=tuple(v for k, v in arguments.items() if k == "fabric"),
                kernels=(built_kernel,) if kernel else (),
            )

        return build

    return decorate


def _checked_arguments(
    function: Callable, *args: Any, **kwargs: Any
) -> Mapping[str, Any]:
    """Arguments by name; a ValueError for a fabric or stiffness of the wrong type."""
    expected, name = signature(function), function.__name__
    try:
        arguments = expected.bind(*args, **kwargs).arguments
    except TypeError as error:
        raise TypeError(
            f"{name}({', '.join(expected.parameters)}): {error}; it returns the forms "
            "energy, residual and tangent for asm"
        ) from None
    for argument, value in arguments.items():
        if argument == "fabric" and not isinstance(value, Fabric):
            raise ValueError(
                f"{name} requires a Fabric such as Fabric(1e4), not {value!r}"
            )
        omitted = value is None and expected.parameters[argument].default is None
        if argument in _STIFFNESSES and not omitted:
            number = isinstance(value, int | float | np.number)
            if not number or not value >= 0:
                raise ValueError(
                    f"{name}: {argument} must be a number >= 0, not {value!r}"
                )
    return arguments


def of_density(energy: Callable, stress: Callable, stiffness: Callable) -> Forms:
    """Forms of an energy density, given its derivatives with respect to F."""

    @Functional
    def energy_form(w):
        return energy(w)

    @LinearForm
    def residual(v, w):
        return ddot(once(w, stress), gradient(v))

    @BilinearForm
    def tangent(u, v, w):
        return contract(gradient(v), once(w, stiffness), gradient(u))

    return Forms(energy_form, residual, tangent)


def once(w: FormExtraParams, function: Callable) -> Any:
    """``function(w)``, evaluated once per assembly, not once per basis function."""
    if function not in w:
        w[function] = function(w)
    return w[function]


def deformation(w: FormExtraParams) -> ndarray:
    """Deformation gradient of the parameter ``u``."""
    return kin.deformation_gradient(gradient(displacement(w)))


def displacement(w: FormExtraParams) -> DiscreteField:
    """The parameter ``u``; a ValueError if it is missing or not a vector field."""
    u = parameter(w, "u")
    if not is_displacement(u):
        raise ValueError(
            "the form requires a displacement with two or three components: pass a "
            "basis such as quad_basis(mesh, CENTRE), and u of shape (basis.N,)"
        )
    return u


def gradient(u: DiscreteField) -> ndarray:
    """Gradient of a field; a ValueError on an `HourglassBasis`."""
    if u.grad3 is not None:
        raise ValueError(
            "the form requires a basis with the whole gradient of the displacement, "
            "such as quad_basis(mesh, CENTRE), not an HourglassBasis"
        )
    return np.asarray(grad(u))


def directions(fabric: Fabric, w: FormExtraParams) -> tuple[ndarray, ndarray]:
    """Unit reference directions of warp and weft.

    Parameters ``warp`` and ``weft`` replace the directions of the fabric.
    """
    given = {name: _in_plane(name, w[name]) for name in ("warp", "weft") if name in w}
    return fabric.directions(np.asarray(w["x"]), elements(w), given)


def _in_plane(name: str, field: Any) -> ndarray:
    """Components along x and y of a direction field; the third must be zero."""
    if np.any(field[2:]):
        raise ValueError(f"{name} must lie in the plane of the mesh: z = 0")
    return np.asarray(field[:2])


def elements(w: FormExtraParams) -> ndarray | None:
    """Element number at each point; None if it is the row number."""
    return np.asarray(w["element"]) if "element" in w else None


def outer(S: ndarray, T: ndarray) -> ndarray:
    """S ⊗ T."""
    return np.einsum("iJ...,kL...->iJkL...", S, T)


def contract(S: ndarray, C: ndarray, T: ndarray) -> ndarray:
    """S : C : T."""
    return np.einsum("iJ...,iJkL...,kL...->...", S, C, T)


def families_with_law(fabric: Fabric) -> list[int]:
    """Families with a tension law: 0 for the warp, 1 for the weft."""
    return [i for i, f in enumerate(fabric.families) if not is_zero(f.tension)]


def mean(w: Any, x: ndarray) -> ndarray:
    """Element mean of values at points, shape (..., n_elements, 1).

    ``w`` are the form parameters on a `MeanBasis`.
    """
    if "share" not in w:
        raise ValueError("the form requires a MeanBasis or a MacroBasis")
    return (w["share"] * x).sum(axis=-1, keepdims=True)
