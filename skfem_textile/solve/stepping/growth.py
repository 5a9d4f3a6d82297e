"""Where an iteration starts on a surface that has grown since the last good state."""

import numpy as np

from ..problem import Problem, Start


def grown(problem: Problem, start: Start) -> Start:
    """A start carried along geodesics onto the surface at the load factor of a problem.

    From there an iteration is short.  It is the start itself where geodesics say
    nothing, or fold the ply, or take it beyond a law.
    """
    if problem.surfaces is None:
        return start
    u = problem.surfaces.carried(start.u, start.load_factor, problem.load_factor)
    if u is None:
        return start
    with np.errstate(all="ignore"):  # what is not finite is caught
        p = start.parameters
        usable = problem.least_area_ratio(u).min() > 0 and problem.in_domain(u, p)
        return problem.start(u, p) if usable else start
