"""Parameters of the scenes, and the defaults of their cases.

Angles are in radians.  Scenes are listed in this order; each is a function of the name
of its class in lower case, which takes the parameters by `with_parameters`.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import field, fields
from typing import TYPE_CHECKING, Any, ClassVar, Literal, TypeAlias, TypedDict

from . import MOST_FRICTION, declaration, deg, key, mm

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

    from ..surfaces.triangle_mesh import TriangleMesh

MeshOrKind: TypeAlias = "str | Mesh"

#: Names of files of triangles that are sewn.
Files: TypeAlias = tuple[str, ...] | str | None

#: Kind of mesh whose edges follow the singular fibres.
GRADED = "graded"


@declaration()
class Scene:
    """A scene.

    Attributes
    ----------
    implemented_in
        Module of the function, see `declaration`.
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

    implemented_in: ClassVar[str]
    kind: ClassVar[str] = "irregular"
    of_grid: ClassVar[tuple[int, int] | None] = None
    fibre_stiffness: ClassVar[float] = 1e4
    shear_stiffness: ClassVar[float] = 0.5
    bending: ClassVar[float] = 0.0
    steps: ClassVar[int] = 20


@declaration()
class OnRectangle(Scene):
    """A scene whose generated mesh fills a rectangle."""

    mesh: MeshOrKind = "irregular"
    size: tuple[int, int] = (10, 10)
    jitter: float = 0.3
    seed: int = 1


@declaration()
class PlaneScene(OnRectangle):
    """A scene in the plane, which can be rotated."""


@declaration("scenes.strip")
class Strip(PlaneScene):
    """a strip bent onto a circle, fibres along its sides, clamped at the bottom"""

    shear_stiffness = 0.0

    size: tuple[int, int] = (10, 15)


@declaration("scenes.trellis")
class PictureFrame(PlaneScene):
    """a square sheared by a hinged frame, fibres along its sides"""

    kind = GRADED

    shear_angle: float = deg("final shear angle", default=45.0)
    side: float = mm("side of a generated mesh", default=100.0)
    frame: float | None = mm(
        "side of the frame between its hinges (default: the side of the fabric)",
        default=None,
    )


@declaration("scenes.trellis")
class Trellis(PlaneScene):
    """a square whose edges follow a motion without fibre strain"""

    warp: float = deg("inclination of the warp", default=0.0)
    weft: float = deg("inclination of the weft", default=90.0)
    turns: tuple[Turn, Turn] | None = None
    edges: Mapping[str, Edge] | None = None


_WEFT = "inclination of the weft (default: 180 minus the warp angle)"


@declaration("scenes.bias_extension")
class BiasExtension(PlaneScene):
    """a rectangle pulled along the bisector of its fibres"""

    kind = GRADED
    fibre_stiffness = 1e5

    size: tuple[int, int] = (8, 16)
    jitter: float = 0.25
    warp: float = deg("inclination of the warp, below 90", default=45.0)
    weft: float = deg(_WEFT, default=135.0, in_file=None, kind=float | None)
    shear_angle: float = deg("final shear angle in the middle", default=40.0)
    part: Literal["whole", "half"] = key(
        "whole, or half: the half up to the axis of symmetry, with rollers on "
        "this axis",
        default="whole",
    )
    width: float = mm("width of a generated mesh", default=50.0)
    height: float | None = mm(
        "height of a generated mesh between its clamps (default: the smallest, "
        "2 width tan(warp))",
        default=None,
    )


#: Motions of the upper clamp across itself in simple shear.
ACROSS = "tension", "circle", "gap"

#: Default tension across the clamps in N/mm.
SHEAR_TENSION = 0.1


@declaration("scenes.simple_shear")
class SimpleShear(PlaneScene):
    """a ply sheared between parallel clamps"""

    steps = 5

    size: tuple[int, int] = (16, 8)
    warp: float = deg("inclination of the warp", default=0.0)
    weft: float = deg("inclination of the weft", default=90.0)
    shear_angle: float = deg(
        "final shear angle of fibres along the sides", default=20.0
    )
    width: float = mm("length of the clamps, for a generated mesh", default=100.0)
    height: float = mm(
        "distance between the clamps, for a generated mesh", default=50.0
    )
    across: Literal["tension", "circle", "gap"] = key(
        "motion of the upper clamp across itself: free under a constant tension, on "
        "the circle of the unstretched weft, or none",
        default="tension",
    )
    tension: float | None = key(
        f"tension across the clamp (default with tension: {SHEAR_TENSION})",
        default=None,
        unit="N_per_mm",
    )


_MOVES = (("bottom", (0.0, 0.0)), ("top", (0.0, 10.0)))


