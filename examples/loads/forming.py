"""
Forming between punch and die from STL files
============================================

A punch forms a ply through a die, which a holder presses against the flange of the die.
Punch and die are STL files, and both laws of the fabric are measured curves. The
results are the shear angle, the draw-in, sections, and the force of each tool over the
travel, and a report in one page. The same run is available on the command line.
"""

import shutil
import sys
from pathlib import Path
from tempfile import mkdtemp

import meshio
import numpy as np

from skfem_textile import Fabric, Tabulated, contact, io, plot, scenes
from skfem_textile.cli.main import main

# %%
# The punch is an oval dome with walls of 60°. The die is 5 mm wider and has a fillet of
# radius 18 mm at its flange, z = 0. Both are in their initial positions: the top of the
# punch is in the plane of the holder. To use other tools, replace both files; their
# triangles must be in mm and well shaped. They are written into the folder that is the
# argument.

RADIUS, CLEARANCE, FILLET, STEEPEST, WALL = 50.0, 5.0, 18.0, np.radians(60), 20.0
FOOT = (RADIUS + CLEARANCE + FILLET) * np.sin(STEEPEST) + WALL / np.tan(STEEPEST)
DEPTH = (RADIUS + CLEARANCE + FILLET) * (1 - np.cos(STEEPEST)) + WALL
HOLDER_GAP, TRAVEL = 0.3, 50.0


def dome(r, radius):
    """Height in mm relative to the top of a sphere that continues as a cone."""
    edge = radius * np.sin(STEEPEST)
    sphere = np.sqrt(radius**2 - np.minimum(r, edge) ** 2) - radius
    return sphere - np.tan(STEEPEST) * np.maximum(r - edge, 0)


def cavity(r):
    """Height in mm of the die above its flange."""
    fillet = FILLET - np.sqrt(FILLET**2 - np.clip(FOOT - r, 0, FILLET) ** 2)
    wall = DEPTH + dome(r, RADIUS + CLEARANCE)
    return np.where(r < FOOT - FILLET * np.sin(STEEPEST), wall, fillet)


def write(file, height, half, n=64):
    """Write the triangles of a surface over an oval grid of n × n cells."""
    s = np.linspace(-half, half, n + 1)
    x, y = (along.ravel() for along in np.meshgrid(1.3 * s, s))
    points = np.column_stack([x, y, height(np.hypot(x / 1.3, y))])
    k = np.add.outer((n + 1) * np.arange(n), np.arange(n)).ravel()
    corners = np.vstack([np.c_[k, k + 1, k + n + 2], np.c_[k, k + n + 2, k + n + 1]])
    meshio.write_points_cells(file, points, [("triangle", corners)])


folder = Path(sys.argv[1] if sys.argv[1:] else mkdtemp())
write(folder / "punch.stl", lambda r: dome(r, RADIUS) - HOLDER_GAP, 75.0)
write(folder / "die.stl", cavity, 125.0)

# %%
# The fabric: files with the tension in a tensile test and the moment in a picture
# frame. Fibres have a bending stiffness of 5 N·mm.

measured = Path(__file__).parents[1] / "fabrics"
tension = Tabulated.from_csv(measured / "tension.csv", odd=True)
shear = Tabulated.from_csv(measured / "shear.csv", odd=True)

# %%
# The ply lies between die and holder, in the middle of their gap. Tools and fibres are
# symmetric: a quarter is enough. The edges are pulled with 0.2 N/mm.

scene = scenes.forming(
    io.read_surface(folder / "punch.stl"),
    io.read_surface(folder / "die.stl"),
    travel=TRAVEL,
    gap=HOLDER_GAP,
    part="quarter",
    width=264.0,
    height=220.0,
    tension=0.2,
    size=(12, 10),
)
fabric = Fabric(tension, shear, scene.warp, scene.weft, bending=(5.0, 5.0))
case = scenes.Case(scene=scene, fabric=fabric, steps=5)
result = case.run()
print(result)

# %%
# Figures of the last state: force of the punch on the quarter, depth of the ply in the
# die between nodes, draw-in, and areal weight relative to the flat ply.

summary = case.summary(result)
for key in (
    "max_shear_angle_deg",
    "punch_travel_mm",
    "punch_force_N",
    "die_penetration_mm",
    "max_draw_in_mm",
    "max_areal_weight_ratio",
    "wrinkle_risk_share_of_area",
):
    print(f"{key}: {summary[key]:.3g}")
assert result.converged

# %%
# Shear angle, fibres and areal weight, with the tools where they stand. Elements with
# compressed fibres are marked: they may wrinkle. The pictures are also written into the
# folder of the report.

report = folder / "report"
report.mkdir(exist_ok=True)


def draw(picture, name):
    """Draw a picture of the result in both folders."""
    picture(result, filename=report / name)
    shutil.copy(report / name, name)


draw(plot.formed, "formed.png")

# %%
# Sections along x at several load factors.

draw(plot.section, "section.png")

# %%
# Force of each tool over the travel. The forces balance, because the edges are pulled
# in the plane of the flange.

draw(plot.tool_force, "tool_force.png")
punch, die, holder = contact.tool_forces(result).values()
assert np.abs(punch + die + holder).max() < 1e-3
print("punch.stl and die.stl written to", folder)

# %%
# The report: all figures, acceptance checks and pictures in one page, which can be sent
# as it is. It is the page of ``skfem-textile report DIR`` for the results of a run on
# the command line.

io.write_summary(summary, report / "summary.json")
assert main(["report", str(report)]) == 0
assert (report / "report.html").is_file()

# %%
# The same run on the command line, which also writes fields for ParaView with the
# tools:
#
# .. code-block:: sh
#
#    skfem-textile run forming --punch punch.stl --die die.stl --travel 50 \
#        --holder-gap 0.3 --part quarter --width 264 --height 220 --size 12x10 \
#        --tension-law tension.csv --set tension.continuation=odd \
#        --shear-law shear.csv --set shear.continuation=odd \
#        --set bending.warp_N_mm=5 bending.weft_N_mm=5 --out DIR

# sphinx_gallery_thumbnail_number = 1
