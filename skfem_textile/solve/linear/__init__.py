"""Sparse direct solvers of symmetric systems, by name."""

from .scaling import SingularMatrixError
from .solver import (
    SOLVERS,
    Choice,
    ChosenSolver,
    Factors,
    Solver,
    check_solver,
    solver_named,
)
from .system import System
from .unknowns import Unknowns, nested_dissection

__all__ = [
    "SOLVERS",
    "Choice",
    "ChosenSolver",
    "Factors",
    "SingularMatrixError",
    "Solver",
    "System",
    "Unknowns",
    "check_solver",
    "nested_dissection",
    "solver_named",
]
