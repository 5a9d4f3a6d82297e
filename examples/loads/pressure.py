"""
Load across a ply with fixed edges
==================================

A square of crimped fabric with fixed edges is loaded by pressure from below. The flat
initial state has no out-of-plane stiffness. The ply bulges until its tensions balance
the pressure. The reaction equals the total load. The load is dead: its direction and
its magnitude per initial area are constant.
"""

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.colors import CenteredNorm
from mpl_toolkits.mplot3d.art3d import Poly3DCollection
from skfem import MeshQuad

from skfem_textile import BodyForce, Condition, CrimpToe, Fabric, LoadStepper, Ply, plot

SIDE, PRESSURE = 100.0, 0.02  # mm, N/mm²

# %%
# Fibres straighten at 2 % strain.

mesh = MeshQuad.init_tensor(*2 * [np.linspace(0, SIDE, 13)]).with_defaults()
fabric = Fabric(CrimpToe(1e4, toe=0.02, initial_stiffness=10.0), 0.5)
pressure = BodyForce((0.0, 0.0, PRESSURE))
ply = Ply(mesh, fabric, terms=[pressure], dimension=3)


def rim(X):
    """Return True for points on the edge of the square."""
    return np.any((X == 0) | (X == SIDE), axis=0)


result = LoadStepper(ply, {"rim": Condition(rim)}, steps=4).run()

# %%
# The bulge, and the reaction of the supports.

carried = -result.states[-1].reactions["rim"][2]
print(f"bulge {ply.nodal(result.u)[2].max():.2f} mm")
print(f"reaction {carried:.3f} N, total load {PRESSURE * SIDE**2:.3f} N")
assert abs(carried / (PRESSURE * SIDE**2) - 1) < 1e-6

# %%
# The warp tension is largest at the centre of the ply, and zero along the edges
# parallel to the warp. Heights are scaled by five.

points = ply.positions(result.u)
points[2] *= 5
tension = ply.fibre_tension(result.u, result.states[-1].parameters)[0].mean(axis=1)

plt.rcParams["font.size"] = 8
figure = plt.figure(figsize=(3.35, 2.4), layout="constrained")
axes = figure.add_subplot(projection="3d", proj_type="ortho")
faces = Poly3DCollection(
    points.T[ply.mesh.t.T],
    array=tension,
    cmap=plot.FIELDS["warp_tension"].cmap,
    norm=CenteredNorm(),
    edgecolor="k",
    linewidth=0.1,
    clip_on=False,
)
axes.add_collection(faces)
axes.set(xlim=(0, SIDE), ylim=(0, SIDE), zlim=(0, 25))
axes.set_box_aspect((4, 4, 1), zoom=1.4)
axes.view_init(elev=28, azim=-60)
axes.set_axis_off()
label = "Warp tension (N/mm)"
of = {"location": "bottom", "shrink": 0.8, "aspect": 30, "pad": 0}
scale = figure.colorbar(faces, label=label, **of)
scale.ax.set_xlim(0, tension.max())
figure.savefig("bulge.png", dpi=300)
