"""Parameters of laws, formulations, surfaces and scenes, with their keys in case files.

A parameter is a field of a dataclass, with its unit, default and meaning.  The class or
function that has the parameters inherits or takes them, and the table of a case file,
the options of the command line and the reference of all keys are derived from them.
These modules import neither NumPy nor scikit-fem, so that a help text does not either.
"""

from collections.abc import Callable, Sequence
from dataclasses import MISSING, dataclass, field
from math import radians
from typing import TYPE_CHECKING, Any, Literal, TypeAlias, TypeVar, dataclass_transform

if TYPE_CHECKING:
    from numpy import ndarray
    from numpy.typing import ArrayLike

_T = TypeVar("_T")

#: Largest coefficient of friction.  A coefficient in percent is larger.
MOST_FRICTION = 2.0

#: Default of the elastic slip in mm: the force of a hemisphere changes by 0.1 % between
#: 0.005 and 0.1 mm (`python -m studies friction`).
ELASTIC_SLIP = 0.02

#: Default in a case file of a parameter that it must state.
REQUIRED = MISSING

_AS_IN_PYTHON = object()


@dataclass(frozen=True)
class Key:
    """Key of a case file for a parameter.

    Attributes
    ----------
    about
        Meaning.
    default
        Default in the file, in its unit; `REQUIRED` if there is none.
    unit
        Unit in the file, with which the key ends; angles are in radians in Python.
    name
        Name without the unit; empty if it is the name of the parameter.
    kind
        Type in the file, if it is not the one in Python.
    limits
        Limit that a number must exceed, and its largest value, in the unit of the file.
    closed
        True if it may also be equal to the first limit.
    words
        Words in the file for False and True; empty if there are none.
    file
        True if the value is the name of a file.
    """

    about: str
    default: Any
    unit: str = ""
    name: str = ""
    kind: Any = None
    limits: tuple[float, float] | None = None
    closed: bool = False
    words: tuple[str, ...] = ()
    file: bool = False


def key(
    about: str,
    *,
    default: Any = MISSING,
    in_file: Any = _AS_IN_PYTHON,
    kw_only: Any = MISSING,
    **stated: Any,
) -> Any:
    """Field of a `declaration` that a case file states.

    Parameters
    ----------
    default
        Default in Python.
    in_file
        Default in a case file, if it is another one.
    kw_only
        See `dataclasses.field`.
    about, **stated
        See `Key`.
    """
    in_file = default if in_file is _AS_IN_PYTHON else in_file
    metadata = {"key": Key(about, in_file, **stated)}
    return field(default=default, kw_only=kw_only, metadata=metadata)


def mm(about: str, *, default: Any = MISSING, **others: Any) -> Any:
    """Length; see `key`."""
    return key(about, default=default, unit="mm", **others)


def deg(about: str, *, default: Any = MISSING, **others: Any) -> Any:
    """Angle, here in degrees and in Python in radians; see `key`."""
    stated = {"in_file": default, "unit": "deg", **others}
    if default is not MISSING and default is not None:
        default = radians(default)
    return key(about, default=default, **stated)


@dataclass_transform(frozen_default=True, field_specifiers=(field, key, mm, deg))
def declaration(
    module: str = "", *, kw_only: bool = False, eq: bool = True
) -> Callable[[type[_T]], type[_T]]:
    """Frozen dataclass of parameters, those with a `key` also in case files.

    Its docstring is the summary in help texts.

    Parameters
    ----------
    module
        Module of the package that contains the class of the same name, or the function
        of the same name in lower case; empty for a base class.
    kw_only, eq
        See `dataclasses.dataclass`.
    """

    def decorated(kind: Any) -> Any:
        kind.implemented_in = module
        return dataclass(frozen=True, kw_only=kw_only, eq=eq)(kind)

    return decorated


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


@declaration("fabric.yarns")
class Yarns:
    """yarns, for the slip index"""

    spacing: tuple[float, float] = mm("distance between yarns of warp and weft")
    width: tuple[float, float] = mm("width of the yarns of warp and weft")
    friction_moment: float | None = key(
        "friction part of the shear moment (default: of the shear law)",
        default=None,
        unit="N_per_mm",
    )


@declaration("fabric.laws.bending")
class Bilinear:
    """M = D kappa up to the knee, then slope D1; the same for both signs of kappa"""

    stiffness: float = key("bending stiffness D up to the knee", unit="N_mm")
    knee: float = key("curvature of the knee", unit="per_mm")
    further_stiffness: float = key("bending stiffness D1 beyond the knee", unit="N_mm")
    rounding: float = key(
        "half of the transition of the slope, relative to the knee", default=0.1
    )


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


