"""
Adaptive refinement to a load tolerance
=======================================

A bias extension on Delaunay triangles, with edges not aligned with the fibres. The
shear angle jumps along the fibres from the corners of the clamps, and a coarse mesh
smears these jumps. The summary contains an estimate of the discretisation error. The
mesh is refined at the jumps until the estimate is below a tolerance.
"""

import numpy as np

from skfem_textile import AdaptiveStepper, Fabric, LoadStepper, Ply, plot
from skfem_textile.scenes import bias_extension

# %%
# A coarse mesh and its estimated load error.

scene = bias_extension("delaunay", (5, 10), shear_angle=np.radians(30.0))
ply = Ply(scene.mesh, Fabric(1e5, 0.5, scene.warp, scene.weft))
coarse = LoadStepper(ply, scene.conditions, steps=3).run()

# %%
# The same run to a tolerance of 2 %; each round has a finer mesh.

result = AdaptiveStepper(ply, scene.conditions, tolerance=0.02, steps=3).run()
for one in result.rounds:
    print(one)
for name, of in (("coarse", coarse), ("refined", result)):
    summary, load = of.summary(), of.states[-1].reactions["top"][1]
    print(
        f"{name:8} {summary['n_dofs']:6} unknowns, {load:.2f} N, estimated error "
        f"{summary['estimated_load_error']:.1%}"
    )
assert result.tolerance_met
assert result.ply.basis.N > coarse.ply.basis.N

# %%
# Elements are small where the shear angle jumps.

plot.shear_angle(
    coarse,
    result,
    titles=["Coarse", "Refined"],
    clim=(0, 30),
    show_edges=True,
    filename="shear_angle.png",
)
