"""
Fabric from a measured shear curve
==================================

The shear law interpolates a measured table. The moment is small up to 30°, then rises
steeply. The load of a bias-extension test rises in the same way.
"""

from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

from skfem_textile import Fabric, LoadStepper, Ply, Tabulated, plot
from skfem_textile.scenes import bias_extension, picture_frame

# %%
# The header of the table specifies columns and units. The law is smooth between the
# points; ``odd`` extends it to negative angles.

table = Path(__file__).with_name("shear.csv")
print(table.read_text())
shear = Tabulated.from_csv(table, odd=True)

plt.rcParams["font.size"] = 8
figure, axes = plt.subplots(figsize=(3.35, 2.2), layout="constrained")
plot.plot_law(shear, axes, of="shear")
figure.savefig("law.png", dpi=300)

# %%
# The moment in a picture frame equals the tabulated one.

frame = picture_frame(size=(2, 2), shear_angle=np.radians(40.0))
ply = Ply(frame.mesh, Fabric(1e5, shear, frame.warp, frame.weft))
result = LoadStepper(ply, frame.conditions, steps=4).run()
moments = shear.value(ply.shear_angle(result.u))
print(f"moment at 40°: {moments.mean():.4f} N mm/mm²")
assert np.allclose(moments, 0.120, rtol=1e-4)

# %%
# The bias-extension test, and the load from the table for inextensible fibres. The
# final load is slightly lower: the fibres stretch, and the mesh smears the zone
# boundaries.

scene = bias_extension(size=(8, 16), shear_angle=np.radians(38.0))
ply = Ply(scene.mesh, Fabric(1e5, shear, scene.warp, scene.weft))
result = LoadStepper(ply, scene.conditions, steps=12).run()
factors = [state.load_factor for state in result.states[1:]]
elongation = [scene.driven_displacement(state)[1] for state in result.states[1:]]
loads = [scene.reaction(state)[1] for state in result.states[1:]]
exact = [scene.load(shear, factor) for factor in factors]
plot.curves(
    {"": {"Ply": (elongation, loads), "Inextensible fibres": (elongation, exact)}},
    "Elongation (mm)",
    "Load (N)",
    filename="load.png",
)
print(f"load: {loads[-1]:.1f} N, with inextensible fibres: {exact[-1]:.1f} N")

# %%

plot.shear_angle(
    result, titles=["Sheared by 38°"], clim=(0, 40), filename="shear_angle.png"
)

# sphinx_gallery_thumbnail_number = 3
