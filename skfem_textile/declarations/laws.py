"""Parameters of the laws that a table of a case file contains."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

from . import declaration, deg, key

if TYPE_CHECKING:
    from numpy import ndarray

_STIFFNESS = "stiffness E or G"


@declaration()
class OneStiffness:
    """A law with one parameter, as in `fabric.law`, which needs no declarations."""

    stiffness: "float | ndarray" = key(_STIFFNESS, unit="N_per_mm", kind=float)


@declaration("fabric.law")
class Linear(OneStiffness):
    """M_s = G gamma, or T = E eps"""


@declaration("fabric.laws.shear")
class Sin2(OneStiffness):
    """w = G sin^2 gamma / 2"""


@declaration("fabric.laws.shear")
class Locking:
    """M_s = G gamma / (1 - (gamma/a)^2)"""

    stiffness: float = key(_STIFFNESS, unit="N_per_mm")
    angle: float = deg(
        "angle a of the pole of the law", name="locking_angle", limits=(0, 90)
    )


@declaration("fabric.laws.tension")
class CrimpToe:
    """T = E (eps - e0 (1 - exp(-eps/e0))) + k eps, k eps in compression"""

    stiffness: float = key(_STIFFNESS, unit="N_per_mm")
    toe: float = key("strain e0")
    initial_stiffness: float = key(
        "stiffness k at rest and in compression", unit="N_per_mm"
    )


#: Words of a law that is given for arguments of both signs, or continued.
CONTINUATION = "none", "odd"

#: Meaning of these words.
ABOUT_CONTINUATION = (
    "none; odd: the law is given for arguments >= 0 and continued as an odd function"
)


@declaration("fabric.laws.polynomial")
class Polynomial:
    """M_s = c1 s + c2 s^2 + ..., s = gamma or sin gamma"""

    coefficients: Sequence[float] = key(
        "c1, c2, ...", unit="N_per_mm", kind=tuple[float, ...]
    )
    sine: bool = key(
        "s: the angle in radians or its sine",
        default=False,
        name="variable",
        words=("angle", "sine"),
    )
    odd: bool = key(
        ABOUT_CONTINUATION, default=False, name="continuation", words=CONTINUATION
    )
