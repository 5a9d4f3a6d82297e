"""Readers of mesh files that are independent of the library.

They read the output of the writers in `mesh_files`, damaged or not: files of Gmsh and
Abaqus with plain code, files of VTK with meshio.
"""

import math
import re
import struct
import warnings
from collections import Counter, deque
from contextlib import redirect_stderr, redirect_stdout
from dataclasses import dataclass, field
from io import StringIO
from itertools import pairwise
from pathlib import Path

import meshio
import numpy as np

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


# --------------------------------------------------------------------------------- VTK

# Number of nodes by meshio's name of a cell.
_OF_VTK = {"vertex": 1, "line": 2, "triangle": 3, "quad": 4}


def vtk(content, suffix=".vtk"):
    """Read a file of VTK with meshio; None if meshio cannot read it."""
    path = Path(f"meshio{suffix}")
    path.write_bytes(content)
    try:
        with (
            warnings.catch_warnings(),
            redirect_stdout(StringIO()),
            redirect_stderr(StringIO()),
        ):
            warnings.simplefilter("ignore")
            read = meshio.read(path)
    except (Exception, SystemExit):
        return None
    finally:
        path.unlink()
    mesh = MeshContent(read.points.tolist())
    for block in read.cells:
        expect(block.type in _OF_VTK, "kind of cell")
        inside = (block.data >= 0) & (block.data < len(mesh.points))
        expect(inside.all(), "no such node")
        cells = block.data.tolist() if _OF_VTK[block.type] > 2 else []
        mesh.cells += map(tuple, cells)
    data = {key: x for key, x in read.cell_data.items() if key.startswith("skfem:")}
    kinds = {block.type for block in read.cells}
    expect(not data or kinds in ({"triangle"}, {"quad"}), "names of one kind")
    for key, blocks in data.items():
        _, kind, name = key.split(":", 2) if key.count(":") > 1 else ("", "", "")
        values = np.concatenate(blocks).ravel().tolist()
        for i, (value, cell) in enumerate(zip(values, mesh.cells, strict=True)):
            most = {"s": 1, "b": 2 ** len(cell) - 1}.get(kind, -1)
            expect(value in range(most + 1), "names")
            if kind == "s" and value:
                mesh.regions.setdefault(name, set()).add(i)
            for bit, pair in enumerate(pairwise((*cell, cell[0]))):
                if kind == "b" and int(value) >> bit & 1:
                    mesh.edges.setdefault(name, set()).add(frozenset(pair))
    return mesh


def vtu(content):
    """Read an unstructured grid of VTK as XML; see `vtk`."""
    return vtk(content, ".vtu")
