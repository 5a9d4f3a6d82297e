"""Parameters of the scenes, and the defaults of their cases.

Angles are in radians.  Scenes are listed in this order; each is a function of the name
of its class in lower case, which takes the parameters by `with_parameters`.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, fields
from math import pi, radians
from typing import (
    TYPE_CHECKING,
    Annotated,
    Any,
    ClassVar,
    Literal,
    TypeAlias,
    TypedDict,
)

from .fields import DEGREES, FILE, MM, N_PER_MM, N_PER_MM2, Declared, InFile, Key, about

#: Rotation of a family in radians at the coordinate s along its fibres (mm) and the
#: load factor t: ``(s, t) -> (n,)``.
Turn: TypeAlias = "Callable[[ndarray, float], ndarray]"

#: Support of a side: ``held`` prescribes the whole displacement, ``free`` nothing.  A
#: number is the inclination in radians of the line along which a roller rolls.
Edge: TypeAlias = Literal["held", "free"] | float

#: Component of a displacement in mm.
Component: TypeAlias = float | Literal["free"]

Part: TypeAlias = Literal["quarter", "whole"]

if TYPE_CHECKING:
    from numpy import ndarray
    from skfem import Mesh

    from ..drape import TriangleMesh

    MeshOrKind: TypeAlias = str | Mesh
    PartOrWhole: TypeAlias = Part | None
    Weft: TypeAlias = float
    Moves: TypeAlias = Sequence[tuple[str, tuple[float | str, float | str]]]
    Point: TypeAlias = Sequence[float]
else:
    MeshOrKind = ndarray = Any
    PartOrWhole = Part
    Weft = float | None
    Moves = dict[str, tuple[Component, Component]]
    Point = tuple[float, float, float]
    TriangleMesh = tuple[str, ...] | str | None

#: Kind of mesh whose edges follow the singular fibres.
GRADED = "graded"


@dataclass(frozen=True)
class Scene(Declared):
    """A scene.

    Attributes
    ----------
    kind
        Default kind of mesh of a case.
    of_grid
        Default size of a generated mesh of a case, if it is not the one in Python.
    fibre_stiffness, shear_stiffness
        Default stiffnesses in N/mm.
    bending
        Default bending stiffness of warp and weft in N mm.
    steps
        Default number of load steps.
    """

    kind: ClassVar[str] = "irregular"
    of_grid: ClassVar[tuple[int, int] | None] = None
    fibre_stiffness: ClassVar[float] = 1e4
    shear_stiffness: ClassVar[float] = 0.5
    bending: ClassVar[float] = 0.0
    steps: ClassVar[int] = 20


@dataclass(frozen=True)
class OnRectangle(Scene):
    """A scene whose generated mesh fills a rectangle."""

    mesh: MeshOrKind = "irregular"
    size: tuple[int, int] = (10, 10)
    jitter: float = 0.3
    seed: int = 1


class PlaneScene(OnRectangle):
    """A scene in the plane, which can be rotated."""


@dataclass(frozen=True)
class Strip(PlaneScene, module="scenes.strip"):
    """a strip bent onto a circle, fibres along its sides, clamped at the bottom"""

    shear_stiffness = 0.0

    size: tuple[int, int] = (10, 15)


@dataclass(frozen=True)
class PictureFrame(PlaneScene, module="scenes.trellis"):
    """a square sheared by a hinged frame, fibres along its sides"""

    kind = GRADED

    shear_angle: Annotated[float, DEGREES, about("final shear angle")] = radians(45)
    side: Annotated[float, MM, about("side of a generated mesh")] = 100.0
    frame: Annotated[
        float | None,
        MM,
        about("side of the frame between its hinges (default: the side of the fabric)"),
    ] = None


_Warp = Annotated[float, DEGREES, about("inclination of the warp")]


@dataclass(frozen=True)
class Trellis(PlaneScene, module="scenes.trellis"):
    """a square whose edges follow a motion without fibre strain"""

    warp: _Warp = 0.0
    weft: Annotated[float, DEGREES, about("inclination of the weft")] = pi / 2
    turns: tuple[Turn, Turn] | None = None
    edges: Mapping[str, Edge] | None = None


_Weft = Annotated[
    Weft,
    DEGREES,
    InFile(None),
    about("inclination of the weft (default: 180 minus the warp angle)"),
]

_Width = Annotated[float, MM, about("width of a generated mesh")]


@dataclass(frozen=True)
class BiasExtension(PlaneScene, module="scenes.bias_extension"):
    """a rectangle pulled along the bisector of its fibres"""

    kind = GRADED
    fibre_stiffness = 1e5

    size: tuple[int, int] = (8, 16)
    jitter: float = 0.25
    warp: Annotated[float, DEGREES, about("inclination of the warp, below 90")] = pi / 4
    weft: _Weft = 3 * pi / 4
    shear_angle: Annotated[float, DEGREES, about("final shear angle in the middle")] = (
        radians(40)
    )
    part: Annotated[
        Literal["whole", "half"],
        about(
            "whole, or half: the half up to the axis of symmetry, with rollers on "
            "this axis"
        ),
    ] = "whole"
    width: _Width = 50.0
    height: Annotated[
        float | None,
        MM,
        about(
            "height of a generated mesh between its clamps (default: the smallest, "
            "2 width tan(warp))"
        ),
    ] = None


_MOVES = (("bottom", (0.0, 0.0)), ("top", (0.0, 10.0)))


@dataclass(frozen=True)
class Specimen(PlaneScene, module="scenes.specimen"):
    """a ply with displacements that you prescribe on its boundaries"""

    kind = GRADED
    fibre_stiffness = 1e5

    size: tuple[int, int] = (8, 16)
    jitter: float = 0.25
    width: _Width = 50.0
    height: Annotated[float, MM, about("height of a generated mesh")] = 100.0
    warp: _Warp = pi / 4
    weft: _Weft = 3 * pi / 4
    moves: Annotated[
        Moves,
        MM,
        Key("move"),
        about(
            "final displacements of boundaries along x and y: 0,0 for a clamped "
            "boundary, free for a component that is not prescribed"
        ),
    ] = _MOVES
    driven: Annotated[
        str | None,
        about("boundary whose reaction is reported (default: the one that moves most)"),
    ] = None


@dataclass(frozen=True)
class StripInSpace(OnRectangle):
    """A strip that bends."""

    shear_stiffness = 0.1
    bending = 6.0

    size: tuple[int, int] = (16, 2)
    jitter: float = 0.0


@dataclass(frozen=True)
class Cantilever(StripInSpace, module="scenes.strips_in_space"):
    """a strip in space that bends under its weight (Peirce)"""

    steps = 4

    length: Annotated[float, MM, about("length of the strip")] = 200.0
    weight: Annotated[
        float, N_PER_MM2, about("weight per area, such as 6e-6 for 0.6 kg/m2")
    ] = 6e-6


@dataclass(frozen=True)
class Buckling(StripInSpace, module="scenes.strips_in_space"):
    """a strip in space that is compressed along its length"""

    fibre_stiffness = 1e5

    shortening: Annotated[
        float,
        about(
            "final shortening of the distance between the ends, relative to the length"
        ),
    ] = 0.2
    push: Annotated[
        float,
        N_PER_MM2,
        about("transverse load, which determines the side to which the strip buckles"),
    ] = 1e-8


_Along = "length of the whole ply along {}, for a generated mesh"
_AlongX = Annotated[float, MM, about(_Along.format("x"))]
_AlongY = Annotated[float, MM, about(_Along.format("y"))]


class PlyOptions(TypedDict, total=False):
    """Common parameters of all plies with tools; see `WithTools`."""

    size: tuple[int, int]
    jitter: float
    seed: int
    fibres: float
    width: float
    height: float
    tension: float
    part: Part | None


@dataclass(frozen=True, kw_only=True)
class WithTools(Scene):
    """A ply in space with tools; the parameters of all such plies."""

    shear_stiffness = 0.1

    size: tuple[int, int] = (16, 16)
    jitter: float = 0.0
    seed: int = 1
    fibres: Annotated[
        float, DEGREES, about("inclination of the warp; the weft is at right angles")
    ] = 0.0
    width: _AlongX = 180.0
    height: _AlongY = 180.0
    tension: Annotated[
        float,
        N_PER_MM,
        about("tension along the fibres on free edges; 0 for none"),
    ] = 2.0
    part: Part | None = None

    def ply(self) -> PlyOptions:
        """Parameters of the ply."""
        options: Any = {one.name: getattr(self, one.name) for one in fields(WithTools)}
        return options


_Part = Annotated[
    Part | None,
    about(
        "computed part (default: quarter if the fibres are along the sides or at "
        "45 degrees to them, else whole)"
    ),
]


class OnTool(WithTools):
    """A ply draped on a tool."""

    steps = 4


@dataclass(frozen=True, kw_only=True)
class OnSymmetricTool(OnTool):
    """A ply on a tool with two planes of symmetry."""

    part: _Part = None


@dataclass(frozen=True)
class Hemisphere(OnSymmetricTool, module="scenes.tools"):
    """a ply on a sphere"""

    mesh: MeshOrKind = "irregular"
    radius: Annotated[float, MM, about("radius of the sphere")] = 100.0


@dataclass(frozen=True)
class Cylinder(OnSymmetricTool, module="scenes.tools"):
    """a ply on a cylinder, without shear"""

    mesh: MeshOrKind = "irregular"
    radius: Annotated[float, MM, about("radius of the cylinder")] = 100.0


@dataclass(frozen=True)
class DoubleDome(OnSymmetricTool, module="scenes.tools"):
    """a ply on two domes with a waist between them"""

    mesh: MeshOrKind = "irregular"
    size: tuple[int, int] = field(default=(32, 18), kw_only=True)
    width: _AlongX = field(default=470.0, kw_only=True)
    height: _AlongY = field(default=270.0, kw_only=True)


@dataclass(frozen=True)
class Saddle(OnSymmetricTool, module="scenes.tools"):
    """a ply on a saddle"""

    mesh: MeshOrKind = "irregular"
    radius: Annotated[float, MM, about("radius of both curvatures in the middle")] = (
        150.0
    )


@dataclass(frozen=True)
class Drape(OnTool, module="scenes.drape"):
    """a ply on a tool from a file, such as STL"""

    tool: Annotated[
        TriangleMesh,
        InFile(None),
        about(
            "file of triangles, or several that are sewn: STL, PLY, OBJ, 3MF, or "
            "another that meshio reads"
        ),
        FILE,
    ]
    mesh: MeshOrKind = "irregular"
    point: Annotated[
        Point | None,
        MM,
        about(
            "point of the tool that the middle of the ply touches (default: the "
            "highest point; of several, the one closest to the middle)"
        ),
    ] = None


@dataclass(frozen=True, kw_only=True)
class Formed(WithTools):
    """A ply between punch, die and holder."""

    bending = 5.0
    steps = 5

    size: tuple[int, int] = (12, 12)
    width: _AlongX = 300.0
    height: _AlongY = 300.0
    tension: Annotated[
        float,
        N_PER_MM,
        about("constant tension along the fibres on free edges; 0 for none"),
    ] = 0.2


@dataclass(frozen=True, kw_only=True)
class FormedBySymmetricTools(Formed):
    """A ply between tools with two planes of symmetry."""

    part: _Part = None


_Gap = Annotated[float, MM, Key("holder_gap"), about("distance between die and holder")]

_Clearance = Annotated[
    float, MM, about("distance between punch and die in the plane of the ply")
]


@dataclass(frozen=True)
class HemisphereForming(FormedBySymmetricTools, module="scenes.forming"):
    """a ply that a punch with a hemispherical end forms through a round hole"""

    mesh: MeshOrKind = "irregular"
    radius: Annotated[float, MM, about("radius of the punch")] = 75.0
    fillet: Annotated[float, MM, about("radius of the fillet of the die")] = 10.0
    travel: Annotated[float, MM, about("final travel of the punch")] = 75.0
    gap: _Gap = 0.3
    clearance: _Clearance = 5.0


@dataclass(frozen=True)
class DoubleDomeForming(FormedBySymmetricTools, module="scenes.forming"):
    """a ply that a double dome forms in a die of the same shape"""

    mesh: MeshOrKind = "irregular"
    size: tuple[int, int] = field(default=(24, 16), kw_only=True)
    width: _AlongX = field(default=470.0, kw_only=True)
    travel: Annotated[float, MM, about("final travel of the punch, at most 60 mm")] = (
        60.0
    )
    gap: _Gap = 0.3
    clearance: _Clearance = 5.0


@dataclass(frozen=True)
class Forming(Formed, module="scenes.forming"):
    """a ply that a punch forms through a die, both from files, or tools of [[tools]]"""

    of_grid = (24, 24)

    punch: Annotated[
        TriangleMesh,
        InFile(None),
        about("file of triangles of the punch, or several that are sewn, such as STL"),
        FILE,
    ]
    die: Annotated[
        TriangleMesh,
        InFile(None),
        about("file of triangles of the die, in the same axes"),
        FILE,
    ]
    mesh: MeshOrKind = "irregular"
    travel: Annotated[
        float, MM, about("final travel of the punch along z, negative if it moves down")
    ] = 50.0
    gap: Annotated[
        float | None,
        MM,
        Key("holder_gap"),
        about("distance between die and holder (default: 0.3 without a pressure)"),
    ] = None
    centre: Annotated[
        tuple[float, float],
        MM,
        about("centre of the ply, x and y in the axes of the tools"),
    ] = (0.0, 0.0)
    pressure: Annotated[
        float | None,
        N_PER_MM2,
        Key("holder_pressure"),
        about(
            "instead of the gap: pressure of the holder in N/mm2 on the ply under the "
            "flat flange of the die"
        ),
    ] = None
    part: Annotated[
        PartOrWhole,
        about(
            "whole, or quarter: the quarter with positive x and y, if tools and fibres "
            "have two planes of symmetry"
        ),
    ] = field(default="whole", kw_only=True)


#: Every scene.
AnyScene: TypeAlias = OnRectangle | WithTools
