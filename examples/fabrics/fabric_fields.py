"""
Spatially varying fabrics
=========================

Fibre directions can be functions of position, and stiffnesses can have one value per
element, for example from a field in a mesh file. Here the warp fans out from a point
below the ply, and the shear stiffness increases to the right. When the top is pulled,
shear is largest on the compliant side.
"""

import numpy as np
from skfem import MeshQuad

from skfem_textile import Condition, Fabric, LoadStepper, Ply, plot
from skfem_textile.fabric.directions import directions_of

# %%
# Warp and weft are at −45° and 45° to rays from (30, −200) mm.

mesh = MeshQuad.init_tensor(np.linspace(0, 60, 13), np.linspace(0, 150, 31))
mesh = mesh.with_defaults()


def turned(degrees):
    """A direction field at an angle to the rays."""
    cos, sin = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))

    def direction(x):
        ray = np.stack([x[0] - 30.0, x[1] + 200.0])
        return np.stack([cos * ray[0] - sin * ray[1], sin * ray[0] + cos * ray[1]])

    return direction


# %%
# ``cell_data`` represents a field of a file: shear stiffnesses from 0.1 to 2 N/mm.

centres = mesh.p[:, mesh.t].mean(axis=1)
cell_data = {"shear": 0.1 * 20 ** (centres[0] / 60.0)}
fabric = Fabric(5e4, cell_data["shear"], warp=turned(-45.0), weft=turned(45.0))

plot.mesh_and_fibres(mesh, directions_of(mesh, fabric), "fibres.png")

# %%
# The top moves up by 12 mm.

ply = Ply(mesh, fabric)
pull = {
    "bottom": Condition("bottom"),
    "top": Condition("top", (0.0, 12.0)),
}
result = LoadStepper(ply, pull, steps=6).run()
angle = np.degrees(ply.on_users_elements(ply.shear_angle(result.u).mean(axis=1)))
low, high = angle[centres[0] < 30.0].max(), angle[centres[0] > 30.0].max()
print(f"load {result.states[-1].reactions['top'][1]:.1f} N")
print(f"largest shear angle {low:.1f}° on the left and {high:.1f}° on the right")
assert low > high

# %%
# The given stiffness field.

field = plot.Field(
    "Shear stiffness (N/mm)",
    lambda ply, u: ply.fabric.shear_law.stiffness,
    cmap="cividis",
)
plot.field(result, field=field, titles=["Stiffness"], state=0, filename="stiffness.png")

# %%
# The shear angle.

plot.shear_angle(result, titles=["Pulled"], filename="shear_angle.png")

# sphinx_gallery_thumbnail_number = 3
