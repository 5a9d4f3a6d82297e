"""Common parts of all forms, and their assembly on any basis of scikit-fem.

The internal energy of a ply is

    Ψ(u) = ∫ Σ_α ψ(ε_α) dΩ + ∫ w(Γ) dΩ + stabilisation.

The modules named after terms define the energy, residual (first derivative) and tangent
(second derivative) of each term, as scikit-fem forms with the displacement as their
parameter ``u``: ``asm(tension(fabric).residual, basis, u=u)``.

On a composite basis a form depends on the first vector field, the displacement, and is
zero for the others.  A form with a kernel is computed by it on the bases that the
kernel supports, and evaluated as defined on all others; arguments and results are the
same.
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import cache, partial, wraps
from inspect import signature
from operator import add, call
from typing import TYPE_CHECKING, Any, NamedTuple, Never, ParamSpec, TypeAlias

import numpy as np
from numpy import ndarray
from skfem import (
    AbstractBasis,
    BilinearForm,
    CellBasis,
    DiscreteField,
    ElementVector,
    Functional,
    LinearForm,
)
from skfem.helpers import ddot, grad

from ..fabric import Fabric, is_zero
from ..fabric import kinematics as kin
from ..mesh.bases import NO_SECOND_FIELD, MacroBasis, element_numbers, main_basis
from ..mesh.scikit_fem import COOData, FormExtraParams, OwnAssembly
from ..mesh.user_input import parameter, with_article
from . import kernels

if TYPE_CHECKING:
    from .kernels.kernel import Kernel, KernelState

#: Arguments of a form by name.
Parameters: TypeAlias = dict[str, Any]

# Parameters that are displacements or fibre directions, given as DOF vectors or fields.
_DISPLACEMENTS, _DIRECTIONS = ("u", "last"), ("warp", "weft")

# Leading shape of the parameters at elements and points.
_LEADING = {"C_s": (), "moment": (), "E_d": (2,), "tension": (2,)}


class OfDisplacement(OwnAssembly):
    """A form of one or more terms.

    Its ``params`` are the ``fabrics`` of the terms, and functions that return their
    ``kernels``: empty if a term has none.
    """

    params: dict[str, Any]

    @property
    def kernels(self) -> "list[Kernel]":
        """Kernels of the terms."""
        return [kernel() for kernel in self.params["kernels"]]

    @property
    def kernel(self) -> "Kernel | None":
        """Kernel that computes the form where it can; None for several terms."""
        return self.kernels[0] if len(self.params["kernels"]) == 1 else None

    def checked(self, basis: Any, parameters: Parameters) -> Parameters:
        """Parameters with the element numbers; see `OwnAssembly`."""
        refuse_basis(basis, self.params["basis"])
        for name, value in parameters.items():
            if name in _DISPLACEMENTS:
                _refuse_displacement(name, value, basis)
            elif name in _DIRECTIONS or name in _LEADING:
                _refuse_shape(name, value, basis)
        if self.params["fabrics"]:
            from ..fabric.regions import fabric_on

            every_element = np.arange(main_basis(basis).mesh.nelements)
            for fabric in self.params["fabrics"]:
                fabric_on(every_element, fabric)
        return {"element": element_numbers(basis), **parameters}

    def taken(self, fields: tuple[DiscreteField, ...]) -> tuple[DiscreteField, ...]:
        """The displacement, the first vector field; see `OwnAssembly`."""
        if len(fields) == 1:
            return fields
        return next(((x,) for x in fields if is_displacement(x)), fields[:1])

    def states(self, basis: Any, parameters: Parameters) -> "list[list[KernelState]]":
        """States of the kernels; empty if a form is evaluated as defined."""
        u: Any = parameters.get("u")
        of_kernels = isinstance(u, ndarray) and u.ndim == 1 and self.params["kernels"]
        if not of_kernels or any(name in parameters for name in _DIRECTIONS):
            return []
        if not all(kernels.can_compute(kernel, basis) for kernel in self.kernels):
            return []
        return kernels.states(self.kernels, basis, u, self.checked(basis, parameters))


class EnergyForm(OfDisplacement, Functional):
    """A functional of the displacement."""

    def entries(
        self, ubasis: Any, vbasis: Any, parameters: Parameters
    ) -> COOData | None:
        """Energy of the kernels."""
        states = self.states(ubasis, parameters)
        return kernels.energy_entries(states) if states else None


class ResidualForm(OfDisplacement, LinearForm):
    """A linear form that depends on the displacement."""

    def entries(
        self, ubasis: Any, vbasis: Any, parameters: Parameters
    ) -> COOData | None:
        """Forces of the kernels."""
        parameters.pop("tension", None)  # only the tangent accepts other tensions
        states = self.states(ubasis, parameters)
        return kernels.force_entries(ubasis, states) if states else None


class TangentForm(OfDisplacement, BilinearForm):
    """A symmetric bilinear form that depends on the displacement."""

    def entries(
        self, ubasis: Any, vbasis: Any, parameters: Parameters
    ) -> COOData | None:
        """Stiffness of the kernels."""
        vbasis = ubasis if vbasis is None else vbasis
        sizes = [(basis.N, basis.nelems) for basis in (ubasis, vbasis)]
        if sizes[0] != sizes[1]:
            (n, elements), (m, others) = sizes
            raise ValueError(
                "the tangent requires one basis, or two of the same unknowns and "
                f"elements: got {n} and {m} unknowns, {elements} and {others} elements"
            )
        states = self.states(ubasis, parameters)
        if not states or vbasis is not ubasis:
            return None
        return kernels.stiffness_entries(ubasis, states)


def is_displacement(field: Any) -> bool:
    """True for a vector field with two or three components and a gradient."""
    return (
        isinstance(field, DiscreteField)
        and field.ndim == 3
        and len(field) in (2, 3)
        and field.grad is not None
    )


def refuse_basis(basis: Any, kind: type) -> None:
    """Refuse a basis of another kind, or on which no displacement of a ply is defined.

    The mesh must lie in the plane, and the displacement must vary in elements.
    """
    if any(isinstance(x, MacroBasis) for x in getattr(basis, "bases", ())):
        raise ValueError(f"the form is on a product of bases: {NO_SECOND_FIELD}")
    if not isinstance(main_basis(basis), kind):
        required = (
            "of elements, such as quad_basis(mesh, CENTRE)"
            if kind is CellBasis
            else f"{kind.__name__}(mesh)"
        )
        raise ValueError(f"the basis must be {required}, not {with_article(basis)}")
    mesh = main_basis(basis).mesh
    if mesh.dim() != 2:
        raise ValueError(
            "the basis must have a mesh of quadrilaterals or triangles in the plane, "
            f"not {type(mesh).__name__}"
        )
    if not np.isfinite(basis.dx).all():
        raise ValueError("the mesh of the basis has positions that are not finite")
    element: Any = main_basis(basis).elem
    parts = getattr(element, "elems", (element,))
    first = next((x for x in parts if isinstance(x, ElementVector)), None)
    if first and first.elem.maxdeg == 0:
        raise ValueError(
            f"{type(first.elem).__name__} has no gradient: use a displacement that "
            "varies in elements, such as ElementVector(ElementQuad1())"
        )


def _refuse_displacement(name: str, value: Any, basis: Any) -> None:
    """Refuse a displacement that is neither a DOF vector nor a field of the basis."""
    fields = value if isinstance(value, tuple) else (value,)
    if all(isinstance(field, DiscreteField) for field in fields):
        _refuse_fields(name, fields, basis)
        return
    if not isinstance(value, ndarray) or value.ndim != 1:
        kind = type(value).__name__
        what = f"shape {value.shape}" if isinstance(value, ndarray) else kind
        raise ValueError(
            f"{name} must be a DOF vector of shape (basis.N,), or a field "
            f"basis.interpolate({name}), not {what}"
        )
    if len(value) != basis.N or value.dtype.kind not in "biuf":
        raise ValueError(
            f"{name} must have {basis.N} real numbers, one for each unknown of the "
            f"basis, got {len(value)} of type {value.dtype}"
        )
    _refuse_infinite(name, value)


def _refuse_fields(name: str, fields: Sequence[DiscreteField], basis: Any) -> None:
    """Refuse interpolated fields of another basis."""
    of_basis = {len(x) for x in basis.basis[0] if is_displacement(x)}
    for field in fields:
        _refuse_points(name, np.shape(field), basis)
        if is_displacement(field):
            if of_basis and len(field) not in of_basis:
                raise ValueError(
                    f"{name} has {len(field)} components, but the displacement of the "
                    f"basis has {of_basis.pop()}"
                )
            _refuse_infinite(name, np.asarray(field.grad))


def _refuse_infinite(name: str, values: ndarray) -> None:
    wrong = values.size - np.count_nonzero(np.isfinite(values))
    if wrong:
        raise ValueError(
            f"{name} must be finite: {wrong} of its {values.size} values are not"
        )


def _refuse_shape(name: str, value: Any, basis: Any) -> None:
    """Refuse values that are not given by element or by point, or are negative."""
    array, direction = np.asarray(value), name in _DIRECTIONS
    if array.dtype.kind not in "biuf":
        raise ValueError(f"{name} must be real-valued, got {array.dtype}")
    if direction and array.shape == (basis.N,):
        return  # a DOF vector
    in_space = direction and array.ndim == 3 and len(array) == 3
    leading = (3,) if in_space else _LEADING.get(name, (2,))
    if array.ndim or leading:
        if array.ndim != len(leading) + 2 or array.shape[:-2] != leading:
            shape = ", ".join([*map(str, leading), "n_elements", "1"])
            also = " or a DOF vector of the basis" if direction else ""
            raise ValueError(
                f"{name} must have the shape ({shape}), or (..., n_points) by point"
                f"{also}, got {array.shape}"
            )
        _refuse_points(name, array.shape, basis)
    if not direction:
        _refuse_infinite(name, array)
    if name in ("C_s", "E_d") and (array < 0).any():
        raise ValueError(f"{name} must be >= 0, got {array.min():g}")


def _refuse_points(name: str, shape: tuple[int, ...], basis: Any) -> None:
    """Refuse a shape whose last two entries do not fit the elements and points."""
    n_elements, n_points = basis.dx.shape
    if len(shape) < 2 or shape[-2] != n_elements or shape[-1] not in (1, n_points):
        raise ValueError(
            f"{name} has the shape {tuple(shape)}, but the basis has {n_elements} "
            f"elements with {n_points} point(s)"
        )


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


_signature = cache(signature)


def _checked_arguments(
    function: Callable, *args: Any, **kwargs: Any
) -> Mapping[str, Any]:
    """Arguments by name; a ValueError for a fabric or stiffness of the wrong type."""
    expected, name = _signature(function), function.__name__
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
