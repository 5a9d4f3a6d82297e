"""
A sheet that hangs in space
===========================

With ``dimension=3`` a ply leaves its plane. A sheet hangs under its weight between two
edges, of which one comes nearer by a fifth of the span. Its fibres do not stretch, so
it takes the shape of a chain, the catenary.
"""

import numpy as np
from scipy.optimize import brentq
from skfem import MeshQuad

from skfem_textile import BodyForce, Condition, Fabric, LoadStepper, Ply, plot

LENGTH, WIDTH, NEARER = 100.0, 50.0, 20.0  # mm
WEIGHT = 1e-3  # N/mm²

# %%
# Displacements, forces and conditions have three components. The weight is there from
# the start.

mesh = MeshQuad.init_tensor(np.linspace(0, LENGTH, 17), np.linspace(0, WIDTH, 9))
weight = BodyForce((0.0, 0.0, -WEIGHT), factor=1.0)
ply = Ply(mesh.with_defaults(), Fabric(1e4, 0.1), terms=[weight], dimension=3)
held = {"left": Condition("left"), "right": Condition("right", (-NEARER, 0.0, 0.0))}
result = LoadStepper(ply, held, steps=5).run()

# %%
# The sag of a chain of this length: 2a sinh(s/2a) is its length over the span s.

span = LENGTH - NEARER
a = brentq(lambda a: 2 * a * np.sinh(span / (2 * a)) - LENGTH, 10.0, 1000.0)
exact = a * (np.cosh(span / (2 * a)) - 1)
sag = -ply.nodal(result.u)[2].min()
pull = result.states[-1].reactions["right"][0]
print(f"sag {sag:.2f} mm, of a chain {exact:.2f} mm")
print(f"pull {pull:.4f} N, of a chain {WEIGHT * WIDTH * a:.4f} N")
assert abs(sag / exact - 1) < 0.01

# %%
# Plies in space are drawn in perspective, here in the colours of their height.

height = plot.Field(
    "Height (mm)",
    lambda ply, u: ply.nodal(u)[2, : ply.mesh.nvertices][ply.mesh.t].mean(axis=0),
    cmap="cividis",
)
plot.field(result, field=height, titles=["Under its weight"], filename="sheet.png")
