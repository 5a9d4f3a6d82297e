"""Tables of the scenes: keys of ``[scene]``."""

from math import radians
from typing import (
    TYPE_CHECKING,
    Annotated,
    Any,
    ClassVar,
    Literal,
    TypeAlias,
    Union,
    get_type_hints,
)

from msgspec import field

from ..declarations import scenes as declared
from .tables import (
    DeclaredTable,
    Degrees,
    LengthUnit,
    about,
    named,
    snake_case,
    table_of,
)
from .tools import ToolTable

if TYPE_CHECKING:
    from skfem import Mesh as SkfemMesh

    from ..scenes import Scene as BuiltScene


class Scene(DeclaredTable, tag_field="name"):
    """The problem: geometry, displacement conditions and exact solution."""

    declaration: ClassVar[type[declared.AnyScene]]

    def build(self, mesh: "str | SkfemMesh", **generated: Any) -> "BuiltScene":
        """Build the scene on a given or generated mesh.

        Parameters
        ----------
        mesh
            A mesh, or one of `MESH_KINDS` except `GRADED`.
        **generated
            ``size``, ``jitter`` and ``seed`` of a generated mesh.
        """
        return self.construct(mesh=mesh, **generated)

    def values(self) -> dict[str, Any]:
        """See `DeclaredTable.values`; also a law of compaction."""
        law = getattr(self, _COMPACTION, None)
        return super().values() | ({"compaction": law.construct()} if law else {})


# Key of the law of compaction under the holder of a scene.
_COMPACTION = "holder_compaction"


class _Plane(Scene):
    """Scene in the plane, which can be rotated."""

    rotate_deg: Annotated[Degrees, about("rotation of the whole problem")] = 0.0


Side: TypeAlias = Literal["top", "right", "bottom", "left"]

if TYPE_CHECKING:
    _Trellis: TypeAlias = _Plane
else:
    _Trellis = table_of(declared.Trellis, _Plane, tag="trellis")


class _TrellisByAngles(_Trellis, tag="trellis", kw_only=True):
    """a square whose edges follow a motion without fibre strain"""

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

    def values(self) -> dict[str, Any]:
        """See `DeclaredTable.values`."""
        from ..scenes.trellis import sheared

        if both := set(self.free) & set(self.roller_deg):
            raise ValueError(
                f"the side {min(both)} is both in scene.free and in scene.roller_deg: "
                "omit one of them"
            )
        edges: dict[str, declared.Edge] = dict.fromkeys(self.free, "free")
        for side, inclination in self.roller_deg.items():
            edges[side] = radians(inclination)
        turns = sheared(radians(self.shear_angle_deg), radians(self.bend_deg))
        return {**super().values(), "turns": turns, "edges": edges}


class _Mirrored(_Plane):
    """Scene whose weft mirrors the warp by default."""

    def values(self: Any) -> dict[str, Any]:
        """See `DeclaredTable.values`."""
        values = DeclaredTable.values(self)
        if self.weft_deg is None:
            values["weft"] = radians(180 - self.warp_deg)
        return values


class _OfFiles(Scene):
    """Scene with tools from files."""

    def build(self: Any, mesh: Any, **generated: Any) -> "BuiltScene":
        """See `Scene.build`."""
        from ..io import read_surface

        files = [key for key in ("tool", "punch", "die") if key in self.keys]
        missing = [key for key in files if getattr(self, key) is None]
        if missing == ["punch", "die"]:
            from ..scenes.forming import formed_ply

            ply = {key: x for key, x in self.values().items() if key in _OF_PLY}
            return formed_ply("forming", (), mesh, **{**ply, **generated})
        for key in missing:
            of = " of triangles" if key == "tool" else ""
            raise ValueError(f"scene.{key} is missing: name an STL file{of}")
        tools = {key: read_surface(getattr(self, key), self.unit) for key in files}
        return self.implementation()(
            mesh=mesh, **{**self.values(), **tools, **generated}
        )

    def refuse_keys_of_tools(self: Any, travel: float | None) -> None:
        """Refuse keys of tools of the scene, which has none, but a given travel."""
        plain = type(self)()
        own = {key: name for key, (name, _) in self.keys.items()} | {
            key: key for key in ("unit", _COMPACTION)
        }
        for key in (key for key, name in own.items() if name not in _OF_PLY):
            allowed = getattr(plain, key), travel if key == "travel_mm" else None
            if getattr(self, key) not in allowed:
                raise ValueError(
                    f"scene.{key} has no effect, because it belongs to tools of the "
                    "scene, and all tools are in [[tools]]: omit it, or set a key of "
                    "[[tools]] or [[phases]]"
                )


_OF_STACK = "layup", "ply_friction", "ply_thickness"
_OF_PLY = "fibres", "width", "height", "tension", "part", *_OF_STACK


def _unit(of: str) -> dict[str, Any]:
    """Key with the unit of files."""
    text = f"unit of length of the {of} (default: the file's, else mm)"
    return {"unit": Annotated[LengthUnit | None, about(text)]}


# Keys of the holder of a scene.
_OF_HOLDER = "gap", "pressure", "force", _COMPACTION

_SETTINGS: dict[type[declared.Scene], dict[str, Any]] = {
    declared.BiasExtension: {"base": _Mirrored},
    declared.Specimen: {"base": _Mirrored},
    declared.Drape: {
        "base": _OfFiles,
        "also": _unit("tool"),
        "last": ["tool", "unit", "point"],
    },
    declared.Forming: {
        "base": _OfFiles,
        "also": _unit("files"),
        "last": [*("punch", "die", "unit", "travel", *_OF_HOLDER, "centre", "part")],
    },
}

#: Order of the keys of forming by tools with two planes of symmetry.
_OF_SYMMETRIC = [
    *(*_OF_HOLDER, "part", "centre", "clearance"),
    *("radius", "fillet", "travel"),
]


def _table_of(scene: type[declared.Scene]) -> type[Scene]:
    """Table of a scene."""
    if scene is declared.Trellis:
        return _TrellisByAngles
    plane = issubclass(scene, declared.PlaneScene)
    symmetric = issubclass(scene, declared.FormedBySymmetricTools)
    settings: dict[str, Any] = {
        "base": _Plane if plane else Scene,
        "last": _OF_SYMMETRIC if symmetric else (),
        **_SETTINGS.get(scene, {}),
    }
    if issubclass(scene, declared.Formed):
        law = get_type_hints(ToolTable, include_extras=True)["compaction"]
        settings["also"] = {**settings.get("also", {}), _COMPACTION: law}
    return table_of(scene, tag=snake_case(scene), **settings)


_TABLES = tuple(
    _table_of(one)
    for one in vars(declared).values()
    if isinstance(one, type) and issubclass(one, declared.Scene) and one.implemented_in
)

if TYPE_CHECKING:
    AnyScene: TypeAlias = Scene
else:
    AnyScene = Union[_TABLES]  # noqa: UP007 - of a sequence

#: Scenes by name.
SCENES: dict[str, type[Scene]] = named(AnyScene)
