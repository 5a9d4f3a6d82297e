"""Sparse direct solvers of symmetric systems, by name."""

from importlib import import_module
from importlib.util import find_spec

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

#: Solvers by name, the fastest first: module, class and the package that it needs.
SOLVERS = {
    "cholmod": ("Cholmod", "cvxopt"),
    "pardiso": ("Pardiso", "pypardiso"),
    "superlu": ("SuperLU", "scipy"),
}

# Below this many unknowns loading another solver is not repaid.
_FEW = 5000


def solver_named(name: str, unknowns: int) -> type[Solver]:
    """The solver of a name; ``auto`` takes the fastest that is installed.

    For systems of few ``unknowns`` that is SuperLU, which is there in any case.

    Raises
    ------
    ValueError
        If the name is unknown, or the package that it needs is not installed.
    """
    if name == "auto":
        name = next(
            known
            for known, (_, package) in SOLVERS.items()
            if known == "superlu" or (unknowns >= _FEW and find_spec(package))
        )
    check_solver(name)
    return getattr(import_module(f".{name}", __package__), SOLVERS[name][0])


def check_solver(name: str) -> None:
    """Refuse a name that is unknown or needs what is not installed."""
    if name == "auto":
        return
    if name not in SOLVERS:
        raise ValueError(
            f"unknown solver {name!r}: choose of auto, {', '.join(SOLVERS)}"
        )
    package = SOLVERS[name][1]
    if find_spec(package) is None:
        raise ValueError(f"solver {name!r} needs {package}: pip install {package}")
