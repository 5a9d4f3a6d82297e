"""The declaration of the scenes: keys of ``[scene]``, their types and defaults.

Each struct builds its scene, and imports what that needs only then.
"""

from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal, TypeAlias

import numpy as np
from msgspec import field

from .table import FILE, Degrees, Table, about, named

if TYPE_CHECKING:
    from skfem import Mesh as SkfemMesh

    from ..scenes import Scene as BuiltScene


class Scene(Table, tag_field="name"):
    """The problem: geometry, displacement conditions and exact answer.

    Attributes
    ----------
    size, jitter
        Default of the mesh to make.
    fibre_stiffness, shear_stiffness
        Default stiffnesses in N/mm.
    bending
        Default bending stiffness of warp and weft in N mm.
    steps
        Default number of load steps.
    """

    size: ClassVar[tuple[int, int]] = (10, 10)
    jitter: ClassVar[float] = 0.3
    fibre_stiffness: ClassVar[float] = 1e4
    shear_stiffness: ClassVar[float] = 0.5
    bending: ClassVar[float] = 0.0
    steps: ClassVar[int] = 20

    def build(self, mesh: "str | SkfemMesh", **generated: Any) -> "BuiltScene":
        """The scene on a mesh, or on one to make.

        Parameters
        ----------
        mesh
            A mesh, or a kind of `MESH_KINDS`.
        **generated
            ``size``, ``jitter`` and ``seed`` of one to make.
        """
        raise NotImplementedError


class PlaneScene(Scene):
    """A scene in the plane, which can be turned."""

    rotate_deg: Annotated[Degrees, about("rotation of the whole problem")] = 0.0


class Strip(PlaneScene, tag="strip"):
    """a strip laid on a circle, fibres along its sides, clamped at the bottom"""

    size = (10, 15)
    shear_stiffness = 0.0

    def build(self, mesh: Any, **generated: Any) -> "BuiltScene":
        """See `Scene.build`."""
        from ..scenes.strip import strip

        return strip(mesh, **generated)


class PictureFrame(PlaneScene, tag="picture_frame"):
    """a square sheared by a hinged frame, fibres along its sides"""

    shear_angle_deg: Annotated[Degrees, about("shear angle at the end")] = 45.0

    def build(self, mesh: Any, **generated: Any) -> "BuiltScene":
        """See `Scene.build`."""
        from ..scenes.trellis import picture_frame

        angle = float(np.radians(self.shear_angle_deg))
        return picture_frame(mesh, shear_angle=angle, **generated)


Side: TypeAlias = Literal["top", "right", "bottom", "left"]


class Trellis(PlaneScene, tag="trellis"):
    """a square whose edges follow a motion that stretches no fibre"""

    warp_deg: Annotated[Degrees, about("inclination of the warp")] = 0.0
    weft_deg: Annotated[Degrees, about("inclination of the weft")] = 90.0
    shear_angle_deg: Annotated[
        Degrees, about("shear angle at the origin, at the end")
    ] = 45.0
    bend_deg: Annotated[
        Degrees, about("angle by which a fibre of 100 mm bends at the end")
    ] = 30.0
    free: Annotated[tuple[Side, ...], about("sides that are not held")] = ()
    roller_deg: Annotated[
        dict[Side, Degrees],
        about("sides on a roller, with the inclination of the line on which it rolls"),
    ] = field(default_factory=dict)

    def build(self, mesh: Any, **generated: Any) -> "BuiltScene":
        """See `Scene.build`."""
        from ..scenes.trellis import Edge, sheared, trellis

        if both := set(self.free) & set(self.roller_deg):
            raise ValueError(f"scene.roller_deg: the side {min(both)} is already free")
        edges: dict[str, Edge] = dict.fromkeys(self.free, "free")
        for side, inclination in self.roller_deg.items():
            edges[side] = float(np.radians(inclination))
        warp, weft = np.radians([self.warp_deg, self.weft_deg]).tolist()
        turns = sheared(*np.radians([self.shear_angle_deg, self.bend_deg]).tolist())
        return trellis(
            mesh, warp=warp, weft=weft, turns=turns, edges=edges, **generated
        )


class BiasExtension(PlaneScene, tag="bias_extension"):
    """a rectangle pulled along the bisector of its fibres"""

    size = (8, 16)
    jitter = 0.25
    fibre_stiffness = 1e5

    warp_deg: Annotated[Degrees, about("inclination of the warp, below 90")] = 45.0
    weft_deg: Annotated[
        Degrees | None, about("inclination of the weft (default: 180 less the warp's)")
    ] = None
    shear_angle_deg: Annotated[
        Degrees, about("shear angle of the middle at the end")
    ] = 40.0
    part: Annotated[
        Literal["whole", "half"], about("half: on a roller along the axis of symmetry")
    ] = "whole"

    def build(self, mesh: Any, **generated: Any) -> "BuiltScene":
        """See `Scene.build`."""
        from ..scenes.bias_extension import bias_extension

        warp, weft = np.radians(_mirrored(self.warp_deg, self.weft_deg)).tolist()
        angle = float(np.radians(self.shear_angle_deg))
        return bias_extension(
            mesh, warp=warp, weft=weft, shear_angle=angle, part=self.part, **generated
        )


Component: TypeAlias = float | Literal["free"]


