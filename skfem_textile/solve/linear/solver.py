"""Linear solvers: interface, choice by name, and time measurement.

The fastest solver depends on the processor, so ``auto`` measures the installed ones for
large systems.
"""

import logging
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field
from functools import cache, partial
from importlib import import_module
from threading import Lock, RLock
from time import perf_counter
from typing import Any, NamedTuple, Protocol, TypeAlias
from weakref import ref

import numpy as np
from numpy import ndarray
from scipy.sparse import csc_matrix

from ...mesh.requirements import is_installed
from ...mesh.user_input import error_text, refuse_unknown
from .scaling import ROUND_OFF, Scaled, Scaling, SingularMatrixError
from .unknowns import Unknowns

log = logging.getLogger(__name__)

#: Largest number of refinements of the solution of an indefinite system.  Pivots are
#: restricted to blocks of columns, so that they may be small and amplify round-off; a
#: pivot above the limit for round-off leaves at least four digits per refinement.
REFINEMENTS = 4

#: Message in a forked process, from which a solver with threads is hidden.
FORKED = (
    "solver 'rslab' cannot be used in a forked process, which lacks its threads: start "
    "processes by spawn, or choose another solver"
)

#: Solvers that are hidden from this process, a forked one.
HIDDEN: set[str] = set()

#: Number of unknowns from which ``auto`` measures.  The measurement then takes 2 s, of
#: which 0.6 s load PARDISO; a solver that saves a third of the time repays this in 25
#: factorisations.
MEASURED_FROM = 100_000

# Maximum number of unknowns eliminated in the measurement: more would take longer and
# give the same ranking.  A quarter is too few, as PARDISO gains with system size.
_MOST_MEASURED = 200_000


@dataclass(frozen=True)
class SolverEntry:
    """Linear solver that can be selected by name.

    Attributes
    ----------
    path
        Module in this package and class, ``module:Class``.
    needs
        Module of the third-party package that it imports at the first solve.
    unknowns
        Number of unknowns from which the import time is repaid.
    rival
        True if it may be the fastest for large systems.
    install
        Command that installs the package; empty for pip.
    pivots_anywhere
        True if pivots of indefinite matrices are not restricted to blocks of columns.
    definite_only
        True if another solver takes over matrices that are not definite.
    """

    path: str
    needs: str
    unknowns: int
    rival: bool
    install: str = ""
    pivots_anywhere: bool = False
    definite_only: bool = False

    @property
    def package(self) -> str:
        """Name of the required package."""
        return self.needs.partition(".")[0]

    @property
    def build(self) -> Any:
        """Solver class."""
        module, _, name = self.path.partition(":")
        return getattr(import_module(f".{module}", __package__), name)


#: Solvers by name, the fastest known first.  SuperLU takes several times the time and
#: memory of the others, see ``docs/benchmarks/speed.md``, so it is not
#: measured.  PETSc follows SuperLU, so that ``auto`` never selects it.
SOLVERS = {
    "cholmod": SolverEntry(
        "cholmod:Cholmod", "cvxopt.cholmod", 500, True, definite_only=True
    ),
    "pardiso": SolverEntry("pardiso:Pardiso", "pypardiso", 20_000, True),
    "rslab": SolverEntry("rslab:Rslab", "rslab", 0, True),
    "superlu": SolverEntry("superlu:SuperLU", "scipy", 0, False, pivots_anywhere=True),
    "petsc": SolverEntry(
        "petsc:PETSc", "petsc4py.PETSc", 0, False, "apt-get install python3-petsc4py"
    ),
}


