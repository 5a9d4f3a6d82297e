"""A plain reader of VTK's legacy files, and what both formats of VTK share."""

import itertools
import struct
from collections.abc import Sequence
from typing import Any

from .mesh_content import MalformedError, MeshContent, demand, number, whole

# Number of nodes by VTK's number of a cell.
CORNERS = {1: 1, 3: 2, 5: 3, 9: 4}

_CODES = {
    **{"char": "b", "short": "h", "int": "i", "long": "q", "vtktypeint64": "q"},
    **{"unsigned_char": "B", "unsigned_short": "H", "unsigned_int": "I"},
    **{"unsigned_long": "Q", "vtkidtype": "i", "float": "f", "double": "d"},
}

_SIZES = {"VECTORS": 3, "NORMALS": 3, "TENSORS": 9, "TENSORS6": 6}


def assembled(
    points: Sequence[float],
    types: Sequence[int],
    cells: Sequence[Sequence[int]],
    data: dict[str, Sequence[float]],
) -> MeshContent:
    """The mesh of points, three numbers each, cells, and scikit-fem's names in data."""
    n = len(points) // 3
    demand(len(points) == 3 * n and len(types) == len(cells), "counts")
    mesh = MeshContent([tuple(points[3 * i : 3 * i + 3]) for i in range(n)], [])
    for kind, cell in zip(types, cells, strict=True):
        demand(CORNERS.get(int(kind)) == len(cell), "kind of cell")
        demand(all(0 <= node < n for node in cell), "no such node")
        if len(cell) > 2:
            mesh.cells.append(tuple(cell))
    if data:
        demand(len(set(types)) == 1 and int(types[0]) in (5, 9), "names of one kind")
    for key, values in data.items():
        demand(len(values) == len(mesh.cells), "length of names")
        _, kind, name = key.split(":", 2) if key.count(":") > 1 else ("", "", "")
        for i, (value, cell) in enumerate(zip(values, mesh.cells, strict=True)):
            most = {"s": 1, "b": 2 ** len(cell) - 1}.get(kind, -1)
            demand(value in range(most + 1), "names")
            if kind == "s" and value:
                mesh.regions.setdefault(name, set()).add(i)
            for bit in range(len(cell)) if kind == "b" else ():
                if int(value) >> bit & 1:
                    ends = frozenset((cell[bit], cell[(bit + 1) % len(cell)]))
                    mesh.edges.setdefault(name, set()).add(ends)
    return mesh


