"""
Draping a double dome at ±45°
=============================

Two fabrics are draped over a double dome with fibres at 45° to its long side. The first
has a low shear stiffness, and its edges are pulled along the fibres. The second locks
at a shear angle of 15°, and its edges are free.
"""

import numpy as np
import pyvista as pv

from skfem_textile import Fabric, Locking, drape, plot
from skfem_textile.scenes import Case, double_dome

FIBRES = np.radians(45)

# %%
# Tool and fibres have two planes of symmetry; a quarter is computed. The ply is draped
# from its kinematic net. The edge tension is 2 N/mm.

pulled = double_dome(fibres=FIBRES, tension=2.0, size=(24, 14))
fabric = Fabric(1e4, 0.1, pulled.warp, pulled.weft)
soft = Case(scene=pulled, fabric=fabric, steps=4)

# %%
# Free edges, and a locking fabric. Its fibres have a small bending stiffness.

free = double_dome(fibres=FIBRES, tension=0.0, size=(24, 14))
law = Locking(0.1, np.radians(15))
locking = Fabric(1e4, law, free.warp, free.weft, bending=(1.0, 1.0))
hard = Case(scene=free, fabric=locking, steps=4)

results, risks = [case.run() for case in (soft, hard)], []
for result in results:
    angle = np.degrees(np.abs(result.ply.shear_angle(result.u)).max())
    risk = drape.wrinkle_risk(result.ply, result.u, result.states[-1].parameters)
    print(f"shear angle up to {angle:.1f}°, {risk.sum()} elements at risk of wrinkles")
    risks.append(risk)

# %%
# The locking fabric is compressed along its fibres. If the compression exceeds the
# shear stiffness, fibres can buckle in the plane of the ply. Negative contact pressure
# (blue) means that the ply bridges the hollow.

assert not risks[0].any()
assert risks[1].any()
for result, title in zip(results, ("edges pulled", "locks at 15°"), strict=True):
    plot.draped(result, titles=[title], filename=f"{title.split()[0]}.png")

# %%
# Forming of the first fabric.

plot.animation(results[0], "forming.gif")

# %%
# The complete first ply on its tool. Lines are fibres: along the warp (white) the
# transverse coordinate in the flat ply is constant, likewise along the weft (black).
# The planes of symmetry mirror the quarter, and exchange warp and weft.

ply, u = results[0].ply, results[0].u
vertices = ply.mesh.nvertices
flat = ply.nodes[:, :vertices]
draped = np.vstack([flat, 0 * flat[:1]]) + ply.nodal(u)[:, :vertices]
quads = np.insert(ply.mesh.t, 0, 4, axis=0).T
shear = np.degrees(ply.shear_angle(u).mean(axis=1))

plotter = pv.Plotter(off_screen=True, window_size=(2000, 960), lighting="none")
plotter.set_background("white")
steel = {"color": "#c4c9d1", "ambient": 0.3, "diffuse": 0.8}
x, y = np.meshgrid(np.linspace(-275, 275, 276), np.linspace(-150, 150, 151))
z = drape.double_dome().height(x, y).h - 0.8  # mm, just below the ply
plotter.add_mesh(pv.StructuredGrid(x, y, z), smooth_shading=True, **steel)
plotter.add_mesh(pv.Box((-275, 275, -150, 150, -85, -61)), **steel)
for sides in ((1, 1), (1, -1), (-1, 1), (-1, -1)):
    mirrored = np.array([*sides, 1])[:, None] * draped
    quarter = pv.PolyData(mirrored.T, quads.ravel())
    quarter["shear"] = shear
    quarter = quarter.cell_data_to_point_data()
    actor = plotter.add_mesh(
        quarter,
        scalars="shear",
        clim=(-30, 30),
        cmap=plot.FIELDS["shear_angle"].cmap,
        smooth_shading=True,
        ambient=0.5,
        diffuse=0.6,
        show_scalar_bar=False,
    )
    for (a, b), colour in ((pulled.warp, "white"), (pulled.weft, "#15202b")):
        quarter["across"] = np.array([-b, a]) @ (np.array(sides)[:, None] * flat)
        fibres = quarter.contour(np.arange(-256, 257, 8), scalars="across")
        plotter.add_mesh(fibres.strip().tube(radius=0.6), color=colour, ambient=0.4)
for position, intensity in (((-600, -150, 350), 0.9), ((500, -800, 300), 0.5)):
    light = pv.Light(position=position, focal_point=(0, 0, -40), intensity=intensity)
    plotter.add_light(light)
plotter.camera_position = [(-400, -720, 420), (3, 0, -101), (0, 0, 1)]
plotter.camera.zoom(1.48)
plotter.enable_anti_aliasing("ssaa")
plotter.add_scalar_bar(
    "Shear angle (°)",
    mapper=actor.mapper,
    n_labels=5,
    fmt="%.0f",
    position_x=0.61,
    position_y=0.03,
    width=0.36,
    height=0.11,
    title_font_size=46,
    label_font_size=44,
    color="black",
)
plotter.screenshot("double_dome.png")

# sphinx_gallery_thumbnail_number = -1
