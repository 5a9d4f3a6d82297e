"""Plain readers of mesh files, independent of the library and of meshio.

They read the output of the writers in `mesh_files`, damaged or not.
"""

import math
import re
import struct
import zlib
from binascii import a2b_base64
from collections import Counter, deque
from dataclasses import dataclass, field
from itertools import pairwise
from xml.dom import minidom
from xml.parsers.expat import ExpatError

_WHOLE = re.compile(rb"[+-]?\d+")
_NUMBER = re.compile(rb"[+-]?((\d+\.?\d*|\.\d+)([eE][+-]?\d+)?|(?i:nan|inf|infinity))")


class MalformedError(Exception):
    """A file that departs from its format or contains unreadable data."""


@dataclass
class MeshContent:
    """Positions of nodes, cells as their nodes, and named groups.

    ``edges`` are pairs of nodes, ``regions`` numbers of cells, ``nodes`` numbers.  The
    outer edges of one cell whose ends are both in one of ``node_sets`` are named, too.
    """

    points: list
    cells: list = field(default_factory=list)
    edges: dict = field(default_factory=dict)
    regions: dict = field(default_factory=dict)
    nodes: dict = field(default_factory=dict)
    node_sets: dict = field(default_factory=dict)


def expect(holds, message=""):
    """Raise `MalformedError` unless a condition holds."""
    if not holds:
        raise MalformedError(message)


def whole(word):
    """A whole number in decimal digits."""
    expect(_WHOLE.fullmatch(word), f"{word!r} is no whole number")
    return int(word)


def number(word):
    """A number in decimal digits."""
    expect(_NUMBER.fullmatch(word), f"{word!r} is no number")
    return float(word)


class _Stream:
    """The rest of a file or of a section, its numbers as words or as bytes.

    ``order`` is the byte order as in `struct`, empty for words.
    """

    def __init__(self, rest, order=""):
        self.rest, self.order = rest, order

    def take(self, count, code):
        """The next numbers of a kind, as in `struct`."""
        expect(0 <= count <= len(self.rest), "numbers are missing")
        if self.order:
            size = count * struct.calcsize(self.order + code)
            expect(size <= len(self.rest), "numbers are missing")
            held, self.rest = self.rest[:size], self.rest[size:]
            return list(struct.unpack(f"{self.order}{count}{code}", held))
        words = self.rest.split(None, count)
        expect(len(words) >= count, "numbers are missing")
        self.rest = words[count] if len(words) > count else b""
        return [(number if code in "fd" else whole)(word) for word in words[:count]]

    def line(self):
        """The rest of the line."""
        line, _, self.rest = self.rest.partition(b"\n")
        return line

    def count(self):
        """A count, which is a word or a line."""
        return whole(self.line().strip()) if self.order else self.take(1, "i")[0]

    def end(self):
        """Demand that nothing is left."""
        rest = self.rest if self.order else self.rest.strip()
        expect(rest in (b"", b"\n", b"\r\n"), "something is left")


# -------------------------------------------------------------------------------- Gmsh

_SECTION = re.compile(
    rb"\s*\$(?!End)([^\n]*?)[ \t\r]*\n(.*?)\$End\1[ \t\r]*(?:\n|$)", re.DOTALL
)
_NAME = re.compile(rb'[ \t]*(\d+)[ \t]+(\d+)[ \t]+"([^"\n]+)"[ \t\r]*')

# Sections that are read; others may be repeated.
_READ = (b"MeshFormat", b"PhysicalNames", b"Entities", b"Nodes", b"Elements")

# Dimension and number of nodes by Gmsh's number of a kind of element.
_KINDS = {15: (0, 1), 1: (1, 2), 2: (2, 3), 3: (2, 4)}


