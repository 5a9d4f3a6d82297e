"""VTK unstructured grids: legacy and XML files."""

import base64
import binascii
import lzma
import re
import zlib
from collections.abc import Mapping, Sequence
from pathlib import Path
from types import MappingProxyType
from typing import Any
from xml.etree import ElementTree
from xml.etree.ElementTree import Element

import meshio
import numpy as np
from meshio._vtk_common import vtk_to_meshio_type
from numpy import ndarray

from ..mesh.checks import MeshError
from ..mesh.user_input import excerpt
from .file_numbers import BinaryNumbers, TextNumbers, errors_about, from_words

#: Prefix of the cell data in which scikit-fem writes names.
SKFEM = "skfem:"

_VERSIONS = ("1.0", "2.0", "3.0", "4.0", "4.1", "4.2", "5.1")

# Numbers of nodes of supported cells, by VTK type number.
_N_NODES = {1: 1, 3: 2, 5: 3, 9: 4, 21: 3, 22: 6, 23: 8, 28: 9}

# Number types; binary ones are big-endian.
_LEGACY_TYPES = {
    **{"char": "i1", "short": "i2", "int": "i4", "long": "i8", "vtktypeint64": "i8"},
    **{"unsigned_char": "u1", "unsigned_short": "u2", "unsigned_int": "u4"},
    **{"unsigned_long": "u8", "vtkidtype": "i4", "float": "f4", "double": "f8"},
}

# Number of components of each kind of data.
_COMPONENTS = {"VECTORS": 3, "NORMALS": 3, "TENSORS": 9, "TENSORS6": 6}


def cells_of(
    types: ndarray, connectivity: ndarray, offsets: ndarray
) -> list[tuple[str, ndarray]]:
    """Blocks of consecutive cells: name of the cell, and nodes, shape (n, corners).

    ``types`` are VTK type numbers of the cells, ``connectivity`` the concatenated nodes
    of the cells, and ``offsets`` the start of each and the end of the last.
    """
    if not set(types.tolist()) <= set(_N_NODES):
        names = {vtk_to_meshio_type.get(t, f"type {t}") for t in types.tolist()}
        raise MeshError(
            "only triangles and four-node quadrilaterals are supported, found "
            + ", ".join(sorted(names))
        )
    corners = np.array([_N_NODES[t] for t in types.tolist()], dtype=int)
    if offsets[0] != 0 or offsets[-1] != len(connectivity):
        raise MeshError("the offsets do not cover all listed nodes")
    if not np.array_equal(np.diff(offsets), corners):
        raise MeshError("the number of nodes of a cell does not match its type")
    breaks = np.flatnonzero(np.diff(types)) + 1
    blocks: list[tuple[str, ndarray]] = []
    for block in np.split(np.arange(len(types)), breaks) if len(types) else ():
        nodes = connectivity[offsets[block[0]] : offsets[block[-1] + 1]]
        kind = vtk_to_meshio_type[int(types[block[0]])]
        blocks.append((kind, nodes.astype("i8").reshape(len(block), -1)))
    return blocks


def mesh_of(
    points: ndarray,
    cells: list[tuple[str, ndarray]],
    data: Mapping[str, ndarray],
    of_points: Any = None,
) -> meshio.Mesh:
    """Mesh with data of its cells and points, each of shape (n,) or (n, m)."""
    ends = np.cumsum([len(nodes) for _, nodes in cells])[:-1]
    blocks: Any = cells
    by_block: Any = {name: np.split(values, ends) for name, values in data.items()}
    return meshio.Mesh(points, blocks, of_points, by_block)


def in_space(points: ndarray) -> ndarray:
    """Points or vectors of shape (n, 2) or (n, 3) with three components."""
    return np.pad(points, ((0, 0), (0, 3 - points.shape[1])))


