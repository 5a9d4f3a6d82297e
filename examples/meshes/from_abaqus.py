"""
From a deck of Abaqus to a figure
=================================

Mesh, fibre directions and fabric come from one deck: a ply of 50 × 100 mm whose fibres
follow a reference curve, and test data of its fabric. It is read, looked at, pulled,
and handed over again.
"""

from pathlib import Path
from tempfile import mkdtemp

from skfem_textile import Condition, LoadStepper, Ply, plot
from skfem_textile.fabric.directions import directions_warning
from skfem_textile.io import read_directions, read_fabric, read_mesh, write_draped

# %%
# What of the material is not taken over is told.

deck = Path(__file__).with_name("cloth.inp")
mesh, directions = read_mesh(deck), read_directions(deck)
fabric, ignored = read_fabric(deck)
print(*(f"not taken over: {sentence}" for sentence in ignored), sep="\n")

# %%
# Look at the fibres before a run. Directions that follow the numbering of nodes by
# accident would be told by ``directions_warning``.

assert directions_warning(mesh, directions) == ""
plot.mesh_and_fibres(mesh, directions, "mesh_and_fibres.png")

# %%
# The deck names the edges. The top is pulled by 12 mm.

ply = Ply(mesh, directions.on(fabric))
pull = {"bottom": Condition("bottom"), "top": Condition("top", (0.0, 12.0))}
result = LoadStepper(ply, pull, steps=6).run()
print(f"load {result.states[-1].reactions['top'][1]:.2f} N")

plot.shear_angle(result, titles=["Pulled by 12 mm"], filename="shear_angle.png")

# %%
# The deformed fibres for another program: ``fibres.vtu``, ``fibres.csv`` and
# ``fibres.inp``.

folder = Path(mkdtemp())
write_draped(result, folder)
warp, weft = read_directions(folder / "fibres.inp").angles_deg()
sheared = 90 - (weft - warp)
print(f"shear angle of the elements up to {sheared.max():.1f}°")
assert 20 < sheared.max() < 60

# sphinx_gallery_thumbnail_number = 2