def gmsh(content):
    """Read a file of Gmsh, of version 2.2 or 4.1."""
    sections, position = {}, 0
    while content[position:].strip():
        section = _SECTION.match(content, position)
        expect(section, "no section")
        expect(section[1] not in sections or section[1] not in _READ, "a section twice")
        sections[section[1]], position = section[2], section.end()
    expect({b"MeshFormat", b"Nodes", b"Elements"} <= set(sections), "no such section")
    head, _, rest = sections[b"MeshFormat"].partition(b"\n")
    words = head.split()
    expect(len(words) == 3 and words[2] == b"8", "format")
    expect(words[0] in (b"2", b"2.2", b"4.1") and words[1] in (b"0", b"1"), "version")
    binary = words[1] == b"1"
    expect(not binary or rest[:4] == struct.pack("<i", 1), "order of bytes")
    expect(not rest[4 * binary :].strip(), "format")
    body = {name: _Stream(b, "<" * binary) for name, b in sections.items()}
    read = [b"Nodes", b"Elements"]
    if words[0] == b"4.1":
        groups = _entities(body[b"Entities"]) if b"Entities" in body else None
        nodes, elements = (
            _nodes_41(body[b"Nodes"]),
            _cells_41(body[b"Elements"], groups),
        )
        read += [b"Entities"] * (groups is not None)
    else:
        nodes, elements = _nodes_22(body[b"Nodes"]), _cells_22(body[b"Elements"])
    for name in read:
        body[name].end()
    return _mesh_of_gmsh(_names(sections), nodes, elements, words[0] != b"4.1")


def _names(sections):
    """Names by dimension and number of their group."""
    lines = [x for x in sections.get(b"PhysicalNames", b"0").split(b"\n") if x.strip()]
    expect(lines and lines[0].strip().isdigit(), "no count of names")
    expect(int(lines[0]) == len(lines) - 1, "count of names")
    names = {}
    for line in lines[1:]:
        words = _NAME.fullmatch(line)
        expect(words, "name")
        try:
            name = words[3].decode()
        except UnicodeDecodeError:
            raise MalformedError("name not in UTF-8") from None
        key = int(words[1]), int(words[2])
        expect(key not in names and name not in names.values(), "a name twice")
        names[key] = name
    return names


def _nodes_22(body):
    count = body.count()
    expect(count >= 0, "count")
    return [(*body.take(1, "i"), body.take(3, "d")) for _ in range(count)]


def _cells_22(body):
    left, elements = body.count(), []
    while left > 0:
        if body.order:
            (kind, count, n_tags), first = body.take(3, "i"), None
        else:
            (first, kind, n_tags), count = body.take(3, "i"), 1
        expect(kind in _KINDS and 0 < count <= left and n_tags >= 0, "element")
        for _ in range(count):
            tag = body.take(1, "i")[0] if first is None else first
            groups = [abs(group) for group in body.take(n_tags, "i")[:1]]
            elements.append((kind, tag, body.take(_KINDS[kind][1], "i"), groups))
        left -= count
    return elements


def _entities(body):
    """Groups by dimension and tag of an entity."""
    groups = {}
    for dimension, count in enumerate(body.take(4, "Q")):
        expect(count >= 0, "count")
        for _ in range(count):
            (tag,) = body.take(1, "i")
            body.take(6 if dimension else 3, "d")
            expect((dimension, tag) not in groups, "an entity twice")
            groups_here = body.take(*body.take(1, "Q"), "i")
            groups[dimension, tag] = [abs(group) for group in groups_here]
            if dimension:
                body.take(*body.take(1, "Q"), "i")
    return groups


def _nodes_41(body):
    n_blocks, n_nodes, _, _ = body.take(4, "Q")
    nodes = []
    for _ in range(n_blocks):
        dimension, _, parametric = body.take(3, "i")
        expect(dimension in range(4) and parametric in (0, 1), "block of nodes")
        for tag in body.take(*body.take(1, "Q"), "Q"):
            nodes.append((tag, body.take(3 + dimension * parametric, "d")[:3]))
    expect(len(nodes) == n_nodes, "count of nodes")
    return nodes