def write_grid(
    path: Path,
    points: ndarray,
    cells: Sequence[ndarray],
    of_cells: Mapping[str, ndarray],
    of_points: Mapping[str, ndarray] = MappingProxyType({}),
) -> None:
    """Write fields of triangles and quadrilaterals, and of their corners.

    The corners are the first columns of ``points``, shape (3, n), and the first rows of
    the fields ``of_points``.
    """
    n = 1 + max(cell.max() for cell in cells)
    blocks = [({3: "triangle", 4: "quad"}[len(cell)], cell.T) for cell in cells]
    at_corners = {name: values[:n] for name, values in of_points.items()}
    mesh_of(points[:, :n].T, blocks, of_cells, at_corners).write(path)


def write_series(path: Path, files: Mapping[str, float]) -> None:
    """Write a .pvd file that lists files of the same folder with their load factors."""
    series = ElementTree.Element("VTKFile", type="Collection", version="0.1")
    collection = ElementTree.SubElement(series, "Collection")
    for name, t in files.items():
        ElementTree.SubElement(collection, "DataSet", timestep=repr(t), file=name)
    ElementTree.ElementTree(series).write(path)


def read_legacy(content: bytes) -> tuple[meshio.Mesh, list[str]]:
    """Mesh of a legacy file, and the names of ignored data.

    The mesh has the cell data that contain names written by scikit-fem.

    Raises
    ------
    MeshError
        If the file violates its format.
    """
    file = _LegacyFile(content)
    while (words := file.line()) is not None:
        file.read(words)
    for part in ("POINTS", "CELLS", "CELL_TYPES"):
        if part not in file.sections:
            raise MeshError(f"the file contains no {part}")
    (connectivity, offsets), types = file.sections["CELLS"], file.sections["CELL_TYPES"]
    if len(types) != len(offsets) - 1:
        raise MeshError(
            f"the file contains {len(offsets) - 1} cells, but {len(types)} CELL_TYPES"
        )
    cells = cells_of(types, connectivity, offsets)
    for part, n in (("POINT", len(file.sections["POINTS"])), ("CELL", len(types))):
        if file.sections.get(f"{part}_DATA", n) != n:
            raise MeshError(f"{part}_DATA must be given for {n} items")
    return mesh_of(file.sections["POINTS"], cells, file.data), file.ignored


