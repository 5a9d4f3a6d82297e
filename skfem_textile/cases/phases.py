"""Declaration of the phases of a process: keys of ``[[phases]]``."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Annotated, Any, TypeAlias

from msgspec import Meta, field, structs

from .tables import Table, about
from .tools import NumberOrRows, in_radians

if TYPE_CHECKING:
    from ..contact import Holder, Phase, Tool
    from ..scenes import Scene


class RowsOfTravel(Table):
    """Value by rows of the travel of a tool."""

    travel_of: Annotated[str, about("name of the tool")]
    rows: Annotated[
        tuple[tuple[float, float], ...],
        about("travel from the initial position in mm, and value"),
    ]


#: A number, rows of the share of a phase and number, or rows of a travel.
InPhase: TypeAlias = NumberOrRows | RowsOfTravel

_SHARES = (
    "at the end of the phase, reached linearly; or rows of the share of the phase, 0 "
    "to 1, and value"
)
_ROWS = (
    f"{_SHARES}; or {{travel_of = NAME, rows}}, rows of the travel of a tool and value"
)


class ToolInPhase(Table):
    """Changes of a tool in a phase; the rest keeps its value."""

    motion_mm: Annotated[
        tuple[float | tuple[float, float, float, float], ...] | None,
        about(
            "translation x, y, z from the initial position at the end of the phase, "
            "reached linearly; or rows of the share of the phase, 0 to 1, x, y, z"
        ),
    ] = None
    motion_deg: Annotated[
        NumberOrRows | None,
        about(f"rotation about the axis of the tool, by default z, {_SHARES}"),
    ] = None
    gap_mm: Annotated[InPhase | None, about(f"gap of a holder, {_ROWS}")] = None
    pressure_N_per_mm2: Annotated[
        InPhase | None, about(f"pressure of a holder, {_ROWS}")
    ] = None
    force_N: Annotated[InPhase | None, about(f"force of a holder, {_ROWS}")] = None
    friction: Annotated[
        InPhase | None,
        about("coefficient of friction in the whole phase, or rows as above"),
    ] = None

    def stated(self) -> dict[str, Any]:
        """Values by the keys that are stated."""
        given = {key: getattr(self, key) for key in self.__struct_fields__}
        return {key: value for key, value in given.items() if value is not None}

    def build(self) -> dict[str, Any]:
        """Values by the names of `contact.Phase`, angles in radians."""
        given = self.stated()
        if (rotation := given.pop("motion_deg", None)) is not None:
            given["rotation"] = in_radians(rotation)
        return {key.partition("_")[0]: built_value(x) for key, x in given.items()}


class PhaseTable(Table):
    """Phase of a process, in which tools move and loads change."""

    name: Annotated[str, about("name of the phase")]
    steps: Annotated[Annotated[int, Meta(ge=1)], about("number of its load steps")]
    loads: Annotated[
        InPhase | None,
        about(f"factor of the forces and the weight in [loads], {_ROWS}"),
    ] = None
    tools: Annotated[
        dict[str, ToolInPhase],
        about(
            "what changes of each tool, in tables [phases.tools.NAME]; of every tool "
            'in [phases.tools."*"], unless its own table states it'
        ),
    ] = field(default_factory=dict)

    def of_each(self, names: Sequence[str]) -> "PhaseTable":
        """The phase with what it states of all tools in the table of each."""
        tools = dict(self.tools)
        if (every := tools.pop("*", None)) is None:
            return self
        for name in names:
            own = tools.get(name, ToolInPhase())
            tools[name] = structs.replace(every, **own.stated())
        return structs.replace(self, tools=tools)

    def build(self) -> "Phase":
        """The phase."""
        from ..contact import Phase

        tools = {name: tool.build() for name, tool in self.tools.items()}
        return Phase(self.name, self.steps, tools, built_value(self.loads))


def built_value(value: Any) -> Any:
    """A value in a phase as in Python."""
    if not isinstance(value, RowsOfTravel):
        return value
    from ..contact import OverTravel

    return OverTravel(value.travel_of, value.rows)


# Axis of rotation of the tools of a scene.
_UP = (0.0, 0.0, 1.0)


def in_phases(scene: "Scene", file: Any, tools: Sequence["Tool | Holder"]) -> "Scene":
    """Scene whose tools, and the tools of the case, move and press in phases.

    Parameters
    ----------
    scene
        The scene.
    file
        The case, with phases.
    tools
        Its tools.

    Raises
    ------
    ValueError
        If there are no tools, or no loads of which a phase states the factor, or the
        first phase replaces a friction that is stated before it; see also `Process`.
    """
    from ..scenes import in_phases as follow

    if not (scene.tools or tools):
        raise ValueError(
            f"[[phases]] do not apply to the scene {scene.name}, which has no tools: "
            "use stepping.programme, or another scene"
        )
    phases = [phase.build() for phase in file.phases]
    stated = file.loads.force_N or file.loads.weight_N_per_mm2 is not None
    for phase in phases:
        if phase.loads is not None and not stated:
            raise ValueError(
                f"phase {phase.name!r} states a factor of the loads, but there are "
                "none: state them in [loads]"
            )
    _refuse_replaced(scene, file, [tool.name for tool in tools])
    origin = scene.axes.origin
    axes: Any = {tool.name: (_UP, -origin) for tool in scene.tools}
    for tool, table in zip(tools, file.tools, strict=True):
        axes[tool.name] = table.motion_axis, table.motion_point_mm - origin
    return follow(scene, phases, tools, axes)


def described_phase(scene: "Scene", name: str | None) -> str | None:
    """Phase that ``output.describe`` names, refused if the scene has no such phase."""
    if name is None:
        return None
    if scene.process is None:
        raise ValueError("output.describe requires a case with [[phases]]: omit it")
    from ..io.file_numbers import errors_about

    with errors_about("output.describe"):
        scene.process.begin(name)
    return name


def _refuse_replaced(scene: "Scene", file: Any, names: Sequence[str]) -> None:
    """Refuse friction that the first phase replaces from its start.

    Other amounts change from their values before the first phase.
    """
    first = file.phases[0]
    replaced = {
        name for name, tool in first.tools.items() if _from_start(tool.friction)
    }
    stated = {
        f"tools.{name}.friction": {name}
        for name, table in zip(names, file.tools, strict=True)
        if table.friction
    }
    rubs = bool(getattr(file.scene, "friction", 0))
    if scene.tools and rubs:
        stated["scene.friction"] = {tool.name for tool in scene.tools}
    for key, tools in stated.items():
        if tools <= replaced:
            raise ValueError(
                f"{key} has no effect, because the phase {first.name!r} states the "
                f"friction from its start: omit {key}, or set "
                f"phases.{first.name}.tools.{min(tools)}.friction"
            )


def _from_start(friction: InPhase | None) -> bool:
    """True if a friction in a phase is stated at its start, too."""
    begins = not isinstance(friction, tuple) or friction[0][0] == 0
    return friction is not None and begins


def furthest(phases: Sequence[PhaseTable], tool: str) -> float | None:
    """The largest motion of a tool along z in mm, with its sign; None if not moved.

    In the direction of the first one: a punch may open further than its stroke.
    """
    changes = (phase.of_each([tool]).tools.get(tool) for phase in phases)
    moved = (change.motion_mm for change in changes if change)
    heights = [
        row[-1] if isinstance(row, tuple) else row
        for rows in moved
        if rows
        for row in (rows if isinstance(rows[0], tuple) else rows[-1:])
    ]
    if not heights:
        return None
    first = next((height for height in heights if height), 0.0)
    return max(heights, key=lambda height: height * first)
