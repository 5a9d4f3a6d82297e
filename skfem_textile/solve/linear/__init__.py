"""Sparse direct solvers of symmetric systems, by name."""

from .solver import (
    SOLVERS,
    Choice,
    ChosenSolver,
    Factors,
    SingularMatrixError,
    Solver,
    check_solver,
    solver_named,
)
from .system import System, nested_dissection

__all__ = [
    "SOLVERS",
    "Choice",
    "ChosenSolver",
    "Factors",
    "SingularMatrixError",
    "Solver",
    "System",
    "check_solver",
    "nested_dissection",
    "solver_named",
]
