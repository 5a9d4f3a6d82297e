"""Declaration of tools and holders: keys of ``[[tools]]``, types and defaults.

Each struct builds its surface and imports the modules for it only then.
"""

from collections.abc import Collection
from math import radians
from typing import TYPE_CHECKING, Annotated, Any, Literal, TypeAlias, Union

from msgspec import Meta

from .. import declarations as declared
from ..mesh.user_input import errors_in
from .tables import (
    FILE,
    DeclaredTable,
    Degrees,
    LengthUnit,
    about,
    table_of,
)

if TYPE_CHECKING:
    from ..contact import Holder, Tool
    from ..surfaces.surface import Axes, Surface

Vector: TypeAlias = tuple[float, float, float]

#: A number, or rows of load factor and number.
NumberOrRows: TypeAlias = float | tuple[tuple[float, float], ...]

_ORIGIN, _UP = (0.0, 0.0, 0.0), (0.0, 0.0, 1.0)

_ROWS = "rows of load factor and value, linear between them"


class _Compaction(DeclaredTable, tag_field="law"):
    """Law of compaction of a ply."""


if TYPE_CHECKING:
    CompactionTable: TypeAlias = _Compaction
else:
    CompactionTable = table_of(declared.Compaction, _Compaction) | table_of(
        declared.MeasuredCompaction, _Compaction
    )


class ToolTable(DeclaredTable, tag_field="surface"):
    """Rigid tool that a ply in space cannot penetrate, or a holder.

    Positions are in mm in the axes of the tools of the scene.
    """

    name: Annotated[
        str | None, about("name of the tool (default: tool_1, tool_2, ...)")
    ] = None
    motion_mm: Annotated[
        tuple[float | tuple[float, float, float, float], ...],
        about(
            "final translation x, y, z, in proportion to the load factor; or rows of "
            "load factor, x, y, z, linear between them"
        ),
    ] = _ORIGIN
    motion_deg: Annotated[
        NumberOrRows,
        about(
            "final rotation about an axis, in proportion to the load factor, "
            "counterclockwise if the axis points to the viewer, before the "
            f"translation; or {_ROWS}"
        ),
    ] = 0.0
    motion_axis: Annotated[Vector, about("direction of this axis")] = _UP
    motion_point_mm: Annotated[
        Vector, about("point of this axis in the initial position")
    ] = _ORIGIN
    side: Annotated[
        Literal[-1, 1] | None,
        about(
            "side of the surface on which the ply lies (default: the side of the "
            "undeformed ply)"
        ),
    ] = None
    thickness_mm: Annotated[
        float, about("thickness of the ply, half of which is kept from the tool")
    ] = 0.0
    outline_mm: Annotated[
        tuple[tuple[float, float], ...] | None,
        about(
            "corners x, y of a polygon in the initial position, outside which the tool "
            "does not touch the ply"
        ),
    ] = None
    friction: Annotated[
        NumberOrRows | None,
        about(f"coefficient of Coulomb friction with the ply; or {_ROWS} (default: 0)"),
    ] = None
    elastic_slip_mm: Annotated[
        Annotated[float, Meta(gt=0)] | None,
        about(
            f"slip up to which friction is elastic (default: {declared.ELASTIC_SLIP:g})"
        ),
    ] = None
    gap_mm: Annotated[
        NumberOrRows | None,
        about(
            f"for a holder: largest distance of the ply from the surface; or {_ROWS}"
        ),
    ] = None
    pressure_N_per_mm2: Annotated[
        NumberOrRows | None,
        about(f"for a holder: pressure towards the surface; or {_ROWS}"),
    ] = None
    force_N: Annotated[
        NumberOrRows | None,
        about(
            "for a rigid holder: force on the computed part of the ply towards the "
            f"surface; or {_ROWS}"
        ),
    ] = None
    compaction: Annotated[
        CompactionTable | None,
        about("law of compaction of the ply under this force"),
    ] = None

    def build(
        self, name: str, axes: "Axes", in_phases: Collection[str] = ()
    ) -> "Tool | Holder":
        """Build the tool.

        Parameters
        ----------
        name
            Its name, or the default of it.
        axes
            Axes of the ply in the axes of the tool.
        in_phases
            Keys of the tool that phases state.

        Raises
        ------
        ValueError
            If a value is not valid.
        """
        import numpy as np

        from ..contact import Holder, Tool

        what, outline = (f"tools.{name}" if self.name else name), None
        if self.outline_mm is not None:
            outline = np.array(self.outline_mm).reshape(-1, 2).T - axes.origin[:2, None]
        with errors_in(f"{what}: "):
            surface = self.surface_in(axes)
        common: dict[str, Any] = {
            "surface": surface,
            "motion": self._motion(what, axes, "motion_deg" in in_phases),
            "side": self.side,
            "thickness": self.thickness_mm,
            "outline": outline,
            "friction": _amount(
                f"{what}.friction", 0.0 if self.friction is None else self.friction
            ),
            "name": name,
            "stated": axes.of_tool,
        }
        if self.elastic_slip_mm is not None:
            if self.friction is None and "friction" not in in_phases:
                raise ValueError(
                    f"{what}: elastic_slip_mm requires friction: set it too, or omit "
                    "elastic_slip_mm"
                )
            common["elastic_slip"] = self.elastic_slip_mm
        given: dict[str, Any] = {
            key.partition("_")[0]: _amount(f"{what}.{key}", amount)
            for key in ("gap_mm", "pressure_N_per_mm2", "force_N")
            if (amount := getattr(self, key)) is not None
        }
        if self.compaction:
            given["compaction"] = self.compaction.construct()
        return Holder(**common, **given) if given else Tool(**common)

    def surface_in(self, axes: "Axes") -> "Surface":
        """Build the surface in the axes of the ply, which are parallel."""
        values = self.values()
        for position in {"point", "centre"} & values.keys():
            values[position] = values[position] - axes.origin
        return self.implementation()(**values)

    def _motion(self, what: str, axes: "Axes", turned: bool) -> Any:
        if not any(self.motion_axis):
            raise ValueError(f"{what}: motion_axis must not be zero")
        translation = self._translation(what)
        given = self.motion_axis, self.motion_point_mm
        if not self.motion_deg and self.motion_deg != ():
            if given != (_UP, _ORIGIN) and not turned:
                raise ValueError(
                    f"{what}: motion_axis and motion_point_mm require motion_deg: set "
                    "it too"
                )
            return translation
        from ..contact.tool import AboutAxis
        from ..ply.amount import Rows

        angle = _amount(f"{what}.motion_deg", in_radians(self.motion_deg))
        moved, turned_by = (
            x if callable(x) else Rows.reaching(x) for x in (translation, angle)
        )
        point = self.motion_point_mm - axes.origin
        return AboutAxis(moved, turned_by, self.motion_axis, point)

    def _translation(self, what: str) -> Any:
        rows = self.motion_mm
        if not any(isinstance(row, tuple) for row in rows):
            if len(rows) != 3:
                raise ValueError(
                    f"{what}.motion_mm must be three numbers, or rows of a load factor "
                    f"and three numbers, got {len(rows)} numbers"
                )
            return rows
        if not all(isinstance(row, tuple) for row in rows):
            raise ValueError(f"{what}.motion_mm contains both rows and numbers")
        return _amount(f"{what}.motion_mm", rows)


