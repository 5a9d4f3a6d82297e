"""Write the input files of a part: raw tests, an outline, tools and the part's mesh."""

import sys
from pathlib import Path

import ezdxf
import meshio
import numpy as np

from skfem_textile import Locking
from skfem_textile.calibration import PictureFrame

# Distance between punch and die, gap of the holder, and travel of the punch, in mm.
CLEARANCE, GAP, TRAVEL = 3.0, 0.3, 30.0


def bump(x, y, a, b, power=2):
    """Height from 1 in the middle to 0, with half-axes a and b in mm."""
    return np.exp(-((x / a) ** power) - (y / b) ** power)


def hood(x, y):
    """A hood with a scoop."""
    return 0.7 * bump(x, y, 80, 55) + 0.35 * bump(x - 20, y, 24, 18)


def helmet(x, y):
    """A shell, open in the middle."""
    return bump(x, y, 62, 50)


def box(x, y):
    """A box of two levels with fillets."""
    return 0.7 * bump(x, y, 68, 48, 4) + 0.35 * bump(x - 18, y, 34, 30, 4)


PARTS = {"hood": hood, "helmet": helmet, "box": box}


def grid(half, n, height):
    """Points and quadrilaterals over a rectangle of half the given sides."""
    x, y = (a.ravel() for a in np.meshgrid(*(np.linspace(-h, h, n + 1) for h in half)))
    k = np.add.outer((n + 1) * np.arange(n), np.arange(n)).ravel()
    corners = np.column_stack([k, k + 1, k + n + 2, k + n + 1])
    return np.column_stack([x, y, height(x, y)]), corners


def triangles(file, points, corners):
    """Write a tool as STL."""
    both = np.vstack([corners[:, [0, 1, 2]], corners[:, [0, 2, 3]]])
    meshio.write_points_cells(file, points, [("triangle", both)])


def surfaces(name):
    """Heights of the die, its flange at z = 0, and of the punch at the end."""
    top = float(PARTS[name](*np.mgrid[-120:121.0, -90:91.0]).max())
    scale = (TRAVEL + CLEARANCE) / top

    def die(x, y):
        return scale * PARTS[name](x, y)

    def punch(x, y, h=0.1):
        slopes = die(x + h, y) - die(x - h, y), die(x, y + h) - die(x, y - h)
        slope = np.hypot(*slopes) / (2 * h)
        return die(x, y) - CLEARANCE * np.sqrt(1 + slope**2) - GAP

    return die, punch


def tools(folder, die, punch):
    """Write die and punch, which begins below the ply."""
    triangles(folder / "die.stl", *grid((130, 100), 80, die))
    begin = grid((110, 85), 70, lambda x, y: punch(x, y) - TRAVEL)
    triangles(folder / "punch.stl", *begin)


def tests(folder, rng):
    """Write a picture frame, as machines export it, and a table of cantilevers."""
    law, frame = Locking(0.08, np.radians(70.0)), PictureFrame(frame=200, fabric=160)
    angle = np.radians(np.linspace(0.0, 50.0, 120))
    force = frame.force(law, angle)
    force = force + 0.01 * force.max() * rng.standard_normal(force.size)
    rows = zip(frame.displacement(angle), force / 1e3, strict=True)
    lines = [f"{a:.4f};{b:.7f}".replace(".", ",") for a, b in rows]
    head = ["Sample;one", "Operator;", "", "Extension;Load", "(mm);(kN)"]
    text = "\r\n".join([*head, *lines])
    (folder / "frame.txt").write_text(text, encoding="cp1252")
    for family, length in ("warp", 188.0), ("weft", 175.0):
        readings = length * (1 + 0.01 * rng.standard_normal(6))
        rows = [f"{one:.1f},41.5" for one in readings]
        head = "overhang (mm),chord angle (deg)"
        (folder / f"droop_{family}.csv").write_text("\n".join([head, *rows]))


def outline(folder, hole):
    """Write the outline of the ply, with rounded corners and possibly a hole."""
    drawing = ezdxf.new("R2000", units=4)
    space = drawing.modelspace()
    for name in ("CUT", "FRAME"):
        drawing.layers.add(name)
    corners = [(0, 20), (20, 0), (220, 0), (240, 30), (240, 180), (30, 190), (0, 160)]
    space.add_lwpolyline(corners, close=True, dxfattribs={"layer": "CUT"})
    if hole:
        space.add_circle((120, 95), 14, dxfattribs={"layer": "CUT"})
    drawing.saveas(folder / "ply.dxf")


# Habits of exporters: first numbers and steps of nodes and elements, type of element,
# include file of the nodes, and order of the corners.
HABITS = {
    "hood": ((1001, 2), (5001, 3), "S4R", True, [0, 1, 2, 3]),
    "helmet": ((7, 1), (100001, 1), "S8R", False, [0, 1, 2, 3]),
    "box": ((20000, 5), (1, 10), "S4", False, [3, 2, 1, 0]),
}

# Material of a family of fibres, and a frequency analysis of the free part.
END = """*MATERIAL, NAME=PREPREG
*ELASTIC, TYPE=LAMINA
60000., 9000., 0.3, 4000., 4000., 3000.
*DENSITY
1.6e-9
*SHELL SECTION, ELSET=SKIN, MATERIAL=PREPREG
0.4
*STEP
*FREQUENCY
8
*NODE FILE
U
*END STEP
"""


def part(folder, name, height, n=10):
    """Write the mesh of the part as an exporter does."""
    (node, node_step), (label, step), kind, include, order = HABITS[name]
    points, quads = grid((55.0, 40.0), n, height)
    middle = points[quads].mean(axis=1)
    if name == "helmet":  # open in the middle
        quads = quads[np.hypot(middle[:, 0], middle[:, 1]) > 24]
    quads = quads[:, order]
    if kind == "S8R":
        edges = np.sort(np.stack([quads, np.roll(quads, -1, axis=1)], axis=-1), axis=-1)
        pairs, number = np.unique(edges.reshape(-1, 2), axis=0, return_inverse=True)
        x, y, _ = points[pairs].mean(axis=1).T
        points = np.vstack([points, np.column_stack([x, y, height(x, y)])])
        quads = np.hstack([quads, (n + 1) ** 2 + number.reshape(quads.shape)])
    used = np.unique(quads)
    nodes = ["*NODE, NSET=ALL"]
    nodes += [
        f"{node + node_step * i}, {', '.join(f'{x:.6f}' for x in points[i])}"
        for i in used
    ]
    lines = ["*HEADING", name]
    if include:
        (folder / "nodes.inc").write_text("\n".join([*nodes, ""]))
        nodes = ["*INCLUDE, INPUT=nodes.inc"]
    lines += [*nodes, f"*ELEMENT, TYPE={kind}, ELSET=SKIN"]
    for i, corners in enumerate(node + node_step * quads):
        lines.append(", ".join(map(str, [label + step * i, *corners])))
    (folder / "part.inp").write_text("\n".join([*lines, END]))


def write(name, folder, seed=1):
    """Write all files of a part."""
    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    die, punch = surfaces(name)
    tests(folder, np.random.default_rng(seed))
    outline(folder, name == "helmet")
    part(folder, name, punch)
    tools(folder, die, punch)


if __name__ == "__main__":
    write(*sys.argv[1:3])
