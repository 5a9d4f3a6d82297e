"""Declaration of the scenes: keys of ``[scene]``, types and defaults.

Each struct builds its scene and imports the modules for it only then.
"""

from math import radians
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal, TypeAlias

from msgspec import field

from ..declarations.fields import FILE, about
from .table import GRADED, Degrees, Table, named

if TYPE_CHECKING:
    from skfem import Mesh as SkfemMesh

    from ..scenes import Scene as BuiltScene


class Scene(Table, tag_field="name"):
    """The problem: geometry, displacement conditions and exact solution.

    Attributes
    ----------
    mesh
        Default kind of mesh.
    size, jitter
        Defaults of a generated mesh, except a graded one.
    fibre_stiffness, shear_stiffness
        Default stiffnesses in N/mm.
    bending
        Default bending stiffness of warp and weft in N mm.
    steps
        Default number of load steps.
    """

    mesh: ClassVar[str] = "irregular"
    size: ClassVar[tuple[int, int]] = (10, 10)
    jitter: ClassVar[float] = 0.3
    fibre_stiffness: ClassVar[float] = 1e4
    shear_stiffness: ClassVar[float] = 0.5
    bending: ClassVar[float] = 0.0
    steps: ClassVar[int] = 20

    def build(self, mesh: "str | SkfemMesh", **generated: Any) -> "BuiltScene":
        """Build the scene on a given or generated mesh.

        Parameters
        ----------
        mesh
            A mesh, or one of `MESH_KINDS` except `GRADED`.
        **generated
            ``size``, ``jitter`` and ``seed`` of a generated mesh.
        """
        raise NotImplementedError


class PlaneScene(Scene):
    """Scene in the plane, which can be rotated."""

    rotate_deg: Annotated[Degrees, about("rotation of the whole problem")] = 0.0


class Strip(PlaneScene, tag="strip"):
    """a strip bent onto a circle, fibres along its sides, clamped at the bottom"""

    size = (10, 15)
    shear_stiffness = 0.0

    def build(self, mesh: Any, **generated: Any) -> "BuiltScene":
        """See `Scene.build`."""
        from ..scenes.strip import strip

        return strip(mesh, **generated)


class PictureFrame(PlaneScene, tag="picture_frame"):
    """a square sheared by a hinged frame, fibres along its sides"""

    mesh = GRADED

    shear_angle_deg: Annotated[Degrees, about("final shear angle")] = 45.0
    side_mm: Annotated[float, about("side of a generated mesh")] = 100.0
    frame_mm: Annotated[
        float | None,
        about("side of the frame between its hinges (default: the side of the fabric)"),
    ] = None

    def build(self, mesh: Any, **generated: Any) -> "BuiltScene":
        """See `Scene.build`."""
        from ..scenes.trellis import picture_frame

        return picture_frame(
            mesh,
            shear_angle=radians(self.shear_angle_deg),
            side=self.side_mm,
            frame=self.frame_mm,
            **generated,
        )


Side: TypeAlias = Literal["top", "right", "bottom", "left"]


class Trellis(PlaneScene, tag="trellis"):
    """a square whose edges follow a motion without fibre strain"""

    warp_deg: Annotated[Degrees, about("inclination of the warp")] = 0.0
    weft_deg: Annotated[Degrees, about("inclination of the weft")] = 90.0
    shear_angle_deg: Annotated[Degrees, about("final shear angle at the origin")] = 45.0
    bend_deg: Annotated[Degrees, about("final bending angle of a fibre of 100 mm")] = (
        30.0
    )
    free: Annotated[tuple[Side, ...], about("free sides")] = ()
    roller_deg: Annotated[
        dict[Side, Degrees],
        about(
            "sides on rollers, with the inclination of the line along which they roll"
        ),
    ] = field(default_factory=dict)

    def build(self, mesh: Any, **generated: Any) -> "BuiltScene":
        """See `Scene.build`."""
        from ..scenes.trellis import Edge, sheared, trellis

        if both := set(self.free) & set(self.roller_deg):
            raise ValueError(
                f"the side {min(both)} is both in scene.free and in scene.roller_deg: "
                "omit one of them"
            )
        edges: dict[str, Edge] = dict.fromkeys(self.free, "free")
        for side, inclination in self.roller_deg.items():
            edges[side] = radians(inclination)
        warp, weft = radians(self.warp_deg), radians(self.weft_deg)
        turns = sheared(radians(self.shear_angle_deg), radians(self.bend_deg))
        return trellis(
            mesh, warp=warp, weft=weft, turns=turns, edges=edges, **generated
        )


