"""
Draping a double dome at ±45°
=============================

Two fabrics are laid on a double dome with their fibres at 45° to its long side. The
first shears easily, and its edges are pulled along the fibres. The second locks at a
shear angle of 15°, and its edges are free.
"""

import numpy as np

from skfem_textile import Fabric, Locking, drape, plot
from skfem_textile.scenes import Case, double_dome

FIBRES = np.radians(45)

# %%
# Tool and fibres have two planes of symmetry: a quarter is computed. The tool grows out
# of the plane of the ply with the load factor. Edges are pulled by 2 N/mm.

pulled = double_dome(fibres=FIBRES, tension=2.0, size=(24, 14))
fabric = Fabric(1e4, 0.1, pulled.warp, pulled.weft)
soft = Case(scene=pulled, fabric=fabric, steps=4)

# %%
# Free edges, and a fabric that locks. Its fibres resist bending a little.

free = double_dome(fibres=FIBRES, tension=0.0, size=(24, 14))
law = Locking(0.1, np.radians(15))
locking = Fabric(1e4, law, free.warp, free.weft, bending=(1.0, 1.0))
hard = Case(scene=free, fabric=locking, steps=4)

results = [case.run() for case in (soft, hard)]
for result in results:
    angle = np.degrees(np.abs(result.ply.shear_angle(result.u)).max())
    risk = drape.wrinkle_risk(result.ply, result.u)
    print(f"shear up to {angle:.1f}°, {risk.sum()} elements at risk of wrinkles")

# %%
# What cannot shear is compressed along its fibres. Where the compression is larger than
# the shear stiffness they may buckle in the plane of the ply. On the blue side of the
# scale of the pressure the tool would have to pull: the ply bridges the hollow there.

assert not drape.wrinkle_risk(results[0].ply, results[0].u).any()
assert drape.wrinkle_risk(results[1].ply, results[1].u).any()
for result, title in zip(results, ("edges pulled", "locks at 15°"), strict=True):
    plot.draped(result, titles=[title], filename=f"{title.split()[0]}.png")

# %%
# The forming of the first.

plot.animation(results[0], "forming.gif")
