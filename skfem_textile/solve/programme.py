"""Load programmes: factors that rise and fall with the load factor."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..fabric.law import keep
from ..mesh.user_input import real_numbers, shortened

# Round-off of a load factor.
_ROUND_OFF = 1e-15


@dataclass(frozen=True)
class Programme:
    """Factor that passes through given levels, in parts of equal length.

    It is the ``factor`` of a `Condition` or a load: while the load factor increases
    from 0 to 1, it starts at 0 and is linear from each level to the next.  A
    `LoadStepper` requires that a step ends at each level, because a step that passes a
    level would miss it.

    Parameters
    ----------
    levels
        Factors at the ends of the parts.

    Raises
    ------
    ValueError
        If there is no level, or one is not a finite number.

    Examples
    --------
    Loading, unloading to a fifth, and loading again:

    >>> programme = Programme([1.0, 0.2, 1.0])
    >>> [round(programme(t), 3) for t in (0.0, 1 / 6, 1 / 3, 2 / 3, 1.0)]
    [0.0, 0.5, 1.0, 0.2, 1.0]
    """

    levels: tuple[float, ...]

    def __post_init__(self) -> None:
        levels = real_numbers("levels of a programme", self.levels)
        if levels.ndim != 1 or not levels.size or not np.isfinite(levels).all():
            raise ValueError(
                "the levels of a programme must be finite numbers, such as [1, 0, 1], "
                f"got {shortened(self.levels)}"
            )
        keep(self, levels=tuple(levels.tolist()))

    @property
    def parts(self) -> int:
        """Number of parts."""
        return len(self.levels)

    def __call__(self, t: float) -> float:
        """Factor at the load factor t, which is exact at the ends of the parts."""
        ends = (0.0, *self.levels)
        place = min(max(t, 0.0), 1.0) * self.parts
        nearest = round(place)
        if abs(place - nearest) <= _ROUND_OFF * self.parts:
            return ends[nearest]
        first = int(place)
        share = place - first
        return (1 - share) * ends[first] + share * ends[first + 1]

    def check_steps(self, load_factors: Sequence[float]) -> None:
        """Refuse steps, given by the load factors at their ends, that pass a level."""
        for level in range(1, self.parts):
            off = min(abs(t * self.parts - level) for t in load_factors)
            if off > _ROUND_OFF * self.parts:
                raise ValueError(
                    f"steps must be a multiple of {self.parts}, the number of parts of "
                    f"the programme, or {self.parts} numbers of steps, so that each "
                    f"part ends with a step; got {len(load_factors)}"
                )