class BiasExtension(PlaneScene, tag="bias_extension"):
    """a rectangle pulled along the bisector of its fibres"""

    mesh = GRADED
    size = (8, 16)
    jitter = 0.25
    fibre_stiffness = 1e5

    warp_deg: Annotated[Degrees, about("inclination of the warp, below 90")] = 45.0
    weft_deg: Annotated[
        Degrees | None,
        about("inclination of the weft (default: 180 minus the warp angle)"),
    ] = None
    shear_angle_deg: Annotated[Degrees, about("final shear angle in the middle")] = 40.0
    part: Annotated[
        Literal["whole", "half"],
        about(
            "whole, or half: the half up to the axis of symmetry, with rollers on "
            "this axis"
        ),
    ] = "whole"
    width_mm: Annotated[float, about("width of a generated mesh")] = 50.0
    height_mm: Annotated[
        float | None,
        about(
            "height of a generated mesh between its clamps (default: the smallest, "
            "2 width tan(warp))"
        ),
    ] = None

    def build(self, mesh: Any, **generated: Any) -> "BuiltScene":
        """See `Scene.build`."""
        from ..scenes.bias_extension import bias_extension

        warp, weft = _mirrored(self.warp_deg, self.weft_deg)
        return bias_extension(
            mesh,
            warp=warp,
            weft=weft,
            shear_angle=radians(self.shear_angle_deg),
            part=self.part,
            width=self.width_mm,
            height=self.height_mm,
            **generated,
        )


Component: TypeAlias = float | Literal["free"]


class Specimen(PlaneScene, tag="specimen"):
    """a ply with displacements that you prescribe on its boundaries"""

    mesh = GRADED
    size = (8, 16)
    jitter = 0.25
    fibre_stiffness = 1e5

    width_mm: Annotated[float, about("width of a generated mesh")] = 50.0
    height_mm: Annotated[float, about("height of a generated mesh")] = 100.0
    warp_deg: Annotated[Degrees, about("inclination of the warp")] = 45.0
    weft_deg: Annotated[
        Degrees | None,
        about("inclination of the weft (default: 180 minus the warp angle)"),
    ] = None
    move_mm: Annotated[
        dict[str, tuple[Component, Component]],
        about(
            "final displacements of boundaries along x and y: 0,0 for a clamped "
            "boundary, free for a component that is not prescribed"
        ),
    ] = field(default_factory=lambda: {"bottom": (0.0, 0.0), "top": (0.0, 10.0)})
    driven: Annotated[
        str | None,
        about("boundary whose reaction is reported (default: the one that moves most)"),
    ] = None

    def build(self, mesh: Any, **generated: Any) -> "BuiltScene":
        """See `Scene.build`."""
        from ..scenes.specimen import specimen

        warp, weft = _mirrored(self.warp_deg, self.weft_deg)
        return specimen(
            mesh,
            width=self.width_mm,
            height=self.height_mm,
            warp=warp,
            weft=weft,
            moves=tuple(self.move_mm.items()),
            driven=self.driven,
            **generated,
        )


def _mirrored(warp: float, weft: float | None) -> tuple[float, float]:
    """Inclinations of warp and weft in radians."""
    return radians(warp), radians(180 - warp if weft is None else weft)


class StripInSpace(Scene):
    """Strip that bends."""

    size = (16, 2)
    jitter = 0.0
    shear_stiffness = 0.1
    bending = 6.0


class Cantilever(StripInSpace, tag="cantilever"):
    """a strip in space that bends under its weight (Peirce)"""

    steps = 4

    length_mm: Annotated[float, about("length of the strip")] = 200.0
    weight_N_per_mm2: Annotated[
        float, about("weight per area, such as 6e-6 for 0.6 kg/m2")
    ] = 6e-6

    def build(self, mesh: Any, **generated: Any) -> "BuiltScene":
        """See `Scene.build`."""
        from ..scenes.strips_in_space import cantilever

        return cantilever(
            mesh, length=self.length_mm, weight=self.weight_N_per_mm2, **generated
        )


class Buckling(StripInSpace, tag="buckling"):
    """a strip in space that is compressed along its length"""

    fibre_stiffness = 1e5

    shortening: Annotated[
        float,
        about(
            "final shortening of the distance between the ends, relative to the length"
        ),
    ] = 0.2
    push_N_per_mm2: Annotated[
        float,
        about("transverse load, which determines the side to which the strip buckles"),
    ] = 1e-8

    def build(self, mesh: Any, **generated: Any) -> "BuiltScene":
        """See `Scene.build`."""
        from ..scenes.strips_in_space import buckling

        return buckling(
            mesh, shortening=self.shortening, push=self.push_N_per_mm2, **generated
        )


Part: TypeAlias = Literal["quarter", "whole"]


