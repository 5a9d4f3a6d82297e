"""Unstructured grids of VTK in legacy files, as text or binary."""

import re
from collections.abc import Mapping
from typing import Any

import meshio
import numpy as np
from meshio._vtk_common import vtk_to_meshio_type
from numpy import ndarray

from ..mesh.checks import MeshError
from ..mesh.user_input import excerpt
from .file_numbers import BinaryNumbers, from_words

#: Prefix of the cell data in which scikit-fem writes names.
SKFEM = "skfem:"

_VERSIONS = ("1.0", "2.0", "3.0", "4.0", "4.1", "4.2", "5.1")

# Numbers of nodes of the cells that can be used, by VTK's number of their type.
_N_CORNERS = {1: 1, 3: 2, 5: 3, 9: 4}

# Types of numbers; binary ones are big-endian.
_TYPES = {
    **{"char": "i1", "short": "i2", "int": "i4", "long": "i8", "vtktypeint64": "i8"},
    **{"unsigned_char": "u1", "unsigned_short": "u2", "unsigned_int": "u4"},
    **{"unsigned_long": "u8", "vtkidtype": "i4", "float": "f4", "double": "f8"},
}

# Components of data of these kinds at each point or cell.
_COMPONENTS = {"VECTORS": 3, "NORMALS": 3, "TENSORS": 9, "TENSORS6": 6}


def cells_of(
    types: ndarray, connectivity: ndarray, offsets: ndarray
) -> list[tuple[str, ndarray]]:
    """Blocks of consecutive cells: name of the cell, and nodes, shape (n, corners).

    Parameters
    ----------
    types
        VTK's numbers of the cells, shape (n,).
    connectivity
        Nodes of one cell after another.
    offsets
        Where each cell begins in it, and where the last one ends, shape (n + 1,).

    Raises
    ------
    MeshError
        If a cell has another number of nodes than its type, or another type.
    """
    others = set(types.tolist()) - set(_N_CORNERS)
    if others:
        names = {vtk_to_meshio_type.get(t, f"type {t}") for t in types.tolist()}
        raise MeshError(
            "only triangles and four-node quadrilaterals are supported, found "
            + ", ".join(sorted(names))
        )
    corners = np.array([_N_CORNERS[t] for t in types.tolist()], dtype=int)
    if offsets[0] != 0 or offsets[-1] != len(connectivity):
        raise MeshError("its cells do not name all nodes that they list")
    if not np.array_equal(np.diff(offsets), corners):
        raise MeshError("a cell has not as many nodes as its type")
    breaks = np.flatnonzero(np.diff(types)) + 1
    blocks: list[tuple[str, ndarray]] = []
    for block in np.split(np.arange(len(types)), breaks) if len(types) else ():
        nodes = connectivity[offsets[block[0]] : offsets[block[-1] + 1]]
        kind = vtk_to_meshio_type[int(types[block[0]])]
        blocks.append((kind, nodes.astype("i8").reshape(len(block), -1)))
    return blocks


def mesh_of(
    points: ndarray, cells: list[tuple[str, ndarray]], data: Mapping[str, ndarray]
) -> meshio.Mesh:
    """The mesh with data of its cells, each of shape (n,) or (n, m)."""
    ends = np.cumsum([len(nodes) for _, nodes in cells])[:-1]
    blocks: Any = cells
    by_block: Any = {name: np.split(values, ends) for name, values in data.items()}
    return meshio.Mesh(points, blocks, cell_data=by_block)


def read(content: bytes) -> tuple[meshio.Mesh, list[str]]:
    """Read an unstructured grid.

    Returns
    -------
    tuple
        The mesh, with the data of cells that hold names by scikit-fem, and the names
        of other data, which are not read.

    Raises
    ------
    MeshError
        If the file departs from its format.
    """
    file = _File(content)
    while (words := file.line()) is not None:
        file.read(words)
    for part in ("POINTS", "CELLS", "CELL_TYPES"):
        if part not in file.sections:
            raise MeshError(f"it has no {part}")
    (connectivity, offsets), types = file.sections["CELLS"], file.sections["CELL_TYPES"]
    if len(types) != len(offsets) - 1:
        raise MeshError(f"{len(offsets) - 1} cells, and {len(types)} CELL_TYPES")
    cells = cells_of(types, connectivity, offsets)
    for part, n in (("POINT", len(file.sections["POINTS"])), ("CELL", len(types))):
        if file.sections.get(f"{part}_DATA", n) != n:
            raise MeshError(f"{part}_DATA must be for {n}")
    return mesh_of(file.sections["POINTS"], cells, file.data), file.ignored