class Factors(Protocol):
    """Factors of a symmetric matrix, definite or indefinite."""

    @property
    def factorisations(self) -> int:
        """Number of factorisations so far.

        A matrix may need a second one if it is indefinite, or if its factors were
        discarded in favour of others.
        """
        ...

    @property
    def definite(self) -> bool:
        """True if the matrix is positive definite."""
        ...

    @property
    def negative_pivots(self) -> int | None:
        """Number of negative eigenvalues, by Sylvester's law of inertia.

        None if an off-diagonal pivot was used.

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
    """Factorises symmetric matrices of one sparsity pattern, analysed once.

    `ChosenSolver` is the solver of users.  It checks and scales matrices for the
    solvers in `SOLVERS`, which compare pivots with `scaling.ROUND_OFF`.

    Parameters
    ----------
    lower
        Lower triangle of a matrix with the pattern, diagonal included, with sorted
        indices.
    unknowns
        Geometry of the unknowns, for solvers that use it.
    """

    def __init__(self, lower: csc_matrix, unknowns: Unknowns) -> None: ...

    def factorise(self, data: ndarray) -> Factors:
        """Factors of the matrix with the entries ``data`` of the lower triangle.

        Raises
        ------
        SingularMatrixError
            If a pivot is zero; a round-off pivot may be detected later.
        """
        ...


class LatestFactors:
    """Base of solvers that keep the factors of one matrix, the most recent one.

    Factors of large matrices take most of the memory of a run.  Discarded factors are
    recomputed when needed.
    """

    # Weak, so that memory is freed without waiting for garbage collection of cycles.
    _kept: ref | None = None

    def factorise(self, data: ndarray) -> "CountedPivots":
        """Factors of the matrix with the entries ``data``."""
        factors = CountedPivots(self, data)
        self.hold(factors)
        return factors

    def hold(self, factors: "CountedPivots") -> None:
        """Keep these factors and discard others."""
        kept = self._kept() if self._kept else None
        if kept is None or kept is not factors:
            if kept is not None:
                kept.factors = None
            self._kept = None  # in case the factorisation fails
            factors.negative, factors.factors = self.factorised(factors.data)
            factors.definite = factors.negative == 0
            factors.factorisations += 1
            self._kept = ref(factors)

    def factorised(self, data: ndarray) -> tuple[int | None, Any]:
        """Factorise a matrix: number of negative pivots, and factors to keep, if any.

        The number is None if the matrix is singular.
        """
        raise NotImplementedError

    def solution(self, of: "CountedPivots", b: ndarray) -> ndarray:
        """Solution of a regular system by the present factors."""
        raise NotImplementedError


@dataclass(eq=False)
class CountedPivots:
    """Factors whose factorisation counts the negative pivots; see `Factors`.

    Attributes
    ----------
    solver, data
        The solver, and the entries of the matrix.
    factorisations
        Number of factorisations so far.
    negative, factors
        Results of `LatestFactors.factorised`.
    definite
        True if all pivots are positive and above round-off.
    """

    solver: LatestFactors
    data: ndarray
    factorisations: int = 0
    negative: int | None = None
    factors: Any = None
    definite: bool = False

    @property
    def negative_pivots(self) -> int:
        """Inertia computed by the factorisation."""
        if self.negative is None:
            raise SingularMatrixError
        return self.negative

    def solve(self, b: ndarray) -> ndarray:
        """Solve A x = b."""
        if self.negative is None:
            raise SingularMatrixError
        self.solver.hold(self)
        return self.solver.solution(self, b)


#: Factory of a solver; arguments as for `Solver`.
SolverOfPattern: TypeAlias = Callable[[csc_matrix, Unknowns], Solver]


@dataclass(eq=False)
class Clock:
    """Numbers and times of linear solves, factorisations and assembly."""

    solves: int = 0
    factorisations: int = 0
    seconds: dict[str, float] = field(
        default_factory=lambda: {"assembly": 0.0, "solve": 0.0}
    )

    def time(self, part: str, function: Callable, *args: Any) -> Any:
        """Call the function and add its time to a category."""
        start = perf_counter()
        try:
            return function(*args)
        finally:
            self.seconds[part] += perf_counter() - start


class Choice(NamedTuple):
    """Name of a solver, and the reason for its choice."""

    name: str
    reason: str


# Measurements of this process, by participating solvers; one measurement at a time.
_MEASURED: dict[tuple[str, ...], Choice] = {}
_LOCK = Lock()


class ScaledFactors:
    """`Factors` of A from factors of S A S with a diagonal matrix S.

    Pivots restricted to blocks of columns may amplify round-off without being small, so
    that solutions of an indefinite system are checked.  If one is wrong, or the solver
    factorises definite matrices only, the next of `ChosenSolver.names` takes over.
    ``definite`` is True if A is positive definite.
    """

    definite: bool

    def __init__(self, solver: "ChosenSolver", scaled: Scaled) -> None:
        self._solver, self._scaled, self._names = solver, scaled, solver.names()
        self._all: list[Factors] = []
        self._by_next_solver()

    @property
    def factorisations(self) -> int:
        """Number of factorisations so far."""
        return sum(factors.factorisations for factors in self._all)

    @property
    def negative_pivots(self) -> int | None:
        """Number of negative eigenvalues of A and, by Sylvester's law, of S A S."""
        with self._solver.lock:
            return self._latest().negative_pivots

    def solve(self, b: ndarray) -> ndarray:
        """Solve A x = b."""
        b = self._scaled.scale * b
        with self._solver.lock:
            factors = self._latest()
            x = factors.solve(b)
            while not (
                factors.definite
                or self._entry.pivots_anywhere
                or self._is_solution(x, b)
            ):
                factors = self._by_next_solver()
                x = factors.solve(b)
        return self._scaled.scale * x

    def __reduce__(self) -> tuple[Callable, tuple]:
        """Factors are pickled as their matrix, and computed again."""
        return ScaledFactors, (self._solver, self._scaled)

    def _latest(self) -> Factors:
        """Factors of the last solver, or of the next one if it needs a definite A."""
        factors = self._all[-1]
        if self._entry.definite_only and not factors.definite:
            return self._by_next_solver()
        return factors

    def _by_next_solver(self) -> Factors:
        name = next(self._names)  # the last one is always certain
        factors = self._solver.analysed(name).factorise(self._scaled.data)
        self._entry, self.definite = SOLVERS[name], factors.definite
        self._all.append(factors)
        return factors

    def _is_solution(self, x: ndarray, b: ndarray) -> bool:
        """True if x solves a system that differs from this one by round-off."""
        data, product = self._scaled.data, self._solver.product
        size = product(np.abs(data), np.abs(x)) + np.abs(b)
        error = np.abs(product(data, x) - b).max(initial=0.0)
        return bool(error <= ROUND_OFF * size.max(initial=0.0))