class WithTools(Scene):
    """Ply in space with tools."""

    jitter = 0.0
    shear_stiffness = 0.1

    fibres_deg: Annotated[
        Degrees, about("inclination of the warp; the weft is at right angles")
    ] = 0.0
    width_mm: Annotated[
        float, about("length of the whole ply along x, for a generated mesh")
    ] = 180.0
    height_mm: Annotated[
        float, about("length of the whole ply along y, for a generated mesh")
    ] = 180.0
    tension_N_per_mm: Annotated[
        float, about("tension along the fibres on free edges; 0 for none")
    ] = 2.0

    def ply(self) -> dict[str, Any]:
        """Parameters of the ply."""
        return {
            "fibres": radians(self.fibres_deg),
            "width": self.width_mm,
            "height": self.height_mm,
            "tension": self.tension_N_per_mm,
        }


class OnTool(WithTools):
    """Ply draped on a tool."""

    size = (16, 16)
    steps = 4


class OnSymmetricTool(OnTool):
    """Ply on a tool with two planes of symmetry."""

    part: Annotated[
        Part | None,
        about(
            "computed part (default: quarter if the fibres are along the sides or at "
            "45 degrees to them, else whole)"
        ),
    ] = None

    def ply(self) -> dict[str, Any]:
        """Parameters of the ply."""
        return {**super().ply(), "part": self.part}


class Hemisphere(OnSymmetricTool, tag="hemisphere"):
    """a ply on a sphere"""

    radius_mm: Annotated[float, about("radius of the sphere")] = 100.0

    def build(self, mesh: Any, **generated: Any) -> "BuiltScene":
        """See `Scene.build`."""
        from ..scenes.tools import hemisphere

        return hemisphere(mesh, self.radius_mm, **generated, **self.ply())


class Cylinder(OnSymmetricTool, tag="cylinder"):
    """a ply on a cylinder, without shear"""

    radius_mm: Annotated[float, about("radius of the cylinder")] = 100.0

    def build(self, mesh: Any, **generated: Any) -> "BuiltScene":
        """See `Scene.build`."""
        from ..scenes.tools import cylinder

        return cylinder(mesh, self.radius_mm, **generated, **self.ply())


class DoubleDome(OnSymmetricTool, tag="double_dome"):
    """a ply on two domes with a waist between them"""

    size = (32, 18)

    width_mm: Annotated[
        float, about("length of the whole ply along x, for a generated mesh")
    ] = 470.0
    height_mm: Annotated[
        float, about("length of the whole ply along y, for a generated mesh")
    ] = 270.0

    def build(self, mesh: Any, **generated: Any) -> "BuiltScene":
        """See `Scene.build`."""
        from ..scenes.tools import double_dome

        return double_dome(mesh, **generated, **self.ply())


class Saddle(OnSymmetricTool, tag="saddle"):
    """a ply on a saddle"""

    radius_mm: Annotated[float, about("radius of both curvatures in the middle")] = (
        150.0
    )

    def build(self, mesh: Any, **generated: Any) -> "BuiltScene":
        """See `Scene.build`."""
        from ..scenes.tools import saddle

        return saddle(mesh, self.radius_mm, **generated, **self.ply())


class Drape(OnTool, tag="drape"):
    """a ply on a tool from a file, such as STL"""

    tool: Annotated[
        tuple[str, ...] | str | None,
        about(
            "file of triangles, or several that are sewn: STL, PLY, OBJ, 3MF, or "
            "another that meshio reads"
        ),
        FILE,
    ] = None
    unit: Annotated[
        Literal["mm", "cm", "m", "in"] | None,
        about("unit of length of the tool (default: the file's, else mm)"),
    ] = None
    point_mm: Annotated[
        tuple[float, float, float] | None,
        about(
            "point of the tool that the middle of the ply touches (default: the "
            "highest point; of several, the one closest to the middle)"
        ),
    ] = None

    def build(self, mesh: Any, **generated: Any) -> "BuiltScene":
        """See `Scene.build`."""
        from ..io import read_surface
        from ..scenes.drape import drape

        if self.tool is None:
            raise ValueError("scene.tool is missing: name an STL file of triangles")
        tool = read_surface(self.tool, self.unit)
        return drape(tool, mesh, self.point_mm, **generated, **self.ply())


class Formed(WithTools):
    """Ply between punch, die and holder."""

    size = (12, 12)
    bending = 5.0
    steps = 5

    width_mm: Annotated[
        float, about("length of the whole ply along x, for a generated mesh")
    ] = 300.0
    height_mm: Annotated[
        float, about("length of the whole ply along y, for a generated mesh")
    ] = 300.0
    tension_N_per_mm: Annotated[
        float, about("constant tension along the fibres on free edges; 0 for none")
    ] = 0.2


