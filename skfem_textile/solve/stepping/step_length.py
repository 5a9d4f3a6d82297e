"""The length of load steps, which is halved where they fail and doubled where easy."""

from dataclasses import dataclass


@dataclass
class StepLength:
    """How long the next step is, in load factors.

    Attributes
    ----------
    longest
        Length of a requested step.
    shortest
        Length of a step that is not halved any more.
    next
        Length of the next step.
    """

    longest: float
    shortest: float
    next: float

    def end(self, t: float, until: float) -> float:
        """Where the next step from ``t`` ends, ``until`` at most.

        It goes up to there if a step would be left over that is too short.
        """
        end = t + self.next
        return until if end > until - 0.5 * min(self.shortest, self.next) else end

    def may_be_halved(self, step: float) -> bool:
        """Whether a step is longer than the shortest."""
        return step > 1.5 * self.shortest

    def halve(self, step: float) -> None:
        """Make the next step half as long as one that failed."""
        self.next = 0.5 * step

    def restore(self) -> None:
        """Make the next step as long as a requested one."""
        self.next = self.longest

    def after(self, altered: int) -> None:
        """Make the next step twice as long if no tangent was projected in one."""
        if altered == 0:
            self.next = min(2 * self.next, self.longest)