def _cells_41(body, groups):
    n_blocks, n_elements, _, _ = body.take(4, "Q")
    elements = []
    for _ in range(n_blocks):
        dimension, entity, kind = body.take(3, "i")
        (count,) = body.take(1, "Q")
        expect(kind in _KINDS and _KINDS[kind][0] == dimension, "kind of element")
        expect(groups is None or (dimension, entity) in groups, "no such entity")
        expect(count <= 10**6, "count")
        groups_here = groups[dimension, entity] if groups else []
        for _ in range(count):
            tag, *nodes = body.take(1 + _KINDS[kind][1], "Q")
            elements.append((kind, tag, nodes, groups_here))
    expect(len(elements) == n_elements, "count of elements")
    return elements


def _mesh_of_gmsh(names, nodes, elements, repeats):
    """Resolve tags and groups; version 2.2 repeats a cell for each of its groups."""
    index = {tag: i for i, (tag, _) in enumerate(nodes)}
    expect(len(index) == len(nodes), "a node twice")
    expect(len({tag for _, tag, _, _ in elements}) == len(elements), "an element twice")
    mesh = MeshContent([tuple(x) for _, x in nodes])
    merged, cell_of = set(), {}
    for kind in (2, 3) if repeats else ():
        cells = [(tuple(n), tuple(g)) for k, _, n, g in elements if k == kind]
        times = Counter(corners for corners, _ in cells)
        again = [cell for cell in cells if times[cell[0]] > 1]
        if len(set(again)) == len(again):
            merged |= (
                {kind} if all(g and (2, g[0]) in names for _, g in again) else set()
            )
    for kind, _, tags, groups in elements:
        expect(all(tag in index for tag in tags), "no such node")
        corners, dimension = tuple(index[tag] for tag in tags), _KINDS[kind][0]
        if dimension == 2 and (kind not in merged or corners not in cell_of):
            cell_of[corners] = len(mesh.cells)
            mesh.cells.append(corners)
        for name in (names[dimension, g] for g in groups if (dimension, g) in names):
            if dimension == 2:
                mesh.regions.setdefault(name, set()).add(cell_of[corners])
            elif dimension == 1:
                mesh.edges.setdefault(name, set()).add(frozenset(corners))
            else:
                mesh.nodes.setdefault(name, set()).add(corners[0])
    return mesh


# ------------------------------------------------------------------------------ Abaqus

# Types of elements by their number of nodes.
_TYPES = {
    2: "T2D2 T2D2H T3D2 T3D2H B21 B21H B31 B31H",
    3: "CPS3 STRI3 S3 S3R S3RS R3D3 M3D3",
    4: "CPS4 CPS4R S4 S4R S4RS S4RSW S4R5 CAX4P M3D4 M3D4R",
}
_CORNERS = {kind: n for n, kinds in _TYPES.items() for kind in kinds.split()}

# Keywords that change the mesh, that may occur once in a file, and that are read, with
# the parameters that they may have.
_CHANGES = ["IMPORT", "IMPERFECTION", "SYMMETRIC MODEL GENERATION", "PARAMETER"]
_CHANGES += ["INCLUDE", "NGEN", "NFILL", "NCOPY", "NMAP", "SYSTEM", "ELGEN", "ELCOPY"]
_ONCE = ("PART", "INSTANCE")
_PARAMETERS = {
    "NODE": {"NSET"},
    "ELEMENT": {"TYPE", "ELSET"},
    "NSET": {"NSET", "ELSET", "GENERATE", "INSTANCE", "INTERNAL", "UNSORTED"},
    "ELSET": {"ELSET", "GENERATE", "INSTANCE", "INTERNAL", "UNSORTED"},
    "INSTANCE": {"NAME", "PART"},
}


def keyword_blocks(content):
    """Keyword, parameters by name, and lines of data of each block of a file."""
    lines = [line.strip() for line in re.split(rb"\r\n|[\r\n]", content)]
    lines = deque(line for line in lines if line and not line.startswith(b"**"))
    expect(lines and lines[0].startswith(b"*"), "no keyword")
    while lines:
        head, data = lines.popleft(), []
        while head.endswith(b",") and lines:
            head += lines.popleft()
        while lines and not lines[0].startswith(b"*"):
            data.append(lines.popleft())
        keyword, *parameters = head[1:].decode(errors="replace").split(",")
        arguments = {}
        for parameter in filter(str.strip, parameters):
            key, _, value = (part.strip() for part in parameter.partition("="))
            expect(key.upper() not in arguments, "a parameter twice")
            arguments[key.upper()] = value
        yield " ".join(keyword.upper().split()), arguments, data