class _File:
    """A file of VTK.

    Attributes
    ----------
    sections
        Values that were read, by keyword.
    data
        Data of cells that hold names by scikit-fem.
    ignored
        Names of other data.
    """

    def __init__(self, content: bytes) -> None:
        head = re.match(
            rb"# vtk DataFile Version (\d+\.\d+)[ \t\r]*\n[^\n]*\n[ \t]*(ASCII|BINARY)"
            rb"[ \t\r]*\n",
            content,
            re.IGNORECASE,
        )
        if head is None:
            raise MeshError("it does not begin as a file of VTK")
        version = head[1].decode()
        if version not in _VERSIONS:
            raise MeshError(f"version {excerpt(version)} of VTK's files is not read")
        self._content, self._position = content, head.end()
        self._binary = head[2].upper() == b"BINARY"
        self._has_offsets = version == "5.1"
        self.sections: dict[str, Any] = {}
        self.data: dict[str, ndarray] = {}
        self.ignored: list[str] = []
        self._count, self._of_cells = 0, False  # of the current data

    def line(self) -> list[str] | None:
        """Words of the next line that is not blank; None at the end of the file."""
        while self._position < len(self._content):
            end = self._content.find(b"\n", self._position) + 1 or len(self._content)
            words = self._content[self._position : end].split()
            self._position = end
            if words:
                return [word.decode(errors="replace") for word in words]
        return None

    def numbers(self, count: int, dtype: str) -> ndarray:
        """The next numbers of a type, shape (count,)."""
        if self._binary:
            rest = BinaryNumbers(self._content[self._position :])
            taken = rest.take(count, f">{dtype}")
            self._position += taken.nbytes
            return taken.astype(dtype)
        words: list[bytes] = self._content[self._position :].split(None, count)
        if len(words) < count:
            raise MeshError(f"{count} numbers are due where {len(words)} are left")
        if count:
            self._position = len(self._content) - sum(map(len, words[count:]))
        return from_words(words[:count], dtype)

    def read(self, words: list[str]) -> None:
        """Read the section that a line with these words begins."""
        keyword, arguments = words[0].upper(), words[1:]
        shown = excerpt(" ".join(words))
        if keyword in self.sections:
            raise MeshError(f"there is more than one {keyword}")
        try:
            self._read(keyword, arguments)
        except MeshError as error:
            raise MeshError(f"{shown}: {error}") from None
        except (ValueError, KeyError, IndexError):
            raise MeshError(f"{shown!r} is not a valid line") from None

    def _read(self, keyword: str, arguments: list[str]) -> None:
        if keyword == "DATASET":
            if arguments != ["UNSTRUCTURED_GRID"]:
                raise MeshError("only an UNSTRUCTURED_GRID is read")
        elif keyword == "POINTS":
            count, kind = arguments
            points = self.numbers(3 * _natural(count), _type(kind))
            self.sections[keyword] = points.reshape(-1, 3)
        elif keyword == "CELLS":
            n, size = map(_natural, arguments)
            read = self._cells_51 if self._has_offsets else self._cells_42
            self.sections[keyword] = read(n, size)
        elif keyword == "CELL_TYPES":
            (count,) = arguments
            self.sections[keyword] = self.numbers(_natural(count), "i4")
        elif keyword in ("POINT_DATA", "CELL_DATA"):
            (count,) = arguments
            self.sections[keyword] = self._count = _natural(count)
            self._of_cells = keyword == "CELL_DATA"
        elif keyword == "METADATA":
            self._skip_metadata()
        elif keyword == "FIELD":
            _, number = arguments
            self._field(_natural(number))
        else:
            self._data(keyword, arguments)

    def _cells_42(self, n: int, size: int) -> tuple[ndarray, ndarray]:
        """Connectivity and offsets, from cells that begin with their size."""
        numbers = self.numbers(size, "i4")
        starts, position = [], 0
        while position < size:
            starts.append(position)
            position += 1 + max(int(numbers[position]), 0)
        if len(starts) != n or position != size:
            raise MeshError("its numbers are not as many as its cells have")
        offsets = np.cumsum([0, *numbers[starts]])
        return np.delete(numbers, starts), offsets

    def _cells_51(self, n: int, size: int) -> tuple[ndarray, ndarray]:
        """Connectivity and offsets."""
        arrays = []
        for part, count in (("OFFSETS", n), ("CONNECTIVITY", size)):
            keyword, kind = self.line() or ("", "")
            if keyword.upper() != part:
                raise MeshError(f"{part} is missing here")
            arrays.append(self.numbers(count, _type(kind)).astype("i8"))
        offsets, connectivity = arrays
        if not n:
            raise MeshError("it has no cells")
        return connectivity, offsets

    def _skip_metadata(self) -> None:
        """Skip metadata up to the blank line that ends them."""
        blank = re.compile(rb"\n[ \t\r]*(\n|$)").search(
            self._content, self._position - 1
        )
        self._position = blank.end() if blank else len(self._content)

    def _field(self, number: int) -> None:
        """Read arrays that state their length."""
        for _ in range(number):
            words = self.line() or []
            while words[:1] == ["METADATA"]:
                self._skip_metadata()
                words = self.line() or []
            name, components, tuples, kind = words
            self._read_array(name, _natural(tuples), _natural(components), _type(kind))

    def _data(self, keyword: str, arguments: list[str]) -> None:
        """Read one array of data of the points or cells, or a table of colours."""
        name, count = arguments[0], self._count
        if keyword == "LOOKUP_TABLE":
            self.numbers(4 * _natural(arguments[1]), "u1" if self._binary else "f4")
        elif keyword == "COLOR_SCALARS":
            kind = "u1" if self._binary else "f4"
            self._read_array(name, count, _natural(arguments[1]), kind)
        elif keyword == "TEXTURE_COORDINATES":
            self._read_array(name, count, _natural(arguments[1]), _type(arguments[2]))
        elif keyword == "SCALARS":
            table, _ = self.line() or ("", "")
            if table.upper() != "LOOKUP_TABLE":
                raise MeshError("LOOKUP_TABLE must follow")
            components = _natural(arguments[2]) if arguments[2:] else 1
            self._read_array(name, count, components, _type(arguments[1]))
        else:
            self._read_array(name, count, _COMPONENTS[keyword], _type(arguments[1]))

    def _read_array(self, name: str, count: int, components: int, kind: str) -> None:
        """Read an array; store it if it holds names by scikit-fem."""
        values = self.numbers(count * components, kind)
        if self._of_cells and name.startswith(SKFEM):
            if (count, components) != (self._count, 1) or name in self.data:
                raise MeshError(
                    "it is not one number for each cell, or its name is not unique"
                )
            self.data[name] = values
        else:
            self.ignored.append(name)


def _natural(word: str) -> int:
    return from_words([word.encode()], "u4").item()


def _type(word: str) -> str:
    return _TYPES[word.lower()]
