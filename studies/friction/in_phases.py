"""Processes drawn at random, and what their phases state at a load factor.

`Plan` states the same amounts twice: as a `Process` of the library, and as separate
functions of the load factor, by which the oracle judges the run.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from numpy import ndarray

from skfem_textile.contact import OverTravel, Phase, Process

#: Chooses one of several values, with their shares.
Chosen = Callable[..., Any]

# Phases of processes by tools: the shares of the whole travel and of the whole rotation
# at the end of each, and the one of the amount of holders.  A drum has no holder.
_OF_PUNCHES: Mapping[str, Sequence[tuple[str, float, float, float]]] = {
    "formed and opened": (
        ("close", 0, 0, 1),
        ("punch", 1, 0, 1),
        ("hold", 1, 0, 1.5),
        ("open", 0, 0, 0.2),
    ),
    "in two strokes": (
        ("close", 0, 0, 1),
        ("punch", 0.6, 0, 1),
        ("hold", 0.6, 0, 0.5),
        ("punch again", 1, 0, 1),
    ),
    "back and forth": (
        ("punch", 0.8, 0, 0.6),
        ("open", 0.5, 0, 0.2),
        ("close", 0.5, 0, 1),
        ("punch again", 1, 0, 1),
    ),
    "turned": (("close", 0, 0, 1), ("punch", 1, 0, 1), ("turn", 1, 1, 0.5)),
    "opened at once": (("punch", 1, 0, 1), ("open", 0.3, 0, 0.2)),
}
_OF_DRUMS: Mapping[str, Sequence[tuple[str, float, float, float]]] = {
    "turned and lowered": (
        ("raise", 1, 0, 1),
        ("turn", 1, 1, 1),
        ("hold", 1, 1, 1),
        ("lower", 0.2, 1, 1),
    ),
    "turned back": (("raise", 1, 0.3, 1), ("turn", 1, 1, 1), ("turn back", 1, 0.4, 1)),
}
_OF_PLATES: Mapping[str, Sequence[tuple[str, float, float, float]]] = {
    "pulled": (
        ("close", 0, 0, 1),
        ("pull", 1, 0, 1),
        ("hold", 1, 0, 1.5),
        ("open", 1, 0, 0.2),
    ),
    "turned": (("turn", 0, 1, 0.5), ("pull", 1, 1, 1), ("turn back", 1, 0.5, 0.6)),
    "pushed back": (("pull", 1, 0, 1), ("hold", 1, 0, 0.4), ("push", -0.5, 0, 1)),
}

# Steps of a phase; an even number where an amount may turn back at half of it.
_STEPS, _EVEN = (1, 2, 3, 5, 8), (2, 4, 6)

# Amount of holders before the first phase relative to the drawn one.  A gap is wider,
# up to this number of times.
_OPEN, _WIDEST = 0.2, 5.0


@dataclass(frozen=True)
class DrawnPhase:
    """Phase of a plan.

    Attributes
    ----------
    name, steps
        Name, and number of steps.
    travel, turn, amount
        Shares at its end of the travel, the rotation, and the gap, pressure or force of
        holders.
    middle
        Share of the amount at half of the phase; None if it changes linearly.
    over_travel
        True if it changes with the travel of the punch.
    friction
        Factors of the coefficients of friction at its start and end.
    """

    name: str
    steps: int
    travel: float
    turn: float
    amount: float
    middle: float | None
    over_travel: bool
    friction: tuple[float, float]

    def __str__(self) -> str:
        return f"{self.name} in {self.steps}"


@dataclass(frozen=True)
class Plan:
    """Process drawn at random.

    Attributes
    ----------
    phases
        Its phases.
    """

    phases: tuple[DrawnPhase, ...]

    @classmethod
    def of(cls, kind: str, chosen: Chosen, turns: bool) -> "Plan":
        """A plan for a ``drum``, a ``plate`` or a ``punch``.

        ``turns`` is False if the tools cannot rotate.
        """
        of_kind = {"drum": _OF_DRUMS, "plate": _OF_PLATES}.get(kind, _OF_PUNCHES)
        rows = of_kind[chosen([x for x in of_kind if turns or x != "turned"])]
        phases: list[DrawnPhase] = []
        last = 0.0
        for name, travel, turn, amount in rows:
            by_rows = chosen(("line", "turned back", "travel"), (0.6, 0.2, 0.2))
            middle = chosen((0.4, 0.8, 1.2)) if by_rows == "turned back" else None
            steps = chosen(_STEPS if middle is None else _EVEN)
            start = chosen((1.0, 0.5, 0.0), (0.7, 0.2, 0.1))
            friction = start, chosen((start, 1.0), (0.8, 0.2))
            moves = by_rows == "travel" and travel > last >= 0 and kind == "punch"
            shares = travel, turn, amount, middle, moves
            phases.append(DrawnPhase(name, steps, *shares, friction))
            last = travel
        return cls(tuple(phases))

    def __str__(self) -> str:
        return ", ".join(map(str, self.phases))

    @property
    def steps(self) -> int:
        """Number of steps of all phases."""
        return sum(phase.steps for phase in self.phases)

    @property
    def ends(self) -> ndarray:
        """Load factors at the ends of the phases, 0 included."""
        return np.arange(len(self.phases) + 1) / len(self.phases)

    def travel(self, t: float) -> float:
        """Share of the travel at a load factor."""
        return self._between([0.0, *(x.travel for x in self.phases)], t)

    def turn(self, t: float) -> float:
        """Share of the rotation at a load factor."""
        return self._between([0.0, *(x.turn for x in self.phases)], t)

    def friction(self, mu: float, t: float) -> float:
        """Coefficient at a load factor; at the end of a phase, the one before it."""
        n = len(self.phases)
        k = max(int(np.ceil(round(t * n, 9))) - 1, 0)
        start, end = self.phases[k].friction
        return mu * (start + (t * n - k) * (end - start))

    def amount(self, value: float, gap: bool, t: float) -> float:
        """Gap, pressure or force at a load factor."""
        at, values, n = [0.0], [_share(_OPEN, gap)], len(self.phases)
        for k, phase in enumerate(self.phases):
            if phase.middle is not None:
                at.append((k + 0.5) / n)
                values.append(_share(phase.middle, gap))
            at.append((k + 1) / n)
            values.append(_share(phase.amount, gap))
        return value * float(np.interp(t, at, values))

    def process(
        self,
        tools: Sequence[Any],
        frictions: Mapping[str, float],
        amounts: Mapping[str, tuple[str, float]],
        travel: ndarray,
        rotation: float,
        axis: tuple[Any, Any] | None = None,
    ) -> Process:
        """The process of the library.

        Parameters
        ----------
        tools
            Tools at rest, of which the first moves.
        frictions, amounts
            Coefficients of friction, and gap, pressure or force of holders, by name.
        travel, rotation
            Whole travel, shape (3,), and rotation in radians about ``axis``.
        """
        first, phases, begin = tools[0].name, [], 0.0
        for k, phase in enumerate(self.phases):
            stated: dict[str, Any] = {tool.name: {} for tool in tools}
            stated[first]["motion"] = phase.travel * travel
            if any(x.turn for x in self.phases):
                stated[first]["rotation"] = phase.turn * rotation
            for name, mu in frictions.items():
                start, end = (mu * factor for factor in phase.friction)
                stated[name]["friction"] = (
                    start if start == end else [(0.0, start), (1.0, end)]
                )
            for name, (what, value) in amounts.items():
                at = partial(self.amount, value, what == "gap")
                end = at(self.ends[k + 1])
                stated[name][what] = end
                if phase.middle is not None:
                    half = at((k + 0.5) / len(self.phases))
                    stated[name][what] = [(0.5, half), (1.0, end)]
                elif phase.over_travel:
                    size = float(np.linalg.norm(travel))
                    rows = [
                        (begin * size, at(self.ends[k])),
                        (phase.travel * size, end),
                    ]
                    stated[name][what] = OverTravel(first, rows)
            phases.append(Phase(phase.name, phase.steps, stated))
            begin = phase.travel
        return Process(phases, tools, {first: axis} if axis else None)

    def _between(self, values: Sequence[float], t: float) -> float:
        return float(np.interp(t, self.ends, values))


def _share(share: float, gap: bool) -> float:
    """Share of an amount; a holder with a gap presses at 1, and is wider below."""
    return 1 + (_WIDEST - 1) * max(1 - share, 0.0) if gap else share


def opened(value: float, gap: bool) -> float:
    """Gap, pressure or force before the first phase."""
    return value * _share(_OPEN, gap)
