"""Forming: rigid tools that move, and a ply that slides between them."""

from .contact import (
    SmallestGap,
    contacts,
    nodes_in_contact,
    pressing,
    smallest_gap,
    tool_force,
    tool_pressure,
    touching,
    turn_on_tool,
)
from .figures import formed, tool_forces, tool_history, travel, travels
from .holder import Holder
from .placed import PlacedTool, box_of, placed_tools
from .shape import (
    DrawIn,
    areal_weight,
    draw_in,
    fibre_curvature,
)
from .tool import Tool

__all__ = [
    "DrawIn",
    "Holder",
    "PlacedTool",
    "SmallestGap",
    "Tool",
    "areal_weight",
    "box_of",
    "contacts",
    "draw_in",
    "fibre_curvature",
    "formed",
    "nodes_in_contact",
    "placed_tools",
    "pressing",
    "smallest_gap",
    "tool_force",
    "tool_forces",
    "tool_history",
    "tool_pressure",
    "touching",
    "travel",
    "travels",
    "turn_on_tool",
]
