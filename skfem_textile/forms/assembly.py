"""Assembly of the forms of the displacement by `asm`, on any basis of scikit-fem.

On a composite basis a form depends on the first vector field, the displacement, and is
zero for the others.  A form with a kernel is computed by it on the bases that the
kernel supports, and evaluated as defined on all others; arguments and results are the
same.
"""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np
from numpy import ndarray
from skfem import (
    BilinearForm,
    CellBasis,
    DiscreteField,
    ElementVector,
    Functional,
    LinearForm,
)

from ..mesh.bases import NO_SECOND_FIELD, MacroBasis, element_numbers, main_basis
from ..mesh.scikit_fem import COOData, OwnAssembly
from ..mesh.user_input import with_article
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

            every_element = np.arange(basis_mesh(basis).nelements)
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
            "is an integral over elements: pass a basis such as quad_basis(mesh, "
            "CENTRE)"
            if kind is CellBasis
            else f"requires a basis {kind.__name__}(mesh)"
        )
        raise ValueError(f"the form {required}, not {with_article(basis)}")
    mesh = basis_mesh(basis)
    if mesh.dim() != 2:
        raise ValueError(
            "the form requires a mesh of quadrilaterals or triangles in the plane, not "
            f"{type(mesh).__name__}"
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


def basis_mesh(basis: Any) -> Any:
    """Mesh of a basis, also of a product of bases."""
    return main_basis(basis).mesh


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
