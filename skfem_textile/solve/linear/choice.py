"""Which solver a system gets: the one asked for, or what ``auto`` finds the fastest.

Whether CHOLMOD or PARDISO is faster depends on the processor: it is measured.
"""

import logging
from collections.abc import Callable
from importlib import import_module
from importlib.util import find_spec
from threading import Lock
from time import perf_counter

import numpy as np
from numpy import ndarray
from scipy.sparse import csc_matrix

from .solver import Choice, Factors, Solver
from .solvers import SOLVERS

log = logging.getLogger(__name__)


#: Unknowns from which ``auto`` measures.  There it takes 2 s, 0.6 s of them to load
#: PARDISO; a solver that saves a third of the time repays that in 25 factorisations.
MEASURED_FROM = 100_000

# Unknowns that are eliminated at most to measure: more would take longer and rank the
# solvers alike.  A quarter of this tells too little: PARDISO gains as systems grow.
_MOST_MEASURED = 200_000


# What this process has measured, by who took part; one measurement at a time.
_MEASURED: dict[tuple[str, ...], Choice] = {}
_LOCK = Lock()


class ChosenSolver:
    """A `Solver` by name; ``auto`` takes the fastest that is installed.

    For few unknowns that is SuperLU, which takes no time to load, for more the fastest
    known.  From `MEASURED_FROM` unknowns on the first matrix that is positive definite
    tells, and the process remembers it.

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
    factorise
        As of `Solver`; measures before, if that is due.

    Raises
    ------
    ValueError
        If the name is unknown, or the package that it needs is not installed.
    """

    def __init__(self, name: str, lower: csc_matrix) -> None:
        self._lower, n = lower, lower.shape[0]
        self._rivals: tuple[str, ...] = ()
        if name != "auto":
            self.choice = Choice(name, "asked for")
        elif n < MEASURED_FROM:
            reason = f"fastest known, not measured below {MEASURED_FROM} unknowns"
            self.choice = Choice(_known(n), reason)
        elif (rivals := _installed_rivals()) in _MEASURED:
            self.choice = _MEASURED[rivals]
        else:
            self.choice = Choice(_known(n), "fastest known of those installed")
            self._rivals = rivals if len(rivals) > 1 else ()
        self._solver = solver_named(self.choice.name)(lower)
        self.factorise: Callable[[ndarray], Factors] = self._measure_before
        if not self._rivals:
            self._take(self.choice)

    def _measure_before(self, data: ndarray) -> Factors:
        """Factors of a matrix, after it has told which solver is the fastest."""
        if choice := _measured(self._rivals, self._lower, data):
            self._take(choice)
        return self._solver.factorise(data)

    def _take(self, choice: Choice) -> None:
        if choice.name != self.choice.name:
            self._solver = solver_named(choice.name)(self._lower)
        self.choice, self.factorise = choice, self._solver.factorise
        log.info("linear solver %s: %s", *choice)


def solver_named(name: str) -> type[Solver]:
    """The solver of a name of `SOLVERS`; errors are those of `check_solver`."""
    check_solver(name)
    import_module(SOLVERS[name].module)
    return SOLVERS[name].build


def check_solver(name: str) -> None:
    """Refuse a name that is unknown or needs what is not installed."""
    if name == "auto":
        return
    if name not in [*SOLVERS]:  # which a list may be asked, that is no name
        raise ValueError(
            f"unknown solver {name!r}: choose of auto, {', '.join(SOLVERS)}"
        )
    package = SOLVERS[name].package
    if find_spec(package) is None:
        raise ValueError(f"solver {name!r} needs {package}: pip install {package}")


def _installed_rivals() -> tuple[str, ...]:
    return tuple(k for k, o in SOLVERS.items() if o.rival and find_spec(o.package))


def _known(unknowns: int) -> str:
    """The fastest known that is installed."""
    for name, offer in SOLVERS.items():
        if unknowns >= offer.unknowns and find_spec(offer.package):
            try:
                solver_named(name)
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
                seconds[name] = _seconds(name, part)
                reports.append(f"{name} {seconds[name]:.2f} s")
            except _NotDefiniteError:
                return None
            except Exception as error:  # it would fail in the run too
                log.info("linear solver %s failed: %s", name, error)
                reports.append(f"{name} failed")
        if not seconds:
            return None
        reason = f"fastest of {', '.join(reports)}, measured on this machine"
        choice = Choice(min(seconds, key=lambda name: seconds[name]), reason)
        return _MEASURED.setdefault(rivals, choice)


class _NotDefiniteError(Exception):
    """CHOLMOD stops early at an indefinite matrix, which tells nothing of others."""


def _seconds(name: str, matrix: csc_matrix) -> float:
    """Time to factorise and solve: of the second time, as the first one warms up."""
    solver, b = solver_named(name)(matrix), np.ones(matrix.shape[0])
    for _ in range(2):
        start = perf_counter()
        factors = solver.factorise(matrix.data)
        if not factors.definite:
            raise _NotDefiniteError
        factors.solve(b)
    return perf_counter() - start