class ChosenSolver:
    """`Solver` by name; ``auto`` selects the fastest installed one.

    This is the fastest known solver whose import time is repaid.  From `MEASURED_FROM`
    unknowns on, the solvers are measured with the first positive definite matrix, once
    per process.

    Matrices are scaled so that every unknown has the same size (`Scaling`).  A matrix
    with a pivot below `scaling.ROUND_OFF` is singular, for each solver.  The
    elimination order is independent of the entries; a regular indefinite matrix, such
    as the tangent of a Lagrange multiplier, may therefore have such a pivot and also
    count as singular, except with SuperLU, which pivots across the whole matrix.

    Threads may share a solver; they wait for each other.

    Parameters
    ----------
    name
        Name of a solver in `SOLVERS`, or ``auto``.
    lower, unknowns
        See `Solver`.

    Attributes
    ----------
    choice
        The `Choice`.

    Raises
    ------
    ValueError
        If the name is unknown or the required package is not installed.
    """

    def __init__(self, name: str, lower: csc_matrix, unknowns: Unknowns) -> None:
        self._lower, self._unknowns, n = lower, unknowns, lower.shape[0]
        self._scaling, self.lock = Scaling(lower), RLock()
        self._analysed: dict[str, Solver] = {}
        self._rivals: tuple[str, ...] = ()  # to be measured
        if name != "auto":
            check_solver(name)
            self.choice = Choice(name, "requested")
        elif n < MEASURED_FROM:
            reason = f"fastest known, not measured below {MEASURED_FROM} unknowns"
            if (known := _known(n)) == "superlu":
                reason = "no other solver can be imported"
            self.choice = Choice(known, reason)
        else:
            rivals = tuple(
                k for k, o in SOLVERS.items() if o.rival and is_installed(o.package)
            )
            if rivals in _MEASURED:
                self.choice = _MEASURED[rivals]
            else:
                self.choice = Choice(_known(n), "fastest known of the installed ones")
                self._rivals = rivals if len(rivals) > 1 else ()
        if not self._rivals:
            log.info("linear solver %s: %s", *self.choice)

    def factorise(self, data: ndarray) -> Factors:
        """See `Solver`; measures the solvers first, if required.

        Raises
        ------
        SingularMatrixError
            See `Solver`.
        ValueError
            If an entry is not finite.
        """
        scaled = self._scaling(data)
        with self.lock:
            if self._rivals and (choice := self._measured(scaled.data)):
                self.choice, self._rivals = choice, ()
                log.info("linear solver %s: %s", *choice)
            return ScaledFactors(self, scaled)

    def names(self) -> Iterator[str]:
        """Names of its solver and of those that take over, RSLAB and SuperLU."""
        name = self.choice.name
        yield name
        if name not in ("rslab", "superlu"):
            name = _first_importable(["rslab"])
            yield name
        if name != "superlu":
            yield "superlu"

    def analysed(self, name: str) -> Solver:
        """The solver with a name; it analyses the pattern at first use."""
        if name not in self._analysed:
            solver = SOLVERS[name].build(self._lower, self._unknowns)
            self._analysed[name] = solver
        return self._analysed[name]

    def __getstate__(self) -> dict[str, Any]:
        """State without lock and analyses, which cannot be pickled."""
        dropped = "lock", "_analysed"
        return {name: x for name, x in vars(self).items() if name not in dropped}

    def __setstate__(self, state: dict[str, Any]) -> None:
        vars(self).update(state, lock=RLock(), _analysed={})

    def product(self, data: ndarray, x: ndarray) -> ndarray:
        """Product of the matrix with the entries ``data`` and a vector."""
        lower = self._lower
        A = csc_matrix((data, lower.indices, lower.indptr), lower.shape)
        return A @ x + A.T @ x - data[lower.indptr[:-1]] * x

    def _measured(self, data: ndarray) -> Choice | None:
        """Fastest solver of the leading block, see `_measured`."""
        n = min(len(self._lower.indptr) - 1, _MOST_MEASURED)
        lower = self._lower
        part = csc_matrix((data, lower.indices, lower.indptr), lower.shape)[:n, :n]
        return _measured(self._rivals, part, self._unknowns.first(n))


