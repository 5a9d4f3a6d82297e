"""A plain reader of VTK's unstructured grids as XML."""

import itertools
import lzma
import re
import struct
import zlib
from binascii import a2b_base64
from xml.dom import minidom
from xml.parsers.expat import ExpatError

from .mesh_content import MalformedError, MeshContent, demand, number, whole
from .vtk_legacy import assembled

# Codes of `struct` by type of number.
_CODES = {
    **{"Int8": "b", "Int16": "h", "Int32": "i", "Int64": "q"},
    **{"UInt8": "B", "UInt16": "H", "UInt32": "I", "UInt64": "Q"},
    **{"Float32": "f", "Float64": "d"},
}

# Base64: groups of four characters, the last of which may be filled up.
_GROUPS = re.compile(rb"([A-Za-z0-9+/]{4})*([A-Za-z0-9+/]{2}(==|[A-Za-z0-9+/]=))?")


class _Reader:
    """The tree of a file, and how its arrays are written."""

    def __init__(self, content: bytes) -> None:
        cut = re.search(rb"<AppendedData[^>]*>\s*_(.*)</AppendedData>", content, re.S)
        self.appended = cut[1] if cut else b""
        text = content[: cut.start(1)] + content[cut.end(1) :] if cut else content
        try:
            self.root = minidom.parseString(text).documentElement
        except (ExpatError, ValueError, LookupError):
            raise MalformedError("no XML") from None
        root = self.root
        demand(root.tagName == "VTKFile", "no VTKFile")
        demand(root.getAttribute("type") == "UnstructuredGrid", "type")
        self.order = {"": "<", "LittleEndian": "<", "BigEndian": ">"}.get(
            root.getAttribute("byte_order"), ""
        )
        head = root.getAttribute("header_type") or "UInt32"
        self.head = {"UInt32": "I", "UInt64": "Q"}.get(head, "")
        version = root.getAttribute("version") or "0.1"
        demand(version in ("0.1", "1.0") and self.order and self.head, "header")
        self.packing = root.getAttribute("compressor")
        unpack = {"": None, "vtkZLibDataCompressor": zlib.decompress}
        unpack["vtkLZMADataCompressor"] = lzma.decompress
        demand(self.packing in unpack, "compressor")
        self.unpack = unpack[self.packing]
        self.raw = False
        if cut:
            encoding = child(root, "AppendedData").getAttribute("encoding")
            demand(encoding in ("raw", "base64"), "encoding")
            self.raw = encoding == "raw"

    def array(self, element, count: int, wholes: bool = False) -> list:
        """The numbers of an array."""
        kind = element.getAttribute("type")
        demand(kind in _CODES and not (wholes and kind.startswith("F")), "type")
        code = _CODES[kind]
        way = element.getAttribute("format") or "ascii"
        nodes = element.childNodes
        text = "".join(n.data for n in nodes if n.nodeType in (3, 4)).encode()
        if way == "ascii":
            read_word = number if code in "fd" else whole
            values = [read_word(word) for word in text.split()]
            demand(len(values) == count, "count of an array")
            form = f"{count}{code}"
            try:
                return list(struct.unpack(form, struct.pack(form, *values)))
            except (struct.error, OverflowError):
                raise MalformedError("a number is too large") from None
        demand(way in ("binary", "appended"), "format")
        if way == "appended":
            offset = whole(element.getAttribute("offset").encode())
            text = self.appended if self.raw else b"".join(self.appended.split())
            text = text[offset:]
        else:
            text = b"".join(text.split())
        held, left = self.held(text, self.raw and way == "appended")
        demand(way == "appended" or not left, "an array is too long")
        form = f"{self.order}{count}{code}"
        demand(len(held) == count * struct.calcsize(f"<{code}"), "size of an array")
        return list(struct.unpack(form, held))

    def held(self, text: bytes, raw: bool) -> tuple[bytes, bytes]:
        """The bytes of an array, and the text after it."""
        size = struct.calcsize(self.order + self.head)
        start, _ = _start(text, size, raw)
        (count,) = struct.unpack(self.order + self.head, start[:size])
        if self.unpack is None:
            alone = -(-size // 3) * 4
            if not raw and text[:alone].endswith(b"=" * (-size % 3)):
                return _run(text[alone:], count, raw)
            content, left = _run(text, size + count, raw)
            return content[size:], left
        demand(count < len(text), "count of blocks")
        head, text = _run(text, size * (3 + count), raw)
        numbers = struct.unpack(f"{self.order}{3 + count}{self.head}", head)
        packed, left = _run(text, sum(numbers[3:]), raw)
        blocks = []
        for i, length in enumerate(numbers[3:]):
            due = numbers[2] or numbers[1] if i == count - 1 else numbers[1]
            try:
                blocks.append(self.unpack(packed[:length]))
            except (zlib.error, lzma.LZMAError, EOFError):
                raise MalformedError("it cannot be unpacked") from None
            demand(len(blocks[-1]) == due, "size of a block")
            packed = packed[length:]
        return b"".join(blocks), left


def _run(text: bytes, count: int, raw: bool) -> tuple[bytes, bytes]:
    """A count of bytes that are encoded together, and the text after them."""
    content, rest = _start(text, count, raw)
    demand(len(content) == count, "length of an array")
    return content, rest


def _start(text: bytes, count: int, raw: bool) -> tuple[bytes, bytes]:
    """At least a count of bytes, from whole groups, and the text after them."""
    end = count if raw else -(-count // 3) * 4
    demand(end <= len(text), "an array is cut off")
    content = text[:end] if raw else _decoded(text[:end])
    demand(len(content) >= count, "an array is cut off")
    return content, text[end:]


def _decoded(text: bytes) -> bytes:
    demand(_GROUPS.fullmatch(text), "no base64")
    return a2b_base64(text)


def children(parent, tag: str) -> list:
    """Children with a tag."""
    return [n for n in parent.childNodes if n.nodeType == 1 and n.tagName == tag]


def child(parent, tag: str):
    """The only child with a tag."""
    with_tag = children(parent, tag)
    demand(len(with_tag) == 1, f"one {tag}")
    return with_tag[0]


def _count(element, key: str) -> int:
    count = whole(element.getAttribute(key).encode())
    demand(count >= 0, key)
    return count


def read(content: bytes) -> MeshContent:
    """Read an unstructured grid."""
    reader = _Reader(content)
    piece = child(child(reader.root, "UnstructuredGrid"), "Piece")
    n_points, n_cells = (_count(piece, f"NumberOf{x}") for x in ("Points", "Cells"))
    positions = child(child(piece, "Points"), "DataArray")
    demand(_count(positions, "NumberOfComponents") == 3, "components")
    points = reader.array(positions, 3 * n_points)
    arrays = {}
    for array in children(child(piece, "Cells"), "DataArray"):
        demand(array.getAttribute("Name") not in arrays, "an array twice")
        arrays[array.getAttribute("Name")] = array
    demand({"types", "offsets", "connectivity"} <= set(arrays), "arrays of the cells")
    types = reader.array(arrays["types"], n_cells, True)
    offsets = [0, *reader.array(arrays["offsets"], n_cells, True)]
    demand(offsets == sorted(offsets), "offsets")
    nodes = reader.array(arrays["connectivity"], offsets[-1], True)
    cells = [nodes[a:b] for a, b in itertools.pairwise(offsets)]
    data: dict[str, list] = {}
    for part in children(piece, "CellData"):
        for array in children(part, "DataArray"):
            name = array.getAttribute("Name")
            if name.startswith("skfem:"):
                demand(name not in data, "names twice")
                data[name] = reader.array(array, n_cells)
    return assembled(points, types, cells, data)
