"""Parameters of the formulations."""

from typing import Literal, TypeAlias

from . import declaration, key

_C_S = (
    "stabilisation stiffness C_s, or auto: computed from shear stiffness, tension and "
    "fibre angle of each element; 1e-4 E without shear stiffness"
)

Kind: TypeAlias = Literal["energy", "rate", "continuity", "isotropic"]


@declaration("ply.formulations")
class Macro:
    """macro-elements, without parameters"""

    stabilisation: float | Literal["auto"] = key(
        _C_S, default="auto", unit="N_per_mm", name="cs"
    )
    deviation: tuple[float, float] = (370.0, 700.0)


@declaration("ply.formulations")
class OnePoint:
    """one stabilised point in every quadrilateral (Hamila & Boisse 2013)"""

    stabilisation: float | Literal["auto"] = key(
        _C_S, default="auto", unit="N_per_mm", name="cs"
    )
    kind: Kind = key(
        "energy: independent of the load path; rate: in rate form, as published; "
        "continuity: penalty on jumps between elements; isotropic: penalty on "
        "hourglass modes in all directions. All except energy require a number for "
        "C_s",
        default="energy",
        name="stabilisation",
    )


@declaration("ply.formulations")
class Full:
    """2x2 points in every quadrilateral"""


@declaration("ply.formulations")
class Quadratic:
    """quadratic triangles; quadrilaterals are cut along a diagonal"""

    deviation: float | None = key(
        "if given, the law is evaluated at the mean stretch, and deviations from "
        "it have a stiffness of this multiple of shear stiffness and tension (400 "
        "with 6 points on graded meshes, 80 on others)",
        default=None,
    )
    points: int = key(
        "number of integration points of a triangle", default=3, kind=Literal[3, 6]
    )
