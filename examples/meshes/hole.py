"""
Ply with a hole, on triangles from Gmsh
=======================================

A strip with a central hole is stretched at 45° to its fibres. Triangles are split
internally, and the mesh does not lock. The hole becomes an ellipse in the load
direction. Bands with a different shear angle extend from it along the cut fibres.
"""

from pathlib import Path

from skfem_textile import Condition, Fabric, LoadStepper, Ply, plot
from skfem_textile.fabric.directions import directions_of
from skfem_textile.io import read_mesh

# %%
# ``hole.msh`` is generated from ``hole.geo`` in the same folder, with the groups
# ``bottom`` and ``top``.

mesh = read_mesh(Path(__file__).with_name("hole.msh"))
fabric = Fabric(1e5, 0.5, warp=(1, 1), weft=(-1, 1))
plot.mesh_and_fibres(mesh, directions_of(mesh, fabric), "fibres.png", size=(85, 170))

# %%
# The top moves up by 30 mm.

ply = Ply(mesh, fabric)
pull = {"bottom": Condition("bottom"), "top": Condition("top", (0.0, 30.0))}
result = LoadStepper(ply, pull, steps=6).run()
print(result)

# %%

plot.shear_angle(
    result,
    titles=["Pulled by 30 mm"],
    clim=(0, 32),
    size=(85, 170),
    filename="shear_angle.png",
)

# %%
# Force against displacement, as measured by a testing machine.

curve = (
    [state.displacements["top"][1] for state in result.states],
    [state.reactions["top"][1] for state in result.states],
)
plot.curves({"": {"With a hole": curve}}, "Displacement (mm)", "Force (N)", "load.png")

# sphinx_gallery_thumbnail_number = 2