def abaqus(content):
    """Read a file of Abaqus."""
    nodes, elements, names, keywords = {}, {}, {}, set()
    sets, of_elements = {"NSET": {}, "ELSET": {}}, set()
    part, instance, level = "", "", ""

    def name_of(kind, options):
        name = options.get(kind, "")
        expect(name and "\ufffd" not in name, "name")
        return names.setdefault((kind, name.upper()), name)  # capitals are the same

    for keyword, keys, lines in keyword_blocks(content):
        expect(keyword not in _CHANGES, "keyword that changes the mesh")
        expect(keyword not in _ONCE or keyword not in keywords, f"two {keyword}")
        keywords.add(keyword)
        expect(set(keys) <= _PARAMETERS.get(keyword, set(keys)), "parameter")
        if keyword in ("INSTANCE", "END INSTANCE", "ASSEMBLY", "END ASSEMBLY"):
            level = keyword
        in_assembly = nodes and level in ("ASSEMBLY", "END INSTANCE")
        if keyword == "PART":
            part = keys.get("NAME", "").upper()
        elif keyword == "INSTANCE":
            instance = keys.get("NAME", "").upper()
            expect(not part or keys.get("PART", part).upper() == part, "part")
            nodes = _placed(nodes, lines)
        elif keyword in ("NODE", "ELEMENT") and in_assembly:
            continue
        elif keyword == "NODE":
            rows = [[word.strip() for word in line.split(b",")] for line in lines]
            more = {whole(tag): tuple(map(number, x)) for tag, *x in rows}
            expect(len(more) == len(rows) and not more.keys() & nodes, "a node twice")
            nodes |= more
            widths = {len(x) for x in nodes.values()}
            expect(widths in (set(), {2}, {3}), "coordinates")
            if "NSET" in keys:
                sets["NSET"].setdefault(name_of("NSET", keys), set()).update(more)
        elif keyword == "ELEMENT":
            block = _elements_of_abaqus(keys.get("TYPE", "").upper(), lines)
            expect(not block.keys() & elements.keys(), "an element twice")
            elements |= block
            if "ELSET" in keys:
                name = name_of("ELSET", keys)
                expect(name not in sets["ELSET"] or name in of_elements, "set twice")
                of_elements.add(name)
                sets["ELSET"].setdefault(name, set()).update(block)
        elif keyword in sets:
            name = name_of(keyword, keys)
            expect(name not in sets[keyword], "set twice")
            known = {n.upper(): tags for n, tags in sets[keyword].items()}
            expect(keys.get("INSTANCE", instance).upper() == instance, "instance")
            known |= {f"{instance}.{n}": tags for n, tags in known.items()}
            if keyword == "NSET" and "ELSET" in keys:
                expect(not lines, "members of a set of nodes of elements")
                of = {n.upper(): tags for n, tags in sets["ELSET"].items()}
                tags = of.get(keys["ELSET"].upper(), {None})
                expect(None not in tags, "no such set")
                ends = (elements.get(tag, ()) for tag in tags)
                sets[keyword][name] = {node for corners in ends for node in corners}
            else:
                sets[keyword][name] = _members(lines, "GENERATE" in keys, known)
    used = {node for corners in elements.values() for node in corners}
    sets["NSET"] = {
        name: tags - (nodes.keys() - used) for name, tags in sets["NSET"].items()
    }
    nodes = {tag: x for tag, x in nodes.items() if tag in used}
    index = {tag: i for i, tag in enumerate(nodes)}
    mesh, cells = MeshContent(list(nodes.values())), {}
    try:
        ends = {tag: tuple(index[n] for n in block) for tag, block in elements.items()}
        for tag, corners in ends.items():
            if len(corners) > 2:
                cells[tag] = len(mesh.cells)
                mesh.cells.append(corners)
        for name, tags in sets["ELSET"].items():
            pairs = (ends[tag] for tag in tags if len(ends[tag]) == 2)
            mesh.edges[name] = set(map(frozenset, pairs))
            mesh.regions[name] = {cells[tag] for tag in tags if tag in cells}
        for name, tags in sets["NSET"].items():
            mesh.node_sets[name] = {index[tag] for tag in tags}
    except KeyError:
        raise MalformedError("it names what is not there") from None
    return mesh


