"""Public names, which the package imports on first use."""

from .nets.course import (
    Course as Course,
    courses as courses,
    side_by_side as side_by_side,
)
from .nets.crossings import (
    FoldedNetError as FoldedNetError,
    Net as Net,
    NetError as NetError,
)
from .nets.flat_pattern import (
    Dart as Dart,
    PatternWithDarts as PatternWithDarts,
    pattern_with_darts as pattern_with_darts,
)
from .nets.darts import NetWithDarts as NetWithDarts, net_with_darts as net_with_darts
from .nets.sheet import (
    FibresInSpace as FibresInSpace,
    fibres_on_ply as fibres_on_ply,
    fibres_on_tool as fibres_on_tool,
)
from .nets.flat_pattern import (
    FlatPattern as FlatPattern,
    SeamLine as SeamLine,
    flat_pattern as flat_pattern,
)
from .nets.kinematic_net import NetStart as NetStart, net as net, nets as nets
from .nets.laying import Status as Status, edge_through as edge_through
from .nets.part import (
    points_of_part as points_of_part,
    triangles_of_part as triangles_of_part,
)
from .surfaces.analytic import Die as Die, Punch as Punch
from .contact.risks import (
    beyond_edges as beyond_edges,
    bridging as bridging,
    contact_pressure as contact_pressure,
    off_triangles as off_triangles,
    turn_of_normal as turn_of_normal,
    wrinkle_risk as wrinkle_risk,
)
from .nets.sheet import Pieces as Pieces, Sheet as Sheet, SheetPoints as SheetPoints
from .nets.start_search import (
    BestStart as BestStart,
    best_start as best_start,
    shear_over as shear_over,
)
from .surfaces.analytic import (
    Cone as Cone,
    Cylinder as Cylinder,
    Height as Height,
    HeightField as HeightField,
    Plane as Plane,
    Sphere as Sphere,
    Torus as Torus,
    double_dome as double_dome,
)
from .surfaces.tool_mesh import ToolMesh as ToolMesh, triangles_on as triangles_on
from .surfaces.triangle_mesh import TriangleMesh as TriangleMesh
from .nets.part import TrimmedNet as TrimmedNet, trimmed as trimmed
from .surfaces.surface import (
    SAME_AXES as SAME_AXES,
    Axes as Axes,
    displacement as displacement,
    exponential_map as exponential_map,
)
