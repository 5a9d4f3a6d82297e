"""Draping: surfaces, kinematic nets, draped fibres, flat patterns and defects."""

from ..solve.surface.surface import displacement, exponential_map
from .course import Course, courses, side_by_side
from .crossings import FoldedNetError, Net, NetError
from .dart_pattern import Dart, PatternWithDarts, pattern_with_darts
from .darts import NetWithDarts, net_with_darts
from .fibres_in_space import (
    SAME_AXES,
    Axes,
    FibresInSpace,
    fibres_on_ply,
    fibres_on_tool,
)
from .flat_pattern import FlatPattern, SeamLine, flat_pattern
from .guide_curve import edge_through
from .kinematic_net import NetStart, net, nets
from .laying import Status
from .part import points_of_part, triangles_of_part
from .punch_and_die import Die, Punch
from .risks import (
    beyond_edges,
    bridging,
    contact_pressure,
    off_triangles,
    turn_of_normal,
    wrinkle_risk,
)
from .sheet import Pieces, Sheet, SheetPoints
from .start_search import BestStart, best_start, shear_over
from .surfaces import (
    Cone,
    Cylinder,
    Height,
    HeightField,
    Plane,
    Sphere,
    Torus,
    double_dome,
)
from .tool_mesh import ToolMesh, triangles_on
from .triangle_mesh import TriangleMesh
from .trimming import TrimmedNet, trimmed

__all__ = [
    "SAME_AXES",
    "Axes",
    "BestStart",
    "Cone",
    "Course",
    "Cylinder",
    "Dart",
    "Die",
    "FibresInSpace",
    "FlatPattern",
    "FoldedNetError",
    "Height",
    "HeightField",
    "Net",
    "NetError",
    "NetStart",
    "NetWithDarts",
    "PatternWithDarts",
    "Pieces",
    "Plane",
    "Punch",
    "SeamLine",
    "Sheet",
    "SheetPoints",
    "Sphere",
    "Status",
    "ToolMesh",
    "Torus",
    "TriangleMesh",
    "TrimmedNet",
    "best_start",
    "beyond_edges",
    "bridging",
    "contact_pressure",
    "courses",
    "displacement",
    "double_dome",
    "edge_through",
    "exponential_map",
    "fibres_on_ply",
    "fibres_on_tool",
    "flat_pattern",
    "net",
    "net_with_darts",
    "nets",
    "off_triangles",
    "pattern_with_darts",
    "points_of_part",
    "shear_over",
    "side_by_side",
    "triangles_of_part",
    "triangles_on",
    "trimmed",
    "turn_of_normal",
    "wrinkle_risk",
]
