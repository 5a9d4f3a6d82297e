"""Draping: surfaces, plies laid on them without mechanics, and what plies meet."""

from .analytic import Cone, Cylinder, Plane, Sphere, Torus
from .geodesics import displacement, exponential_map
from .height_field import Height, HeightField, double_dome
from .kinematic_net import Net, net
from .risks import bridging, contact_pressure, wrinkle_risk
from .tessellation import triangles_on
from .triangle_mesh import TriangleMesh

__all__ = [
    "Cone",
    "Cylinder",
    "Height",
    "HeightField",
    "Net",
    "Plane",
    "Sphere",
    "Torus",
    "TriangleMesh",
    "bridging",
    "contact_pressure",
    "displacement",
    "double_dome",
    "exponential_map",
    "net",
    "triangles_on",
    "wrinkle_risk",
]
