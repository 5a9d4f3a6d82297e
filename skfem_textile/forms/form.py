"""Common parts of all forms.

The internal energy of a ply is

    Ψ(u) = ∫ Σ_α ψ(ε_α) dΩ + ∫ w(Γ) dΩ + stabilisation.

Every other module in this folder defines the energy, residual (first derivative) and
tangent (second derivative) of one term, as scikit-fem forms with the displacement as
their parameter ``u``: ``asm(tension(fabric).residual, basis, u=u)``.
"""

from collections.abc import Callable, Mapping
from functools import partial, wraps
from operator import call
from typing import Any, NamedTuple, ParamSpec

import numpy as np
from numpy import ndarray
from skfem import BilinearForm, DiscreteField, Functional, LinearForm
from skfem.helpers import ddot, grad

from ..fabric import Fabric, is_zero
from ..fabric import kinematics as kin
from ..mesh.scikit_fem import FormExtraParams


class Forms(NamedTuple):
    """Energy, residual and tangent of one term, with the parameter ``u``."""

    energy: Functional
    residual: LinearForm
    tangent: BilinearForm


_P = ParamSpec("_P")


class _BuiltForms(Forms):
    """Forms that are pickled and copied as the call that builds them.

    The functions of forms are local to this call and cannot be pickled.
    """

    built_by: Callable[[], Forms]

    def __reduce__(self) -> tuple[Callable, tuple]:
        return call, (self.built_by,)


def builds_forms(function: Callable[_P, Forms]) -> Callable[_P, Forms]:
    """Let the forms that a function of a module returns be pickled."""

    @wraps(function)
    def build(*args: _P.args, **kwargs: _P.kwargs) -> Forms:
        forms = _BuiltForms(*function(*args, **kwargs))
        forms.built_by = partial(build, *args, **kwargs)
        return forms

    return build


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
    """The parameter ``u``; a ValueError if it is missing or not a vector field.

    Also on a `FacetBasis`, which has normals.
    """
    if "n" in w:
        raise ValueError(
            "the form is an integral over elements: pass a basis such as "
            "quad_basis(mesh, CENTRE), not a FacetBasis"
        )
    u = parameter(w, "u")
    if np.ndim(u) != 3 or len(u) not in (2, 3) or u.grad is None:
        raise ValueError(
            "the form requires a displacement with two or three components: pass a "
            "basis such as quad_basis(mesh, CENTRE), and u of shape (basis.N,)"
        )
    return u


def parameter(w: Mapping[str, Any], name: str) -> Any:
    """Parameter of a form; a ValueError if it is missing."""
    if name not in w:
        raise ValueError(
            f"the form requires the parameter {name!r}: asm(form, basis, {name}=...)"
        )
    return w[name]


def gradient(u: DiscreteField) -> ndarray:
    """Gradient of a field; a ValueError on an `HourglassBasis`."""
    if u.grad3 is not None:
        raise ValueError(
            "the form requires a basis with the whole gradient of the displacement, "
            "such as quad_basis(mesh, CENTRE), not an HourglassBasis"
        )
    return np.asarray(grad(u))


def directions(fabric: Fabric, w: FormExtraParams) -> tuple[ndarray, ndarray]:
    """Unit reference directions of warp and weft."""
    return fabric.directions(np.asarray(w["x"]), elements(w))


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