def _elements_of_abaqus(kind, lines):
    expect(kind in _CORNERS, "type of element")
    elements, joined = {}, b""
    for line in lines:
        joined += line
        words = [word.strip() for word in joined.split(b",")]
        if words[-1] == b"" and len(words) - 1 < 1 + _CORNERS[kind]:
            continue
        tag, *nodes = map(whole, words[:-1] if words[-1] == b"" else words)
        expect(len(nodes) == _CORNERS[kind] and tag not in elements, "element")
        elements[tag], joined = tuple(nodes), b""
    expect(not joined, "an element is cut off")
    return elements


def _placed(nodes, lines):
    """Nodes after a translation, and a rotation by a matrix about an axis."""
    if not lines:
        return nodes
    rows = [[number(w.strip()) for w in x.split(b",") if w.strip()] for x in lines]
    expect(list(map(len, rows)) in ([3], [3, 7]), "position")
    moved = {}
    for tag, x in nodes.items():
        p = [a + b for a, b in zip((*x, 0.0)[:3], rows[0], strict=True)]
        for row in rows[1:]:
            start, axis = row[:3], [b - a for a, b in pairwise_of(row)]
            size = math.dist(row[:3], row[3:6])
            expect(size, "axis")
            (u, v, w), t = (a / size for a in axis), math.radians(row[6])
            c, s, k = math.cos(t), math.sin(t), 1 - math.cos(t)
            matrix = (
                (c + k * u * u, k * u * v - s * w, k * u * w + s * v),
                (k * u * v + s * w, c + k * v * v, k * v * w - s * u),
                (k * u * w - s * v, k * v * w + s * u, c + k * w * w),
            )
            d = [a - b for a, b in zip(p, start, strict=True)]
            p = [
                a + sum(m * x for m, x in zip(line, d, strict=True))
                for a, line in zip(start, matrix, strict=True)
            ]
        moved[tag] = tuple(p)
    return moved


def pairwise_of(row):
    """Coordinates of two points, in pairs."""
    return zip(row[:3], row[3:6], strict=True)


