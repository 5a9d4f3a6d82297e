"""Tests in tension: strips along one fibre family, and biaxial tests.

Strains of a test are engineering strains, λ − 1; laws use ε = ln λ.  A fabric of width
W normal to the load has the force F = W T(ε)/λ.
"""

import os
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import NamedTuple, Self

import numpy as np
from numpy import ndarray

from ..fabric.law import number
from .measured import FAMILIES, MeasuredTest, beyond_slack
from .preparing import Preparation, prepare
from .reading import Format, read_recordings


class Along(NamedTuple):
    """Logarithmic strain and force in N along a family, (n,), and the width in mm."""

    strain: ndarray
    force: ndarray
    width: float

    @property
    def tension(self) -> ndarray:
        """Tension T = F λ/W in N/mm."""
        return self.force * np.exp(self.strain) / self.width


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
    def parts(self) -> tuple[str, ...]:
        """See `MeasuredTest.parts`."""
        return (self.family,)

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


@dataclass(frozen=True, eq=False)
class BiaxialCurve(MeasuredTest):
    """Test at one ratio of the strains.

    Attributes
    ----------
    strain
        Logarithmic strains ln λ of warp and weft, shape (2, n).
    force
        Forces along warp and weft in N, shape (2, n).
    widths
        Width in mm normal to the warp load, and normal to the weft load.
    slack_is_unknown
        True if a fit is to determine the strain at which each family becomes taut.
    assumed_slack
        Slacks of warp and weft, as elongations per length, at which such a fit begins,
        and which determine the largest strain; None before they are estimated.
    """

    strain: ndarray
    force: ndarray
    widths: tuple[float, float]
    slack_is_unknown: bool = False
    assumed_slack: tuple[float, float] | None = None

    @property
    def parts(self) -> tuple[str, ...]:
        """See `MeasuredTest.parts`."""
        return (*FAMILIES, "both")

    def along(self, family: int) -> Along:
        """Strain, force and width of a family."""
        slack = (self.assumed_slack or (0.0, 0.0))[family]
        strain = self.taut(family, slack) if slack else self.strain[family]
        return Along(strain, self.force[family], self.widths[family])

    def with_slack(self, zeros: Mapping[str, float]) -> Self:
        """See `MeasuredTest.with_slack`."""
        warp, weft = (zeros.get(f"{family} slack", 0.0) for family in FAMILIES)
        return replace(self, assumed_slack=(warp, weft))

    @property
    def loose(self) -> list[int]:
        """Stretched families with a slack that a fit is to determine."""
        return [
            i for i in range(2) if self.slack_is_unknown and self.strain[i].max() > 0
        ]

    def taut(self, family: int, slack: float) -> ndarray:
        """Logarithmic strain of a family beyond its slack, an elongation per length."""
        if not self.slack_is_unknown:
            return self.strain[family]
        elongation = np.expm1(self.strain[family])
        beyond = np.maximum(elongation - slack, 0.0)
        return np.log1p(np.where(elongation > 0, beyond, elongation))


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
                cyclic=choices.cycles,
            )
        )
    return strips


def read_biaxial(
    path: str | os.PathLike[str],
    widths: tuple[float, float],
    form: Format | None = None,
    choices: Preparation | None = None,
) -> list[BiaxialCurve]:
    """Tests of a file or folder with strain and force of warp and weft.

    The family with the larger strain determines loading and unloading.  The strains at
    which fibres become taut are unknowns of a fit, unless the slack of the choices is
    0: strains then have the zeros of the machine.

    Parameters
    ----------
    path, form
        See `read_recordings`, with its errors.
    widths
        See `BiaxialCurve`.
    choices
        See `prepare`, with its errors.

    Raises
    ------
    ValueError
        If a strain is not above −1, or a slack other than 0 is given.
    """
    choices = choices or Preparation()
    strains, forces = ([f"{f} {of}" for f in FAMILIES] for of in ("strain", "force"))
    curves = []
    for recording in read_recordings(path, form):
        choices.refuse_slack(recording.name, "strains")
        complete = recording.complete(*strains, *forces)
        driving = max(strains, key=lambda name: np.ptp(complete.column(name)))
        prepared = prepare(complete, driving, forces, choices)
        read = prepared.recording
        elongation, force = (
            np.array([read.column(name) for name in of]) for of in (strains, forces)
        )
        if not np.all(elongation > -1):
            raise ValueError(
                f"{read.name}: every strain must be above -1, got {elongation.min():g}"
            )
        strain = np.log1p(elongation)
        curves.append(
            BiaxialCurve(
                *(read.name, strain, force, widths),
                slack_is_unknown=prepared.zero(choices.slack) is None,
                prepared=prepared,
            )
        )
    return curves
