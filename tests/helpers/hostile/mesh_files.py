"""Small valid meshes, and files of them as Gmsh, Abaqus and VTK write them."""

import base64
import re
import struct
import zlib
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np

NAMES = ("bottom", "two sides", "Ä", "left:1", "ply", "half", "corner", "UPPER", "x_1")


@dataclass
class SoundMesh:
    """Positions, shape (n, 2), cells as their nodes, and named groups.

    ``edges`` are pairs of nodes, ``regions`` numbers of cells, ``nodes`` numbers.
    """

    points: np.ndarray
    cells: list
    edges: dict = field(default_factory=dict)
    regions: dict = field(default_factory=dict)
    nodes: dict = field(default_factory=dict)

    @property
    def kinds(self):
        """Numbers of corners of the cells, ascending, each once."""
        return sorted({len(cell) for cell in self.cells})


def sound_mesh(rng, one_kind=False):
    """A distorted grid of at most 4 by 6 quadrilaterals, some of them cut."""
    n, m = rng.integers(1, 5), rng.integers(1, 7)
    x, y = np.meshgrid(np.arange(n + 1.0), np.arange(m + 1.0), indexing="ij")
    p = np.stack([x.ravel(), y.ravel()], axis=1)
    p += rng.uniform(-0.2, 0.2, p.shape) * rng.integers(0, 2)
    angle, size = rng.uniform(0, 6) * rng.integers(0, 2), 10 ** rng.uniform(0, 3)
    c, s = np.cos(angle), np.sin(angle)
    p = (p @ np.array([[c, s], [-s, c]]) + rng.integers(-5, 5, 2)) * size
    number = np.arange((n + 1) * (m + 1)).reshape(n + 1, m + 1)
    corners = number[:-1, :-1], number[1:, :-1], number[1:, 1:], number[:-1, 1:]
    share = rng.choice([0.0, 1.0] if one_kind else [0.0, 0.0, 0.5, 1.0])
    cells = []
    for a, b, c, d in zip(*(corner.ravel() for corner in corners), strict=True):
        cells += [(a, b, c), (a, c, d)] if rng.random() < share else [(a, b, c, d)]
    turned = 1 - 2 * rng.integers(0, 2)
    order = rng.permutation(len(p)) if rng.integers(0, 2) else np.arange(len(p))
    cells = [order[np.roll(cell[::turned], rng.integers(len(cell)))] for cell in cells]
    cells = [tuple(cell.tolist()) for cell in cells]
    mesh = SoundMesh(p[np.argsort(order)], cells)
    names = [str(name) for name in rng.permutation(NAMES)]
    sides = [order[number[:, 0]], order[number[:, -1]], order[number[0]]]
    chosen = sides[: rng.integers(0, 4)]
    chosen += [np.array(cells[rng.integers(len(cells))])] * rng.integers(0, 2)
    for side in chosen:
        mesh.edges[names.pop()] = list(pairwise(side.tolist()))
    for _ in range(rng.integers(0, 3)):
        members = np.flatnonzero(rng.integers(0, 2, len(cells)))
        mesh.regions[names.pop()] = members.tolist() or [0]
    for _ in range(rng.integers(0, 2)):
        members = rng.choice(len(p), rng.integers(1, 3), replace=False)
        mesh.nodes[names.pop()] = members.tolist()
    return mesh


# -------------------------------------------------------------------------------- Gmsh

# Gmsh's number of a kind of element by its number of nodes.
_OF_GMSH = {1: 15, 2: 1, 3: 2, 4: 3}


def _elements(mesh, rng):
    """The section of names; dimension, nodes and groups of each element."""
    lines, groups, number = [], {}, 0
    for dimension, named in enumerate((mesh.nodes, mesh.edges, mesh.regions)):
        for name, members in named.items():
            number += int(rng.integers(1, 3))
            lines.append(f'{dimension} {number} "{name}"\n')
            for member in members:
                nodes = (member,) if dimension == 0 else member
                nodes = mesh.cells[member] if dimension == 2 else nodes
                groups.setdefault((dimension, nodes), []).append(number)
    elements = [(2, cell, tuple(groups.pop((2, cell), ()))) for cell in mesh.cells]
    elements += [(d, nodes, tuple(names)) for (d, nodes), names in groups.items()]
    text = f"$PhysicalNames\n{len(lines)}\n{''.join(lines)}$EndPhysicalNames\n"
    return text.encode() if lines else b"", sorted(elements, key=lambda e: e[0])


