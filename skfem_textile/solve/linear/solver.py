"""Linear solvers: their interface, the choice of one by name, and the time they take.

Whether CHOLMOD or PARDISO is faster depends on the processor: ``auto`` measures it.
"""

import logging
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property
from importlib import import_module
from importlib.util import find_spec
from threading import Lock
from time import perf_counter
from typing import Any, NamedTuple, Protocol, TypeAlias
from weakref import ref

import numpy as np
from numpy import ndarray
from scipy.sparse import csc_matrix

log = logging.getLogger(__name__)

# A pivot is round-off if it is no larger than this share of the entry that it comes
# from, or this share of the largest pivot.  Larger shares refuse sound matrices of very
# different stiffnesses; smaller ones take a mechanism for stiff.
_LEAST_OF_ENTRY, _LEAST_OF_LARGEST = 1e-12, 1e-16

#: Unknowns from which ``auto`` measures.  There it takes 2 s, 0.6 s of them to load
#: PARDISO; a solver that saves a third of the time repays that in 25 factorisations.
MEASURED_FROM = 100_000

# Unknowns that are eliminated at most to measure: more would take longer and rank the
# solvers alike.  A quarter of this tells too little: PARDISO gains as systems grow.
_MOST_MEASURED = 200_000


@dataclass(frozen=True)
class Offer:
    """A linear solver that can be chosen by name.

    Attributes
    ----------
    path
        Its module in this package and its class, ``module:Class``.
    needs
        The module of another package that it imports when a system is to be solved.
    unknowns
        Number of unknowns from which the time of that import is repaid.
    rival
        Whether it may be the fastest for large systems.
    """

    path: str
    needs: str
    unknowns: int
    rival: bool

    @property
    def package(self) -> str:
        """The package that it needs."""
        return self.needs.partition(".")[0]

    @property
    def build(self) -> Any:
        """Its class."""
        module, _, name = self.path.partition(":")
        return getattr(import_module(f".{module}", __package__), name)


#: The solvers by their names, the fastest known first.  SuperLU takes four times as
#: long as the others or longer, and three times the memory: it is not worth a
#: measurement.  Unknowns that repay an import are of ``docs/speed.md``.
SOLVERS = {
    "cholmod": Offer("cholmod:Cholmod", "cvxopt.cholmod", 500, True),
    "pardiso": Offer("pardiso:Pardiso", "pypardiso", 20_000, True),
    "superlu": Offer("superlu:SuperLU", "scipy", 0, False),
}


class SingularMatrixError(RuntimeError):
    """The matrix leaves some motion without stiffness."""

    def __init__(self) -> None:
        super().__init__("some motion meets no stiffness")


