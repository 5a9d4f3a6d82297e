"""
Zones between singular fibres
=============================

Fibres hardly stretch, so that a kink of the motion at one point runs along the fibre
through the whole ply: across this *singular fibre* the shear angle jumps. Singular
fibres start at the ends of clamps and where a fibre touches a hole. A mesh that has
them as edges represents the jumps exactly.
"""

import numpy as np

from skfem_textile import (
    Condition,
    Fabric,
    LoadStepper,
    Outline,
    Ply,
    Quadratic,
    mesh_outline,
    plot,
    singular_fibres,
)

# %%
# A ply of 50 mm × 115 mm with a hole, clamped at the bottom and pulled at the top.

angles = 2 * np.pi * np.arange(64) / 64
hole = [22 + 10 * np.cos(angles), 55 + 10 * np.sin(angles)]
outline = Outline([[0, 50, 50, 0], [0, 0, 115, 115]], [hole])
c, s = np.cos(np.radians(41)), np.sin(np.radians(41))
fabric = Fabric(1e5, 0.5, warp=(c, s), weft=(-c, s))
conditions = {"clamp": Condition("bottom"), "pull": Condition("top", (0, 12))}

fibres = singular_fibres(outline, fabric, conditions)
print(fibres.summary())
plot.singular_fibres(outline, fibres, filename="singular_fibres.png")

# %%
# The net has edges on the singular fibres, and is finest there. On these meshes
# quadratic triangles need neither a stabilisation nor a mean of the stretches.

net = mesh_outline(outline, fabric, conditions)
ply = Ply(net, fabric, Quadratic())
result = LoadStepper(ply, conditions, steps=2).run()
load = result.states[-1].reactions["pull"][1]
print(f"{ply.basis.N} unknowns, {load:.3f} N")

# %%
# Half the size of all elements changes the load by a tenth of a percent.

finer = mesh_outline(outline, fabric, conditions, density=2)
check = LoadStepper(Ply(finer, fabric, Quadratic()), conditions, steps=2).run()
change = load / check.states[-1].reactions["pull"][1] - 1
print(f"{check.ply.basis.N} unknowns, change of the load {100 * change:+.2f} %")
assert abs(change) < 0.003

# %%

plot.shear_angle(result, clim=(0, 30), filename="shear_angle.png")

# sphinx_gallery_thumbnail_number = 2
