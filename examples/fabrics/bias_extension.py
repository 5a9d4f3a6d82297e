"""
Bias extension
==============

A strip twice as long as wide, with fibres at ±45°, is pulled until its middle is
sheared by 40°. Three zones form: no shear at the clamps, full shear in the middle, and
half of it between. Fibres that start at the corners of the clamps bend at the borders
of the zones; the fibre strain is largest along them, and is small everywhere.
"""

import numpy as np

from skfem_textile import Fabric, LoadStepper, Ply, plot
from skfem_textile.scenes import bias_extension

# %%
# The scene has mesh, fibre directions and conditions. E/G is 2·10⁵.

scene = bias_extension(size=(12, 24), shear_angle=np.radians(40.0))
fabric = Fabric(tension=1e5, shear=0.5, warp=scene.warp, weft=scene.weft)
ply = Ply(scene.mesh, fabric)
result = LoadStepper(ply, scene.conditions, steps=4).run()

# %%
# The exact load is that of fibres that do not stretch.

summary = scene.summary(result)
print(f"load {summary['reaction_y']:.2f} N")
print(f"load over exact {summary['load_over_exact']:.3f}")
print(f"largest fibre strain {100 * summary['max_fibre_strain']:.3f} %")
assert abs(summary["load_over_exact"] - 1) < 0.05

# %%
# The zones of the shear angle, and the fibres that bend at their borders.

plot.shear_angle(
    result, titles=["Sheared by 40°"], clim=(0, 40), filename="shear_angle.png"
)

# %%

plot.fibre_directions(result, titles=["Fibres"], size=(85, 150), filename="fibres.png")

# %%
# The fibre strain, warp on the left and weft on the right.

plot.fibre_strain(result, titles=["bias extension"], filename="fibre_strain.png")
