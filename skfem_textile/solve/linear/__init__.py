"""Sparse direct solvers of symmetric systems, by name."""

from .choice import ChosenSolver, check_solver, solver_named
from .dissection import nested_dissection
from .solver import Choice, Factors, SingularMatrixError, Solver
from .solvers import SOLVERS

__all__ = [
    "SOLVERS",
    "Choice",
    "ChosenSolver",
    "Factors",
    "SingularMatrixError",
    "Solver",
    "check_solver",
    "nested_dissection",
    "solver_named",
]
