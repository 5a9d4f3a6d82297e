"""
Draping a tool from an STL file
===============================

An STL file contains a dome with a fillet. A ply is draped over it, with the warp at 30°
to the side of the blank. The results are the shear angle, the fibres on the tool, and
the flat pattern. The same run is available on the command line.
"""

from pathlib import Path
from tempfile import mkdtemp

import matplotlib.pyplot as plt
import meshio
import numpy as np

from skfem_textile import Fabric, drape, io, plot, scenes

# %%
# The tool: a sphere of radius 50 mm down to a slope of 45°, and a fillet of radius
# 20 mm to a plane. To use another tool, replace ``tool.stl``; its triangles must be in
# mm and well shaped.

DOME, FILLET, STEEPEST = 50.0, 20.0, np.radians(45)
FOOT = (DOME + FILLET) * np.sin(STEEPEST)
TOP = (DOME + FILLET) * (1 - np.cos(STEEPEST))


def height(r):
    """Height in mm of the tool above its plane at a distance from its axis."""
    dome = TOP - DOME + np.sqrt(np.maximum(DOME**2 - r**2, 0))
    fillet = FILLET - np.sqrt(FILLET**2 - np.clip(FOOT - r, 0, FILLET) ** 2)
    return np.where(r < DOME * np.sin(STEEPEST), dome, fillet)


n = 55
x, y = (along.ravel() for along in np.meshgrid(*2 * [np.linspace(-110, 110, n + 1)]))
points = np.column_stack([x, y, height(np.hypot(x, y))])
k = np.add.outer((n + 1) * np.arange(n), np.arange(n)).ravel()
corners = np.vstack([np.c_[k, k + 1, k + n + 2], np.c_[k, k + n + 2, k + n + 1]])
folder = Path(mkdtemp())
file = folder / "tool.stl"
meshio.write_points_cells(file, points, [("triangle", corners)])

# %%
# The ply: its centre touches the tool at the highest point. The tension on its edges,
# along the fibres, is 2 N/mm, and the fibres have bending stiffness.

scene = scenes.drape(
    io.read_surface(file),
    fibres=np.radians(30),
    width=180.0,
    height=180.0,
    tension=2.0,
    size=(32, 32),
)
fabric = Fabric(1e4, 0.1, scene.warp, scene.weft, bending=(5.0, 5.0))
result = scenes.Case(scene=scene, fabric=fabric, steps=1).run()
ply, u = result.ply, result.u
print(result)

# %%
# Shear angle and contact pressure. Where the pressure is negative, the ply bridges the
# fillet.

plot.draped(result, filename="draped.png")
plot.fibre_directions(result, filename="fibres.png")

# %%
# The part is trimmed along a circle of radius 80 mm on the plane. Because the dome
# draws in fabric, the pattern is larger than the circle. The trimming curve is in the
# axes of the file; the ply is transformed to these axes.

t = np.linspace(0, 2 * np.pi, 180, endpoint=False)
curve = np.array([80 * np.cos(t), 80 * np.sin(t), 0 * t])
sheet = drape.Sheet.of_ply(ply, u, scene.axes)
pattern = drape.flat_pattern(sheet, curve)
print(f"cut area: {pattern.area:.0f} mm², cut length: {pattern.length:.0f} mm")
assert pattern.area > np.pi * 80**2
io.write_pattern(folder / "pattern.svg", pattern)
np.savetxt(folder / "trim.csv", curve.T, delimiter=",", header="x,y,z", comments="")
print("tool.stl, trim.csv and pattern.svg written to", folder)

# %%
# The part from above, and its flat pattern. Lines are warp (blue) and weft (green)
# fibres: along the warp the transverse coordinate in the flat ply is constant.

a, b, c, d = ply.mesh.t
triangles = np.hstack([[a, b, c], [a, c, d]]).T
angle = np.degrees(np.tile(ply.shear_angle(u, ply.centre)[:, 0], 2))
across = np.array([scene.weft, scene.warp]) @ sheet.flat

plt.rcParams["font.size"] = 8
figure, both = plt.subplots(1, 2, figsize=(6.85, 3.5), layout="constrained")
for axes, (x, y), outline, title in (
    (both[0], sheet.positions[:2], pattern.on_tool, "On the tool, from above"),
    (both[1], sheet.flat, pattern.outline, "Flat pattern"),
):
    shear = axes.tripcolor(
        x, y, triangles, facecolors=angle, cmap="RdBu_r", vmin=-20, vmax=20
    )
    lines = [
        axes.tricontour(x, y, triangles, s, np.arange(-120, 121, 6), linewidths=0.4)
        for s in across
    ]
    for line, colour in zip(lines, ("#0072B2", "#1B7837"), strict=True):
        line.set(edgecolor=colour)
    (rim,) = axes.fill(*outline[:2], fill=False, linewidth=1.0)
    for drawn in (shear, *lines):
        drawn.set_clip_path(rim)
    axes.set(title=title, aspect="equal", xlim=(-88, 88), ylim=(-88, 88))
    axes.set_axis_off()
figure.colorbar(shear, ax=both, label="Shear angle (°)", shrink=0.7)
figure.savefig("pattern.png", dpi=300)

# %%
# The equivalent command with the two files:
#
# .. code-block:: sh
#
#    python -m skfem_textile run drape --tool tool.stl --trim trim.csv --fibres 30 \
#        --width 180 --height 180 --tension 2 --size 32x32 --steps 1 \
#        --set bending.warp_N_mm=5 bending.weft_N_mm=5 --out DIR
#
# ``DIR`` then contains the figures, ``pattern.svg``, the fibres of each element in
# ``fibres.csv``, and fields for ParaView. ``--part-mesh`` maps the fibres to a mesh of
# the part.

# sphinx_gallery_thumbnail_number = 3