class _LegacyFile:
    """Legacy file, read section by section.

    ``sections`` has the values read, by keyword, ``data`` the cell data that contain
    names written by scikit-fem, and ``ignored`` the names of other data.
    """

    def __init__(self, content: bytes) -> None:
        head = re.match(
            rb"# vtk DataFile Version (\d+\.\d+)[ \t\r]*\n[^\n]*\n[ \t]*(ASCII|BINARY)"
            rb"[ \t\r]*\n",
            content,
            re.IGNORECASE,
        )
        if head is None:
            raise MeshError("the file does not begin with the header of a VTK file")
        version = head[1].decode()
        if version not in _VERSIONS:
            raise MeshError(
                f"version {excerpt(version)} of the VTK format is not supported: save "
                "the mesh in version 4.2 or 5.1"
            )
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
        """Next numbers of a type, shape (count,)."""
        if self._binary:
            remaining = BinaryNumbers(self._content[self._position :])
            numbers = remaining.take(count, f">{dtype}")
            self._position += numbers.nbytes
            return numbers.astype(dtype)
        words: list[bytes] = self._content[self._position :].split(None, count)
        if len(words) < count:
            raise MeshError(f"{count} numbers expected, but {len(words)} remain")
        if count:
            self._position = len(self._content) - sum(map(len, words[count:]))
        return from_words(words[:count], dtype)

    def read(self, words: list[str]) -> None:
        """Read the section that a line with these words begins."""
        keyword, arguments = words[0].upper(), words[1:]
        text = excerpt(" ".join(words))
        if keyword in self.sections:
            raise MeshError(f"the file contains more than one {keyword} section")
        try:
            self._read(keyword, arguments)
        except MeshError as error:
            raise MeshError(f"{text}: {error}") from None
        except (ValueError, KeyError, IndexError):
            raise MeshError(f"{text!r} is not a valid line") from None

    def _read(self, keyword: str, arguments: list[str]) -> None:
        if keyword == "DATASET":
            if arguments != ["UNSTRUCTURED_GRID"]:
                raise MeshError("only an UNSTRUCTURED_GRID is supported")
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
            raise MeshError("the number of values does not match the cell sizes")
        offsets = np.cumsum([0, *numbers[starts]])
        return np.delete(numbers, starts), offsets

    def _cells_51(self, n: int, size: int) -> tuple[ndarray, ndarray]:
        """Connectivity and offsets."""
        arrays = []
        for part, count in (("OFFSETS", n), ("CONNECTIVITY", size)):
            keyword, kind = self.line() or ("", "")
            if keyword.upper() != part:
                raise MeshError(f"{part} is missing")
            arrays.append(self.numbers(count, _type(kind)).astype("i8"))
        offsets, connectivity = arrays
        if not n:
            raise MeshError("the file contains no cells")
        return connectivity, offsets

    def _skip_metadata(self) -> None:
        """Skip metadata up to the blank line that ends them."""
        blank = re.compile(rb"\n[ \t\r]*(\n|$)").search(
            self._content, self._position - 1
        )
        self._position = blank.end() if blank else len(self._content)

    def _field(self, number: int) -> None:
        """Read arrays with a declared length."""
        for _ in range(number):
            words = self.line() or []
            while words[:1] == ["METADATA"]:
                self._skip_metadata()
                words = self.line() or []
            name, components, tuples, kind = words
            self._read_array(name, _natural(tuples), _natural(components), _type(kind))

    def _data(self, keyword: str, arguments: list[str]) -> None:
        """Read one array of point or cell data, or a colour table."""
        name, *numbers = arguments
        colour = "u1" if self._binary else "f4"
        if keyword == "LOOKUP_TABLE":
            self.numbers(4 * _natural(numbers[0]), colour)
            return
        if keyword == "COLOR_SCALARS":
            components, kind = _natural(numbers[0]), colour
        elif keyword == "TEXTURE_COORDINATES":
            components, kind = _natural(numbers[0]), _type(numbers[1])
        elif keyword == "SCALARS":
            table, _ = self.line() or ("", "")
            if table.upper() != "LOOKUP_TABLE":
                raise MeshError("the next line must begin with LOOKUP_TABLE")
            components = _natural(numbers[1]) if numbers[1:] else 1
            kind = _type(numbers[0])
        else:
            components, kind = _COMPONENTS[keyword], _type(numbers[0])
        self._read_array(name, self._count, components, kind)

    def _read_array(self, name: str, count: int, components: int, kind: str) -> None:
        """Read an array; store it if it contains names written by scikit-fem."""
        values = self.numbers(count * components, kind)
        if self._of_cells and name.startswith(SKFEM):
            if (count, components) != (self._count, 1) or name in self.data:
                raise MeshError(
                    "the array must have one number per cell, and a unique name"
                )
            self.data[name] = values
        else:
            self.ignored.append(name)


def _natural(word: str) -> int:
    return from_words([word.encode()], "u4").item()


def _type(word: str) -> str:
    return _LEGACY_TYPES[word.lower()]


#: Decompressors by VTK name.
DECOMPRESSORS: dict[str | None, Any] = {
    None: None,
    "vtkZLibDataCompressor": zlib.decompressobj,
    "vtkLZMADataCompressor": lzma.LZMADecompressor,
}


def decoded(characters: bytes) -> bytes:
    """Bytes in base64, in runs that each end with a complete group of characters.

    Programs write the number of bytes as a separate run, or not.
    """
    runs = re.findall(rb"[^=]+={0,2}", characters)
    try:
        data = [base64.b64decode(run, validate=True) for run in runs]
    except binascii.Error:
        data = []
    if len(data) < len(runs) or sum(map(len, runs)) < len(characters):
        raise MeshError("the data are not valid base64")
    return b"".join(data)


def read_uncompressed(numbers: BinaryNumbers, header: np.dtype) -> bytes:
    """Read bytes preceded by their number."""
    count = numbers.take(1, header).item()
    return numbers.take(count, "u1").tobytes()


