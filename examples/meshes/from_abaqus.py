"""
From an Abaqus deck to a figure
===============================

Mesh, fibre directions and fabric come from one deck: a ply of 50 × 100 mm with fibres
along a reference curve, and test data of its fabric. The deck is read and plotted, the
ply is stretched, and the deformed fibres are exported.
"""

from pathlib import Path
from tempfile import mkdtemp

from skfem_textile import Condition, LoadStepper, Ply, plot
from skfem_textile.fabric.directions import directions_warning
from skfem_textile.io import read_directions, read_fabric, read_mesh, write_draped

# %%
# ``read_fabric`` also returns the material data that it ignores.

deck = Path(__file__).with_name("cloth.inp")
mesh, directions = read_mesh(deck), read_directions(deck)
fabric, ignored, _ = read_fabric(deck)
print(*(f"not represented exactly: {sentence}" for sentence in ignored), sep="\n")

# %%
# Plot the fibres before a run. ``directions_warning`` detects directions that merely
# follow the node numbering.

assert directions_warning(mesh, directions) == ""
plot.mesh_and_fibres(mesh, directions, "mesh_and_fibres.png")

# %%
# The deck defines the edge names. The top moves up by 12 mm.

ply = Ply(mesh, directions.on(fabric))
pull = {"bottom": Condition("bottom"), "top": Condition("top", (0.0, 12.0))}
result = LoadStepper(ply, pull, steps=6).run()
print(f"load {result.states[-1].reactions['top'][1]:.2f} N")

plot.shear_angle(result, titles=["Pulled by 12 mm"], filename="shear_angle.png")

# %%
# Export the deformed fibres: ``fibres.vtu``, ``fibres.csv`` and ``fibres.inp``.

folder = Path(mkdtemp())
write_draped(result, folder)
warp, weft = read_directions(folder / "fibres.inp").angles_deg()
sheared = 90 - (weft - warp)
print(f"shear angle of the elements up to {sheared.max():.1f}°")
assert 20 < sheared.max() < 60

# sphinx_gallery_thumbnail_number = 2
