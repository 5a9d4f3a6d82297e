"""How the cases of the stability study end: the rules."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy import ndarray

RIGHT, OTHER = "right", "on another equilibrium, and reported"
REFUSED, MISSED = "refused", "refused though solvable"
WRONG = "wrong"

#: The outcomes, in the order of reports.
OUTCOMES = (RIGHT, OTHER, REFUSED, MISSED, WRONG)

# Energies and reactions that differ by a smaller share belong to one state.
_SAME = 0.01


@dataclass(frozen=True, eq=False)
class End:
    """How a run ended.

    Attributes
    ----------
    converged
        Whether the run applied the whole load.
    sound
        Whether it ended on a stable, unfolded equilibrium under the whole load, and on
        the exact motion where the mesh can represent it.
    path_resolved
        Whether the run says that more steps lead to the same equilibrium.
    energy, reactions
        Energy in N·mm, and all components of all reactions in N.
    no_energy, no_force
        Energy and force that are round-off.
    """

    converged: bool
    sound: bool
    path_resolved: bool
    energy: float
    reactions: ndarray
    no_energy: float
    no_force: float

    def energy_off(self, other: "End") -> float:
        """Difference of the energies, as a share of the larger."""
        return _off([self.energy], [other.energy], other.no_energy)

    def reactions_off(self, other: "End") -> float:
        """Largest difference of a reaction's component, as a share of the largest."""
        return _off(self.reactions, other.reactions, other.no_force)

    def agrees(self, reference: "End") -> bool:
        """Whether both runs ended on the same sound state."""
        return (
            self.sound
            and reference.sound
            and self.energy_off(reference) <= _SAME
            and self.reactions_off(reference) <= _SAME
        )


def outcome(end: End, reference: End, solvable: bool) -> str:
    """How a case ended, one of `OUTCOMES`.

    Parameters
    ----------
    end
        End of the run.
    reference
        End of the run with the most steps.
    solvable
        Whether any run of the same problem ended soundly.
    """
    if not end.converged:
        return MISSED if solvable else REFUSED
    if not end.sound:
        return WRONG
    if end.agrees(reference):
        return RIGHT
    return WRONG if end.path_resolved else OTHER


def _off(ours: Any, theirs: Any, nothing: float) -> float:
    """Largest difference as a share of the largest magnitude; 0 within ``nothing``."""
    ours, theirs = np.asarray(ours), np.asarray(theirs)
    difference = float(np.abs(ours - theirs).max())
    if difference <= nothing:
        return 0.0
    return difference / float(np.abs([ours, theirs]).max())
