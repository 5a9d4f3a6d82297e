"""Forming: rigid tools that move, and a ply that slides between them."""

from .contact import (
    SmallestGap,
    contacts,
    smallest_gap,
    tool_pressure,
    touching,
    turn_on_tool,
)
from .figures import formed, tool_forces, travel, travels
from .holder import Holder
from .placed import PlacedTool, box_of, placed_tools
from .shape import (
    DrawIn,
    areal_weight,
    draw_in,
    fibre_curvature,
    fibre_fraction_at_constant_thickness,
    thickness_at_constant_fibre_fraction,
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
    "fibre_fraction_at_constant_thickness",
    "formed",
    "placed_tools",
    "smallest_gap",
    "thickness_at_constant_fibre_fraction",
    "tool_forces",
    "tool_pressure",
    "touching",
    "travel",
    "travels",
    "turn_on_tool",
]