def refuse_round_off(pivots: ndarray, entries: ndarray) -> None:
    """Refuse pivots, given by magnitude, that are but round-off of the entries."""
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
            If a pivot vanishes; one that is round-off may be found later.
        """
        ...


class OneAtATime:
    """Base of solvers that keep the factors of one matrix, the last that was used.

    Factors of large matrices are most of the memory of a run.  Those of another matrix
    are computed again.
    """

    lower: csc_matrix
    # Weak, or memory would not be free before Python looks for cycles.
    _held: ref | None = None

    @cached_property
    def superlu(self) -> Any:
        """Solves indefinite systems; analysed when the first is to be solved."""
        return SOLVERS["superlu"].build(self.lower)

    def hold(self, factors: Any) -> None:
        """Keep these factors, and no others."""
        if self._held is None or self._held() is not factors:
            self._held = None  # in case this fails
            factors.refactorise()
            factors.factorisations += 1
            self._held = ref(factors)


#: Makes the solver of a pattern, given as its lower triangle.
SolverOfPattern: TypeAlias = Callable[[csc_matrix], Solver]


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


class Choice(NamedTuple):
    """Name of a solver, and why it was chosen."""

    name: str
    reason: str


# What this process has measured, by who took part; one measurement at a time.
_MEASURED: dict[tuple[str, ...], Choice] = {}
_LOCK = Lock()


class ChosenSolver:
    """A `Solver` by name; ``auto`` takes the fastest that is installed.

    For few unknowns that is SuperLU, which takes no time to load, for more the fastest
    known.  From `MEASURED_FROM` unknowns on the solvers are measured with the first
    matrix that is positive definite, once in a process.

    Parameters
    ----------
    name
        Name of a solver of `SOLVERS`, or ``auto``.
    lower
        As of `Solver`.

    Attributes
    ----------
    choice
        The `Choice`.

    Raises
    ------
    ValueError
        If the name is unknown, or the package that it needs is not installed.
    """

    def __init__(self, name: str, lower: csc_matrix) -> None:
        self._lower, n = lower, lower.shape[0]
        self._rivals: tuple[str, ...] = ()  # to be measured
        if name != "auto":
            check_solver(name)
            self.choice = Choice(name, "asked for")
        elif n < MEASURED_FROM:
            reason = f"fastest known, not measured below {MEASURED_FROM} unknowns"
            self.choice = Choice(_known(n), reason)
        else:
            rivals = tuple(
                k for k, o in SOLVERS.items() if o.rival and find_spec(o.package)
            )
            if rivals in _MEASURED:
                self.choice = _MEASURED[rivals]
            else:
                self.choice = Choice(_known(n), "fastest known of those installed")
                self._rivals = rivals if len(rivals) > 1 else ()
        self._solver: Solver = SOLVERS[self.choice.name].build(lower)
        if not self._rivals:
            log.info("linear solver %s: %s", *self.choice)

    def factorise(self, data: ndarray) -> Factors:
        """As of `Solver`; measures before, if that is due."""
        if self._rivals and (choice := _measured(self._rivals, self._lower, data)):
            if choice.name != self.choice.name:
                self._solver = SOLVERS[choice.name].build(self._lower)
            self.choice, self._rivals = choice, ()
            log.info("linear solver %s: %s", *choice)
        return self._solver.factorise(data)


def solver_named(name: str) -> type[Solver]:
    """The solver of a name of `SOLVERS`; it raises the errors of `check_solver`."""
    check_solver(name)
    return SOLVERS[name].build


def check_solver(name: str) -> None:
    """Refuse a name that is unknown or needs what is not installed, by a ValueError."""
    if name == "auto":
        return
    if name not in [*SOLVERS]:  # a list, as the name may be no string
        raise ValueError(
            f"unknown solver {name!r}: choose of auto, {', '.join(SOLVERS)}"
        )
    package = SOLVERS[name].package
    if find_spec(package) is None:
        raise ValueError(f"solver {name!r} needs {package}: pip install {package}")


def _known(unknowns: int) -> str:
    """The fastest known that is installed."""
    for name, offer in SOLVERS.items():
        if unknowns >= offer.unknowns and find_spec(offer.package):
            try:
                import_module(offer.needs)
            except ImportError as error:  # installed, but not whole
                log.warning("solver %s: %s", name, error)
            else:
                return name
    return "superlu"


def _measured(
    rivals: tuple[str, ...], lower: csc_matrix, data: ndarray
) -> Choice | None:
    """The fastest, measured unless remembered; None where the matrix does not tell.

    That is one that is not positive definite, or that all of them fail at.
    """
    n = min(lower.shape[0], _MOST_MEASURED)
    with _LOCK:
        if rivals in _MEASURED:
            return _MEASURED[rivals]
        part = csc_matrix((data, lower.indices, lower.indptr), lower.shape)[:n, :n]
        seconds, reports = {}, []
        for name in rivals:
            try:
                took = _seconds(name, part)
            except Exception as error:  # it would fail in the run too
                log.info("linear solver %s failed: %s", name, error)
                reports.append(f"{name} failed")
                continue
            if took is None:
                return None
            seconds[name] = took
            reports.append(f"{name} {took:.2f} s")
        if not seconds:
            return None
        reason = f"fastest of {', '.join(reports)}, measured on this machine"
        choice = Choice(min(seconds, key=lambda name: seconds[name]), reason)
        return _MEASURED.setdefault(rivals, choice)


def _seconds(name: str, matrix: csc_matrix) -> float | None:
    """Time to factorise and solve: of the second time, as the first one warms up.

    None where the matrix is not positive definite: CHOLMOD stops early there.
    """
    solver, b = SOLVERS[name].build(matrix), np.ones(matrix.shape[0])
    for _ in range(2):
        start = perf_counter()
        factors = solver.factorise(matrix.data)
        if not factors.definite:
            return None
        factors.solve(b)
    return perf_counter() - start
