"""A plain reader of Gmsh's files, versions 2.2 and 4.1."""

import re
import struct
from collections import Counter

from .mesh_content import MalformedError, MeshContent, Words, demand

_SECTION = re.compile(
    rb"[ \t\r]*\$(?!End)([^\n]*?)[ \t\r]*\n(.*?)\$End\1[ \t\r]*(?:\n|$)", re.DOTALL
)
_NAME = re.compile(rb'[ \t]*(\d+)[ \t]+(\d+)[ \t]+"([^"\n]+)"[ \t\r]*')

# Sections that are read; others may be there twice.
_READ = ("MeshFormat", "PhysicalNames", "Entities", "Nodes", "Elements")

# Dimension and number of nodes by Gmsh's number of a kind of element.
_KINDS = {15: (0, 1), 1: (1, 2), 2: (2, 3), 3: (2, 4)}

Names = dict[tuple[int, int], str]
Elements = list[tuple[int, int, list[int], list[int]]]


class _Packed:
    """Bytes of numbers, taken from their start."""

    def __init__(self, body: bytes) -> None:
        self.body, self.position = body, 0

    def unpack(self, code: str) -> tuple:
        start, end = self.position, self.position + struct.calcsize("<" + code)
        demand(end <= len(self.body), "bytes are missing")
        self.position = end
        return struct.unpack_from("<" + code, self.body, start)

    def line(self) -> bytes:
        line = self.body[self.position :].partition(b"\n")[0]
        self.position += len(line) + 1
        return line

    def end(self) -> None:
        rest = self.body[self.position :]
        demand(rest in (b"", b"\n", b"\r\n"), "bytes are left")


def _take(body, count: int, code: str) -> list:
    """Numbers: i and Q for whole ones, d for others."""
    if isinstance(body, _Packed):
        demand(0 <= count <= len(body.body), "bytes are missing")
        return list(body.unpack(f"{count}{code}"))
    return body.numbers(count) if code == "d" else body.wholes(count)


def read(content: bytes) -> MeshContent:
    """Read a file of Gmsh."""
    sections = _sections(content)
    demand({"MeshFormat", "Nodes", "Elements"} <= set(sections), "sections are missing")
    head, _, rest = sections["MeshFormat"].partition(b"\n")
    words = head.split()
    demand(len(words) == 3 and words[2] == b"8", "format")
    demand(words[0] in (b"2", b"2.2", b"4.1") and words[1] in (b"0", b"1"), "version")
    binary = words[1] == b"1"
    if binary:
        demand(rest[:4] == struct.pack("<i", 1), "order of bytes")
    demand(not rest[4 * binary :].strip(), "format")
    names = _names(sections.get("PhysicalNames"))
    body = {k: (_Packed if binary else Words)(v) for k, v in sections.items()}
    is_41 = words[0] == b"4.1"
    if is_41:
        groups = _groups(body["Entities"]) if "Entities" in body else None
        nodes = _nodes_41(body["Nodes"])
        elements = _elements_41(body["Elements"], groups)
    else:
        nodes = _nodes_22(body["Nodes"])
        elements = _elements_22(body["Elements"])
    for name in ("Nodes", "Elements", "Entities"):
        if name in body and (name != "Entities" or is_41):
            body[name].end()
    return _mesh(names, nodes, elements, not is_41)


def _sections(content: bytes) -> dict[str, bytes]:
    sections: dict[str, bytes] = {}
    position = 0
    while content[position:].strip():
        blank = re.compile(rb"\s*").match(content, position)
        section = _SECTION.match(content, blank.end())
        demand(section, "no section")
        name = section[1].decode(errors="replace")
        demand(name not in sections or name not in _READ, f"two {name}")
        sections[name] = section[2]
        position = section.end()
    return sections


def _names(body: bytes | None) -> Names:
    if body is None:
        return {}
    lines = [line for line in body.split(b"\n") if line.strip()]
    demand(lines and lines[0].strip().isdigit(), "no count of names")
    demand(int(lines[0]) == len(lines) - 1, "count of names")
    names: Names = {}
    for line in lines[1:]:
        words = _NAME.fullmatch(line)
        demand(words, "name")
        try:
            name = words[3].decode()
        except UnicodeDecodeError:
            raise MalformedError("name not in UTF-8") from None
        key = int(words[1]), int(words[2])
        demand(key not in names and name not in names.values(), "a name twice")
        names[key] = name
    return names


def _count(body) -> int:
    if isinstance(body, _Packed):
        line = Words(body.line())
        count = line.whole()
        line.end()
        return count
    return body.whole()


def _nodes_22(body) -> list[tuple[int, list[float]]]:
    count = _count(body)
    demand(count >= 0, "count")
    nodes = []
    for _ in range(count):
        (tag,) = _take(body, 1, "i")
        nodes.append((tag, _take(body, 3, "d")))
    return nodes


