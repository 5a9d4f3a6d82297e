"""Pictures of meshes and results: pixels by pyvista, vectors by matplotlib."""

from ..mesh.requirements import require

require("a picture", "plot", "matplotlib")

from .curves import curves, plot_law, plot_tensions
from .fields import FIELDS, Field
from .forming import formed, section, tool_force
from .in_space import export_gltf, to_pyvista, view
from .motion import animation
from .nets import net_on_tool, starts
from .outlines import singular_fibres
from .pictures import (
    contact_sheet,
    draped,
    fibre_directions,
    fibre_strain,
    field,
    mesh_and_fibres,
    shear_angle,
    verdict,
)

__all__ = [
    "FIELDS",
    "Field",
    "animation",
    "contact_sheet",
    "curves",
    "draped",
    "export_gltf",
    "fibre_directions",
    "fibre_strain",
    "field",
    "formed",
    "mesh_and_fibres",
    "net_on_tool",
    "plot_law",
    "plot_tensions",
    "section",
    "shear_angle",
    "singular_fibres",
    "starts",
    "to_pyvista",
    "tool_force",
    "verdict",
    "view",
]
