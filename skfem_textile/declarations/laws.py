"""Parameters of the laws that a table of a case file contains."""

from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, TypeAlias

from .fields import DEGREES, N_PER_MM, Declared, Key, Range, about

if TYPE_CHECKING:
    from numpy import ndarray

    Uniform: TypeAlias = float
    OrByElement: TypeAlias = float | ndarray
else:
    OrByElement = Uniform = Annotated[float, N_PER_MM, about("stiffness E or G")]


@dataclass(frozen=True)
class OneStiffness(Declared):
    """A law with one parameter."""

    stiffness: OrByElement


class Linear(OneStiffness, module="fabric.law"):
    """M_s = G gamma, or T = E eps"""


class Sin2(OneStiffness, module="fabric.laws.shear"):
    """w = G sin^2 gamma / 2"""


@dataclass(frozen=True)
class Locking(Declared, module="fabric.laws.shear"):
    """M_s = G gamma / (1 - (gamma/a)^2)"""

    stiffness: Uniform
    angle: Annotated[
        float,
        DEGREES,
        Key("locking_angle"),
        Range(above=0, most=90),
        about("angle a of the pole of the law"),
    ]


@dataclass(frozen=True)
class CrimpToe(Declared, module="fabric.laws.tension"):
    """T = E (eps - e0 (1 - exp(-eps/e0))) + k eps, k eps in compression"""

    stiffness: Uniform
    toe: Annotated[float, about("strain e0")]
    initial_stiffness: Annotated[
        float, N_PER_MM, about("stiffness k at rest and in compression")
    ]
