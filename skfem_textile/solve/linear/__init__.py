"""Sparse direct solvers of symmetric systems, by name."""

import logging
from importlib import import_module
from importlib.util import find_spec
from typing import NamedTuple

from .dissection import nested_dissection
from .solver import Factors, SingularMatrixError, Solver

__all__ = [
    "SOLVERS",
    "Factors",
    "SingularMatrixError",
    "Solver",
    "nested_dissection",
    "solver_named",
]


log = logging.getLogger(__name__)


class Offer(NamedTuple):
    """A solver: its class, its package, and when loading that package is repaid."""

    cls: str
    package: str
    unknowns: int


#: Solvers by name, the fastest first.
SOLVERS = {
    "cholmod": Offer("Cholmod", "cvxopt", 500),
    "pardiso": Offer("Pardiso", "pypardiso", 20_000),
    "superlu": Offer("SuperLU", "scipy", 0),
}


def solver_named(name: str, unknowns: int) -> type[Solver]:
    """The solver of a name; ``auto`` takes the fastest that is installed.

    For systems of few ``unknowns`` that is SuperLU, which takes no time to load.

    Raises
    ------
    ValueError
        If the name is unknown, or the package that it needs is not installed.
    """
    check_solver(name)
    if name != "auto":
        return _loaded(name)
    for known, offer in SOLVERS.items():
        if unknowns >= offer.unknowns and find_spec(offer.package):
            try:
                return _loaded(known)
            except ImportError as error:  # installed, but not whole
                log.warning("solver %s: %s", known, error)
    return _loaded("superlu")


def _loaded(name: str) -> type[Solver]:
    return getattr(import_module(f".{name}", __package__), SOLVERS[name].cls)


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