@declaration("contact.compaction")
class Compaction:
    """p = P ((t0/t)^B - 1) of the thickness t"""

    thickness: float = mm("thickness t0 without pressure")
    pressure: float = key("P", unit="N_per_mm2")
    exponent: float = key("B")


@declaration("contact.compaction")
class MeasuredCompaction:
    """a monotone curve through points"""

    thickness: Sequence[float] = mm("thicknesses", kind=tuple[float, ...])
    pressure: Sequence[float] = key(
        "pressures, from 0", unit="N_per_mm2", kind=tuple[float, ...]
    )


if TYPE_CHECKING:
    Vector: TypeAlias = ArrayLike
else:
    Vector = tuple[float, float, float]

_ORIGIN, _UP = (0.0, 0.0, 0.0), (0.0, 0.0, 1.0)


@declaration("ply.clamps", eq=False)
class Clamp:
    """springs along an edge of the ply, which may let go"""

    edge: Any = key(
        "name of the boundary of the mesh that the clamp holds, such as left, right, "
        "top or bottom",
        kind=str,
    )
    stiffness: float = key(
        "stiffness of the whole clamp, shared by length along the edge",
        unit="N_per_mm",
    )
    direction: "ArrayLike | None" = key(
        "direction x, y (and z in space) in which the clamp pulls; the ply moves "
        "freely along the others (default: springs in all directions)",
        default=None,
        kind=tuple[float, ...] | None,
    )
    release: float | None = key(
        "force of the whole clamp on the computed part of the ply at which it lets go "
        "(default: it never does)",
        default=None,
        unit="N",
    )
    preload: float = key(
        "force along the direction with which the clamp pulls at the undeformed edge",
        default=0.0,
        unit="N",
    )
    within: Any = mm(
        "the part of the edge within a rectangle: smallest x and y, and largest x and "
        "y, of the undeformed ply (default: the whole edge)",
        default=None,
        kind=tuple[float, float, float, float] | None,
    )
    name: str = key(
        "name of the clamp (default: clamp_1, clamp_2, ...)",
        default="clamp",
        in_file=None,
        kind=str | None,
    )


@declaration("surfaces.analytic", eq=False)
class Plane:
    """plane"""

    point: Vector = mm("point of the surface or of its axis", default=_ORIGIN)
    normal: Vector = key("normal of any length", default=_UP)


@declaration("surfaces.analytic", eq=False)
class Sphere:
    """sphere"""

    radius: float = mm("radius")
    centre: Vector = mm("centre of the sphere", default=_ORIGIN, in_file=REQUIRED)


@declaration("surfaces.analytic", eq=False)
class Cylinder:
    """cylinder"""

    radius: float = mm("radius")
    point: Vector = mm(
        "point of the surface or of its axis", default=_ORIGIN, in_file=REQUIRED
    )
    axis: Vector = key("direction of the axis", default=(0.0, 1.0, 0.0))


@declaration("surfaces.analytic", eq=False)
class Cone:
    """cone"""

    angle: float = deg("angle between axis and surface")
    point: Vector = mm("apex", default=_ORIGIN, in_file=REQUIRED)
    axis: Vector = key("direction from the apex into the cone", default=_UP)


@declaration("surfaces.analytic", eq=False)
class Torus:
    """torus"""

    radius: float = mm("radius of the centre line of the tube")
    tube: float = mm("radius of the tube")
    point: Vector = mm("centre", default=_ORIGIN, in_file=REQUIRED)
    axis: Vector = key("direction of the axis", default=_UP)


@declaration("surfaces.analytic", eq=False)
class Punch:
    """shaft with a hemispherical end"""

    radius: float = mm("radius of the shaft and of the hemisphere")
    point: Vector = mm("centre of the hemisphere", default=_ORIGIN, in_file=REQUIRED)
    axis: Vector = key("direction from the shaft to the tip", default=_UP)


@declaration("surfaces.analytic", eq=False)
class Die:
    """plane with a round hole and a fillet"""

    radius: float = mm("radius of the hole")
    fillet: float = mm("radius of the fillet")
    point: Vector = mm("centre of the hole in the plane", default=_ORIGIN)
    axis: Vector = key("direction from the plane into the hole", default=_UP)
