"""Where an iteration starts, and what a search is to reach from there."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy import ndarray

if TYPE_CHECKING:
    from .problem import Problem
    from .tangent import Tangent


@dataclass(frozen=True, eq=False)
class Start:
    """Initial guess of an iteration: a displacement, with forces and energies there.

    Attributes
    ----------
    load_factor
        Load factor.
    u, f, load
        Displacement, nodal forces and those of the loads.
    energies
        Energy of each term in N·mm, those of loads aside.
    parameters
        Parameters of the ply's terms.
    tangent
        A tangent for the first increment; None where it is singular.
    """

    load_factor: float
    u: ndarray
    f: ndarray
    load: ndarray
    energies: Mapping[str, float]
    parameters: Mapping[str, Any]
    tangent: "Tangent | None" = None

    def with_parameters(
        self, problem: "Problem", parameters: Mapping[str, Any]
    ) -> "Start":
        """The same displacement at the same load factor, with other parameters."""
        if all(parameters[name].same_as(own) for name, own in self.parameters.items()):
            return self
        return problem.at(self.load_factor).start(self.u, parameters)


class Goal(NamedTuple):
    """What to reach, and from where.

    Attributes
    ----------
    load_factor, step
        Load factor, and its distance from that of the last good state.
    fixed_values
        Values of the fixed unknowns.
    start, before
        Where the search starts, and the last good state; None before the load.
    most_altered
        How many tangents may be altered on the way; if not any number, only strategies
        that follow the path are tried.
    held
        Forces beside the loads, as of `Problem`.
    """

    load_factor: float
    step: float
    fixed_values: ndarray
    start: Start
    before: Start | None
    most_altered: float = np.inf
    held: ndarray | float = 0.0