def _elements_22(body) -> Elements:
    left = _count(body)
    elements: Elements = []
    while left > 0:
        if isinstance(body, _Packed):
            kind, count, n_tags = _take(body, 3, "i")
            first = None
        else:
            first, kind, n_tags = _take(body, 3, "i")
            count = 1
        demand(kind in _KINDS and 0 < count <= left and n_tags >= 0, "element")
        for _ in range(count):
            number = _take(body, 1, "i")[0] if first is None else first
            tags = _take(body, n_tags, "i")
            nodes = _take(body, _KINDS[kind][1], "i")
            elements.append((kind, number, nodes, [abs(tag) for tag in tags[:1]]))
        left -= count
    return elements


def _groups(body) -> dict[tuple[int, int], list[int]]:
    groups = {}
    for dimension, count in enumerate(_take(body, 4, "Q")):
        demand(count >= 0, "count")
        for _ in range(count):
            (tag,) = _take(body, 1, "i")
            _take(body, 3 if dimension == 0 else 6, "d")
            demand((dimension, tag) not in groups, "an entity twice")
            groups[dimension, tag] = [abs(g) for g in _list(body)]
            if dimension:
                _list(body)
    return groups


def _list(body) -> list[int]:
    (count,) = _take(body, 1, "Q")
    return _take(body, count, "i")


def _nodes_41(body) -> list[tuple[int, list[float]]]:
    n_blocks, n_nodes, _, _ = _take(body, 4, "Q")
    nodes: list[tuple[int, list[float]]] = []
    for _ in range(n_blocks):
        dimension, _, parametric = _take(body, 3, "i")
        demand(dimension in range(4) and parametric in (0, 1), "block of nodes")
        (count,) = _take(body, 1, "Q")
        tags = _take(body, count, "Q")
        for tag in tags:
            x = _take(body, 3 + dimension * parametric, "d")
            nodes.append((tag, x[:3]))
    demand(len(nodes) == n_nodes, "count of nodes")
    return nodes


def _elements_41(body, groups: dict | None) -> Elements:
    n_blocks, n_elements, _, _ = _take(body, 4, "Q")
    elements: Elements = []
    for _ in range(n_blocks):
        dimension, entity, kind = _take(body, 3, "i")
        (count,) = _take(body, 1, "Q")
        demand(kind in _KINDS and _KINDS[kind][0] == dimension, "kind of element")
        demand(groups is None or (dimension, entity) in groups, "no such entity")
        own = groups[dimension, entity] if groups else []
        demand(count <= 10**6, "count")
        for _ in range(count):
            number, *nodes = _take(body, 1 + _KINDS[kind][1], "Q")
            elements.append((kind, number, nodes, own))
    demand(len(elements) == n_elements, "count of elements")
    return elements


def _mesh(names: Names, nodes, elements: Elements, repeats: bool) -> MeshContent:
    """Resolve tags and groups; version 2.2 repeats a cell for each of its groups."""
    index = {tag: i for i, (tag, _) in enumerate(nodes)}
    demand(len(index) == len(nodes), "a node twice")
    numbers = {number for _, number, _, _ in elements}
    demand(len(numbers) == len(elements), "an element twice")
    mesh = MeshContent([tuple(x) for _, x in nodes], [])
    merged_kinds = _to_merge(names, elements) if repeats else set()
    cell_of: dict[tuple[int, ...], int] = {}
    for kind, _, tags, groups in elements:
        demand(all(tag in index for tag in tags), "no such node")
        corners = tuple(index[tag] for tag in tags)
        dimension, _ = _KINDS[kind]
        own = [names[dimension, g] for g in groups if (dimension, g) in names]
        for name in own if dimension == 0 else ():
            mesh.nodes.setdefault(name, set()).add(corners[0])
        for name in own if dimension == 1 else ():
            mesh.edges.setdefault(name, set()).add(frozenset(corners))
        if dimension == 2:
            if kind not in merged_kinds or corners not in cell_of:
                cell_of[corners] = len(mesh.cells)
                mesh.cells.append(corners)
            for name in own:
                mesh.regions.setdefault(name, set()).add(cell_of[corners])
    return mesh


def _to_merge(names: Names, elements: Elements) -> set[int]:
    """Kinds of cells that are repeated only to be in several named groups."""
    kinds = set()
    for kind in (2, 3):
        cells = [(tuple(n), tuple(g)) for k, _, n, g in elements if k == kind]
        times = Counter(nodes for nodes, _ in cells)
        repeated = [(nodes, g) for nodes, g in cells if times[nodes] > 1]
        named = all(g and (2, g[0]) in names for _, g in repeated)
        if named and len(set(repeated)) == len(repeated):
            kinds.add(kind)
    return kinds
