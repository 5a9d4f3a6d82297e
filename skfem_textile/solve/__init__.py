"""Equilibria under a growing load: conditions, steps, and checks of states."""

from collections.abc import Callable
from contextvars import ContextVar
from typing import Any

#: Number of threads of the linear solvers that are built in a context, which sweeps
#: limit without the import of a solver; None for ``OMP_NUM_THREADS``, and without it a
#: number selected by the solver.
solver_threads: ContextVar[int | None] = ContextVar("solver_threads", default=None)

#: Function that shows a result in 3D.  The package sets it, because pictures are in a
#: layer above.
viewer: Callable[..., Any]
