"""Parameters of the formulations."""

from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Literal, TypeAlias

from .fields import N_PER_MM, Declared, Key, about

if TYPE_CHECKING:
    Points: TypeAlias = int
else:
    Points = Literal[3, 6]

Kind: TypeAlias = Literal["energy", "rate", "continuity", "isotropic"]

Stabilisation: TypeAlias = Annotated[
    float | Literal["auto"],
    Key("cs"),
    N_PER_MM,
    about(
        "stabilisation stiffness C_s, or auto: computed from shear stiffness, tension "
        "and fibre angle of each element; 1e-4 E without shear stiffness"
    ),
]


@dataclass(frozen=True)
class Macro(Declared, module="ply.formulations"):
    """macro-elements, without parameters"""

    stabilisation: Stabilisation = "auto"
    deviation: tuple[float, float] = (370.0, 700.0)


@dataclass(frozen=True)
class OnePoint(Declared, module="ply.formulations"):
    """one stabilised point in every quadrilateral (Hamila & Boisse 2013)"""

    stabilisation: Stabilisation = "auto"
    kind: Annotated[
        Kind,
        Key("stabilisation"),
        about(
            "energy: independent of the load path; rate: in rate form, as published; "
            "continuity: penalty on jumps between elements; isotropic: penalty on "
            "hourglass modes in all directions. All except energy require a number for "
            "C_s"
        ),
    ] = "energy"


class Full(Declared, module="ply.formulations"):
    """2x2 points in every quadrilateral"""


@dataclass(frozen=True)
class Quadratic(Declared, module="ply.formulations"):
    """quadratic triangles; quadrilaterals are cut along a diagonal"""

    deviation: Annotated[
        float | None,
        about(
            "if given, the law is evaluated at the mean stretch, and deviations from "
            "it have a stiffness of this multiple of shear stiffness and tension (400 "
            "with 6 points on graded meshes, 80 on others)"
        ),
    ] = None
    points: Annotated[Points, about("number of integration points of a triangle")] = 3