def _tags(mesh, rng):
    """Tags of the nodes: 1, 2, ..., or with gaps in any order."""
    n = len(mesh.points)
    chosen = rng.permutation(2 * n + 3)[:n] if rng.integers(0, 2) else np.arange(n)
    return (chosen + 1).tolist()


def _text(code, *values):
    return " ".join(map(str, values)).encode() + b"\n"


def _packed(code, *values):
    return struct.pack("<" + code, *values)


def _gmsh(version, binary, names, sections):
    byte_order = struct.pack("<i", 1) + b"\n" if binary else b""
    text = f"$MeshFormat\n{version} {int(binary)} 8\n".encode() + byte_order
    text += b"$EndMeshFormat\n" + names
    for name, body in sections.items():
        text += b"$%b\n%b%b$End%b\n" % (name, body, b"\n" * binary, name)
    return text


def gmsh_22(mesh, rng):
    """A file of version 2.2, which repeats an element for each of its groups."""
    binary, tags = bool(rng.integers(0, 2)), _tags(mesh, rng)
    put = _packed if binary else _text
    names, elements = _elements(mesh, rng)
    nodes, cells, number = b"%d\n" % len(tags), b"", 0
    for tag, (x, y) in zip(tags, mesh.points, strict=True):
        nodes += put("i3d", tag, x, y, 0)
    for _, corners, groups in elements:
        for group in groups or (0,):
            number += 1
            kind, members = _OF_GMSH[len(corners)], [tags[node] for node in corners]
            head = (kind, 1, 2, number) if binary else (number, kind, 2)
            row = *head, group, 1, *members
            cells += put(f"{len(row)}i", *row)
    sections = {b"Nodes": nodes, b"Elements": b"%d\n" % number + cells}
    return _gmsh("2.2", binary, names, sections)


def gmsh_41(mesh, rng):
    """A file of version 4.1, its nodes in one block or in two."""
    binary, tags = bool(rng.integers(0, 2)), _tags(mesh, rng)
    put = _packed if binary else _text
    names, elements = _elements(mesh, rng)
    blocks = {}
    for dimension, corners, groups in elements:
        blocks.setdefault((dimension, groups, len(corners)), []).append(corners)
    entities = put("4Q", *(sum(key[0] == d for key in blocks) for d in range(4)))
    total, number = len(elements), 0
    cells = put("4Q", len(blocks), total, 1, total)
    for tag, ((dimension, groups, k), members) in enumerate(blocks.items(), 1):
        box, n = [0.0] * (6 if dimension else 3), len(groups)
        entities += put(f"i{len(box)}dQ{n}i", tag, *box, n, *groups)
        entities += put("Q", 0) if dimension else b""
        cells += put("3iQ", dimension, tag, _OF_GMSH[k], len(members))
        for corners in members:
            number += 1
            cells += put(f"{1 + k}Q", number, *(tags[node] for node in corners))
    n = len(tags)
    cuts = [0, int(rng.integers(1, n)), n] if rng.integers(0, 2) else [0, n]
    nodes = put("4Q", len(cuts) - 1, n, min(tags), max(tags))
    for first, last in pairwise(cuts):
        nodes += put("3iQ", 2, 1, 0, last - first)
        nodes += b"".join(put("Q", tag) for tag in tags[first:last])
        nodes += b"".join(put("3d", x, y, 0.0) for x, y in mesh.points[first:last])
    sections = {b"Entities": entities, b"Nodes": nodes, b"Elements": cells}
    return _gmsh("4.1", binary, names, sections)


# ------------------------------------------------------------------------------ Abaqus

# Types of elements by their number of nodes.
_OF_ABAQUS = {
    2: ("T3D2", "B31"),
    3: ("S3", "CPS3", "M3D3"),
    4: ("S4R", "CPS4", "M3D4R"),
}


