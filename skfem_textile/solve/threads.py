"""Threads of the linear solvers that are built in a context, which sweeps limit.

Sweeps import this module without the solvers, whose import would take most of the start
of every worker process.
"""

from contextvars import ContextVar

#: Number of threads; None for ``OMP_NUM_THREADS``, and without it a number selected by
#: the solver.
solver_threads: ContextVar[int | None] = ContextVar("solver_threads", default=None)
