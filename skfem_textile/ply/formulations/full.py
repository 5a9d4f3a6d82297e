"""Four points in every quadrilateral."""

from dataclasses import dataclass
from typing import ClassVar

from numpy import ndarray

from ...mesh.bases import GAUSS
from ...registration import FormulationRegistration
from .common import Quadrilaterals


@dataclass(frozen=True)
class Full(Quadrilaterals):
    """2×2 points and no stabilisation: locks unless a mesh follows the fibres."""

    name: ClassVar[str] = "full"
    title: ClassVar[str] = "2×2 points"
    rule: ClassVar[tuple[ndarray, ndarray]] = GAUSS


REGISTRATION = FormulationRegistration(
    name=Full.name, description="2x2 points", build=Full, rank=3
)
