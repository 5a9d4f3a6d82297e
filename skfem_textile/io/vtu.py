"""Unstructured grids of VTK in XML files."""

import base64
import binascii
import lzma
import zlib
from collections.abc import Mapping
from types import MappingProxyType
from typing import Any
from xml.etree import ElementTree
from xml.etree.ElementTree import Element

import meshio
import numpy as np
from numpy import ndarray

from ..mesh.checks import MeshError
from ..mesh.user_input import excerpt
from .file_numbers import TextNumbers, from_words
from .vtk import SKFEM, cells_of, mesh_of

#: Decompressors by VTK's name.
DECOMPRESSORS: dict[str | None, Any] = {
    None: None,
    "vtkZLibDataCompressor": zlib.decompressobj,
    "vtkLZMADataCompressor": lzma.LZMADecompressor,
}


class RawData:
    """Bytes that are not encoded."""

    def __init__(self, content: bytes) -> None:
        self._content, self._position = content, 0

    def peek(self, count: int) -> bytes:
        """The next bytes, without taking them."""
        if not 0 <= count <= len(self._content) - self._position:
            raise MeshError("it is cut off")
        return self._content[self._position : self._position + count]

    def take(self, count: int) -> bytes:
        """The next bytes."""
        taken = self.peek(count)
        self._position += count
        return taken

    def ends_after(self, count: int) -> bool:
        """Whether these bytes are encoded apart from those that follow."""
        return False