@declaration("scenes.specimen")
class Specimen(PlaneScene):
    """a ply with displacements that you prescribe on its boundaries"""

    kind = GRADED
    fibre_stiffness = 1e5

    size: tuple[int, int] = (8, 16)
    jitter: float = 0.25
    width: float = mm("width of a generated mesh", default=50.0)
    height: float = mm("height of a generated mesh", default=100.0)
    warp: float = deg("inclination of the warp", default=45.0)
    weft: float = deg(_WEFT, default=135.0, in_file=None, kind=float | None)
    moves: Sequence[tuple[str, tuple[float | str, float | str]]] = mm(
        "final displacements of boundaries along x and y: 0,0 for a clamped "
        "boundary, free for a component that is not prescribed",
        default=_MOVES,
        name="move",
        kind=dict[str, tuple[Component, Component]],
    )
    driven: str | None = key(
        "boundary whose reaction is reported (default: the one that moves most)",
        default=None,
    )


@declaration()
class StripInSpace(OnRectangle):
    """A strip that bends."""

    shear_stiffness = 0.1
    bending = 6.0

    size: tuple[int, int] = (16, 2)
    jitter: float = 0.0


@declaration("scenes.strips_in_space")
class Cantilever(StripInSpace):
    """a strip in space that bends under its weight (Peirce)"""

    steps = 4

    length: float = mm("length of the strip", default=200.0)
    weight: float = key(
        "weight per area, such as 6e-6 for 0.6 kg/m2", default=6e-6, unit="N_per_mm2"
    )


@declaration("scenes.strips_in_space")
class Buckling(StripInSpace):
    """a strip in space that is compressed along its length"""

    fibre_stiffness = 1e5

    shortening: float = key(
        "final shortening of the distance between the ends, relative to the length",
        default=0.2,
    )
    push: float = key(
        "transverse load, which determines the side to which the strip buckles",
        default=1e-8,
        unit="N_per_mm2",
    )


_ALONG_X = "length of the whole ply along x, for a generated mesh"

_ALONG_Y = "length of the whole ply along y, for a generated mesh"

_PART = (
    "computed part (default: quarter if the fibres are along the sides or at 45 "
    "degrees to them, else whole)"
)


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


class FormedOptions(PlyOptions, total=False):
    """Common parameters of all plies that are formed; see `Formed`."""

    layup: str | Sequence[float] | None
    ply_friction: Any
    ply_thickness: float | Sequence[float]


@declaration(kw_only=True)
class WithTools(Scene):
    """A ply in space with tools; the parameters of all such plies."""

    shear_stiffness = 0.1

    size: tuple[int, int] = (16, 16)
    jitter: float = 0.0
    seed: int = 1
    fibres: float = deg(
        "inclination of the warp; the weft is at right angles", default=0.0
    )
    width: float = mm(_ALONG_X, default=180.0)
    height: float = mm(_ALONG_Y, default=180.0)
    tension: float = key(
        "tension along the fibres on free edges; 0 for none",
        default=2.0,
        unit="N_per_mm",
    )
    part: Part | None = None

    def ply(self) -> PlyOptions:
        """Parameters of the ply."""
        options: Any = {one.name: getattr(self, one.name) for one in fields(WithTools)}
        return options


@declaration()
class OnTool(WithTools):
    """A ply draped on a tool."""

    steps = 4


@declaration(kw_only=True)
class OnSymmetricTool(OnTool):
    """A ply on a tool with two planes of symmetry."""

    mesh: MeshOrKind = field(default="irregular", kw_only=False)
    part: Part | None = key(_PART, default=None)


@declaration("scenes.tools")
class Hemisphere(OnSymmetricTool):
    """a ply on a sphere"""

    radius: float = mm("radius of the sphere", default=100.0)


@declaration("scenes.tools")
class Cylinder(OnSymmetricTool):
    """a ply on a cylinder, without shear"""

    radius: float = mm("radius of the cylinder", default=100.0)


@declaration("scenes.tools")
class DoubleDome(OnSymmetricTool):
    """a ply on two domes with a waist between them"""

    size: tuple[int, int] = field(default=(32, 18), kw_only=True)
    width: float = mm(_ALONG_X, default=470.0, kw_only=True)
    height: float = mm(_ALONG_Y, default=270.0, kw_only=True)


@declaration("scenes.tools")
class Saddle(OnSymmetricTool):
    """a ply on a saddle"""

    radius: float = mm("radius of both curvatures in the middle", default=150.0)


@declaration("scenes.drape")
class Drape(OnTool):
    """a ply on a tool from a file, such as STL"""

    tool: "TriangleMesh" = key(
        "file of triangles, or several that are sewn: STL, PLY, OBJ, 3MF, or "
        "another that meshio reads",
        in_file=None,
        kind=Files,
        file=True,
    )
    mesh: MeshOrKind = "irregular"
    point: Sequence[float] | None = mm(
        "point of the tool that the middle of the ply touches (default: the "
        "highest point; of several, the one closest to the middle)",
        default=None,
        kind=tuple[float, float, float] | None,
    )


