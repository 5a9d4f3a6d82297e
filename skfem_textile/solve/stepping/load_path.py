"""Whether a run follows the path of its load, however many steps it takes.

A ply may have several stable equilibria under one load.  A short step leads to the one
that continues the path; a long one may lead to another.  Iterations that pass where the
ply is not stable tell them apart.  A step of which they are few is easy, and stays on
the path.  A hard one is halved, until its halves are easy or it is short; then its end
is reached in one step and in two, and both must agree.
"""

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from typing import Any, NamedTuple

import numpy as np

from ..states import State

# Energies and reactions that differ by a smaller share are of one state.  A larger
# share takes two equilibria for one; a smaller one takes what round-off and C_s of
# another state leave for another equilibrium.
_SAME_STATE = 0.01

#: Altered tangents at most on the way of an easy step.  With more, steps that leave the
#: path are taken for easy; with fewer, steps that stay on it are halved.
MOST_ALTERED = 2

# How much shorter than a requested step a hard one becomes before it is taken: 2⁻⁶.
_PATH_HALVINGS = 6

# Load factors that a warning names at most.
_SHOWN = 5


class StepEnd(NamedTuple):
    """The state to which a hard step led, as far as it is compared.

    Attributes
    ----------
    load_factor
        Load factor.
    energy, reactions
        Energy in N·mm and all components of the reactions in N.
    energy_error, force_error
        What round-off leaves of these.
    """

    load_factor: float
    energy: float
    reactions: list[float]
    energy_error: float
    force_error: float

    @classmethod
    def of(cls, state: State) -> "StepEnd":
        """The end of a step to a state."""
        return cls(
            state.load_factor,
            sum(state.energies.values()),
            np.concatenate(list(state.reactions.values())).tolist(),
            state.tolerance * float(np.abs(state.u).sum()),
            state.tolerance * state.u.size,
        )

    def agrees(self, other: "StepEnd") -> bool:
        """Whether both are of one state."""
        ours, theirs = np.array(self.reactions), np.array(other.reactions)
        force = np.abs([ours, theirs]).max()
        energy = max(abs(self.energy), abs(other.energy))
        return bool(
            abs(self.energy - other.energy) <= _SAME_STATE * energy + other.energy_error
            and np.abs(ours - theirs).max() <= _SAME_STATE * force + other.force_error
        )


@dataclass
class LoadPath:
    """The hard steps of a run, and how they ended.

    Attributes
    ----------
    longest
        Length of a requested step.
    halvings
        How often it may be halved.
    unresolved
        Load factors at which another number of steps may lead to another equilibrium.
    to_compare
        Ends of hard steps that are being taken again, as two.
    not_followed_until
        Up to this load factor the path is not followed.
    """

    longest: float
    halvings: int
    unresolved: list[float] = field(default_factory=list)
    to_compare: list[StepEnd] = field(default_factory=list)
    not_followed_until: float = -1.0

    def saved(self) -> dict[str, Any]:
        """What a checkpoint keeps."""
        return asdict(self)

    @classmethod
    def of(cls, saved: Mapping[str, Any]) -> "LoadPath":
        """The path that a checkpoint holds."""
        to_compare = [StepEnd(*past) for past in saved["to_compare"]]
        return cls(**{**saved, "to_compare": to_compare})

    @property
    def _short(self) -> float:
        return self.longest / 2.0 ** min(_PATH_HALVINGS, max(self.halvings - 2, 0))

    def most_altered(self, step: float, t: float, loaded: bool) -> float:
        """How many altered tangents a step to ``t`` may take before it is halved.

        Past a limit point of a load, ``loaded``, there is no path to follow.
        """
        followed = step > 1.5 * self._short and t > self.not_followed_until
        return MOST_ALTERED if followed or loaded else np.inf

    def must_repeat(
        self, step: float, state: State, altered: int, followed_path: bool
    ) -> bool:
        """Whether a step is to be taken again as two; where it led is then kept.

        Parameters
        ----------
        step
            Length of the step.
        state
            Where it led.
        altered
            Tangents that were altered on the way.
        followed_path
            Whether ``altered`` tells if the state is on the path.
        """
        if followed_path and altered <= MOST_ALTERED:
            return False
        t = state.load_factor
        if not followed_path:
            self.mark(t)
        if step > 0.75 * self._short and self.halvings and t > self.not_followed_until:
            self.to_compare.append(StepEnd.of(state))
            return True
        self.mark(t)
        return False

    def stop_following(self, goal: float) -> bool:
        """Take steps as they come up to a load factor, because short ones fail.

        Returns
        -------
        bool
            Whether it was being followed.
        """
        if self.not_followed_until >= goal or self._short == self.longest:
            return False
        self.not_followed_until = goal
        self.to_compare.clear()
        return True

    def reached(self, state: State) -> None:
        """Compare a state with the ends of hard steps to the same load factor."""
        if state.load_factor <= self.not_followed_until:
            self.mark(state.load_factor)
        for past in [c for c in self.to_compare if c.load_factor == state.load_factor]:
            self.to_compare.remove(past)
            if not past.agrees(StepEnd.of(state)):
                self.mark(state.load_factor)

    def mark(self, t: float) -> None:
        """Remember that the path was not resolved at a load factor."""
        if t not in self.unresolved:
            self.unresolved.append(t)

    def warning(self) -> str:
        """What to say of the load factors at which the path was not resolved."""
        if not self.unresolved:
            return ""
        shown = ", ".join(f"{t:.4g}" for t in self.unresolved[:_SHOWN])
        more = ", ..." if len(self.unresolved) > _SHOWN else ""
        return (
            f"the path was not resolved at load factor {shown}{more}: another number "
            "of steps may lead to another equilibrium; compare with more steps"
        )

    def until(self, goal: float) -> float:
        """The load factor that the next step must not pass."""
        return min([goal, *(past.load_factor for past in self.to_compare)])
