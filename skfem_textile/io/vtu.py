"""Unstructured grids of VTK, as XML."""

from typing import Any
from xml.etree import ElementTree
from xml.etree.ElementTree import Element

import meshio
import numpy as np
from numpy import ndarray

from ..mesh.checks import MeshError
from ..mesh.user_input import printable
from .file_numbers import Words, from_words
from .vtk import SKFEM, cells_of, mesh_of
from .vtk_encoding import UNPACKERS, Base64, Raw, plain, unpacked

_TYPES = {
    **{f"Int{n}": f"i{n // 8}" for n in (8, 16, 32, 64)},
    **{f"UInt{n}": f"u{n // 8}" for n in (8, 16, 32, 64)},
    **{f"Float{n}": f"f{n // 8}" for n in (32, 64)},
}

_ORDERS: dict[str, Any] = {"LittleEndian": "<", "BigEndian": ">"}


def read(content: bytes) -> tuple[meshio.Mesh, list[str]]:
    """Read an unstructured grid of one piece.

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
    for name, array in (item for some in of_cells for item in some.items()):
        if name.startswith(SKFEM):
            data[name] = file.array(array, n_cells)
    for part in (*piece.findall("PointData"), *piece.findall("CellData")):
        ignored += [name for name in _by_name(part) if name not in data]
    for part in grid.findall("FieldData"):
        ignored += _by_name(part)
    return mesh_of(points, cells, data), ignored


def _only(parent: Element, tag: str) -> Element:
    """The only child of its kind."""
    found = parent.findall(tag)
    if len(found) != 1:
        raise MeshError(
            f"{printable(parent.tag[:40])} must have one {tag}, and has {len(found)}"
        )
    return found[0]


def _by_name(parent: Element) -> dict[str, Element]:
    """Arrays by name."""
    arrays = {child.get("Name", ""): child for child in parent.findall("DataArray")}
    if len(arrays) < len(parent.findall("DataArray")):
        raise MeshError(f"two arrays of {parent.tag} have the same name")
    return arrays


def _whole(element: Element, key: str) -> int:
    """A number that an element names."""
    try:
        return from_words([element.get(key, "").encode()], "u4").item()
    except MeshError as error:
        raise MeshError(f"{key}: {error}") from None


def _choice(element: Element, key: str, default: Any, choices: Any) -> Any:
    """What an element names, of some choices."""
    if (chosen := element.get(key, default)) not in choices:
        raise MeshError(f"{key} {printable(chosen)[:40]!r} is not read")
    return chosen


class _File:
    """The XML of a file, and data that are appended to it."""

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
            raise MeshError(f"it is no XML: {printable(error)[:100]}") from None
        root = self.root
        if root.tag != "VTKFile" or root.get("type") != "UnstructuredGrid":
            raise MeshError("it is no VTKFile of an UnstructuredGrid")
        _choice(root, "version", "0.1", ("0.1", "1.0"))
        self._order = _ORDERS[_choice(root, "byte_order", "LittleEndian", _ORDERS)]
        header = _choice(root, "header_type", "UInt32", ("UInt32", "UInt64"))
        self._header = np.dtype(self._order + _TYPES[header])
        self._unpacker = UNPACKERS[_choice(root, "compressor", None, UNPACKERS)]
        self._appended, self._raw = data, True
        if appended:
            found = _only(root, "AppendedData")
            self._raw = _choice(found, "encoding", "", ("raw", "base64")) == "raw"
            if (found.text or "").strip():
                raise MeshError("appended data must begin with '_'")

    def array(self, element: Element, count: int, whole: bool = False) -> ndarray:
        """The numbers of an array, shape (count,)."""
        try:
            return self._array(element, count, whole)
        except MeshError as error:
            name = printable(element.get("Name", "of the points")[:40])
            raise MeshError(f"array {name!r}: {error}") from None

    def _array(self, element: Element, count: int, whole: bool) -> ndarray:
        types = [name for name in _TYPES if not (whole and name.startswith("F"))]
        dtype = np.dtype(_TYPES[_choice(element, "type", "", types)])
        kind = _choice(element, "format", "ascii", ("ascii", "binary", "appended"))
        inside = [element.text or "", *(child.tail or "" for child in element)]
        text = "".join(inside).encode()
        if kind == "ascii":
            words = Words(text)
            numbers = words.take(count, dtype)
            words.end()
            return numbers
        if kind == "appended" and self._raw:
            data = Raw(self._appended[_whole(element, "offset") :])
        elif kind == "appended":
            rest = b"".join(self._appended.split())
            data = Base64(rest[_whole(element, "offset") :])
        else:
            data = Base64(b"".join(text.split()))
        due = count * dtype.itemsize
        if self._unpacker is None:
            held = plain(data, self._header)
        else:
            held = unpacked(data, self._header, self._unpacker, due)
        if kind == "binary" and isinstance(data, Base64):
            data.end()
        if len(held) != due:
            raise MeshError(f"it holds {len(held)} bytes, and {due} are due")
        return np.frombuffer(held, dtype.newbyteorder(self._order)).astype(dtype)