class Specimen(PlaneScene, tag="specimen"):
    """a ply of which you say what is held and what moves"""

    size = (8, 16)
    jitter = 0.25
    fibre_stiffness = 1e5

    width_mm: Annotated[float, about("width of a mesh to make")] = 50.0
    height_mm: Annotated[float, about("height of a mesh to make")] = 100.0
    warp_deg: Annotated[Degrees, about("inclination of the warp")] = 45.0
    weft_deg: Annotated[
        Degrees | None, about("inclination of the weft (default: 180 less the warp's)")
    ] = None
    move_mm: Annotated[
        dict[str, tuple[Component, Component]],
        about(
            "displacements of boundaries along x and y at the end: 0,0 to hold one, "
            "free for what is not prescribed"
        ),
    ] = field(default_factory=lambda: {"bottom": (0.0, 0.0), "top": (0.0, 10.0)})
    driven: Annotated[
        str | None,
        about("boundary whose reaction is reported (default: the one that moves most)"),
    ] = None

    def build(self, mesh: Any, **generated: Any) -> "BuiltScene":
        """See `Scene.build`."""
        from ..scenes.specimen import specimen

        warp, weft = np.radians(_mirrored(self.warp_deg, self.weft_deg)).tolist()
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
    return warp, 180 - warp if weft is None else weft


class StripInSpace(Scene):
    """A strip that bends."""

    size = (16, 2)
    jitter = 0.0
    shear_stiffness = 0.1
    bending = 6.0


class Cantilever(StripInSpace, tag="cantilever"):
    """a strip in space that bends under its own weight (Peirce)"""

    steps = 4

    length_mm: Annotated[float, about("length of the strip")] = 200.0
    weight_N_per_mm2: Annotated[float, about("weight per area, 6e-6 for 0.6 kg/m2")] = (
        6e-6
    )

    def build(self, mesh: Any, **generated: Any) -> "BuiltScene":
        """See `Scene.build`."""
        from ..scenes.strips_in_space import cantilever

        return cantilever(
            mesh, length=self.length_mm, weight=self.weight_N_per_mm2, **generated
        )


class Buckling(StripInSpace, tag="buckling"):
    """a strip in space whose ends are pushed together"""

    fibre_stiffness = 1e5

    shortening: Annotated[
        float, about("share of the length by which the ends approach at the end")
    ] = 0.2
    push_N_per_mm2: Annotated[
        float, about("load across the strip, which decides to which side it buckles")
    ] = 1e-8

    def build(self, mesh: Any, **generated: Any) -> "BuiltScene":
        """See `Scene.build`."""
        from ..scenes.strips_in_space import buckling

        return buckling(
            mesh, shortening=self.shortening, push=self.push_N_per_mm2, **generated
        )


class OnTool(Scene):
    """A ply on a tool."""

    size = (16, 16)
    jitter = 0.0
    shear_stiffness = 0.1
    steps = 4

    fibres_deg: Annotated[
        Degrees, about("inclination of the warp; the weft is at right angles")
    ] = 0.0
    width_mm: Annotated[float, about("of the whole ply along x, of a mesh to make")] = (
        180.0
    )
    height_mm: Annotated[
        float, about("of the whole ply along y, of a mesh to make")
    ] = 180.0
    tension_N_per_mm: Annotated[
        float, about("tension on free edges along the fibres; 0 for edges without")
    ] = 2.0

    def ply(self) -> dict[str, Any]:
        """The parameters of the ply."""
        return {
            "fibres": float(np.radians(self.fibres_deg)),
            "width": self.width_mm,
            "height": self.height_mm,
            "tension": self.tension_N_per_mm,
        }


class OnSymmetricTool(OnTool):
    """A ply on a tool with two planes of symmetry."""

    part: Annotated[
        Literal["quarter", "whole"] | None,
        about(
            "computed part (default: quarter with fibres along the sides or at 45 "
            "degrees to them, else whole)"
        ),
    ] = None

    def ply(self) -> dict[str, Any]:
        """The parameters of the ply."""
        return {**super().ply(), "part": self.part}


class Hemisphere(OnSymmetricTool, tag="hemisphere"):
    """a ply on a sphere"""

    radius_mm: Annotated[float, about("radius of the sphere")] = 100.0

    def build(self, mesh: Any, **generated: Any) -> "BuiltScene":
        """See `Scene.build`."""
        from ..scenes.tools import hemisphere

        return hemisphere(mesh, self.radius_mm, **generated, **self.ply())


class Cylinder(OnSymmetricTool, tag="cylinder"):
    """a ply on a cylinder, which shears no ply"""

    radius_mm: Annotated[float, about("radius of the cylinder")] = 100.0

    def build(self, mesh: Any, **generated: Any) -> "BuiltScene":
        """See `Scene.build`."""
        from ..scenes.tools import cylinder

        return cylinder(mesh, self.radius_mm, **generated, **self.ply())


class DoubleDome(OnSymmetricTool, tag="double_dome"):
    """a ply on two domes with a waist between them"""

    size = (32, 18)

    width_mm: Annotated[float, about("of the whole ply along x, of a mesh to make")] = (
        470.0
    )
    height_mm: Annotated[
        float, about("of the whole ply along y, of a mesh to make")
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
    """a ply on a tool in a file, such as STL"""

    tool: Annotated[
        str | None,
        about("triangles of an STL file, or of another file that meshio reads"),
        FILE,
    ] = None
    point_mm: Annotated[
        tuple[float, float, float] | None,
        about(
            "point of the tool that the middle of the ply touches (default: the "
            "highest point, nearest to the middle)"
        ),
    ] = None

    def build(self, mesh: Any, **generated: Any) -> "BuiltScene":
        """See `Scene.build`."""
        from ..io import read_surface
        from ..scenes.drape import drape

        if self.tool is None:
            raise ValueError("scene.tool is missing: name an STL file of triangles")
        tool = read_surface(self.tool)
        return drape(tool, mesh, self.point_mm, **generated, **self.ply())


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
)

#: The scenes by their names.
SCENES: dict[str, type[Scene]] = named(AnyScene)
