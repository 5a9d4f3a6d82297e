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

from .result import State

# Energies and reactions that differ by a smaller share are of one state.
_SAME = 0.01

# Share of the energy that may depend on the length of the last step: the load is off by
# up to twice as much (tests/test_path.py).
_DRIFT = 0.005

# Altered tangents at most on the way of an easy step.
_EASY = 2

# How much shorter than a requested step a hard one becomes before it is taken: 2⁻⁶.
_HALVINGS = 6


class Claim(NamedTuple):
    """Where a hard step led.

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
    def of(cls, state: State) -> "Claim":
        """What is told of a state."""
        return cls(
            state.load_factor,
            sum(state.energies.values()),
            np.concatenate(list(state.reactions.values())).tolist(),
            state.tolerance * float(np.abs(state.u).sum()),
            state.tolerance * state.u.size,
        )

    def agrees(self, other: "Claim") -> bool:
        """Whether both are of one state."""
        ours, theirs = np.array(self.reactions), np.array(other.reactions)
        force = np.abs([ours, theirs]).max()
        energy = max(abs(self.energy), abs(other.energy))
        return bool(
            abs(self.energy - other.energy) <= _SAME * energy + other.energy_error
            and np.abs(ours - theirs).max() <= _SAME * force + other.force_error
        )


@dataclass
class Path:
    """The hard steps of a run, and how they ended.

    Attributes
    ----------
    longest
        Length of a requested step.
    halvings
        How often it may be halved.
    unresolved
        Load factors at which another number of steps may lead to another equilibrium.
    claims
        Where hard steps led that are being taken again, as two.
    lost_until
        Up to this load factor the path is not followed.
    """

    longest: float
    halvings: int
    unresolved: list[float] = field(default_factory=list)
    claims: list[Claim] = field(default_factory=list)
    lost_until: float = -1.0

    def saved(self) -> dict[str, Any]:
        """What a checkpoint keeps."""
        return asdict(self)

    @classmethod
    def of(cls, saved: Mapping[str, Any]) -> "Path":
        """The path that a checkpoint holds."""
        claims = [Claim(*past) for past in saved["claims"]]
        return cls(**{**saved, "claims": claims})

    @property
    def _short(self) -> float:
        return self.longest / 2.0 ** min(_HALVINGS, max(self.halvings - 2, 0))

    def most_altered(self, step: float, t: float) -> float:
        """How many altered tangents a step to ``t`` may take before it is halved."""
        return _EASY if step > 1.5 * self._short and t > self.lost_until else np.inf

    def doubts(self, step: float, state: State, altered: int, stays: bool) -> bool:
        """Whether a step is to be taken again as two; where it led is then kept.

        Parameters
        ----------
        step
            Length of the step.
        state
            Where it led.
        altered
            Tangents that were altered on the way.
        stays
            Whether what found the state stays on the path.
        """
        if stays and altered <= _EASY:
            return False
        t = state.load_factor
        if not stays:
            self._doubt(t)
        if step > 0.75 * self._short and self.halvings and t > self.lost_until:
            self.claims.append(Claim.of(state))
            return True
        if not self.claims:
            self._doubt(t)
        return False

    def lost(self, goal: float) -> bool:
        """Follow the path no more, up to a load factor, as short steps fail there.

        Returns
        -------
        bool
            Whether it was being followed.
        """
        if self.lost_until >= goal or self._short == self.longest:
            return False
        self.lost_until = goal
        self.claims.clear()
        return True

    def reached(self, state: State) -> None:
        """Compare a state with where hard steps to the same load factor led."""
        if state.load_factor <= self.lost_until:
            self._doubt(state.load_factor)
        for past in [c for c in self.claims if c.load_factor == state.load_factor]:
            self.claims.remove(past)
            if not past.agrees(Claim.of(state)):
                self._doubt(state.load_factor)

    def drifted(self, state: State, drift: float) -> None:
        """Doubt a state if what the ply remembers changed much of its energy."""
        if drift > _DRIFT * abs(sum(state.energies.values())):
            self._doubt(state.load_factor)

    def _doubt(self, t: float) -> None:
        if t not in self.unresolved:
            self.unresolved.append(t)

    def until(self, goal: float) -> float:
        """The load factor that the next step must not pass."""
        return min([goal, *(past.load_factor for past in self.claims)])
