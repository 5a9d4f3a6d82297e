"""
A net on a tool, and the best place to start
============================================

A kinematic net shows in seconds how much a fabric must shear on a tool. On a panel
without symmetry the shear depends on where the first threads cross and on their
direction. The best start is searched for, and the flat pattern is cut.
"""

import matplotlib.pyplot as plt
import numpy as np

from skfem_textile import drape, plot

# %%
# The tool: a panel with a hump that is off its centre, as triangles of 8 mm. For a file
# use ``tool = io.read_surface("panel.stl")``.

x, y = (
    along.ravel()
    for along in np.meshgrid(np.linspace(-150, 150, 39), np.linspace(-100, 100, 26))
)
hump = 70 * np.exp(-(((x - 40) / 80) ** 2) - ((y - 10) / 55) ** 2)
k = np.add.outer(39 * np.arange(25), np.arange(38)).ravel()
triangles = np.hstack([[k, k + 1, k + 40], [k, k + 40, k + 39]])
tool = drape.TriangleMesh(np.array([x, y, hump]), triangles)
(outline,) = tool.facets.boundary()

# %%
# The net from the top of the hump, with the warp along x.

CELL = 10.0
top = tool.facets.points[:, hump.argmax()]
net = drape.net(tool, CELL, point=top)
part = drape.trimmed(net, outline)


def largest(part):
    """Largest shear angle of a part in degrees."""
    return np.degrees(np.nanmax(np.abs(part.shear_angle())))


print(f"from the top: shear of at most {largest(part):.1f}°")

# %%
# The start with the smallest largest shear angle over the panel. All starts of the
# search are kept.

best = drape.best_start(tool, CELL, trials=64)
best_part = drape.trimmed(best.net, outline)
print(f"from the best start: at most {largest(best_part):.1f}°")
assert largest(best_part) < largest(part)

# %%
# Both nets on the tool. Cells that shear by more than 30° are marked.

plot.net_on_tool(net, tool, np.radians(30), filename="from_top.png")
plot.net_on_tool(best.net, tool, np.radians(30), filename="from_best.png")

# %%
# Places of all starts, with the largest shear angle of the net.

plot.starts(best, tool, "starts.png")

# %%
# The flat patterns.

plt.rcParams["font.size"] = 8
figure, axes = plt.subplots(figsize=(3.35, 2.6), layout="constrained")
for one, label in ((part, "from the top"), (best_part, "from the best start")):
    rim = one.pattern.outline - one.pattern.outline.mean(axis=1, keepdims=True)
    axes.plot(*rim[:, [*range(rim.shape[1]), 0]], label=label)
axes.legend(loc="center")
axes.set_aspect("equal")
axes.set_axis_off()
figure.savefig("patterns.png", dpi=300)

# %%
# The equivalent command, which also writes the pattern for the cutter and the fibres:
#
# .. code-block:: sh
#
#    skfem-textile net --tool panel.stl --cell 10 --best largest --out DIR

# sphinx_gallery_thumbnail_number = 1
