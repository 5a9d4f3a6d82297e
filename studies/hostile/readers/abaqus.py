"""A plain reader of Abaqus's files."""

import re

from .mesh_content import MalformedError, MeshContent, demand, number, whole

# Numbers of nodes by type of element.
_CORNERS = {
    **dict.fromkeys(
        ["T2D2", "T2D2H", "T3D2", "T3D2H", "B21", "B21H", "B31", "B31H"], 2
    ),
    **dict.fromkeys(["CPS3", "STRI3", "S3", "S3R", "S3RS", "R3D3", "M3D3"], 3),
    **dict.fromkeys(
        [
            "CPS4",
            "CPS4R",
            "S4",
            "S4R",
            "S4RS",
            "S4RSW",
            "S4R5",
            "CAX4P",
            "M3D4",
            "M3D4R",
        ],
        4,
    ),
}

# Keywords that change the nodes and elements of the file.
_CHANGES = ["INCLUDE", "NGEN", "NFILL", "NCOPY", "NMAP", "SYSTEM", "ELGEN", "ELCOPY"]
# Keywords that may stand in a file once.
_ONCE = ("NODE", "PART", "INSTANCE")

# Keywords that are read, with the parameters that they may have.
_PARAMETERS = {
    "NODE": ["NSET"],
    "ELEMENT": ["TYPE", "ELSET"],
    "NSET": ["NSET", "GENERATE", "INSTANCE", "INTERNAL", "UNSORTED"],
    "ELSET": ["ELSET", "GENERATE", "INSTANCE", "INTERNAL", "UNSORTED"],
}


class _Reader:
    """Nodes, elements and sets, as the keywords of a file give them."""

    def __init__(self) -> None:
        self.nodes: dict[int, tuple[float, ...]] = {}
        self.elements: dict[int, tuple[int, ...]] = {}
        self.node_sets: dict[str, set[int]] = {}
        self.element_sets: dict[str, set[int]] = {}
        self.own_sets: set[str] = set()
        self.names: dict[tuple[str, str], str] = {}
        self.seen: set[str] = set()

    def name(self, kind: str, given: dict[str, str]) -> str:
        """The name of a set; capitals are the same letters."""
        name = given.get(kind, "")
        demand(name and "\ufffd" not in name, "name")
        return self.names.setdefault((kind, name.upper()), name)

    def read(self, keyword: str, given: dict[str, str], lines: list[bytes]) -> None:
        """Read the data of a keyword."""
        demand(keyword not in _CHANGES, "keyword that changes the mesh")
        demand(keyword not in _ONCE or keyword not in self.seen, f"two {keyword}")
        self.seen.add(keyword)
        if keyword not in _PARAMETERS:
            return
        demand(set(given) <= set(_PARAMETERS[keyword]), "parameter")
        if keyword == "NODE":
            self._nodes(lines)
            if "NSET" in given:
                self.node_sets[self.name("NSET", given)] = set(self.nodes)
        elif keyword == "ELEMENT":
            self._elements(given, lines)
        else:
            name = self.name(keyword, given)
            sets = self.node_sets if keyword == "NSET" else self.element_sets
            demand(name not in sets, "set twice")
            sets[name] = _members(lines, "GENERATE" in given)

    def _nodes(self, lines: list[bytes]) -> None:
        widths = set()
        for line in lines:
            tag, *x = line.split(b",")
            demand(whole(tag.strip()) not in self.nodes, "a node twice")
            self.nodes[whole(tag.strip())] = tuple(number(w.strip()) for w in x)
            widths.add(len(x))
        demand(widths in ({2}, {3}), "coordinates")

    def _elements(self, given: dict[str, str], lines: list[bytes]) -> None:
        corners = _CORNERS.get(given.get("TYPE", "").upper())
        demand(corners, "type of element")
        members = set()
        joined = b""
        for line in lines:
            joined += line
            words = joined.split(b",")
            if words[-1].strip() == b"" and len(words) - 1 < 1 + corners:
                continue
            if words[-1].strip() == b"":
                words = words[:-1]
            tag, *nodes = [whole(w.strip()) for w in words]
            demand(len(nodes) == corners and tag not in self.elements, "element")
            self.elements[tag] = tuple(nodes)
            members.add(tag)
            joined = b""
        demand(not joined, "an element is cut off")
        if "ELSET" in given:
            name = self.name("ELSET", given)
            demand(name not in self.element_sets or name in self.own_sets, "set twice")
            self.own_sets.add(name)
            self.element_sets.setdefault(name, set()).update(members)


def _members(lines: list[bytes], generate: bool) -> set[int]:
    words = []
    for line in lines:
        row = [word.strip() for word in line.split(b",")]
        words += row[:-1] if row[-1] == b"" else row
    demand(all(word.isdigit() for word in words), "member")
    numbers = [int(word) for word in words]
    if not generate:
        return set(numbers)
    demand(len(numbers) == 3 and numbers[2] > 0, "GENERATE")
    first, last, step = numbers
    demand(last >= first and (last - first) % step == 0, "GENERATE")
    demand((last - first) // step < 10**6, "GENERATE")
    return set(range(first, last + 1, step))


def read(content: bytes) -> MeshContent:
    """Read a file of Abaqus."""
    reader = _Reader()
    lines = [line.strip() for line in re.split(rb"\r\n|[\r\n]", content)]
    lines = [line for line in lines if line and not line.startswith(b"**")]
    demand(lines and lines[0].startswith(b"*"), "no keyword")
    end = 0
    while end < len(lines):
        head, start = lines[end], end + 1
        while head.endswith(b",") and start < len(lines):
            head, start = head + lines[start], start + 1
        end = start
        while end < len(lines) and not lines[end].startswith(b"*"):
            end += 1
        keyword, *parameters = head[1:].decode(errors="replace").split(",")
        given: dict[str, str] = {}
        for parameter in parameters:
            key, _, value = parameter.partition("=")
            if parameter.strip():
                demand(key.strip().upper() not in given, "a parameter twice")
                given[key.strip().upper()] = value.strip()
        reader.read(" ".join(keyword.upper().split()), given, lines[start:end])
    return _mesh(reader)


def _mesh(reader: _Reader) -> MeshContent:
    index = {tag: i for i, tag in enumerate(reader.nodes)}
    mesh = MeshContent(list(reader.nodes.values()), [])
    cells: dict[int, int] = {}
    try:
        for tag, nodes in reader.elements.items():
            if len(nodes) > 2:
                cells[tag] = len(mesh.cells)
                mesh.cells.append(tuple(index[n] for n in nodes))
        for name, tags in reader.element_sets.items():
            mesh.regions[name] = {cells[tag] for tag in tags if tag in cells}
            mesh.edges[name] = {
                frozenset(index[n] for n in reader.elements[tag])
                for tag in tags
                if len(reader.elements[tag]) == 2
            }
        for tag, nodes in reader.elements.items():
            demand(all(n in index for n in nodes), f"no such node in {tag}")
        for name, nodes in reader.node_sets.items():
            mesh.node_sets[name] = {index[n] for n in nodes}
    except KeyError:
        raise MalformedError("it names what is not there") from None
    return mesh
