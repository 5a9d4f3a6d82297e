"""
Kawabata test of a ply
======================

A ply is sheared between two clamps, as in the test of Kawabata: one clamp moves along
itself and is free across itself, under a constant tension. The force is known if fibres
do not stretch.
"""

import numpy as np

from skfem_textile import Fabric, plot
from skfem_textile.scenes import Case, simple_shear

# %%
# Three tensions across the clamps. The scene contains the rigid clamp and the tension.

gamma, curves = np.radians(20.0), {}
for tension in (0.05, 0.1, 0.2):  # N/mm
    scene = simple_shear(size=(8, 4), tension=tension)
    fabric = Fabric(1e4, 0.5, scene.warp, scene.weft, bending=(5.0, 5.0))
    case = Case(scene=scene, fabric=fabric, steps=4)
    result = case.run()
    moved, force = scene.driven_curve(result)
    curves[f"{tension:g} N/mm"] = moved, force
    exact = scene.load(fabric.shear_law, 1.0)
    print(f"{tension:4g} N/mm: {force[-1]:.2f} N, inextensible fibres {exact:.2f} N")
    assert abs(force[-1] / exact - 1) < 0.01

plot.curves({"": curves}, "Displacement (mm)", "Force (N)", "force.png")

# %%
# The shear angle is uniform except at the free sides, where one half of each side is
# compressed.

plot.shear_angle(result, filename="shear_angle.png")