class Base64Data(RawData):
    """Bytes in base64, in runs that each end with a whole group of characters."""

    @staticmethod
    def _length(count: int) -> int:
        return -(-count // 3) * 4

    def peek(self, count: int) -> bytes:
        """The next bytes of a run."""
        try:
            chars = super().peek(self._length(count))
            return base64.b64decode(chars, validate=True)[:count]
        except binascii.Error:
            raise MeshError("it is not in base64") from None

    def take(self, count: int) -> bytes:
        """The next run, of so many bytes."""
        taken = self.peek(count)
        self._position += self._length(count)
        padding = self._content[: self._position][-2:].count(b"=")
        if len(taken) != count or padding != -count % 3:
            raise MeshError("it is not in base64")
        return taken

    def ends_after(self, count: int) -> bool:
        """Whether a run of so many bytes ends there."""
        end = b"=" * (-count % 3)
        return bool(end) and super().peek(self._length(count)).endswith(end)

    def refuse_rest(self) -> None:
        """Refuse further data."""
        if self._position < len(self._content):
            raise MeshError("it is longer than it states")


def read_uncompressed(data: RawData, header: np.dtype) -> bytes:
    """Read bytes that follow their number."""
    (count,) = np.frombuffer(data.peek(header.itemsize), header).tolist()
    if data.ends_after(header.itemsize):
        data.take(header.itemsize)
        return data.take(count)
    return data.take(header.itemsize + count)[header.itemsize :]


def read_compressed(
    data: RawData, header: np.dtype, decompressor: Any, n_bytes: int
) -> bytes:
    """Read a number of bytes that are compressed in blocks.

    Before them stand the number of blocks, the size of one and of the last, and their
    compressed sizes.
    """
    (n,) = np.frombuffer(data.peek(header.itemsize), header).tolist()
    sizes = np.frombuffer(data.take((3 + n) * header.itemsize), header).tolist()[1:]
    full, last, *compressed = sizes
    lengths = [full] * (n - 1) + [last or full] if n else []
    if sum(lengths) != n_bytes:
        raise MeshError(f"it holds {sum(lengths)} bytes, and {n_bytes} are due")
    rest, start, blocks = data.take(sum(compressed)), 0, []
    for size, length in zip(compressed, lengths, strict=True):
        block = decompressor()
        try:
            part = rest[start : start + size]
            blocks.append(block.decompress(part, max_length=length + 1))
        except (zlib.error, lzma.LZMAError):
            raise MeshError("it cannot be unpacked") from None
        if len(blocks[-1]) != length or not block.eof or block.unused_data:
            raise MeshError("a block has another length than it states")
        start += size
    return b"".join(blocks)


_TYPES = {
    **{f"Int{n}": f"i{n // 8}" for n in (8, 16, 32, 64)},
    **{f"UInt{n}": f"u{n // 8}" for n in (8, 16, 32, 64)},
    **{f"Float{n}": f"f{n // 8}" for n in (32, 64)},
}

_ORDERS: dict[str, Any] = {"LittleEndian": "<", "BigEndian": ">"}


def read(
    content: bytes, wanted: Mapping[str, int] = MappingProxyType({})
) -> tuple[meshio.Mesh, list[str]]:
    """Read an unstructured grid of one piece.

    Parameters
    ----------
    content
        Of the file.
    wanted
        Data of cells to read, by name, and how many components they must have.

    Returns
    -------
    tuple
        The mesh, with the data of cells that hold names by scikit-fem or are wanted,
        and the names of other data, which are not read.

    Raises
    ------
    MeshError
        If the file departs from its format.
    """
    file = _File(content)
    grid = _only(file.root, "UnstructuredGrid")
    piece = _only(grid, "Piece")
    n_points, n_cells = (_whole(piece, f"NumberOf{x}") for x in ("Points", "Cells"))
    positions = _only(_only(piece, "Points"), "DataArray")
    if _whole(positions, "NumberOfComponents") != 3:
        raise MeshError("its points must have three coordinates")
    points = file.array(positions, 3 * n_points).reshape(-1, 3)
    arrays = _by_name(_only(piece, "Cells"))
    if missing := {"connectivity", "offsets", "types"} - set(arrays):
        raise MeshError(f"its cells have no {min(missing)!r}")
    types, ends = (
        file.array(arrays[x], n_cells, whole=True) for x in ("types", "offsets")
    )
    offsets = np.concatenate([[0], ends.astype("i8")])
    nodes = file.array(arrays["connectivity"], int(offsets[-1]), whole=True)
    cells = cells_of(types, nodes, offsets)
    data, ignored = {}, []
    of_cells = [_by_name(part) for part in piece.findall("CellData")]
    for name, array in (item for arrays in of_cells for item in arrays.items()):
        if name.startswith(SKFEM):
            data[name] = file.array(array, n_cells)
        elif name in wanted:
            width = wanted[name]
            if array.get("NumberOfComponents", "1") != str(width):
                raise MeshError(f"{name} must have {width} component(s)")
            data[name] = file.array(array, n_cells * width).reshape(n_cells, width)
    for part in (*piece.findall("PointData"), *piece.findall("CellData")):
        ignored += [name for name in _by_name(part) if name not in data]
    for part in grid.findall("FieldData"):
        ignored += _by_name(part)
    return mesh_of(points, cells, data), ignored


def _only(parent: Element, tag: str) -> Element:
    """The only child with a tag."""
    children = parent.findall(tag)
    if len(children) != 1:
        raise MeshError(
            f"{excerpt(parent.tag)} must have one {tag}, and has {len(children)}"
        )
    return children[0]


def _by_name(parent: Element) -> dict[str, Element]:
    """Arrays by name."""
    arrays = {child.get("Name", ""): child for child in parent.findall("DataArray")}
    if len(arrays) < len(parent.findall("DataArray")):
        raise MeshError(f"two arrays of {parent.tag} have the same name")
    return arrays


def _whole(element: Element, key: str) -> int:
    """The natural number in an attribute of an element."""
    try:
        return from_words([element.get(key, "").encode()], "u4").item()
    except MeshError as error:
        raise MeshError(f"{key}: {error}") from None


def _choice(element: Element, key: str, default: Any, choices: Any) -> Any:
    """The value of an attribute, which must be one of the choices."""
    if (chosen := element.get(key, default)) not in choices:
        raise MeshError(f"{key} {excerpt(str(chosen))!r} is not read")
    return chosen


class _File:
    """The XML of a file and its appended data."""

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
            raise MeshError(f"it is no XML: {excerpt(str(error))}") from None
        root = self.root
        if root.tag != "VTKFile" or root.get("type") != "UnstructuredGrid":
            raise MeshError("it is no VTKFile of an UnstructuredGrid")
        _choice(root, "version", "0.1", ("0.1", "1.0"))
        self._order = _ORDERS[_choice(root, "byte_order", "LittleEndian", _ORDERS)]
        header = _choice(root, "header_type", "UInt32", ("UInt32", "UInt64"))
        self._header = np.dtype(self._order + _TYPES[header])
        self._decompressor = DECOMPRESSORS[
            _choice(root, "compressor", None, DECOMPRESSORS)
        ]
        self._appended, self._raw = data, True
        if appended:
            element = _only(root, "AppendedData")
            self._raw = _choice(element, "encoding", "", ("raw", "base64")) == "raw"
            if (element.text or "").strip():
                raise MeshError("appended data must begin with '_'")

    def array(self, element: Element, count: int, whole: bool = False) -> ndarray:
        """The numbers of an array, shape (count,)."""
        try:
            return self._array(element, count, whole)
        except MeshError as error:
            name = excerpt(element.get("Name", "of the points"))
            raise MeshError(f"array {name!r}: {error}") from None

    def _array(self, element: Element, count: int, whole: bool) -> ndarray:
        types = [name for name in _TYPES if not (whole and name.startswith("F"))]
        dtype = np.dtype(_TYPES[_choice(element, "type", "", types)])
        kind = _choice(element, "format", "ascii", ("ascii", "binary", "appended"))
        texts = [element.text or "", *(child.tail or "" for child in element)]
        text = "".join(texts).encode()
        if kind == "ascii":
            words = TextNumbers(text)
            numbers = words.take(count, dtype)
            words.refuse_rest()
            return numbers
        if kind == "appended" and self._raw:
            data = RawData(self._appended[_whole(element, "offset") :])
        elif kind == "appended":
            rest = b"".join(self._appended.split())
            data = Base64Data(rest[_whole(element, "offset") :])
        else:
            data = Base64Data(b"".join(text.split()))
        n_bytes = count * dtype.itemsize
        if self._decompressor is None:
            content = read_uncompressed(data, self._header)
        else:
            content = read_compressed(data, self._header, self._decompressor, n_bytes)
        if kind == "binary" and isinstance(data, Base64Data):
            data.refuse_rest()
        if len(content) != n_bytes:
            raise MeshError(f"it holds {len(content)} bytes, and {n_bytes} are due")
        return np.frombuffer(content, dtype.newbyteorder(self._order)).astype(dtype)