class _Reader:
    """The rest of a file, and the parts that stand before it."""

    def __init__(self, content: bytes) -> None:
        lines = content.split(b"\n", 3)
        demand(len(lines) == 4, "header")
        words = lines[0].split()
        demand(b" ".join(words[:4]).lower() == b"# vtk datafile version", "header")
        demand(len(words) == 5, "version")
        version = words[4].decode(errors="replace")
        demand(version in ["1.0", "2.0", "3.0", "4.0", "4.1", "4.2", "5.1"], "version")
        kind = lines[2].strip().upper()
        demand(kind in (b"ASCII", b"BINARY"), "kind")
        self.packed, self.new = kind == b"BINARY", version == "5.1"
        self.rest = lines[3]
        self.parts: dict[str, Any] = {}
        self.data: dict[str, Sequence[float]] = {}
        self.count, self.of_cells = 0, False

    def line(self) -> list[str]:
        """Words of the next line that is not blank."""
        self.rest = self.rest.lstrip()
        line, _, self.rest = self.rest.partition(b"\n")
        return [word.decode(errors="replace") for word in line.split()]

    def numbers(self, count: int, kind: str) -> list:
        """The next numbers of a kind."""
        demand(kind.lower() in _CODES, "kind of numbers")
        code = _CODES[kind.lower()]
        demand(0 <= count <= len(self.rest), "numbers are missing")
        if self.packed:
            size = struct.calcsize(f">{count}{code}")
            demand(size <= len(self.rest), "numbers are missing")
            numbers = struct.unpack(f">{count}{code}", self.rest[:size])
            self.rest = self.rest[size:]
            return list(numbers)
        words = self.rest.split(None, count)
        demand(len(words) >= count, "numbers are missing")
        self.rest = words[count] if len(words) > count else b""
        if code in "fd":
            values = [number(word) for word in words[:count]]
            return [_single(x) for x in values] if code == "f" else values
        return [whole(word) for word in words[:count]]

    def skip_metadata(self) -> None:
        """Go to the next blank line."""
        line = b"METADATA"
        while line.strip():
            line, _, self.rest = self.rest.partition(b"\n")

    def take(self, words: list[str]) -> None:
        """Read what a line with these words begins."""
        keyword, given = words[0].upper(), words[1:]
        demand(keyword not in self.parts, f"two {keyword}")
        if keyword == "DATASET":
            demand(given == ["UNSTRUCTURED_GRID"], "dataset")
        elif keyword == "POINTS":
            demand(len(given) == 2, "points")
            self.parts[keyword] = self.numbers(3 * _count(given[0]), given[1])
        elif keyword == "CELLS":
            demand(len(given) == 2, "cells")
            self.parts[keyword] = self.cells(*map(_count, given))
        elif keyword == "CELL_TYPES":
            demand(len(given) == 1, "types")
            self.parts[keyword] = self.numbers(_count(given[0]), "int")
        elif keyword in ("POINT_DATA", "CELL_DATA"):
            demand(len(given) == 1, "data")
            self.parts[keyword] = self.count = _count(given[0])
            self.of_cells = keyword == "CELL_DATA"
        elif keyword == "METADATA":
            self.skip_metadata()
        elif keyword == "FIELD":
            demand(len(given) == 2, "field")
            for _ in range(_count(given[1])):
                self.array()
        else:
            self.values(keyword, given)

    def cells(self, n: int, size: int) -> list[list[int]]:
        """Nodes of each cell."""
        if self.new:
            offsets, nodes = self.part("OFFSETS", n), self.part("CONNECTIVITY", size)
            demand(n and offsets[0] == 0 and offsets[-1] == size, "offsets")
            demand(offsets == sorted(offsets), "offsets")
            return [nodes[a:b] for a, b in itertools.pairwise(offsets)]
        numbers, cells, start = self.numbers(size, "int"), [], 0
        while start < size:
            demand(0 <= numbers[start] < size - start, "size of a cell")
            end = start + 1 + numbers[start]
            cells.append(numbers[start + 1 : end])
            start = end
        demand(len(cells) == n, "count of cells")
        return cells

    def part(self, name: str, count: int) -> list[int]:
        """Offsets or connectivity."""
        words = self.line()
        demand(len(words) == 2 and words[0].upper() == name, name)
        return self.numbers(count, words[1])

    def array(self) -> None:
        """An array of a field."""
        words = self.line()
        while words[:1] == ["METADATA"]:
            self.skip_metadata()
            words = self.line()
        demand(len(words) == 4, "array")
        size, count = _count(words[1]), _count(words[2])
        self.keep(words[0], size, count, words[3])

    def values(self, keyword: str, given: list[str]) -> None:
        """Data of points or cells."""
        demand(given, keyword)
        if keyword == "SCALARS":
            demand(len(given) in (2, 3), keyword)
            table = self.line()
            demand(len(table) == 2 and table[0].upper() == "LOOKUP_TABLE", keyword)
            size = _count(given[2]) if len(given) == 3 else 1
            self.keep(given[0], size, self.count, given[1])
        elif keyword in _SIZES:
            demand(len(given) == 2, keyword)
            self.keep(given[0], _SIZES[keyword], self.count, given[1])
        else:
            raise MalformedError(keyword)

    def keep(self, name: str, size: int, count: int, kind: str) -> None:
        """Read an array; keep it if it holds names."""
        values = self.numbers(size * count, kind)
        if self.of_cells and name.startswith("skfem:"):
            demand(name not in self.data and size == 1, "names twice, or long")
            demand(count == self.count, "length of names")
            self.data[name] = values


def _count(word: str) -> int:
    count = whole(word.encode())
    demand(count >= 0, "count")
    return count


def _single(x: float) -> float:
    try:
        return struct.unpack("f", struct.pack("f", x))[0]
    except OverflowError:
        return float("inf") if x > 0 else float("-inf")


def read(content: bytes) -> MeshContent:
    """Read a legacy file of VTK."""
    reader = _Reader(content)
    while words := reader.line():
        reader.take(words)
    parts = reader.parts
    demand({"POINTS", "CELLS", "CELL_TYPES"} <= set(parts), "parts are missing")
    n = len(parts["POINTS"]) // 3
    demand(parts.get("POINT_DATA", n) == n, "data of points")
    cells = parts["CELLS"]
    demand(parts.get("CELL_DATA", len(cells)) == len(cells), "data of cells")
    return assembled(parts["POINTS"], parts["CELL_TYPES"], cells, reader.data)
