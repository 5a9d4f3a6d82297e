"""Input of meshes, fibre directions and fabrics, and output of results."""

from .curves import read_curve
from .directions import OF_DIRECTIONS, read_directions, write_directions
from .draping import (
    DRAPED,
    write_draped,
    write_fibres,
    write_net,
    write_pattern,
)
from .fabrics import OF_FABRICS, read_fabric, write_fabric
from .meshes import read_mesh
from .results import FIELDS, write_fields, write_history, write_summary
from .tools import read_surface, read_tool_mesh

__all__ = [
    "DRAPED",
    "FIELDS",
    "OF_DIRECTIONS",
    "OF_FABRICS",
    "read_curve",
    "read_directions",
    "read_fabric",
    "read_mesh",
    "read_surface",
    "read_tool_mesh",
    "write_directions",
    "write_draped",
    "write_fabric",
    "write_fibres",
    "write_fields",
    "write_history",
    "write_net",
    "write_pattern",
    "write_summary",
]
