"""Writes sound meshes as files of VTK: XML and legacy."""

import base64
import struct
import zlib

import numpy as np
from numpy.random import Generator

from .sound_meshes import SoundMesh

# VTK's number of a cell by its number of nodes.
_TYPES = {3: 5, 4: 9}
# Codes of numpy by type of number.
_CODES = {"Float64": "f8", "Float32": "f4", "Int64": "i8", "Int32": "i4", "UInt8": "u1"}


def _named(mesh: SoundMesh) -> dict[str, list[int]]:
    """Names of edges and cells as scikit-fem writes them."""
    data = {}
    if len(mesh.kinds) == 1:
        for name, cells in mesh.regions.items():
            key = "skfem:s:" + name.replace(" ", "_")
            data[key] = [int(i in cells) for i in range(len(mesh.cells))]
        for name, pairs in mesh.edges.items():
            wanted = {frozenset(pair) for pair in pairs}
            data["skfem:b:" + name.replace(" ", "_")] = [
                sum(
                    1 << i
                    for i in range(len(c))
                    if frozenset((c[i], c[(i + 1) % len(c)])) in wanted
                )
                for c in mesh.cells
            ]
    return data


def vtu(mesh: SoundMesh, rng: Generator) -> bytes:
    """An unstructured grid as XML, its arrays in one of five encodings."""
    way = str(rng.choice(["ascii", "binary", "zlib", "raw", "base64"]))
    order, head = str(rng.choice(["<", ">"])), str(rng.choice(["UInt32", "UInt64"]))
    appended: list[bytes] = []
    code = order + {"UInt32": "I", "UInt64": "Q"}[head]

    def array(name: str, kind: str, values: list, components: int = 1) -> str:
        text = f'<DataArray type="{kind}" Name="{name}" '
        text += f'NumberOfComponents="{components}" '
        with np.errstate(over="ignore"):  # in single precision
            held = np.array(values).astype(order + _CODES[kind]).tobytes()
        if way == "ascii":
            return f'{text}format="ascii">{" ".join(map(str, values))}</DataArray>\n'
        if way == "zlib":
            packed = zlib.compress(held)
            numbers = struct.pack(order + 4 * code[1], 1, len(held), 0, len(packed))
            data = base64.b64encode(numbers) + base64.b64encode(packed)
        elif way == "raw":
            data = struct.pack(code, len(held)) + held
        else:
            data = base64.b64encode(struct.pack(code, len(held)) + held)
        if way in ("binary", "zlib"):
            return f'{text}format="binary">\n{data.decode()}\n</DataArray>\n'
        offset = sum(map(len, appended))
        appended.append(data)
        return f'{text}format="appended" offset="{offset}"/>\n'

    points = np.column_stack([mesh.points, np.zeros(len(mesh.points))])
    ends = np.cumsum([len(cell) for cell in mesh.cells]).tolist()
    kinds = [_TYPES[len(cell)] for cell in mesh.cells]
    nodes = [node for cell in mesh.cells for node in cell]
    whole = str(rng.choice(["Int64", "Int32"]))
    shape = f'NumberOfPoints="{len(points)}" NumberOfCells="{len(kinds)}"'
    byte_order = {"<": "LittleEndian", ">": "BigEndian"}[order]
    packing = ' compressor="vtkZLibDataCompressor"' if way == "zlib" else ""
    precision = str(rng.choice(["Float64", "Float64", "Float32"]))
    text = (
        f'<?xml version="1.0"?>\n<VTKFile type="UnstructuredGrid" version="0.1" '
        f'byte_order="{byte_order}" header_type="{head}"{packing}>\n'
        f"<UnstructuredGrid>\n<Piece {shape}>\n<Points>\n"
        + array("Points", precision, points.ravel().tolist(), 3)
        + "</Points>\n<Cells>\n"
        + array("connectivity", whole, nodes)
        + array("offsets", whole, ends)
        + array("types", "UInt8", kinds)
        + "</Cells>\n<CellData>\n"
        + "".join(array(name, "Int64", v) for name, v in _named(mesh).items())
        + array("thickness", "Float64", [0.5] * len(kinds))
        + "</CellData>\n</Piece>\n</UnstructuredGrid>\n"
    ).encode()
    if way in ("raw", "base64"):
        text += b'<AppendedData encoding="%b">\n_' % way.encode()
        text += b"".join(appended) + b"\n</AppendedData>\n"
    return text + b"</VTKFile>\n"


def vtk(mesh: SoundMesh, rng: Generator) -> bytes:
    """A legacy file, its cells by size or by offsets, as text or as bytes."""
    binary, new = rng.integers(0, 2, 2).astype(bool).tolist()

    def put(kind: str, values: list, code: str) -> bytes:
        held = struct.pack(f">{len(values)}{code}", *values)
        text = " ".join(map(str, values)).encode()
        return f"{kind}\n".encode() + (held if binary else text) + b"\n"

    points = np.column_stack([mesh.points, np.zeros(len(mesh.points))])
    n, m = len(points), len(mesh.cells)
    nodes = [node for cell in mesh.cells for node in cell]
    text = b"# vtk DataFile Version %b\n" % (b"5.1" if new else b"3.0")
    text += b"a mesh\n%b\nDATASET UNSTRUCTURED_GRID\n" % (
        b"BINARY" if binary else b"ASCII"
    )
    text += put(f"POINTS {n} double", points.ravel().tolist(), "d")
    if new:
        ends = [0, *np.cumsum([len(cell) for cell in mesh.cells]).tolist()]
        text += f"CELLS {m + 1} {len(nodes)}\n".encode()
        text += put("OFFSETS vtktypeint64", ends, "q")
        text += put("CONNECTIVITY vtktypeint64", nodes, "q")
    else:
        numbers = [x for cell in mesh.cells for x in (len(cell), *cell)]
        text += put(f"CELLS {m} {len(numbers)}", numbers, "i")
    text += put(f"CELL_TYPES {m}", [_TYPES[len(cell)] for cell in mesh.cells], "i")
    if rng.integers(0, 2):
        text += f"POINT_DATA {n}\nSCALARS u double 1\n".encode()
        text += put("LOOKUP_TABLE default", [0.5] * n, "d")
    named = _named(mesh)
    if named:
        text += f"CELL_DATA {m}\nFIELD FieldData {len(named)}\n".encode()
        for name, values in named.items():
            text += put(f"{name} 1 {m} long", values, "q")
    return text
