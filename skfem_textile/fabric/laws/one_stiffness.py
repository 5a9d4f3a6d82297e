"""What the laws with one parameter share, their initial stiffness."""

from dataclasses import dataclass, replace
from typing import ClassVar, Self

import numpy as np
from numpy import ndarray

from ...registration import Option
from ..law import Law

#: The parameter of these laws.
STIFFNESS = Option(name="stiffness", help="N/mm", default=0.0, read=float, metavar="G")


@dataclass(frozen=True)
class OneStiffness:
    """A law with one parameter, its initial stiffness; finite everywhere.

    The stiffness is a number, or one for each element, shape (n_elements,).
    """

    stiffness: float | ndarray
    domain: ClassVar[tuple[float, float]] = (-np.inf, np.inf)

    def __post_init__(self) -> None:
        stiffness = np.ravel(self.stiffness)
        if (wrong := stiffness[~(np.isfinite(stiffness) & (stiffness >= 0))]).size:
            raise ValueError(f"stiffness must be a finite number >= 0, got {wrong[0]}")

    def at(self, element: ndarray | None = None) -> Self:
        """The law at points, by the numbers of their elements; see `Law`."""
        every = np.asarray(self.stiffness)
        if every.ndim == 0:
            return self
        own = every[:, None] if element is None else every[element]
        return replace(self, stiffness=own)


def is_zero(law: Law) -> bool:
    """Whether a law needs no term at all."""
    return isinstance(law, OneStiffness) and not np.any(law.stiffness)
