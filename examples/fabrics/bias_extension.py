"""
Bias extension
==============

A strip twice as long as wide, with fibres at ±45°, is stretched until the shear angle
at its centre is 40°. Three zones form: no shear at the clamps, full shear in the
centre, and half the shear angle between. Fibres through the corners of the clamps bend
at the zone boundaries. The fibre strain is largest along them, but small everywhere.
"""

import numpy as np

from skfem_textile import Fabric, LoadStepper, Ply, plot
from skfem_textile.scenes import bias_extension

# %%
# The scene provides mesh, fibre directions and conditions. E/G is 2·10⁵.

scene = bias_extension(size=(12, 24), shear_angle=np.radians(40.0))
fabric = Fabric(tension=1e5, shear=0.5, warp=scene.warp, weft=scene.weft)
ply = Ply(scene.mesh, fabric)
result = LoadStepper(ply, scene.conditions, steps=4).run()

# %%
# The exact load is the load with inextensible fibres.

summary = scene.summary(result)
print(f"load: {summary['reaction_y']:.2f} N")
print(f"load / exact load: {summary['load_over_exact']:.3f}")
print(f"largest fibre strain: {100 * summary['max_fibre_strain']:.3f} %")
assert abs(summary["load_over_exact"] - 1) < 0.05

# %%
# The shear-angle zones, and the fibres, which bend at the zone boundaries.

plot.shear_angle(
    result, titles=["Sheared by 40°"], clim=(0, 40), filename="shear_angle.png"
)

# %%

plot.fibre_directions(result, titles=["Fibres"], size=(85, 150), filename="fibres.png")

# %%
# The fibre strain: warp (left) and weft (right).

plot.fibre_strain(result, titles=["bias extension"], filename="fibre_strain.png")