def _members(lines, generate, known):
    """Members of a set; of first, last and step if they are to be generated."""
    rows = [[word.strip() for word in line.split(b",")] for line in lines]
    words = [word for row in rows for word in (row if row[-1] else row[:-1])]
    numbers = {int(word) for word in words if word.isdigit()}
    names = [w.decode(errors="replace").upper() for w in words if not w.isdigit()]
    expect(all(name in known for name in names), "member")
    if not generate:
        return numbers.union(*(known[name] for name in names))
    expect(not names, "GENERATE")
    members = set()
    for row in rows:
        numbers = [int(word) for word in (row if row[-1] else row[:-1])]
        expect(len(numbers) in (2, 3), "GENERATE")
        first, last, step = [*numbers, 1][:3]
        expect(step > 0 and last >= first, "GENERATE")
        expect((last - first) % step == 0, "GENERATE")
        expect((last - first) // step < 10**6, "GENERATE")
        members.update(range(first, last + 1, step))
    expect(members, "GENERATE")
    return members


# ------------------------------------------------------------------------- VTK, legacy

# Number of nodes by VTK's number of a cell, and codes of kinds of numbers.
_OF_VTK = {1: 1, 3: 2, 5: 3, 9: 4}
_LEGACY = {"int": "i", "long": "q", "vtktypeint64": "q", "float": "f", "double": "d"}


def _mesh_of_vtk(points, types, cells, data):
    """The mesh of points, three numbers each, cells, and scikit-fem's names in data."""
    n = len(points) // 3
    expect(len(points) == 3 * n and len(types) == len(cells), "counts")
    mesh = MeshContent([tuple(points[3 * i : 3 * i + 3]) for i in range(n)])
    for kind, cell in zip(types, cells, strict=True):
        expect(_OF_VTK.get(kind) == len(cell), "kind of cell")
        expect(all(0 <= node < n for node in cell), "no such node")
        mesh.cells += [tuple(cell)] * (len(cell) > 2)
    expect(not data or set(types) in ({5}, {9}), "names of one kind")
    for key, values in data.items():
        expect(len(values) == len(mesh.cells), "length of names")
        _, kind, name = key.split(":", 2) if key.count(":") > 1 else ("", "", "")
        for i, (value, cell) in enumerate(zip(values, mesh.cells, strict=True)):
            most = {"s": 1, "b": 2 ** len(cell) - 1}.get(kind, -1)
            expect(value in range(most + 1), "names")
            if kind == "s" and value:
                mesh.regions.setdefault(name, set()).add(i)
            for bit, pair in enumerate(pairwise((*cell, cell[0]))):
                if kind == "b" and int(value) >> bit & 1:
                    mesh.edges.setdefault(name, set()).add(frozenset(pair))
    return mesh


def _as(code, values):
    """Numbers as their kind can hold them."""
    try:
        form = f"{len(values)}{code}"
        return list(struct.unpack(form, struct.pack(form, *values)))
    except (struct.error, OverflowError):
        raise MalformedError("a number is too large") from None


class _Legacy(_Stream):
    """The rest of a legacy file."""

    def __init__(self, content):
        head, _, kind, *rest = [*content.split(b"\n", 3), b"", b""][:4]
        words = head.split()
        expect(b" ".join(words[:4]).lower() == b"# vtk datafile version", "header")
        versions = b"1.0", b"2.0", b"3.0", b"4.0", b"4.1", b"4.2", b"5.1"
        expect(len(words) == 5 and words[4] in versions, "version")
        expect(kind.strip().upper() in (b"ASCII", b"BINARY"), "kind")
        super().__init__(*rest, ">" * (kind.strip().upper() == b"BINARY"))
        self.new = words[4] == b"5.1"

    def words(self, length=None):
        """Words of the next line that is not blank."""
        self.rest = self.rest.lstrip()
        words = [word.decode(errors="replace") for word in self.line().split()]
        expect(length in (None, len(words)), "words of a line")
        return words

    def numbers(self, count, kind):
        """The next numbers of a kind."""
        expect(kind.lower() in _LEGACY, "kind of numbers")
        code = _LEGACY[kind.lower()]
        values = self.take(count, code)
        return _as(code, values) if code == "f" else values

    def cells(self, n, size):
        """Nodes of each cell."""
        if self.new:
            parts = []
            for name, count in (("OFFSETS", n), ("CONNECTIVITY", size)):
                keyword, kind = self.words(2)
                expect(keyword.upper() == name, name)
                parts.append(self.numbers(count, kind))
            offsets, nodes = parts
            expect(n and offsets[0] == 0 and offsets[-1] == size, "offsets")
            expect(offsets == sorted(offsets), "offsets")
            return [nodes[a:b] for a, b in pairwise(offsets)]
        numbers, cells = self.numbers(size, "int"), []
        while numbers:
            k, *numbers = numbers
            expect(0 <= k <= len(numbers), "size of a cell")
            cells.append(numbers[:k])
            numbers = numbers[k:]
        expect(len(cells) == n, "count of cells")
        return cells


def vtk(content):
    """Read a legacy file of VTK."""
    file, parts, names, count, of_cells = _Legacy(content), {}, {}, 0, False

    def keep(name, size, n, kind):
        values = file.numbers(size * n, kind)
        if of_cells and name.startswith("skfem:"):
            expect(name not in names and size == 1 and n == count, "names")
            names[name] = values

    while words := file.words():
        keyword, options = words[0].upper(), words[1:]
        expect(keyword not in parts, f"two {keyword}")
        lengths = {"DATASET": 1, "CELL_TYPES": 1, "POINT_DATA": 1, "CELL_DATA": 1}
        expect(len(options) == lengths.get(keyword, len(options)), keyword)
        if keyword == "DATASET":
            expect(options == ["UNSTRUCTURED_GRID"], "dataset")
        elif keyword == "SCALARS":
            expect(len(options) in (2, 3), keyword)
            table, _ = file.words(2)
            expect(table.upper() == "LOOKUP_TABLE", keyword)
            keep(options[0], *map(_count, options[2:] or "1"), count, options[1])
        elif keyword == "FIELD":
            expect(len(options) == 2, keyword)
            for _ in range(_count(options[1])):
                name, size, n, kind = file.words(4)
                keep(name, _count(size), _count(n), kind)
        elif keyword == "CELL_TYPES":
            parts[keyword] = file.numbers(_count(options[0]), "int")
        elif keyword in ("POINT_DATA", "CELL_DATA"):
            parts[keyword] = count = _count(options[0])
            of_cells = keyword == "CELL_DATA"
        else:
            expect(keyword in ("POINTS", "CELLS") and len(options) == 2, keyword)
            if keyword == "POINTS":
                parts[keyword] = file.numbers(3 * _count(options[0]), options[1])
            else:
                parts[keyword] = file.cells(*map(_count, options))
    expect({"POINTS", "CELLS", "CELL_TYPES"} <= set(parts), "parts are missing")
    points, cells = parts["POINTS"], parts["CELLS"]
    expect(parts.get("POINT_DATA", len(points) // 3) == len(points) // 3, "data")
    expect(parts.get("CELL_DATA", len(cells)) == len(cells), "data")
    return _mesh_of_vtk(points, parts["CELL_TYPES"], cells, names)


def _count(word):
    count = whole(word.encode())
    expect(count >= 0, "count")
    return count


# ---------------------------------------------------------------------------- VTK, XML

# Codes of `struct` by type of number.
_XML = {
    **{"Int8": "b", "Int16": "h", "Int32": "i", "Int64": "q"},
    **{"UInt8": "B", "UInt16": "H", "UInt32": "I", "UInt64": "Q"},
    **{"Float32": "f", "Float64": "d"},
}

# Base64: groups of four characters, the last of which may be padded.
_GROUPS = re.compile(rb"([A-Za-z0-9+/]{4})*([A-Za-z0-9+/]{2}(==|[A-Za-z0-9+/]=))?")


class _Tree:
    """The tree of a file, and how its arrays are written."""

    def __init__(self, content):
        cut = re.search(rb"<AppendedData[^>]*>\s*_(.*)</AppendedData>", content, re.S)
        self.appended = cut[1] if cut else b""
        text = content[: cut.start(1)] + content[cut.end(1) :] if cut else content
        try:
            self.root = minidom.parseString(text).documentElement
        except (ExpatError, ValueError, LookupError):
            raise MalformedError("no XML") from None
        get = self.root.getAttribute
        expect(self.root.tagName == "VTKFile", "no VTKFile")
        expect(get("type") == "UnstructuredGrid", "type")
        orders = {"": "<", "LittleEndian": "<", "BigEndian": ">"}
        self.order = orders.get(get("byte_order"), "")
        self.head = {"UInt32": "I", "UInt64": "Q", "": "I"}.get(get("header_type"), "")
        expect(get("version") in ("0.1", "1.0", "") and self.order, "header")
        self.zipped = get("compressor") == "vtkZLibDataCompressor"
        expect(self.head and (self.zipped or not get("compressor")), "header")
        self.raw = False
        if cut:
            encoding = _child(self.root, "AppendedData").getAttribute("encoding")
            expect(encoding in ("raw", "base64"), "encoding")
            self.raw = encoding == "raw"

    def array(self, element, count, wholes=False):
        """The numbers of an array."""
        kind, encoding = element.getAttribute("type"), element.getAttribute("format")
        expect(kind in _XML and not (wholes and kind.startswith("F")), "type")
        code = _XML[kind]
        nodes = element.childNodes
        text = "".join(n.data for n in nodes if n.nodeType in (3, 4)).encode()
        if encoding in ("ascii", ""):
            read = number if code in "fd" else whole
            values = [read(word) for word in text.split()]
            expect(len(values) == count, "count of an array")
            return _as(code, values)
        expect(encoding in ("binary", "appended"), "format")
        raw = self.raw and encoding == "appended"
        if encoding == "appended":
            text = self.appended if raw else b"".join(self.appended.split())
            text = text[whole(element.getAttribute("offset").encode()) :]
        else:
            text = b"".join(text.split())
        held, left = self.held(text, raw)
        expect(encoding == "appended" or not left, "an array is too long")
        expect(len(held) == count * struct.calcsize(f"<{code}"), "size of an array")
        return list(struct.unpack(f"{self.order}{count}{code}", held))

    def held(self, text, raw):
        """The bytes of an array, and the text after it."""
        size = struct.calcsize(self.order + self.head)
        start, _ = _start(text, size, raw)
        (count,) = struct.unpack(self.order + self.head, start[:size])
        if not self.zipped:
            alone = -(-size // 3) * 4
            if not raw and text[:alone].endswith(b"=" * (-size % 3)):
                return _run(text[alone:], count, raw)
            content, left = _run(text, size + count, raw)
            return content[size:], left
        expect(count < len(text), "count of blocks")
        head, text = _run(text, size * (3 + count), raw)
        numbers = struct.unpack(f"{self.order}{3 + count}{self.head}", head)
        packed, left = _run(text, sum(numbers[3:]), raw)
        content = b""
        for i, length in enumerate(numbers[3:]):
            due = numbers[2] or numbers[1] if i == count - 1 else numbers[1]
            try:
                block = zlib.decompress(packed[:length])
            except zlib.error:
                raise MalformedError("it cannot be unpacked") from None
            expect(len(block) == due, "size of a block")
            content, packed = content + block, packed[length:]
        return content, left


def _run(text, count, raw):
    """A count of bytes that are encoded together, and the text after them."""
    content, rest = _start(text, count, raw)
    expect(len(content) == count, "length of an array")
    return content, rest


def _start(text, count, raw):
    """At least a count of bytes, from whole groups, and the text after them."""
    end = count if raw else -(-count // 3) * 4
    expect(end <= len(text), "an array is cut off")
    expect(raw or _GROUPS.fullmatch(text[:end]), "no base64")
    content = text[:end] if raw else a2b_base64(text[:end])
    expect(len(content) >= count, "an array is cut off")
    return content, text[end:]


def _children(parent, tag):
    return [n for n in parent.childNodes if n.nodeType == 1 and n.tagName == tag]


def _child(parent, tag):
    """The only child with a tag."""
    with_tag = _children(parent, tag)
    expect(len(with_tag) == 1, f"one {tag}")
    return with_tag[0]


def vtu(content):
    """Read an unstructured grid of VTK as XML."""
    tree = _Tree(content)
    piece = _child(_child(tree.root, "UnstructuredGrid"), "Piece")
    n_points, n_cells = (
        _count(piece.getAttribute(f"NumberOf{x}")) for x in ("Points", "Cells")
    )
    positions = _child(_child(piece, "Points"), "DataArray")
    expect(_count(positions.getAttribute("NumberOfComponents")) == 3, "components")
    points, arrays, names = tree.array(positions, 3 * n_points), {}, {}
    for array in _children(_child(piece, "Cells"), "DataArray"):
        expect(array.getAttribute("Name") not in arrays, "an array twice")
        arrays[array.getAttribute("Name")] = array
    expect({"types", "offsets", "connectivity"} <= set(arrays), "arrays of the cells")
    types = tree.array(arrays["types"], n_cells, True)
    offsets = [0, *tree.array(arrays["offsets"], n_cells, True)]
    expect(offsets == sorted(offsets), "offsets")
    nodes = tree.array(arrays["connectivity"], offsets[-1], True)
    cells = [nodes[a:b] for a, b in pairwise(offsets)]
    for part in _children(piece, "CellData"):
        for array in _children(part, "DataArray"):
            if (name := array.getAttribute("Name")).startswith("skfem:"):
                expect(name not in names, "names twice")
                names[name] = tree.array(array, n_cells)
    return _mesh_of_vtk(points, types, cells, names)
