"""
Hanging sheet in 3D
===================

With ``dimension=3`` a ply can move out of plane. A sheet hangs under its weight between
two edges, one of which approaches the other by a fifth of the span. Its fibres hardly
stretch, so it takes the shape of a chain, the catenary.
"""

import numpy as np
from scipy.optimize import brentq
from skfem import MeshQuad

from skfem_textile import BodyForce, Condition, Fabric, LoadStepper, Ply, plot

LENGTH, WIDTH, NEARER = 100.0, 50.0, 20.0  # mm
WEIGHT = 1e-3  # N/mm²

# %%
# Displacements, forces and conditions have three components. The weight acts from the
# start.

mesh = MeshQuad.init_tensor(np.linspace(0, LENGTH, 17), np.linspace(0, WIDTH, 9))
weight = BodyForce((0.0, 0.0, -WEIGHT), factor=1.0)
ply = Ply(mesh.with_defaults(), Fabric(1e4, 0.1), terms=[weight], dimension=3)
held = {"left": Condition("left"), "right": Condition("right", (-NEARER, 0.0, 0.0))}
result = LoadStepper(ply, held, steps=5).run()

# %%
# The sag of a chain over the span s, with the length 2a sinh(s/2a).

span = LENGTH - NEARER
a = brentq(lambda a: 2 * a * np.sinh(span / (2 * a)) - LENGTH, 10.0, 1000.0)
exact = a * (np.cosh(span / (2 * a)) - 1)
sag = -ply.nodal(result.u)[2].min()
pull = result.states[-1].reactions["right"][0]
print(f"sag: {sag:.2f} mm, catenary: {exact:.2f} mm")
print(f"pull: {pull:.4f} N, catenary: {WEIGHT * WIDTH * a:.4f} N")
assert abs(sag / exact - 1) < 0.01

# %%
# Plies in 3D are drawn in perspective, here coloured by height.

height = plot.Field(
    "Height (mm)",
    lambda ply, u: ply.nodal(u)[2, : ply.mesh.nvertices][ply.mesh.t].mean(axis=0),
    cmap="cividis",
)
plot.field(result, field=height, titles=["Under its weight"], filename="sheet.png")