def abaqus(mesh, rng):
    """A file of nodes, elements and sets."""
    gap, first = int(rng.integers(1, 4)), int(rng.integers(1, 10))
    z = ", 0." if rng.integers(0, 2) else ""
    tag = [first + gap * i for i in range(len(mesh.points))]
    lines = ["*Heading", " a mesh", "** nodes", "*NODE" + [", NSET=All", ""][gap % 2]]
    lines += [f"{t}, {x}, {y}{z}" for t, (x, y) in zip(tag, mesh.points, strict=True)]
    number, of_cell = 0, {}

    def elements(kind, cells, ending=""):
        nonlocal number
        lines.append(f"*ELEMENT, TYPE={kind}{ending}")
        for i, cell in cells:
            number += 1
            of_cell[i] = number
            lines.append(", ".join(map(str, [number, *(tag[n] for n in cell)])))

    for corners in mesh.kinds:
        kind = str(rng.choice(_OF_ABAQUS[corners]))
        cells = [(i, c) for i, c in enumerate(mesh.cells) if len(c) == corners]
        elements(kind.lower() if gap == 3 else kind, cells)
    sets = [("NSET", name, [tag[i] for i in ids]) for name, ids in mesh.nodes.items()]
    for name, pairs in mesh.edges.items():
        edges = (((), pair) for pair in pairs)
        elements(rng.choice(_OF_ABAQUS[2]), edges, f", ELSET={name.replace(' ', '_')}")
    for name, ids in mesh.regions.items():
        sets.append(("ELSET", name, [of_cell[i] for i in ids]))
    for keyword, name, members in sets:
        head = f"*{keyword}, {keyword}={name.replace(' ', '_')}"
        steps = {b - a for a, b in pairwise(members)}
        if len(steps) == 1 and min(steps) > 0:
            row = f"{members[0]}, {members[-1]}, {min(steps)}"
            lines += [f"{head}, GENERATE", row]
        else:
            rows = [members[i : i + 8] for i in range(0, len(members), 8)]
            lines += [head, *(", ".join(map(str, row)) + "," for row in rows)]
    if rng.integers(0, 3) == 0:
        lines += ["*MATERIAL, NAME=glass", "*ELASTIC", "1000., 0.3"]
    if rng.integers(0, 3) == 0:  # of common exporters
        at = next(i for i, x in enumerate(lines) if x.upper().startswith("*ELEMENT"))
        lines.insert(at - len(mesh.points) // 2, "*NODE")
        lines += ["*NODE", f"{tag[-1] + 9}, 3., 4.{z}", "*NSET, NSET=Ref"]
        lines += [f"{tag[-1] + 9},", "*ELSET, ELSET=some", "1", "*ELSET, ELSET=again"]
        lines += [f"some, {len(mesh.cells)}", "*NSET, NSET=of some, ELSET=again"]
    lower = rng.integers(0, 4) == 0
    lines = [x.lower() if lower and re.match(r"\*(?!.*SET=)", x) else x for x in lines]
    return ("\n".join(lines) + "\n").encode()


# --------------------------------------------------------------------------------- VTK

# VTK's number of a cell by its number of nodes; codes of numpy by type of number.
_OF_VTK = {3: 5, 4: 9}
_CODES = {"Float64": "f8", "Float32": "f4", "Int64": "i8", "Int32": "i4", "UInt8": "u1"}


def _parts(mesh):
    """Coordinates, nodes of all cells, kinds of cells, and names as data of cells."""
    points = np.pad(mesh.points, ((0, 0), (0, 1))).ravel().tolist()
    nodes = [node for cell in mesh.cells for node in cell]
    kinds = [_OF_VTK[len(cell)] for cell in mesh.cells]
    names = {}
    if len(mesh.kinds) == 1:  # as scikit-fem writes them
        for name, members in mesh.regions.items():
            flags = [int(i in members) for i in range(len(mesh.cells))]
            names[f"skfem:s:{name.replace(' ', '_')}"] = flags
        for name, pairs in mesh.edges.items():
            sought = set(map(frozenset, pairs))
            names[f"skfem:b:{name.replace(' ', '_')}"] = [
                sum(
                    1 << i
                    for i, pair in enumerate(pairwise((*cell, cell[0])))
                    if frozenset(pair) in sought
                )
                for cell in mesh.cells
            ]
    return points, nodes, kinds, names


def vtu(mesh, rng):
    """An unstructured grid as XML, its arrays in one of five encodings."""
    encoding = str(rng.choice(["ascii", "binary", "zlib", "raw", "base64"]))
    order, head = str(rng.choice(["<", ">"])), str(rng.choice(["UInt32", "UInt64"]))
    code, appended = order + {"UInt32": "I", "UInt64": "Q"}[head], []

    def array(name, kind, values, components=1):
        text = f'<DataArray type="{kind}" Name="{name}" '
        text += f'NumberOfComponents="{components}" '
        if encoding == "ascii":
            return f'{text}format="ascii">{" ".join(map(str, values))}</DataArray>\n'
        with np.errstate(over="ignore"):  # in single precision
            held = np.array(values).astype(order + _CODES[kind]).tobytes()
        if encoding == "zlib":
            packed = zlib.compress(held)
            numbers = struct.pack(order + 4 * code[1], 1, len(held), 0, len(packed))
            data = base64.b64encode(numbers) + base64.b64encode(packed)
        else:
            data = struct.pack(code, len(held)) + held
            data = data if encoding == "raw" else base64.b64encode(data)
        if encoding in ("binary", "zlib"):
            return f'{text}format="binary">\n{data.decode()}\n</DataArray>\n'
        appended.append(data)
        offset = sum(map(len, appended[:-1]))
        return f'{text}format="appended" offset="{offset}"/>\n'

    points, nodes, kinds, names = _parts(mesh)
    ends = np.cumsum([len(cell) for cell in mesh.cells]).tolist()
    whole = str(rng.choice(["Int64", "Int32"]))
    byte_order = {"<": "LittleEndian", ">": "BigEndian"}[order]
    packing = ' compressor="vtkZLibDataCompressor"' if encoding == "zlib" else ""
    precision = str(rng.choice(["Float64", "Float64", "Float32"]))
    text = (
        f'<?xml version="1.0"?>\n<VTKFile type="UnstructuredGrid" version="0.1" '
        f'byte_order="{byte_order}" header_type="{head}"{packing}>\n'
        f'<UnstructuredGrid>\n<Piece NumberOfPoints="{len(mesh.points)}" '
        f'NumberOfCells="{len(kinds)}">\n<Points>\n'
        + array("Points", precision, points, 3)
        + "</Points>\n<Cells>\n"
        + array("connectivity", whole, nodes)
        + array("offsets", whole, ends)
        + array("types", "UInt8", kinds)
        + "</Cells>\n<CellData>\n"
        + "".join(array(name, "Int64", values) for name, values in names.items())
        + array("thickness", "Float64", [0.5] * len(kinds))
        + "</CellData>\n</Piece>\n</UnstructuredGrid>\n"
    ).encode()
    if appended:
        text += b'<AppendedData encoding="%b">\n_' % encoding.encode()
        text += b"".join(appended) + b"\n</AppendedData>\n"
    return text + b"</VTKFile>\n"


def vtk(mesh, rng):
    """A legacy file, its cells by size or by offsets, as text or as bytes."""
    binary, new = rng.integers(0, 2, 2).astype(bool).tolist()

    def put(head, values, code):
        held = struct.pack(f">{len(values)}{code}", *values)
        text = " ".join(map(str, values)).encode()
        return f"{head}\n".encode() + (held if binary else text) + b"\n"

    points, nodes, kinds, names = _parts(mesh)
    n, m = len(mesh.points), len(kinds)
    text = b"# vtk DataFile Version %b\na mesh\n%b\nDATASET UNSTRUCTURED_GRID\n" % (
        *(b"5.1" if new else b"3.0", b"BINARY" if binary else b"ASCII"),
    )
    text += put(f"POINTS {n} double", points, "d")
    if new:
        ends = [0, *np.cumsum([len(cell) for cell in mesh.cells]).tolist()]
        text += f"CELLS {m + 1} {len(nodes)}\n".encode()
        text += put("OFFSETS vtktypeint64", ends, "q")
        text += put("CONNECTIVITY vtktypeint64", nodes, "q")
    else:
        numbers = [x for cell in mesh.cells for x in (len(cell), *cell)]
        text += put(f"CELLS {m} {len(numbers)}", numbers, "i")
    text += put(f"CELL_TYPES {m}", kinds, "i")
    if rng.integers(0, 2):
        text += f"POINT_DATA {n}\nSCALARS u double 1\n".encode()
        text += put("LOOKUP_TABLE default", [0.5] * n, "d")
    if names:
        text += f"CELL_DATA {m}\nFIELD FieldData {len(names)}\n".encode()
        kind = "vtktypeint64" if new else "long"
        for name, values in names.items():
            text += put(f"{name} 1 {m} {kind}", values, "q")
    return text
