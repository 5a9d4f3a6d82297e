"""Texts of meshes, fabrics and tools as other programs write them."""

import re
import struct
from collections import deque

import meshio
import numpy as np

from skfem_textile import CrimpInterchange, Fabric, Locking
from tests.helpers.tool_shapes import bonnet

# A mesh of 2 × 2 quadrilaterals, and a part of an assembly of Abaqus with it


XY = [(10.0 * i, 10.0 * j) for j in range(3) for i in range(3)]
CELLS = [(1, 2, 5, 4), (2, 3, 6, 5), (4, 5, 8, 7), (5, 6, 9, 8)]
NODES = [f"{i}, {x}, {y}, 0." for i, (x, y) in enumerate(XY, 1)]
PLY = [
    "*Element, type=S4R, elset=E1",
    *(f"{i}, {', '.join(map(str, q))}" for i, q in enumerate(CELLS, 1)),
]
PART = ["*Part, name=P", "*Node", *NODES, *PLY, "*End Part", "*Assembly, name=A"]


def mesh_deck(folder, *lines):
    """A file of Abaqus."""
    path = folder / "m.inp"
    path.write_text("\n".join(["*Heading", *lines, ""]))
    return path


def keyword_blocks(content):
    """Keyword, parameters by name, and rows of words of each block of a deck."""
    lines = re.split(r"\r\n|[\r\n]", content.decode(errors="replace"))
    lines = deque(x for x in map(str.strip, lines) if x and not x.startswith("**"))
    while lines:
        head, rows = lines.popleft(), []
        while head.endswith(",") and lines:
            head += lines.popleft()
        while lines and not lines[0].startswith("*"):
            rows.append([word.strip() for word in lines.popleft().split(",")])
        keyword, *parameters = head[1:].split(",")
        given = {}
        for parameter in filter(str.strip, parameters):
            key, _, value = (part.strip() for part in parameter.partition("="))
            given[key.upper()] = value
        yield " ".join(keyword.upper().split()), given, rows


def sets(quad="S4R", triangle="S3"):
    """Three quadrilaterals and two triangles, with sets of nodes and elements."""
    nodes = "\n".join(f"{i}, {x / 10}, {y / 10}" for i, (x, y) in enumerate(XY, 1))
    return f"""*HEADING
*NODE, NSET=all
{nodes}
*ELEMENT, TYPE={quad}
1, 1, 2, 5, 4
2, 2, 3, 6, 5
3, 4, 5, 8, 7
*ELEMENT, TYPE={triangle}, ELSET=upper
4, 5, 6, 9
5, 5, 9, 8
*NSET, NSET=bottom
1, 2, 3
*NSET, NSET=point
5
*NSET, NSET=both
3, 6, 5
*NSET, NSET=row, GENERATE
4, 6, 1
*ELSET, ELSET=mixed
1, 4
"""


# Two squares beside one another, also as triangles


POINTS = np.array([[0, 0, 0], [1, 0, 0], [2, 0, 0], [0, 1, 0], [1, 1, 0], [2, 1, 0.0]])
QUADS = np.array([[0, 1, 4, 3], [1, 2, 5, 4]])
TRIANGLES = np.array([[0, 1, 4], [0, 4, 3], [1, 2, 5], [1, 5, 4]])


def with_lines(path, points, kind, cells, lines):
    """A file of Gmsh in which these lines are the boundary ``clamp``."""
    tags = [[3] * len(cells), [1] * len(lines)]
    meshio.Mesh(
        points,
        [(kind, cells), ("line", lines)],
        cell_data={"gmsh:physical": tags, "gmsh:geometrical": tags},
        field_data={"clamp": np.array([1, 1]), "ply": np.array([3, 2])},
    ).write(path, file_format="gmsh22")
    return path


# Directions and fabrics


DIRECTIONS = """*NODE
1, 0., 0., 0.
2, 10., 0., 0.
3, 10., 10., 0.
4, 0., 10., 0.
5, 20., 0., 0.
6, 20., 10., 0.
*ELEMENT, TYPE=M3D4R, ELSET=PLY
11, 1, 2, 3, 4
7, 2, 5, 6, 3
*ELSET, ELSET=LAST
7,
"""

FABRIC = """*MATERIAL, NAME=CLOTH
*FABRIC
*UNIAXIAL, COMPONENT=1
*LOADING DATA, DIRECTION=TENSION, EXTRAPOLATION=LINEAR
0., 0.
10., 0.01
200., 0.03
*LOADING DATA, DIRECTION=COMPRESSION, EXTRAPOLATION=LINEAR
0., 0.
1., 0.1
*UNIAXIAL, COMPONENT=2
*LOADING DATA, EXTRAPOLATION=LINEAR
0., 0.
400., 0.02
*UNIAXIAL, COMPONENT=SHEAR
*LOADING DATA, EXTRAPOLATION=LINEAR
0., 0.
0.1, 0.5
1., 0.9
"""

WEAVE = Fabric(CrimpInterchange(1e4, (0.01, 0.02), 1.0, 1e-3, 1.0), Locking(0.5, 1))


def card(*fields):
    """A line of numbers, at first columns of ten characters; integers take one."""
    line = " " * 100
    for first, value in fields:
        end = 10 * (first + 2 - isinstance(value, int))
        word = str(value).rjust(end - 10 * first)
        line = line[: 10 * first] + word + line[end:]
    return line.rstrip()


LAW58 = [
    *("/MAT/LAW58/7/1", "cloth", card((0, 1e-9))),
    card((0, 1000.0), (2, 50.0), (4, 800.0), (8, 0.01)),
    card((0, 0.5), (2, 5.0), (4, 45.0)),
    card((0, 0.05)),
    card((0, 1), (1, 1), (2, 0.05), (4, 0.04)),
]


def radioss(*lines):
    """Text of OpenRadioss."""
    return "\n".join(["#RADIOSS STARTER", *lines, "/END"])


# A tool as STL


X, T = bonnet(length=200.0, width=150.0, crown=30.0)


def ascii_solid(x, t, name="part"):
    """A solid as text."""
    lines = [f"solid {name}"]
    for corners in x[:, t].transpose(2, 1, 0):
        lines += ["facet normal 0 0 0", " outer loop"]
        lines += [f"  vertex {a:.9e} {b:.9e} {c:.9e}" for a, b, c in corners]
        lines += [" endloop", "endfacet"]
    return "\n".join([*lines, f"endsolid {name}", ""]).encode()


def binary_solid(x, t, header=b"made by CAD"):
    """A solid as bytes."""
    rows = np.zeros(
        t.shape[1], dtype=[("normal", "<f4", 3), ("x", "<f4", (3, 3)), ("mark", "<u2")]
    )
    rows["x"] = x[:, t].transpose(2, 1, 0)
    return header.ljust(80) + struct.pack("<I", t.shape[1]) + rows.tobytes()
