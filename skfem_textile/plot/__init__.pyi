"""Public names, which the package imports on first use."""

from .curves import (
    compared_runs as compared_runs,
    curves as curves,
    plot_law as plot_law,
    plot_tensions as plot_tensions,
    singular_fibres as singular_fibres,
)
from .fabrics import (
    fabric_laws as fabric_laws,
)
from .fields import (
    FIELDS as FIELDS,
    Field as Field,
)
from .forming import (
    formed as formed,
    phases as phases,
    section as section,
    tool_force as tool_force,
)
from .in_space import (
    export_gltf as export_gltf,
    to_pyvista as to_pyvista,
    view as view,
)
from .nets import (
    net_on_tool as net_on_tool,
    starts as starts,
)
from .pictures import (
    animation as animation,
    contact_sheet as contact_sheet,
    draped as draped,
    fibre_directions as fibre_directions,
    fibre_strain as fibre_strain,
    field as field,
    mesh_and_fibres as mesh_and_fibres,
    shear_angle as shear_angle,
    verdict as verdict,
)
