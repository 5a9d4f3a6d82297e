"""Properties that all kinds of tests share: recording, slack, fibre families."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Self

import numpy as np
from numpy import ndarray

from .preparing import Prepared

#: Fibre families.
FAMILIES = "warp", "weft"

# Range of the slack relative to the largest displacement.  Chosen: a negative slack is
# a pretension; beyond half of the curve the fabric would not be tested.
_LEAST_SLACK, _MOST_SLACK = -0.1, 0.6


@dataclass(frozen=True, eq=False)
class MeasuredTest:
    """Test of a fabric.

    Attributes
    ----------
    name
        Name of the test.
    prepared
        The recording as read and as prepared; None for a test that was not read.
    cyclic
        True if loading and unloading determine the friction of the law.
    """

    name: str
    prepared: Prepared | None = field(default=None, kw_only=True)
    cyclic: bool = field(default=False, kw_only=True)

    @property
    def statements(self) -> tuple[str, ...]:
        """Description of the reading and preparation."""
        return () if self.prepared is None else self.prepared.recording.statements

    @property
    def parts(self) -> tuple[str, ...]:
        """Laws that the test determines, by the names of `PARTS`."""
        raise NotImplementedError

    def with_slack(self, zeros: Mapping[str, float]) -> Self:
        """The test that assumes the slack of fitted zeros, by name."""
        return self


def families_of(part: str) -> list[int]:
    """Numbers of the fibre families of a tension law: one, or both."""
    return [i for i, name in enumerate(FAMILIES) if part in (name, "both")]


def slack_range(displacement: ndarray) -> tuple[float, float]:
    """Smallest and largest slack of a curve, in the unit of the displacement."""
    size = float(displacement.max())
    return _LEAST_SLACK * size, _MOST_SLACK * size


def beyond_slack(displacement: ndarray, slack: float, is_known: bool) -> ndarray:
    """Displacement beyond a slack; 0 within it, unless it is known to be 0."""
    moved = displacement - slack
    return moved if is_known and not slack else np.maximum(moved, 0.0)
