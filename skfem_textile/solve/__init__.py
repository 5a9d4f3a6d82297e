"""Equilibria under a growing load: conditions, steps, and checks of states."""

from contextvars import ContextVar

#: Number of threads of the linear solvers that are built in a context, which sweeps
#: limit without the import of a solver; None for ``OMP_NUM_THREADS``, and without it a
#: number selected by the solver.
solver_threads: ContextVar[int | None] = ContextVar("solver_threads", default=None)
