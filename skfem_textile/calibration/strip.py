"""Tensile tests of strips, loaded along one fibre family."""

import os
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Self

import numpy as np
from numpy import ndarray

from ..fabric.law import number
from .biaxial import Along
from .measured import FAMILIES, MeasuredTest, beyond_slack
from .preparing import Preparation, prepare
from .reading import Format, read_recordings


@dataclass(frozen=True, eq=False)
class Strip(MeasuredTest):
    """Tensile test of a strip, whose transverse fibres carry no load.

    Attributes
    ----------
    family
        Family along the load, ``warp`` or ``weft``.
    width, length
        Width, and length between the clamps, in mm.
    displacement, force
        Displacement in mm and force in N, shape (n,).
    slack
        Displacement in mm at which the strip is taut; None if a fit is to determine it.
    assumed_slack
        Slack in mm at which such a fit begins, and which determines the largest strain;
        None before it is estimated.

    Raises
    ------
    ValueError
        If the family is unknown, or a length is not positive.
    """

    family: str
    width: float
    length: float
    displacement: ndarray
    force: ndarray
    slack: float | None = 0.0
    assumed_slack: float | None = None

    def __post_init__(self) -> None:
        if self.family not in FAMILIES:
            raise ValueError(
                f"{self.name}: the family must be warp or weft, got {self.family!r}"
            )
        number("the width of the strip", self.width, above=0)
        number("the length of the strip", self.length, above=0)

    @property
    def slack_is_unknown(self) -> bool:
        """True if a fit is to determine the slack."""
        return self.slack is None

    def strain(self, slack: float) -> ndarray:
        """Logarithmic strain ln(1 + δ/L); 0 within a slack."""
        moved = beyond_slack(self.displacement, slack, not self.slack_is_unknown)
        return np.log1p(moved / self.length)

    def along(self, family: int) -> Along | None:
        """Strain, force and width of a family; None for the transverse one."""
        if FAMILIES[family] != self.family:
            return None
        slack = self.assumed_slack if self.slack_is_unknown else self.slack
        return Along(self.strain(slack or 0.0), self.force, self.width)

    def with_slack(self, zeros: Mapping[str, float]) -> Self:
        """See `MeasuredTest.with_slack`."""
        return replace(self, assumed_slack=zeros["slack"]) if zeros else self


def read_strips(
    path: str | os.PathLike[str],
    family: str,
    width: float,
    length: float,
    form: Format | None = None,
    choices: Preparation | None = None,
) -> list[Strip]:
    """Tensile tests of a file or folder with displacement, or strain, and force.

    Parameters
    ----------
    path, form
        See `read_recordings`, with its errors.
    family, width, length
        See `Strip`.
    choices
        See `prepare`, with its errors.
    """
    choices, strips = choices or Preparation(), []
    for recording in read_recordings(path, form):
        driving = "strain" if "strain" in recording.columns else "displacement"
        complete = recording.complete(driving, "force")
        prepared = prepare(complete, driving, ["force"], choices)
        read, slack = prepared.recording, prepared.zero(choices.slack)
        moved = read.column(driving) * (length if driving == "strain" else 1.0)
        strips.append(
            Strip(
                *(read.name, family, width, length, moved, read.column("force"), slack),
                prepared=prepared,
            )
        )
    return strips
