"""Biaxial tests.

Strains of a test are engineering strains, λ − 1; laws use ε = ln λ.  A fabric of width
W normal to the load has the force F = W T(ε)/λ.
"""

import os
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import NamedTuple, Self

import numpy as np
from numpy import ndarray

from .measured import FAMILIES, MeasuredTest
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