def solver_named(name: str) -> SolverOfPattern:
    """`ChosenSolver` with a name; raises the errors of `check_solver`."""
    check_solver(name)
    return partial(ChosenSolver, name)


def check_solver(name: str) -> None:
    """Raise a ValueError if a name is unknown or its package is not installed."""
    refuse_unknown("solver", name, ("auto", *SOLVERS))
    if name == "auto":
        return
    package, install = SOLVERS[name].package, SOLVERS[name].install
    if name in HIDDEN:
        raise ValueError(FORKED)
    try:
        _import(name)
    except ModuleNotFoundError:
        install = install or f"pip install {package}"
        raise ValueError(f"solver {name!r} needs {package}: {install}") from None
    except ImportError as error:
        raise ValueError(
            f"solver {name!r} needs {package}, which fails to import: {error}"
        ) from None


def _known(unknowns: int) -> str:
    """Fastest known solver that is installed."""
    return _first_importable(k for k, o in SOLVERS.items() if unknowns >= o.unknowns)


def _first_importable(names: Iterable[str]) -> str:
    """First of these solvers whose package imports; if there is none, SuperLU.

    A warning names a package that fails to import, and RSLAB if it is not installed.
    """
    for name in names:
        instead = ": superlu takes over, which is slower" if name == "rslab" else ""
        try:
            _import(name)
            return name
        except ModuleNotFoundError:
            if instead and name not in HIDDEN:
                missing = f"solver {name} is not installed (pip install {name})"
                _warn_once(f"{missing}{instead}")
        except ImportError as error:
            _warn_once(f"solver {name}: {error}{instead}")
    return "superlu"


def _import(name: str) -> None:
    """Import the package of a solver.

    Raises
    ------
    ModuleNotFoundError
        If it is not installed.
    ImportError
        If it fails to import.
    """
    try:
        import_module(SOLVERS[name].needs)
    except Exception as error:  # of any type, as by NumPy for another binary interface
        if getattr(error, "name", None) in (SOLVERS[name].package, SOLVERS[name].needs):
            raise
        raise ImportError(error_text(error)) from error


@cache
def _warn_once(message: str) -> None:
    """Log a warning, once per process."""
    log.warning("%s", message)


def _measured(
    rivals: tuple[str, ...], lower: csc_matrix, unknowns: Unknowns
) -> Choice | None:
    """Fastest solver, measured or remembered; None if the matrix does not allow it.

    The matrix must be positive definite, and at least one solver must succeed.
    """
    with _LOCK:
        if rivals in _MEASURED:
            return _MEASURED[rivals]
        seconds, reports = {}, []
        for name in rivals:
            try:
                took = _seconds(name, lower, unknowns)
            except Exception as error:  # it would also fail in the run
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


def _seconds(name: str, matrix: csc_matrix, unknowns: Unknowns) -> float | None:
    """Time of the second factorisation and solve, as the first one warms up.

    None if the matrix is not positive definite: CHOLMOD then stops early.
    """
    solver, b = SOLVERS[name].build(matrix, unknowns), np.ones(matrix.shape[0])
    for _ in range(2):
        start = perf_counter()
        factors = solver.factorise(matrix.data)
        if not factors.definite:
            return None
        factors.solve(b)
    return perf_counter() - start
