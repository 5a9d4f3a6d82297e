"""
A sheet that hangs in space
===========================

With ``dimension=3`` a ply leaves its plane. A sheet hangs under its weight between two
edges, of which one comes nearer by a fifth of the span. Its fibres do not stretch, so
it takes the shape of a chain, the catenary.
"""

import matplotlib.pyplot as plt
import numpy as np
from mpl_toolkits.mplot3d.art3d import Poly3DCollection
from scipy.optimize import brentq
from skfem import MeshQuad

from skfem_textile import BodyForce, Condition, Fabric, LoadStepper, Ply

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
# Pictures of this library show plies in their plane. In space, matplotlib draws nodes
# and elements, here in the first and the last state.

plt.rcParams["font.size"] = 8
figure = plt.figure(figsize=(3.35, 2.2), layout="constrained")
axes = figure.add_subplot(projection="3d", proj_type="ortho")
for state in (result.states[1], result.states[-1]):
    points = np.pad(ply.nodes, ((0, 1), (0, 0))) + ply.nodal(state.u)
    faces = Poly3DCollection(
        points.T[ply.mesh.t.T],
        array=points[2][ply.mesh.t].mean(axis=0),
        cmap="cividis",
        clim=(-30, 0),
        edgecolor="k",
        linewidth=0.1,
        clip_on=False,
    )
    axes.add_collection(faces)
axes.set(xlim=(0, LENGTH), ylim=(0, WIDTH), zlim=(-30, 0))
axes.set_box_aspect((LENGTH, WIDTH, 30), zoom=1.4)
axes.view_init(elev=18, azim=-65)
axes.set_axis_off()
figure.colorbar(
    faces, label="Height (mm)", location="bottom", shrink=0.8, aspect=30, pad=0
)
figure.savefig("sheet.png", dpi=300)
