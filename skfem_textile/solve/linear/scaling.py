"""Scaling of symmetric matrices, by which all solvers recognise round-off alike."""

from typing import NamedTuple

import numpy as np
from numpy import ndarray
from scipy.sparse import csc_matrix

#: Magnitude below which a pivot of a scaled matrix is round-off, and the matrix
#: singular.  Larger limits refuse regular matrices with very different stiffnesses;
#: smaller ones miss mechanisms.
ROUND_OFF = 1e-12

# Smallest size of an unknown, as a share of the largest.  Pivots below 1e-15 of the
# largest, a few units of round-off, are thereby round-off.
_SMALLEST = 1e-3

# Largest entry of a scaled definite matrix: sizes are rounded to powers of two.
_LARGEST_ENTRY = 2.0

# Smallest regular number, for matrices without a nonzero entry.
_TINY = np.finfo(float).tiny


class SingularMatrixError(RuntimeError):
    """Singular matrix: a mechanism is present."""

    def __init__(self) -> None:
        super().__init__("singular tangent: a mechanism is present")


class Scaled(NamedTuple):
    """Entries of a scaled matrix S A S, and the diagonal of S."""

    data: ndarray
    scale: ndarray


class Scaling:
    """Scales the rows and columns of a matrix by the sizes of its unknowns.

    The size of unknown i is the magnitude of its diagonal entry a_ii, unless other
    entries violate a condition of definite matrices, a_ij² ≤ a_ii a_jj.  It is then the
    largest of this magnitude and of a_ij² / m_j with the largest magnitude m_j in row
    j, which is zero only if the row is.  S contains the inverse square roots of the
    sizes, rounded to powers of two, so that scaling has no round-off.

    Parameters
    ----------
    lower
        Lower triangle of a matrix with the sparsity pattern, diagonal included, with
        sorted indices.

    Examples
    --------
    >>> A = csc_matrix([[4.0, 0.0], [2.0, 64.0]])
    >>> data, scale = Scaling(A)(A.data)
    >>> data.tolist(), scale.tolist()
    ([1.0, 0.125, 1.0], [0.5, 0.125])
    """

    def __init__(self, lower: csc_matrix) -> None:
        self._row, self._start = lower.indices, lower.indptr[:-1]
        self._per_column = np.diff(lower.indptr)

    def __call__(self, data: ndarray) -> Scaled:
        """Scale a matrix with the entries ``data``.

        Raises
        ------
        ValueError
            If an entry is not finite.
        SingularMatrixError
            If a row is zero or round-off.
        """
        sizes = np.abs(data[self._start])
        for of_diagonal in (True, False):
            least = max(_SMALLEST * sizes.max(initial=0.0), _TINY)
            scale = np.exp2(np.rint(-0.5 * np.log2(np.maximum(sizes, least))))
            with np.errstate(over="ignore", invalid="ignore"):
                scaled = data * np.repeat(scale, self._per_column)
                scaled *= scale[self._row]
            if np.abs(scaled).max(initial=0.0) <= _LARGEST_ENTRY or not of_diagonal:
                break
            if not np.all(np.isfinite(data)):
                raise ValueError("the matrix of a linear system is not finite")
            sizes = self._sizes(data)
        refuse_round_off(sizes * scale**2)
        return Scaled(scaled, scale)

    def _sizes(self, data: ndarray) -> ndarray:
        entries = np.abs(data)
        largest = np.maximum(self._largest(entries, entries), _TINY)
        in_column = entries * (entries / largest[self._row])
        in_row = entries * (entries / np.repeat(largest, self._per_column))
        return np.maximum(self._largest(in_row, in_column), entries[self._start])

    def _largest(self, in_row: ndarray, in_column: ndarray) -> ndarray:
        """Largest value for each unknown, in its row and its column of the triangle."""
        largest = np.maximum.reduceat(in_column, self._start)
        np.maximum.at(largest, self._row, in_row)
        return largest


def refuse_round_off(pivots: ndarray) -> None:
    """Refuse pivots of a scaled matrix, given by magnitude, that are round-off.

    Raises
    ------
    SingularMatrixError
        If there is such a pivot.
    """
    if not np.all(pivots > ROUND_OFF):
        raise SingularMatrixError