def _amount(what: str, amount: Any) -> Any:
    if not isinstance(amount, tuple):
        return amount
    if not amount:
        raise ValueError(f"{what} is empty: state a number, or {_ROWS}, or omit it")
    from ..ply.amount import Rows

    return Rows.of(what, amount)


def in_radians(value: NumberOrRows) -> NumberOrRows:
    """An angle, or the angles in rows, in radians."""
    if isinstance(value, tuple):
        return tuple((at, radians(angle)) for at, angle in value)
    return radians(value)


class TrianglesTool(ToolTable, tag="triangles", kw_only=True):
    """triangles of a file, such as STL"""

    source: Annotated[
        tuple[str, ...] | str,
        about("file of triangles, or several that are sewn, as for the scene drape"),
        FILE,
    ]
    unit: Annotated[
        LengthUnit | None,
        about("unit of length of the file (default: the file's, else mm)"),
    ] = None
    offset_mm: Annotated[
        Vector,
        about(
            "translation x, y, z from the position in the file to the initial position"
        ),
    ] = _ORIGIN
    rotation_deg: Annotated[
        Degrees,
        about(
            "rotation about an axis through the origin of the file, before the "
            "translation, counterclockwise if the axis points to the viewer"
        ),
    ] = 0.0
    rotation_axis: Annotated[Vector, about("direction of this axis")] = _UP

    def surface_in(self, axes: "Axes") -> "Surface":
        """See `ToolTable.surface_in`."""
        from ..contact.tool import rotation_matrix
        from ..io import read_surface

        if not any(self.rotation_axis):
            raise ValueError("rotation_axis must not be zero")
        turn = rotation_matrix(self.rotation_axis, radians(self.rotation_deg))
        surface = read_surface(self.source, self.unit)
        return surface.moved(turn.T @ (axes.origin - self.offset_mm), turn.T)


if TYPE_CHECKING:
    AnyTool: TypeAlias = ToolTable
else:
    AnyTool = Union[
        TrianglesTool,
        *(
            table_of(surface, ToolTable)
            for surface in (
                *(declared.Plane, declared.Sphere, declared.Cylinder, declared.Cone),
                *(declared.Torus, declared.Punch, declared.Die),
            )
        ),
    ]
