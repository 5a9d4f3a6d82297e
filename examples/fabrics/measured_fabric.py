"""
A fabric from a laboratory
==========================

A table of a shear test makes a fabric. It is easy to shear up to 30°, and then the
moment rises steeply. A bias-extension test of the fabric shows the same rise in its
force.
"""

from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

from skfem_textile import Fabric, LoadStepper, Ply, Tabulated, plot
from skfem_textile.scenes import bias_extension, picture_frame

# %%
# The table has a header that names columns and units. Between its points the law is
# smooth; ``odd`` continues it to negative angles.

table = Path(__file__).with_name("shear.csv")
print(table.read_text())
shear = Tabulated.from_csv(table, odd=True)

plt.rcParams["font.size"] = 8
figure, axes = plt.subplots(figsize=(3.35, 2.2), layout="constrained")
plot.plot_law(shear, axes, of="shear")
figure.savefig("law.png", dpi=300)

# %%
# In a picture frame the moment is that of the table.

frame = picture_frame(size=(2, 2), shear_angle=np.radians(40.0))
ply = Ply(frame.mesh, Fabric(1e5, shear, frame.warp, frame.weft))
result = LoadStepper(ply, frame.conditions, steps=4).run()
moments = shear.value(ply.shear_angle(result.u))
print(f"moment at 40°: {moments.mean():.4f} N mm/mm²")
assert np.allclose(moments, 0.120, rtol=1e-4)

# %%
# The bias-extension test, and the load that the table predicts for fibres that do not
# stretch. At its end the load is a little lower: these fibres stretch, and the mesh
# smears the borders of the zones.

scene = bias_extension(size=(8, 16), shear_angle=np.radians(38.0))
ply = Ply(scene.mesh, Fabric(1e5, shear, scene.warp, scene.weft))
result = LoadStepper(ply, scene.conditions, steps=12).run()
factors = [state.load_factor for state in result.states[1:]]
elongation = [scene.driven_displacement(state)[1] for state in result.states[1:]]
found = [scene.reaction(state)[1] for state in result.states[1:]]
exact = [scene.load(shear, factor) for factor in factors]
plot.curves(
    {"": {"Ply": (elongation, found), "Inextensible fibres": (elongation, exact)}},
    "Elongation (mm)",
    "Load (N)",
    filename="load.png",
)
print(f"load {found[-1]:.1f} N, of inextensible fibres {exact[-1]:.1f} N")

# %%

plot.shear_angle(
    result, titles=["Sheared by 38°"], clim=(0, 40), filename="shear_angle.png"
)

# sphinx_gallery_thumbnail_number = 3