class FormedBySymmetricTools(Formed):
    """Ply between tools with two planes of symmetry."""

    holder_gap_mm: Annotated[float, about("distance between die and holder")] = 0.3

    part: Annotated[
        Part | None,
        about(
            "computed part (default: quarter if the fibres are along the sides or at "
            "45 degrees to them, else whole)"
        ),
    ] = None
    clearance_mm: Annotated[
        float, about("distance between punch and die in the plane of the ply")
    ] = 5.0

    def ply(self) -> dict[str, Any]:
        """Parameters of the ply, and the clearance of its tools."""
        return {**super().ply(), "part": self.part, "clearance": self.clearance_mm}


class HemisphereForming(FormedBySymmetricTools, tag="hemisphere_forming"):
    """a ply that a punch with a hemispherical end forms through a round hole"""

    radius_mm: Annotated[float, about("radius of the punch")] = 75.0
    fillet_mm: Annotated[float, about("radius of the fillet of the die")] = 10.0
    travel_mm: Annotated[float, about("final travel of the punch")] = 75.0

    def build(self, mesh: Any, **generated: Any) -> "BuiltScene":
        """See `Scene.build`."""
        from ..scenes.forming import hemisphere_forming

        return hemisphere_forming(
            mesh,
            self.radius_mm,
            self.fillet_mm,
            self.travel_mm,
            self.holder_gap_mm,
            **generated,
            **self.ply(),
        )


class DoubleDomeForming(FormedBySymmetricTools, tag="double_dome_forming"):
    """a ply that a double dome forms in a die of the same shape"""

    size = (24, 16)

    width_mm: Annotated[
        float, about("length of the whole ply along x, for a generated mesh")
    ] = 470.0
    travel_mm: Annotated[float, about("final travel of the punch, at most 60 mm")] = (
        60.0
    )

    def build(self, mesh: Any, **generated: Any) -> "BuiltScene":
        """See `Scene.build`."""
        from ..scenes.forming import double_dome_forming

        return double_dome_forming(
            mesh, self.travel_mm, self.holder_gap_mm, **generated, **self.ply()
        )


class Forming(Formed, tag="forming"):
    """a ply that a punch forms through a die, both from files, or tools of [[tools]]"""

    size = (24, 24)

    punch: Annotated[
        tuple[str, ...] | str | None,
        about("file of triangles of the punch, or several that are sewn, such as STL"),
        FILE,
    ] = None
    die: Annotated[
        tuple[str, ...] | str | None,
        about("file of triangles of the die, in the same axes"),
        FILE,
    ] = None
    unit: Annotated[
        Literal["mm", "cm", "m", "in"] | None,
        about("unit of length of the files (default: the file's, else mm)"),
    ] = None
    travel_mm: Annotated[
        float, about("final travel of the punch along z, negative if it moves down")
    ] = 50.0
    holder_gap_mm: Annotated[
        float | None,
        about("distance between die and holder (default: 0.3 without a pressure)"),
    ] = None
    holder_pressure_N_per_mm2: Annotated[
        float | None,
        about(
            "instead of the gap: pressure of the holder in N/mm2 on the ply under the "
            "flat flange of the die"
        ),
    ] = None
    centre_mm: Annotated[
        tuple[float, float],
        about("centre of the ply, x and y in the axes of the tools"),
    ] = (0.0, 0.0)
    part: Annotated[
        Part,
        about(
            "whole, or quarter: the quarter with positive x and y, if tools and fibres "
            "have two planes of symmetry"
        ),
    ] = "whole"

    def build(self, mesh: Any, **generated: Any) -> "BuiltScene":
        """See `Scene.build`."""
        from ..io import read_surface
        from ..scenes.forming import formed_ply, forming

        options = {**generated, **self.ply(), "part": self.part}
        if self.punch is None and self.die is None:
            return formed_ply("forming", (), mesh, **options)
        if self.punch is None or self.die is None:
            missing = "punch" if self.punch is None else "die"
            raise ValueError(f"scene.{missing} is missing: name an STL file")
        return forming(
            read_surface(self.punch, self.unit),
            read_surface(self.die, self.unit),
            mesh,
            self.travel_mm,
            self.holder_gap_mm,
            self.centre_mm,
            self.holder_pressure_N_per_mm2,
            **options,
        )


AnyScene: TypeAlias = (
    Strip
    | PictureFrame
    | Trellis
    | BiasExtension
    | Specimen
    | Cantilever
    | Buckling
    | Hemisphere
    | Cylinder
    | DoubleDome
    | Saddle
    | Drape
    | HemisphereForming
    | DoubleDomeForming
    | Forming
)

#: Scenes by name.
SCENES: dict[str, type[Scene]] = named(AnyScene)