def read_compressed(
    numbers: BinaryNumbers, header: np.dtype, decompressor: Any, n_bytes: int
) -> bytes:
    """Read a number of bytes that are compressed in blocks.

    They are preceded by the number of blocks, the size of one and of the last block,
    and their compressed sizes.
    """
    n, full, last = numbers.take(3, header).tolist()
    compressed = numbers.take(n, header).tolist()
    lengths = [full] * (n - 1) + [last or full] if n else []
    if sum(lengths) != n_bytes:
        raise MeshError(
            f"{n_bytes} bytes expected, but the header declares {sum(lengths)}"
        )
    blocks = []
    for size, length in zip(compressed, lengths, strict=True):
        block, part = decompressor(), numbers.take(size, "u1").tobytes()
        try:
            blocks.append(block.decompress(part, max_length=length + 1))
        except (zlib.error, lzma.LZMAError):
            raise MeshError("the data cannot be decompressed") from None
        if len(blocks[-1]) != length or not block.eof or block.unused_data:
            raise MeshError("the length of a block differs from the declared one")
    return b"".join(blocks)


_XML_TYPES = {
    **{f"Int{n}": f"i{n // 8}" for n in (8, 16, 32, 64)},
    **{f"UInt{n}": f"u{n // 8}" for n in (8, 16, 32, 64)},
    **{f"Float{n}": f"f{n // 8}" for n in (32, 64)},
}

_ORDERS: dict[str, Any] = {"LittleEndian": "<", "BigEndian": ">"}


def read_xml(
    content: bytes, widths: Mapping[str, int] = MappingProxyType({})
) -> tuple[meshio.Mesh, list[str]]:
    """Mesh of an XML file with one piece, and names of ignored data.

    The mesh has the cell data that contain names written by scikit-fem, and those whose
    names are in ``widths``, with the given number of components.

    Raises
    ------
    MeshError
        If the file violates its format.
    """
    file = _XMLFile(content)
    grid = _only(file.root, "UnstructuredGrid")
    piece = _only(grid, "Piece")
    n_points, n_cells = (_integer(piece, f"NumberOf{x}") for x in ("Points", "Cells"))
    positions = _only(_only(piece, "Points"), "DataArray")
    if _integer(positions, "NumberOfComponents") != 3:
        raise MeshError("the points must have three coordinates")
    points = file.array(positions, 3 * n_points).reshape(-1, 3)
    arrays = _by_name(_only(piece, "Cells"))
    if missing := {"connectivity", "offsets", "types"} - set(arrays):
        raise MeshError(f"Cells must contain an array {min(missing)!r}")
    types, ends = (
        file.array(arrays[x], n_cells, integers=True) for x in ("types", "offsets")
    )
    offsets = np.concatenate([[0], ends.astype("i8")])
    nodes = file.array(arrays["connectivity"], int(offsets[-1]), integers=True)
    cells = cells_of(types, nodes, offsets)
    data, ignored = {}, []
    of_cells = [_by_name(part) for part in piece.findall("CellData")]
    for name, array in (item for arrays in of_cells for item in arrays.items()):
        if name.startswith(SKFEM):
            data[name] = file.array(array, n_cells)
        elif width := widths.get(name):
            if array.get("NumberOfComponents", "1") != str(width):
                raise MeshError(f"{name} must have {width} component(s)")
            data[name] = file.array(array, n_cells * width).reshape(n_cells, width)
    parts = *piece.findall("PointData"), *piece.findall("CellData")
    for part in (*parts, *grid.findall("FieldData")):
        ignored += [name for name in _by_name(part) if name not in data]
    return mesh_of(points, cells, data), ignored


def _only(parent: Element, tag: str) -> Element:
    """The only child with a tag."""
    children = parent.findall(tag)
    if len(children) != 1:
        raise MeshError(
            f"{excerpt(parent.tag)} must have one {tag}, found {len(children)}"
        )
    return children[0]


