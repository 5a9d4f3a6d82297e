"""Public names, which the package imports on first use."""

from .gaps import (
    SmallestGap as SmallestGap,
    nodes_in_contact as nodes_in_contact,
    smallest_gap as smallest_gap,
    tool_force as tool_force,
    tool_pressure as tool_pressure,
    touching as touching,
    turn_on_tool as turn_on_tool,
)
from .figures import (
    formed as formed,
    phase_table as phase_table,
    tool_forces as tool_forces,
    tool_history as tool_history,
    travel as travel,
    travels as travels,
)
from .compaction import (
    Compaction as Compaction,
    MeasuredCompaction as MeasuredCompaction,
)
from .holder import (
    contacts as contacts,
    pressing as pressing,
)
from .phases import (
    OverTravel as OverTravel,
    Phase as Phase,
    Process as Process,
)
from .placed import (
    PlacedTool as PlacedTool,
    box_of as box_of,
    placed_tools as placed_tools,
)
from .shape import (
    DrawIn as DrawIn,
    areal_weight as areal_weight,
    draw_in as draw_in,
    fibre_curvature as fibre_curvature,
)
from .stack import Stack as Stack
from .tool import (
    Holder as Holder,
    Tool as Tool,
)