#: Default distance between die and holder in mm.
HOLDER_GAP = 0.3


@declaration(kw_only=True)
class Formed(WithTools):
    """A ply between punch, die and holder."""

    bending = 5.0
    steps = 5

    size: tuple[int, int] = (12, 12)
    width: float = mm(_ALONG_X, default=300.0)
    height: float = mm(_ALONG_Y, default=300.0)
    tension: float = key(
        "constant tension along the fibres on free edges; 0 for none",
        default=0.2,
        unit="N_per_mm",
    )
    friction: float = key(
        "coefficient of friction between the ply and punch, die and holder",
        default=0.0,
        limits=(0, MOST_FRICTION),
        closed=True,
    )
    gap: float | None = mm(
        f"distance between die and holder (default: {HOLDER_GAP:g} and the thickness "
        "of all plies of a lay-up, without a pressure or force)",
        default=None,
        name="holder_gap",
    )
    pressure: float | None = key(
        "instead of the gap: pressure of the holder in N/mm2 on the ply under the "
        "flat flange of the die",
        default=None,
        unit="N_per_mm2",
        name="holder_pressure",
    )
    force: float | None = key(
        "instead of the gap: force of the rigid holder in N on the computed part of "
        "the ply under the flat flange of the die",
        default=None,
        unit="N",
        name="holder_force",
    )
    compaction: Any = None
    layup: str | Sequence[float] | None = key(
        "plies that are formed together, from the bottom to the top, such as "
        "'[0/90, ±45]s'; angles in degrees from the fibres of the scene (default: one "
        "ply)",
        default=None,
        kind=str | None,
    )
    ply_friction: Any = key(
        "coefficient of friction between plies; in a case file also a symmetric table "
        "with a row of coefficients for each ply",
        default=0.0,
        kind=float | tuple[tuple[float, ...], ...],
    )
    ply_thickness: float | Sequence[float] = mm(
        "thickness of each ply of the lay-up; 0 for plies in one plane",
        default=0.0,
        kind=float,
    )

    def formed(self) -> FormedOptions:
        """Parameters of the plies."""
        options: Any = {one: getattr(self, one) for one in _OF_FORMED}
        return options


# Names of the parameters of plies that are formed.
_OF_FORMED = tuple(FormedOptions.__annotations__)

_CENTRE = "centre of the ply, x and y in the axes of the tools"


@declaration(kw_only=True)
class FormedBySymmetricTools(Formed):
    """A ply between tools with two planes of symmetry."""

    mesh: MeshOrKind = field(default="irregular", kw_only=False)
    part: Part | None = key(_PART, default=None)
    centre: tuple[float, float] = mm(_CENTRE, default=(0.0, 0.0))


_CLEARANCE = "distance between punch and die in the plane of the ply"


@declaration("scenes.forming")
class HemisphereForming(FormedBySymmetricTools):
    """a ply that a punch with a hemispherical end forms through a round hole"""

    radius: float = mm("radius of the punch", default=75.0)
    fillet: float = mm("radius of the fillet of the die", default=10.0)
    travel: float = mm("final travel of the punch", default=75.0)
    clearance: float = mm(_CLEARANCE, default=5.0)


@declaration("scenes.forming")
class DoubleDomeForming(FormedBySymmetricTools):
    """a ply that a double dome forms in a die of the same shape"""

    size: tuple[int, int] = field(default=(24, 16), kw_only=True)
    width: float = mm(_ALONG_X, default=470.0, kw_only=True)
    travel: float = mm("final travel of the punch, at most 60 mm", default=60.0)
    clearance: float = mm(_CLEARANCE, default=5.0)


@declaration("scenes.forming")
class Forming(Formed):
    """a ply that a punch forms through a die, both from files, or tools of [[tools]]"""

    of_grid = (24, 24)

    punch: "TriangleMesh" = key(
        "file of triangles of the punch, or several that are sewn, such as STL",
        in_file=None,
        kind=Files,
        file=True,
    )
    die: "TriangleMesh" = key(
        "file of triangles of the die, in the same axes",
        in_file=None,
        kind=Files,
        file=True,
    )
    mesh: MeshOrKind = "irregular"
    travel: float = mm(
        "final travel of the punch along z, negative if it moves down", default=50.0
    )
    centre: tuple[float, float] = mm(_CENTRE, default=(0.0, 0.0))
    part: Part | None = key(
        "whole, or quarter: the quarter with positive x and y, if tools and fibres "
        "have two planes of symmetry",
        default="whole",
        kind=Part,
        kw_only=True,
    )


#: Every scene.
AnyScene: TypeAlias = OnRectangle | WithTools
