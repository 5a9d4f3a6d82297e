"""
Tension locking and locking-free macro-elements
===============================================

Bilinear elements with 2×2 points cannot shear without stretching fibres that cross them
at an angle. On a distorted mesh the fibre strains are then spurious, and the load is
too large. Macro-elements, the default, evaluate the law at the average strain of their
parts. The figure shows the fibre strain of warp and weft on one scale.
"""

import numpy as np

from skfem_textile import Fabric, Full, LoadStepper, Macro, OnePoint, Ply, plot
from skfem_textile.scenes import bias_extension

# %%
# A bias-extension test with fibres at ±45°, E/G = 2·10⁵. ``Macro`` splits elements in
# four, so that a coarser mesh has the same number of unknowns.

fine = bias_extension(size=(12, 24), shear_angle=np.radians(20.0))
coarse = bias_extension(size=(6, 12), shear_angle=np.radians(20.0))
fabric = Fabric(tension=1e5, shear=0.5, warp=fine.warp, weft=fine.weft)
cases = [(fine, Full()), (fine, OnePoint()), (coarse, Macro())]
results = [
    LoadStepper(Ply(scene.mesh, fabric, formulation), scene.conditions, steps=4).run()
    for scene, formulation in cases
]

# %%
# The load is compared with the load for inextensible fibres.

print(f"{'':12} unknowns  load/exact load  largest fibre strain")
shares = []
for (scene, formulation), result in zip(cases, results, strict=True):
    summary = scene.summary(result)
    shares.append(summary["load_over_exact"])
    print(
        f"{formulation.name:12}{summary['n_dofs']:9}{shares[-1]:17.3f}"
        f"{summary['max_fibre_strain']:22.1e}"
    )
locked, one_point, macro = shares
assert locked > 3
assert abs(one_point - 1) < 0.1
assert abs(macro - 1) < 0.1

# %%
# All panels share one scale; panels without locking are nearly white.

plot.fibre_strain(*results, filename="fibre_strain.png")