def _by_name(parent: Element) -> dict[str, Element]:
    """Arrays by name."""
    children = parent.findall("DataArray")
    arrays = {child.get("Name", ""): child for child in children}
    if len(arrays) < len(children):
        raise MeshError(
            f"two arrays of {parent.tag} have the same name: use unique names"
        )
    return arrays


def _integer(element: Element, key: str) -> int:
    """Natural number in an attribute of an element."""
    with errors_about(key):
        return _natural(element.get(key, ""))


def _choice(element: Element, key: str, default: Any, choices: Any) -> Any:
    """Value of an attribute, which must be one of the choices."""
    if (chosen := element.get(key, default)) not in choices:
        raise MeshError(f"{key} {excerpt(str(chosen))!r} is not supported")
    return chosen


class _XMLFile:
    """XML of a file and its appended data."""

    def __init__(self, content: bytes) -> None:
        head, tag, rest = content.partition(b"<AppendedData")
        attributes, mark, rest = rest.partition(b"_")
        data, last, foot = rest.rpartition(b"</AppendedData>")
        appended = bool(tag and mark and last)
        try:
            self.root = ElementTree.fromstring(
                head + tag + attributes + last + foot if appended else content
            )
        except (ElementTree.ParseError, ValueError, LookupError) as error:
            raise MeshError(
                f"the file is not valid XML: {excerpt(str(error))}"
            ) from None
        root = self.root
        if root.tag != "VTKFile" or root.get("type") != "UnstructuredGrid":
            raise MeshError("the file is not a VTKFile of an UnstructuredGrid")
        _choice(root, "version", "0.1", ("0.1", "1.0"))
        self._order = _ORDERS[_choice(root, "byte_order", "LittleEndian", _ORDERS)]
        header = _choice(root, "header_type", "UInt32", ("UInt32", "UInt64"))
        self._header = np.dtype(self._order + _XML_TYPES[header])
        self._decompressor = DECOMPRESSORS[
            _choice(root, "compressor", None, DECOMPRESSORS)
        ]
        self._appended, self._raw = data, True
        if appended:
            element = _only(root, "AppendedData")
            self._raw = _choice(element, "encoding", "", ("raw", "base64")) == "raw"
            if (element.text or "").strip():
                raise MeshError("appended data must begin with '_'")
        if not self._raw:
            self._appended = b"".join(data.split())
        offsets = (array.get("offset", "") for array in root.iter("DataArray"))
        self._offsets = sorted(int(one) for one in offsets if one.isdecimal())

    def array(self, element: Element, count: int, integers: bool = False) -> ndarray:
        """Numbers of an array, shape (count,)."""
        with errors_about(f"array {excerpt(element.get('Name', 'Points'))!r}"):
            return self._array(element, count, integers)

    def _array(self, element: Element, count: int, integers: bool) -> ndarray:
        types = [name for name in _XML_TYPES if not (integers and name.startswith("F"))]
        dtype = np.dtype(_XML_TYPES[_choice(element, "type", "", types)])
        kind = _choice(element, "format", "ascii", ("ascii", "binary", "appended"))
        texts = [element.text or "", *(child.tail or "" for child in element)]
        text = "".join(texts).encode()
        if kind == "ascii":
            words = TextNumbers(text)
            numbers = words.take(count, dtype)
            words.refuse_rest()
            return numbers
        if kind == "appended":
            start = _integer(element, "offset")
            end = next((x for x in self._offsets if x > start), None)
            data, is_raw = self._appended[start:end], self._raw
        else:
            data, is_raw = b"".join(text.split()), False
        read = BinaryNumbers(data if is_raw else decoded(data))
        n_bytes = count * dtype.itemsize
        if self._decompressor is None:
            content = read_uncompressed(read, self._header)
        else:
            content = read_compressed(read, self._header, self._decompressor, n_bytes)
        if not is_raw:
            read.refuse_rest()
        if len(content) != n_bytes:
            raise MeshError(f"{n_bytes} bytes expected, got {len(content)}")
        return np.frombuffer(content, dtype.newbyteorder(self._order)).astype(dtype)
