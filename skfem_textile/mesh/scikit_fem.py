"""Uses of scikit-fem beyond its public interface.

Written for scikit-fem 12.  `PRIVATE` lists them; for each one,
`tests/mesh/test_scikit_fem.py` fails if a later version differs.  Other modules import
only from `skfem` and `skfem.helpers`.
"""

from dataclasses import replace
from typing import Any, TypeAlias, TypeVar

import numpy as np
from numpy import ndarray
from skfem import AbstractBasis, DiscreteField, Mesh
from skfem.assembly.form.form import FormExtraParams as FormExtraParams
from skfem.quadrature import get_quadrature as get_quadrature

_Mesh = TypeVar("_Mesh", bound=Mesh)

#: Arguments of `skfem.assembly.form.coo_data.COOData`: indices, values, shapes of the
#: whole and of an element.
Entries: TypeAlias = tuple[ndarray, ndarray, tuple[int, ...], tuple[int, ...]]


#: Private names of scikit-fem that the package uses, with their use.
PRIVATE = {
    "Mesh._boundaries, Mesh._subdomains": "names that are replaced in a copy of a mesh",
    "AbstractBasis._element_dofs": "unknowns of the elements of a basis",
    "AbstractBasis._global_coordinates": "positions of the points of a basis",
    "Form._assemble": "entries of a form that are computed without its function",
    "DiscreteField.grad3": "slot for the centre gradient of a bilinear function",
    "skfem.assembly.form.form.FormExtraParams": "parameters of a form, in annotations",
    "skfem.quadrature.get_quadrature": "points and weights of a rule on an element",
}


def with_names(
    mesh: _Mesh,
    boundaries: dict[str, ndarray] | None,
    subdomains: dict[str, ndarray] | None,
) -> _Mesh:
    """Copy of a mesh with exactly these boundaries and subdomains, as numbers.

    `skfem.Mesh.with_boundaries` keeps existing names, and so cannot remove any.
    """
    return replace(mesh, _boundaries=boundaries, _subdomains=subdomains)


def set_element_dofs(basis: AbstractBasis, element_dofs: ndarray) -> None:
    """Set the unknowns of the elements of a basis, shape (n_functions, n_elements)."""
    basis._element_dofs = element_dofs
    basis.Nbfun = len(element_dofs)


def set_positions(basis: AbstractBasis, x: ndarray) -> None:
    """Set the positions of the points of a basis, (2, n_elements, n_points)."""
    basis._global_coordinates = DiscreteField(x)


class OwnAssembly:
    """Mixin for forms that may compute their entries without evaluating their function.

    It must precede a scikit-fem form in the bases of a class.
    """

    def entries(
        self, ubasis: Any, vbasis: Any, parameters: dict[str, Any]
    ) -> Entries | None:
        """Entries computed directly, or None to evaluate the form as usual."""
        raise NotImplementedError

    def _assemble(self, ubasis: Any, vbasis: Any = None, **parameters: Any) -> Any:
        entries = self.entries(ubasis, vbasis, parameters)
        if entries is not None:
            return entries
        form: Any = super()
        return form._assemble(ubasis, vbasis, **parameters)


def number_entries(value: float) -> Entries:
    """Entries of a functional."""
    return np.array([]), np.array([value]), (), ()


def vector_entries(basis: Any, f: ndarray) -> Entries:
    """Entries of a linear form, given as (n_functions, n_elements)."""
    rows = np.array([basis.element_dofs.ravel()])
    return rows, f.ravel(), (basis.N,), (basis.Nbfun,)


def matrix_entries(basis: Any, K: ndarray) -> Entries:
    """Entries of a symmetric form, as (n_functions, n_functions, n_elements)."""
    dofs = basis.element_dofs
    rows, cols = np.broadcast_arrays(dofs[None], dofs[:, None])
    indices = np.array([rows.ravel(), cols.ravel()])
    return indices, K.ravel(), (basis.N, basis.N), (basis.Nbfun, basis.Nbfun)
