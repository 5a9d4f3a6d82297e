"""Uses of scikit-fem beyond its public interface.

Written for scikit-fem 12; `tests/mesh/test_scikit_fem.py` fails if a later version
differs.  Other modules import only from `skfem` and `skfem.helpers`.
"""

from dataclasses import dataclass, replace
from typing import Any, NamedTuple, TypeVar
from weakref import WeakKeyDictionary

import numpy as np
from numpy import ndarray
from scipy.sparse import csr_matrix
from skfem import AbstractBasis, DiscreteField, Mesh
from skfem.assembly.form.coo_data import COOData
from skfem.assembly.form.form import FormExtraParams as FormExtraParams
from skfem.quadrature import get_quadrature as get_quadrature

from .user_input import with_article

_Mesh = TypeVar("_Mesh", bound=Mesh)

# Number of axes of element matrices given by pairs of nodes.
_BY_PAIRS = 4


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


def jacobian(mapping: Any, i: int, j: int, X: ndarray, tind: Any = None) -> ndarray:
    """Component of the Jacobian matrices of an isoparametric mapping, not cached."""
    return mapping._J(i, j, X, tind)


class OwnAssembly:
    """Mixin for forms that check their parameters or compute their entries themselves.

    It must precede a scikit-fem form in the bases of a class.
    """

    def entries(
        self, ubasis: Any, vbasis: Any, parameters: dict[str, Any]
    ) -> COOData | None:
        """Entries computed directly, or None to evaluate the form as usual."""
        raise NotImplementedError

    def checked(self, basis: Any, parameters: dict[str, Any]) -> dict[str, Any]:
        """Parameters for the function of the form, before interpolation."""
        return parameters

    def taken(self, fields: tuple[DiscreteField, ...]) -> tuple[DiscreteField, ...]:
        """Fields of a composite basis that the function of the form takes."""
        return fields

    def _assemble(self, ubasis: Any, vbasis: Any = None, **parameters: Any) -> Any:
        x = self.coo_data(ubasis, vbasis, **parameters)
        return x.indices, x.data, x.shape, x.local_shape

    def coo_data(self, ubasis: Any, vbasis: Any = None, **parameters: Any) -> COOData:
        """Entries for `skfem.asm`."""
        for basis in (ubasis, ubasis if vbasis is None else vbasis):
            if not isinstance(basis, AbstractBasis):
                raise ValueError(
                    "asm takes bases by position and parameters by name, asm(form, "
                    f"basis, u=u): got {with_article(basis)} in place of a basis"
                )
        entries = self.entries(ubasis, vbasis, parameters)
        if entries is None:
            form: Any = super()
            entries = COOData(*form._assemble(ubasis, vbasis, **parameters))
        return entries

    def _normalize_asm_kwargs(self, w: dict[str, Any], basis: Any) -> dict[str, Any]:
        form: Any = super()
        fields = form._normalize_asm_kwargs(self.checked(basis, w), basis)
        for name, value in fields.items():
            if isinstance(value, tuple) and isinstance(value[0], DiscreteField):
                used = self.taken(value)
                fields[name] = used[0] if len(used) == 1 else used
        return fields

    def _kernel(self, *arguments: Any) -> ndarray:
        *functions, w, dx = arguments
        used = [self.taken(fields) for fields in functions]
        selected = any(len(x) < len(y) for x, y in zip(used, functions, strict=True))
        if selected and any(map(_vanishes, used)):  # a function of another field
            return np.zeros(len(dx))
        form: Any = super()
        return form._kernel(*used, w, dx)


def _vanishes(fields: tuple[DiscreteField, ...]) -> bool:
    """True if fields and their derivatives are zero at all points."""
    values = (x for field in fields for x in field.astuple if x is not None)
    return not any(map(np.any, values))


def number_entries(value: float) -> COOData:
    """Entries of a functional."""
    return COOData(np.array([]), np.array([value]), (), ())


def vector_entries(basis: Any, f: ndarray) -> COOData:
    """Entries of a linear form, given as (n_functions, n_elements)."""
    rows = np.array([basis.element_dofs.ravel()])
    return COOData(rows, f.ravel(), (basis.N,), (basis.Nbfun,))


def matrix_entries(basis: Any, K: ndarray) -> COOData:
    """Entries of a symmetric form.

    Given as (n_functions, n_functions, n_elements), or by pairs of nodes, see
    `full_matrices`.
    """
    shape, local = (basis.N, basis.N), (basis.Nbfun, basis.Nbfun)
    return _OfBasis(_positions(basis).indices, K, shape, local, basis)


class _Positions(NamedTuple):
    """Positions of the entries of element matrices.

    ``indices`` are rows and columns.  ``order`` sorts the entries by them, ``starts``
    is the first in ``order`` of each entry of ``whole``, a CSR matrix with all entries,
    also zero ones.  ``sums`` maps element matrices, by their number of axes, to the
    data of ``whole``.
    """

    indices: ndarray
    order: ndarray
    starts: ndarray
    whole: csr_matrix
    sums: dict[int, csr_matrix]


_POSITIONS: WeakKeyDictionary[Any, _Positions] = WeakKeyDictionary()


def _positions(basis: Any) -> _Positions:
    """Positions for a basis, computed once."""
    if basis not in _POSITIONS:
        dofs, n = basis.element_dofs, basis.N
        rows, cols = np.broadcast_arrays(dofs[None], dofs[:, None])
        indices = np.array([rows.ravel(), cols.ravel()])
        keys = indices[0] * np.int64(n) + indices[1]
        order = np.argsort(keys, kind="stable")
        distinct, starts = np.unique(keys[order], return_index=True)
        row, col = np.divmod(distinct, n)
        ends = np.searchsorted(row, np.arange(n + 1))
        whole = csr_matrix((np.zeros(len(col)), col, ends), (n, n))
        starts = np.append(starts, len(keys))
        _POSITIONS[basis] = _Positions(indices, order, starts, whole, {})
    return _POSITIONS[basis]


@dataclass
class _OfBasis(COOData):
    """Entries of the element matrices of a basis, in full when they are read."""

    basis: Any = None

    @property  # type: ignore[misc]
    def data(self) -> ndarray:
        """Entries as (n_functions n_functions n_elements,)."""
        return _in_full(self._given).ravel()

    @data.setter
    def data(self, values: ndarray) -> None:
        vars(self)["data"] = values

    @property
    def _given(self) -> ndarray:
        """Element matrices, in full or by pairs of nodes."""
        return vars(self)["data"]

    def tocsr(self) -> csr_matrix:
        """Sum of the entries."""
        if self.local_shape is None:  # added to other entries
            return super().tocsr()
        _, order, starts, whole, sums = _positions(self.basis)
        K = self._given
        if K.ndim not in sums:
            numbers = _in_full(np.arange(K.size).reshape(K.shape))
            ones, shape = np.ones(len(order)), (len(starts) - 1, K.size)
            sums[K.ndim] = csr_matrix((ones, numbers.ravel()[order], starts), shape)
        own = whole.indices.copy(), whole.indptr.copy()
        total = csr_matrix((sums[K.ndim] @ K.ravel(), *own), whole.shape)
        total.has_canonical_format = True
        return total


def _in_full(K: ndarray) -> ndarray:
    """Element matrices as (n_functions, n_functions, n_elements)."""
    if K.ndim != _BY_PAIRS:
        return K
    from .pattern import full_matrices

    return full_matrices(K)
