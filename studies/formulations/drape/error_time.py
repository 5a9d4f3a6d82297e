"""Error against run time on the sphere: formulations and starts."""

from collections.abc import Callable
from time import process_time

from numpy import ndarray

from skfem_textile import LoadStepper, drape, equilibrium_near
from skfem_textile.solve.result import StepError
from skfem_textile.solve.states import NoEquilibriumError

from ...study import Row
from . import chebyshev
from .cases import FROM_NET, GROWTH, Case
from .runs import on_sphere

# Of so many runs the fastest counts, until they have taken so many seconds.
_RUNS, _ENOUGH = 5, 2.0

_WARN_ONLY = "stabilisation", "deviation", "work"


def timed(case: Case) -> Row:
    """The fastest of a few runs, from a ply to a state: start, set-up and solution."""
    seconds: list[float] = []
    while len(seconds) < _RUNS and sum(seconds) < _ENOUGH:
        run = _run_of(case)
        began = process_time()
        try:
            u, solves = run()
        except (NoEquilibriumError, StepError) as error:
            return {"refused": str(error)}
        seconds.append(process_time() - began)
    ply, *_ = on_sphere(case)
    largest, rms = chebyshev.error(ply, u)
    return {
        "unknowns": ply.basis.N,
        "solves": solves,
        "seconds": min(seconds),
        "largest": largest,
        "rms": rms,
    }


def _run_of(case: Case) -> Callable[[], tuple[ndarray, int]]:
    """A run with a ply of its own, which knows nothing of runs before."""
    ply, conditions, surface, _ = on_sphere(case)

    def grown() -> tuple[ndarray, int]:
        result = LoadStepper(ply, conditions, 1, warn_only=_WARN_ONLY).run()
        return result.u, result.linear_solves

    def started() -> tuple[ndarray, int]:
        if case.start == FROM_NET:
            n = case.parts
            x = drape.net(surface, chebyshev.SIDE / n, (0, n), (0, n)).at(ply.nodes)
        else:
            x = drape.exponential_map(surface, ply.nodes)
        start = drape.displacement(ply.nodes, x)
        state = equilibrium_near(ply, conditions, start, warn_only=_WARN_ONLY)
        return state.u, state.linear_solves

    return grown if case.start == GROWTH else started
