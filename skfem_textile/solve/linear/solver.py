"""What the load stepper asks of a linear solver, and the time that it takes."""

from collections.abc import Callable
from dataclasses import dataclass, field
from time import perf_counter
from typing import Any, NamedTuple, Protocol, TypeAlias
from weakref import ref

import numpy as np
from numpy import ndarray
from scipy.sparse import csc_matrix

# A pivot is round-off if it is no larger than this share of the entry that it comes
# from, or this share of the largest pivot.  Larger shares refuse sound matrices of very
# different stiffnesses; smaller ones take a mechanism for stiff.
_LEAST_OF_ENTRY, _LEAST_OF_LARGEST = 1e-12, 1e-16


class SingularMatrixError(RuntimeError):
    """The matrix leaves some motion without stiffness."""

    def __init__(self) -> None:
        super().__init__("some motion meets no stiffness")


def refuse_round_off(pivots: ndarray, entries: ndarray) -> None:
    """Refuse pivots, given by magnitude, that are but round-off of the entries.

    Raises
    ------
    SingularMatrixError
        If there is one.
    """
    largest = pivots.max(initial=0.0)
    round_off = np.maximum(
        _LEAST_OF_ENTRY * np.abs(entries), _LEAST_OF_LARGEST * largest
    )
    if not np.all(pivots > round_off):
        raise SingularMatrixError


class Factors(Protocol):
    """Factors of a symmetric matrix, definite or not.

    ``factorisations`` is how many were needed so far: an indefinite matrix may have to
    be factorised again to solve with, and so may one whose factors gave way to others.
    """

    factorisations: int

    @property
    def definite(self) -> bool:
        """Whether the matrix is positive definite."""
        ...

    @property
    def negative_pivots(self) -> int | None:
        """Number of negative eigenvalues, by Sylvester's law of inertia.

        None where a pivot had to be taken off the diagonal and does not tell.

        Raises
        ------
        SingularMatrixError
            If a pivot vanishes to working precision.
        """
        ...

    def solve(self, b: ndarray) -> ndarray:
        """Solve A x = b.

        Raises
        ------
        SingularMatrixError
            If a pivot vanishes to working precision.
        """
        ...


class Solver(Protocol):
    """Factorises symmetric matrices of one pattern, which is analysed once.

    Parameters
    ----------
    lower
        A matrix of the pattern: its triangle at and below the diagonal, with sorted
        indices, in an order in which factors are sparse.
    """

    def __init__(self, lower: csc_matrix) -> None: ...

    def factorise(self, data: ndarray) -> Factors:
        """Factors of the matrix with the entries ``data`` of the lower triangle.

        Raises
        ------
        SingularMatrixError
            If a pivot vanishes; one that is round-off may be told later.
        """
        ...


#: Makes the solver of a pattern, given as its lower triangle.
SolverOfPattern: TypeAlias = Callable[[csc_matrix], Solver]


class Choice(NamedTuple):
    """Name of a solver, and why it was chosen."""

    name: str
    reason: str


@dataclass(eq=False)
class Clock:
    """Linear solves and factorisations, and the time that these and assembly took."""

    solves: int = 0
    factorisations: int = 0
    seconds: dict[str, float] = field(
        default_factory=lambda: {"assembly": 0.0, "solve": 0.0}
    )

    def time(self, part: str, function: Callable, *args: Any) -> Any:
        """Call the function and add its time to that part."""
        start = perf_counter()
        try:
            return function(*args)
        finally:
            self.seconds[part] += perf_counter() - start


class OneAtATime:
    """Room for the factors of one matrix: those of another are made again when asked.

    Factors of large matrices are most of the memory of a run.
    """

    # Weak, or memory would not be free before Python looks for cycles.
    _held: ref | None = None

    def hold(self, factors: Any) -> None:
        """Have the factors of this matrix, and of no other."""
        if self._held is None or self._held() is not factors:
            self._held = None  # in case this fails
            factors.refactorise()
            factors.factorisations += 1
            self._held = ref(factors)
