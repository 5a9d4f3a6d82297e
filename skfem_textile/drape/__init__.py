"""Draping: surfaces, plies laid on them without mechanics, and what plies meet."""

from .analytic import Cone, Cylinder, Plane, Sphere, Torus
from .fibres_in_space import FibresInSpace, fibres_on_ply, fibres_on_tool
from .flat_pattern import FlatPattern, flat_pattern
from .geodesics import SAME_AXES, Axes, displacement, exponential_map
from .height_field import Height, HeightField, double_dome
from .kinematic_net import Net, net
from .risks import beyond_edges, bridging, contact_pressure, wrinkle_risk
from .sheet import Places, Sheet
from .tessellation import triangles_on
from .tool_mesh import ToolMesh
from .triangle_mesh import TriangleMesh

__all__ = [
    "SAME_AXES",
    "Axes",
    "Cone",
    "Cylinder",
    "FibresInSpace",
    "FlatPattern",
    "Height",
    "HeightField",
    "Net",
    "Places",
    "Plane",
    "Sheet",
    "Sphere",
    "ToolMesh",
    "Torus",
    "TriangleMesh",
    "beyond_edges",
    "bridging",
    "contact_pressure",
    "displacement",
    "double_dome",
    "exponential_map",
    "fibres_on_ply",
    "fibres_on_tool",
    "flat_pattern",
    "net",
    "triangles_on",
    "wrinkle_risk",
]
