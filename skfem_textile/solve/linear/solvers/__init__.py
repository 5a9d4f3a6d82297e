"""Sparse direct solvers, one a file."""

from ....registration import SolverRegistration, registered

#: The solvers by their names, the fastest known first.  SuperLU takes four times as
#: long as the others or longer, and three times the memory: it is not worth a
#: measurement.
SOLVERS = registered(__name__, SolverRegistration)

__all__ = ["SOLVERS"]
