"""Abaqus input files: nodes, elements and sets, read and written."""

import re
from codecs import BOM_UTF8
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from types import MappingProxyType
from typing import Any, NamedTuple

import meshio
import numpy as np
from numpy import ndarray
from scipy.spatial.transform import Rotation

from ..mesh.checks import MeshError
from ..mesh.user_input import excerpt, printable
from .deck_text import DeckText, Include
from .file_numbers import (
    errors_about,
    from_words,
    real_word,
    refuse_duplicates,
    tag_positions,
)
from .vtk import in_space

# A comma outside of quotation marks.
_COMMA = re.compile(r',(?=(?:[^"]*"[^"]*")*[^"]*$)')


# Keywords whose data lines may be in another file, and the name of that file.
_WITH_INPUT = re.compile(r"\s*\*\s*(INCLUDE|NODE|ELEMENT|DISTRIBUTION)\s*,", re.I)
_INPUT = re.compile(r"(?:,|^)\s*INPUT\s*=\s*(\"[^\"]*\"|[^,]*)", re.I)


def find_include(lines: list[str], line: int) -> Include | None:
    """File that a keyword includes, or with the data lines of a keyword."""
    keyword = _WITH_INPUT.match(lines[line])
    if keyword is None:
        return None
    n = 1
    while lines[line + n - 1].rstrip().endswith(",") and line + n < len(lines):
        n += 1
    head = lines[line : line + n]
    inputs = ((i, _INPUT.search(x)) for i, x in enumerate(head))
    names = {i: found[1].strip('"') for i, found in inputs if found}
    if not names:
        return None
    rest = "**" if keyword[1].upper() == "INCLUDE" else _INPUT.sub("", "".join(head))
    return Include(names, [rest, *["**"] * (n - 1)])


def content_of(path: Path) -> bytes:
    """Content of a file; a deck has its include files in their places."""
    if path.suffix.lower() == ".inp":
        text = DeckText(path, find_include)
        if len(text.files) > 1:
            return text.content
    return path.read_bytes()


class Block(NamedTuple):
    """Keyword, its parameters, the words of its data lines, and all its line numbers.

    Lines are numbered from 0 on; lines of comments are omitted.
    """

    keyword: str
    parameters: dict[str, str]
    data: list[list[bytes]]
    lines: list[int]

    def __str__(self) -> str:
        name = self.parameters.get(self.keyword, "").strip('"')
        return f"*{printable(self.keyword)}" + (f" {name!r}" if name else "")


def without_trailing_comma(words: list[bytes]) -> list[bytes]:
    """Words of a data line that may end with a comma."""
    return words[:-1] if words[-1] == b"" else words


def blocks(content: bytes) -> Iterator[Block]:
    """All keywords, each with its data."""
    every = re.split(rb"\r\n|\n|\r", content.removeprefix(BOM_UTF8))
    stripped = (line.strip() for line in every)
    numbered = enumerate(stripped)
    kept = [(i, x) for i, x in numbered if x and not x.startswith(b"**")]
    numbers, lines = [i for i, _ in kept], [x for _, x in kept]
    starts = [i for i, line in enumerate(lines) if line.startswith(b"*")]
    if starts[:1] != [0]:
        raise MeshError("the file does not begin with an Abaqus keyword")
    for start, end in zip(starts, [*starts[1:], len(lines)], strict=True):
        first, head = start + 1, lines[start][1:]
        while head.endswith(b",") and first < end:
            head, first = head + lines[first], first + 1
        keyword, *words = _COMMA.split(head.decode(errors="replace"))
        pairs = [word.partition("=") for word in words if word.strip()]
        parameters = {key.strip().upper(): value.strip() for key, _, value in pairs}
        data = [
            [word.strip() for word in line.split(b",")] for line in lines[first:end]
        ]
        name = " ".join(keyword.upper().split())
        block = Block(name, parameters, data, numbers[start:end])
        if len(parameters) < len(pairs):
            raise MeshError(f"{block}: a parameter is given twice")
        yield block


# Element types, by cell and number of nodes.
_TYPES = {
    ("line", 2): "T2D2 T2D2H T3D2 T3D2H B21 B21H B31 B31H",
    ("triangle", 3): "CPS3 STRI3 S3 S3R S3RS R3D3 M3D3",
    ("quad", 4): "CPS4 CPS4R S4 S4R S4RS S4RSW S4R5 CAX4P M3D4 M3D4R",
    ("triangle6", 6): "STRI65 S6 M3D6",
    ("quad8", 8): "S8 S8R S8R5 S8RT M3D8 M3D8R",
    ("quad9", 9): "S9R5 M3D9 M3D9R",
}
_CELLS = {name: cell for cell, names in _TYPES.items() for name in names.split()}

# Supported parameters, by keyword.
_PARAMETERS = {
    "NODE": {"NSET"},
    "ELEMENT": {"TYPE", "ELSET"},
    "NSET": {"NSET", "ELSET", "GENERATE", "INSTANCE", "INTERNAL", "UNSORTED"},
    "ELSET": {"ELSET", "GENERATE", "INSTANCE", "INTERNAL", "UNSORTED"},
    "INSTANCE": {"NAME", "PART"},
}

# Keywords without effect on the mesh.
_WITHOUT_EFFECT = ("HEADING", "PREPRINT", "PART", "ASSEMBLY", "INSTANCE")

#: Keywords that give elements a material or an orientation.
SECTIONS = ("SHELL SECTION", "SHELL GENERAL SECTION", "MEMBRANE SECTION")

#: Keywords that generate or modify parts of a mesh.
GENERATING = (
    *("NGEN", "NFILL", "NCOPY", "NMAP", "SYSTEM", "ELGEN", "ELCOPY"),
    *("IMPORT", "IMPERFECTION", "SYMMETRIC MODEL GENERATION", "PARAMETER"),
)


@dataclass
class Deck:
    """Numbers and positions of nodes, elements, and sets by keyword and name.

    ``blocks`` has cell type, numbers, nodes and set of each ``*ELEMENT``.  A generated
    set has at most one member for each line of the file.  ``part`` and ``instance`` are
    the names of both, ``after`` has the keywords of nodes and elements in the assembly
    after the instance, and ``of_assembly`` their sets.  ``cells`` are the cell and the
    number of nodes of each supported type.
    """

    cells: Mapping[str, tuple[str, int]] = field(default_factory=lambda: _CELLS)

    tags: ndarray | None = None
    points: ndarray = field(default_factory=lambda: np.empty((0, 3)))
    part: str = ""
    instance: str = ""
    within: str = ""
    moved: bool = False
    rotated: bool = False
    after: set[str] = field(default_factory=set)
    of_assembly: set[tuple[str, str]] = field(default_factory=set)
    used: set[tuple[str, str]] = field(default_factory=set)
    blocks: list[tuple[str, ndarray, ndarray, str | None]] = field(default_factory=list)
    sets: dict[tuple[str, str], ndarray] = field(default_factory=dict)
    ignored: list[str] = field(default_factory=list)
    n_lines: int = 0
    spelled: dict[tuple[str, str], str] = field(default_factory=dict)

    def spelling(self, keyword: str, parameters: dict[str, str]) -> str:
        """Name of a set in its first spelling, without quotation marks."""
        name = parameters.get(keyword, "")
        key = keyword, name_key(name)
        if key in self.used:
            raise MeshError(
                f"the set {excerpt(name)!r} is extended after another set refers to it"
            )
        if not name.strip('"') or "\ufffd" in name:
            raise MeshError(f"the parameter {keyword} must be a name in UTF-8")
        bare = name.strip('"')
        if key not in self.spelled and bare in [
            other for (of, _), other in self.spelled.items() if of == keyword
        ]:
            raise MeshError(f"two sets {excerpt(bare)!r}: use unique names")
        return self.spelled.setdefault(key, bare)

    def local(self, word: bytes) -> bytes:
        """Number or name of a set without the name of the instance and a point."""
        prefix, bare = f"{self.instance}.".encode(), word.strip(b'"')
        if len(prefix) > 1 and bare.upper().startswith(prefix):
            return bare[len(prefix) :]
        return bare if bare.isdigit() else word


def name_key(name: str) -> str:
    """Key of a name, whose case counts in quotation marks alone."""
    return name.strip('"') if name.startswith('"') else name.upper()


def read(content: bytes) -> tuple[meshio.Mesh, list[str]]:
    """Mesh of an Abaqus file, and the ignored keywords.

    Raises
    ------
    MeshError
        If the file violates its format, or has elements other than edges, triangles and
        four-node quadrilaterals.
    """
    deck = _deck(content)
    mesh = _mesh(deck)  # also extends the ignored content
    return mesh, deck.ignored


def read_elements(content: bytes) -> tuple[ndarray, Deck]:
    """Numbers of the triangles and quadrilaterals, in the order of a file, and sets."""
    deck = _deck(content)
    if deck.rotated:
        raise MeshError(
            "*INSTANCE: directions in a rotated instance are not supported: export the "
            "deck without this rotation"
        )
    plane = [numbers for kind, numbers, _, _ in deck.blocks if kind != "line"]
    if not plane:
        raise MeshError(
            "the file contains no *ELEMENT with triangles or quadrilaterals"
        )
    numbers = np.concatenate(plane)
    refuse_duplicates(numbers, "element")
    return numbers, deck


def _deck(content: bytes) -> Deck:
    deck, keywords = Deck(n_lines=content.count(b"\n") + content.count(b"\r")), set()
    for block in blocks(content):
        if block.keyword in ("PART", "INSTANCE") and block.keyword in keywords:
            raise MeshError(
                f"the file contains more than one *{block.keyword} block: merge them "
                "into one"
            )
        keywords.add(block.keyword)
        with errors_about(block):
            read_block(deck, block)
    return deck


def read_block(deck: Deck, block: Block) -> None:
    """Add the content of a block to a deck."""
    keyword, parameters, data, _ = block
    if keyword in ("INSTANCE", "END INSTANCE", "ASSEMBLY", "END ASSEMBLY"):
        deck.within = "" if keyword == "END ASSEMBLY" else keyword
    if keyword == "INCLUDE":
        raise MeshError("the parameter INPUT, the name of a file, is missing")
    if keyword in GENERATING:
        raise MeshError(
            "this keyword is not supported: list nodes and elements one by one"
        )
    refuse_parameters(block)
    _refuse_unknown(deck, block)
    in_assembly = deck.within in ("ASSEMBLY", "END INSTANCE")
    if in_assembly and deck.tags is not None and _is_of_the_assembly(deck, block):
        deck.ignored.append(f"{block} of the assembly")
    elif keyword == "NODE":
        _add_nodes(deck, parameters, data)
    elif keyword == "PART":
        deck.part = name_of(parameters, "NAME")
    elif keyword == "INSTANCE":
        deck.instance = name_of(parameters, "NAME")
        _place(deck, data)
    elif keyword == "ELEMENT":
        kind, corners = _cell(deck.cells, parameters.get("TYPE", ""))
        rows = _elements(data, 1 + corners)
        name = deck.spelling("ELSET", parameters) if "ELSET" in parameters else None
        deck.blocks.append((kind, rows[:, 0], rows[:, 1:], name))
    elif keyword in ("NSET", "ELSET"):
        name = deck.spelling(keyword, parameters)
        members = set_members(deck, block)
        before = deck.sets.get((keyword, name), members[:0])
        deck.sets[keyword, name] = np.union1d(before, members)
    elif keyword.removeprefix("END ") not in _WITHOUT_EFFECT:
        deck.ignored.append(f"*{keyword}")


def refuse_parameters(block: Block) -> None:
    """Refuse parameters that are not supported."""
    known = _PARAMETERS.get(block.keyword, block.parameters.keys())
    if other := block.parameters.keys() - known:
        raise MeshError(
            f"the parameter {printable(min(other))!r} is not supported: list plain "
            "numbers without it"
        )


def name_of(parameters: dict[str, str], key: str) -> str:
    """Name in upper case, as case is ignored."""
    return parameters.get(key, "").strip('"').upper()


def _refuse_unknown(deck: Deck, block: Block) -> None:
    """Refuse the name of a part or an instance that is not defined before."""
    parameters, known = block.parameters, {"INSTANCE": deck.instance}
    if block.keyword == "INSTANCE" and deck.part:
        known = {"PART": deck.part}
    for key, defined in known.items():
        if key in parameters and name_of(parameters, key) != defined:
            raise MeshError(
                f"the {key.lower()} {excerpt(parameters[key])!r} is not defined before "
                "it is used: define it before"
            )


def _is_of_the_assembly(deck: Deck, block: Block) -> bool:
    """True if a block after the instance has items of the assembly, or their sets.

    Numbers of the assembly are independent of numbers of the instance.
    """
    keyword, parameters, data, _ = block
    if keyword in ("NODE", "ELEMENT"):
        deck.after.add(keyword)
        sets = {"NSET", "ELSET"} & set(parameters)
        deck.of_assembly |= {(key, name_of(parameters, key)) for key in sets}
        return True
    numbered = {"NSET": "NODE", "ELSET": "ELEMENT"}.get(keyword)
    of_instance = ({"INSTANCE", "ELSET"} - {keyword}) & set(parameters)
    if numbered is None or of_instance:
        return False
    words = [word.decode(errors="replace") for row in data for word in row if word]
    is_own = bool(words) and all(
        numbered in deck.after
        if word.isdigit()
        else (keyword, word.strip('"').upper()) in deck.of_assembly
        for word in words
    )
    if is_own:
        deck.of_assembly.add((keyword, name_of(parameters, keyword)))
    return is_own


def _add_nodes(deck: Deck, parameters: dict[str, str], data: list[list[bytes]]) -> None:
    tags, points = _nodes(data)
    if "NSET" in parameters:
        key = "NSET", deck.spelling("NSET", parameters)
        deck.sets[key] = np.concatenate([deck.sets.get(key, tags[:0]), tags])
    if deck.tags is None:
        deck.tags, deck.points = tags, points
    elif len(tags):
        if deck.within == "INSTANCE" and deck.moved:
            raise MeshError(
                "nodes within a moved *INSTANCE are not supported: define them in *PART"
            )
        if len(deck.tags) and points.shape[1] != deck.points.shape[1]:
            raise MeshError("all nodes must have the same number of coordinates")
        deck.tags = np.concatenate([deck.tags, tags])
        deck.points = np.vstack([deck.points.reshape(-1, points.shape[1]), points])


def _place(deck: Deck, data: list[list[bytes]]) -> None:
    """Move the nodes so far."""
    turn, shift = motion(data)
    if deck.tags is None:
        if shift.any() or not np.array_equal(turn, np.eye(3)):
            raise MeshError("*PART with the nodes must precede a moved instance")
        return
    if data:
        deck.points, deck.moved = in_space(deck.points) @ turn.T + shift, True
        deck.rotated = not np.array_equal(turn, np.eye(3))


def motion(data: list[list[bytes]]) -> tuple[ndarray, ndarray]:
    """Rotation matrix and translation of an instance, which is translated first.

    The first line contains the translation; a second one has two points a and b and the
    right-handed angle about the axis from a to b, in degrees.
    """
    rows = [from_words(without_trailing_comma(row), "f8") for row in data]
    if [len(row) for row in rows] not in ([], [3], [3, 7]) or not all(
        np.isfinite(row).all() for row in rows
    ):
        raise MeshError(
            "the position must be a line with a translation, and possibly a line with "
            "two points of an axis and an angle"
        )
    turn, shift = np.eye(3), rows[0] if rows else np.zeros(3)
    for row in rows[1:]:
        axis = row[3:6] - row[:3]
        if not (length := np.linalg.norm(axis)):
            raise MeshError("the two points of the axis coincide")
        if row[6] % 360:
            turn = Rotation.from_rotvec(row[6] * axis / length, degrees=True)
            turn = turn.as_matrix()
        shift = row[:3] + turn @ (shift - row[:3])
    return turn, shift


def _nodes(data: list[list[bytes]]) -> tuple[ndarray, ndarray]:
    """Node numbers and positions; a coordinate between commas may be missing."""
    tags = from_words([words[0] for words in data], "i8")
    data = [words[:-1] if len(words) > 4 and not words[-1] else words for words in data]
    width = len(data[0]) - 1 if data else 3
    for words in data:
        if len(words) - 1 != width or width not in (2, 3):
            shown = excerpt(b", ".join(words))
            raise MeshError(
                f"the line {shown!r} must contain a node number and two or three "
                "coordinates, as many as the first line"
            )
    x = from_words([word or b"0" for words in data for word in words[1:]], "f8")
    return tags, x.reshape(-1, width)


def _cell(cells: Mapping[str, tuple[str, int]], element: str) -> tuple[str, int]:
    """Cell of an element, and its number of nodes."""
    if element.upper() not in cells:
        raise MeshError(
            "only triangles and four-node quadrilaterals, such as CPS3 and CPS4, are "
            f"supported, found {excerpt(element) or 'no TYPE'}"
        )
    return cells[element.upper()]


def _elements(data: list[list[bytes]], width: int) -> ndarray:
    """Number and nodes of each element, possibly on several lines."""
    rows: list[list[bytes]] = []
    open_row = False
    for words in data:
        continues = words[-1] == b""
        words = words[:-1] if continues else words
        if open_row:
            rows[-1] += words
        else:
            rows.append(words)
        open_row = continues and len(rows[-1]) < width
        if len(rows[-1]) != width and not open_row:
            shown = excerpt(b", ".join(rows[-1]))
            raise MeshError(
                f"the element {shown!r} must have {width} numbers: its number and its "
                "nodes"
            )
    if open_row:
        raise MeshError("the last element is incomplete")
    return from_words([word for row in rows for word in row], "i8").reshape(-1, width)


def set_members(deck: Deck, block: Block) -> ndarray:
    """Numbers of the members of a set, which may name sets defined before."""
    keyword, parameters, data, _ = block
    lines = [list(map(deck.local, without_trailing_comma(line))) for line in data]
    words = [word for line in lines for word in line]
    if "ELSET" in parameters and keyword == "NSET":
        if words or "GENERATE" in parameters:
            raise MeshError("a set of nodes with ELSET= has no data lines")
        name = deck.local(parameters["ELSET"].encode())
        return _nodes_of_elements(deck, members_of(deck, "ELSET", name))
    if "GENERATE" in parameters:
        return _generated(lines, deck.n_lines)
    names = [word for word in words if not word.isdigit()]
    parts = [from_words([word for word in words if word.isdigit()], "i8")]
    parts += [members_of(deck, keyword, word) for word in names]
    return np.unique(np.concatenate(parts))


def members_of(deck: Deck, keyword: str, word: bytes) -> ndarray:
    """Members of a set that is defined so far."""
    key = name_key(word.decode(errors="replace"))
    deck.used.add((keyword, key))
    name = deck.spelled.get((keyword, key), "")
    found = [deck.sets[keyword, name]] if (keyword, name) in deck.sets else []
    if keyword == "ELSET" and name:
        found += [numbers for _, numbers, _, elset in deck.blocks if elset == name]
    if not found and (keyword, key.upper()) in deck.of_assembly:
        return np.empty(0, "i8")
    if not found:
        raise MeshError(
            f"the set {excerpt(key)!r} is not defined before it is used: define it "
            "before"
        )
    return np.concatenate(found)


def _nodes_of_elements(deck: Deck, members: ndarray) -> ndarray:
    nodes = [n[np.isin(numbers, members)].ravel() for _, numbers, n, _ in deck.blocks]
    return np.unique(np.concatenate([np.empty(0, "i8"), *nodes]))


def _generated(lines: list[list[bytes]], n_lines: int) -> ndarray:
    """Members of a set with first, last and possibly a step on each line."""
    ranges, left = [np.empty(0, "i8")], n_lines
    for words in lines:
        if not all(word.isdigit() for word in words):
            raise MeshError("GENERATE requires numbers")
        first, last, step = [*from_words(words, "i8").tolist(), 1, 0, 0][:3]
        if len(words) not in (2, 3) or step < 1 or (last - first) % step:
            raise MeshError(
                "GENERATE requires lines with first, last and possibly a step, whose "
                "steps end exactly at last"
            )
        left -= (last - first) // step + 1
        if last < first or left < 0:
            break
        ranges.append(np.arange(first, last + 1, step))
    if len(ranges) <= max(len(lines), 1):
        raise MeshError(
            "this set has no members, or more members than lines in the file"
        )
    return np.unique(np.concatenate(ranges))


def _mesh(deck: Deck) -> meshio.Mesh:
    if deck.tags is None or not deck.blocks:
        raise MeshError(
            f"the file contains no *{'NODE' if deck.tags is None else 'ELEMENT'}"
            f"{' outside of the assembly' if deck.after else ''}"
        )
    refuse_duplicates(deck.tags, "node")
    _drop_unused_nodes(deck)
    numbers = np.concatenate([numbers for _, numbers, _, _ in deck.blocks])
    refuse_duplicates(numbers, "element")
    cells: list[Any] = [
        (kind, tag_positions(deck.tags, nodes, "node"))
        for kind, _, nodes, _ in deck.blocks
    ]
    nodes: dict[str, Any] = {}
    elements: dict[str, Any] = {}
    first = np.cumsum([0, *(len(block) for _, block, _, _ in deck.blocks)])
    every = [(("ELSET", name), own) for _, own, _, name in deck.blocks if name]
    for (keyword, name), members in [*every, *deck.sets.items()]:
        with errors_about(f"*{keyword} {name!r}"):
            if keyword == "NSET":
                nodes[name] = tag_positions(deck.tags, members, "node")
                continue
            before = elements.setdefault(name, np.empty(0, "i8"))
            more = tag_positions(numbers, members, "element")
            elements[name] = np.union1d(before, more)
    for name, positions in elements.items():
        ends = np.searchsorted(positions, first)
        elements[name] = [
            positions[a:b] - n for a, b, n in zip(ends, ends[1:], first, strict=False)
        ]
    return meshio.Mesh(deck.points, cells, point_sets=nodes, cell_sets=elements)


def _drop_unused_nodes(deck: Deck) -> None:
    """Omit nodes of no element, such as reference points, also from the sets."""
    assert deck.tags is not None
    used = np.isin(deck.tags, np.concatenate([n.ravel() for _, _, n, _ in deck.blocks]))
    unused = deck.tags[~used]
    if not unused.size:
        return
    more = f" and {unused.size - 1} more" if unused.size > 1 else ""
    deck.ignored.append(f"node {unused[0]}{more} (of no element)")
    deck.tags, deck.points = deck.tags[used], deck.points[used]
    for (keyword, name), members in deck.sets.items():
        if keyword == "NSET" and np.isin(members, unused).any():
            deck.sets[keyword, name] = np.setdiff1d(members, unused)
            if not deck.sets[keyword, name].size:
                deck.ignored.append(f"*NSET {name!r} (nodes of no element)")


#: Names of two orientations, each with its first direction along one family: an Abaqus
#: orientation cannot describe families whose angle varies by element.
WARP, WEFT = "WARP", "WEFT"

#: Set of elements without directions, and set of the others.
NOT_COVERED, COVERED = "NOT_COVERED", "COVERED"

# Members of a set per line: at most 16 in Abaqus.
_IN_A_LINE = 16

_TYPES_OF_CELLS = {3: "M3D3", 4: "M3D4R"}


def deck_of(
    cells: Sequence[ndarray],
    points: ndarray,
    warp: ndarray,
    weft: ndarray,
    normal: ndarray,
    node_sets: Mapping[str, ndarray] = MappingProxyType({}),
    element_sets: Mapping[str, ndarray] = MappingProxyType({}),
) -> str:
    """Deck of elements with the direction of both families in each element.

    The first axis of the orientations ``WARP`` and ``WEFT`` is the direction of a
    family, given by a distribution of points a and b: a along the fibres, and b normal
    to them in the plane of the element.  Numbers have full precision.

    ``cells`` are node numbers of shape (3, n) and (4, n), directions and normals unit
    vectors of shape (3, n_elements), and the members of sets numbers from 0 on.
    Elements with NaN directions form the set ``NOT_COVERED``, the others ``COVERED``.
    """
    covered = np.isfinite(warp).all(axis=0)
    number = np.arange(1, 1 + len(covered))
    parts = {} if covered.all() else {COVERED: covered, NOT_COVERED: ~covered}
    own = {name: np.flatnonzero(mask) for name, mask in parts.items()}
    lines = [
        "*HEADING",
        "mesh and fibre directions, by skfem_textile; lengths in mm",
        *_mesh_lines(
            cells, points, "" if "PLY" in map(str.upper, element_sets) else "PLY"
        ),
    ]
    for keyword, sets in (("NSET", node_sets), ("ELSET", {**own, **element_sets})):
        for name, word in _words_of(sets).items():
            lines += set_lines(keyword, word, (sets[name] + 1).tolist())
    lines += ["*DISTRIBUTION TABLE, NAME=AXES", AXES]
    for name, family in ((WARP, warp), (WEFT, weft)):
        across = np.cross(normal, family, axis=0)
        a, b = family[:, covered], across[:, covered]
        lines += axes_lines(name, "AXES", number[covered].tolist(), a, b)
    return "\n".join([*lines, ""])


def _words_of(names: Iterable[str]) -> dict[str, str]:
    """Names as words: in quotation marks where case or other characters count."""
    bare = {name: re.sub(r'["\r\n]', "_", name) for name in names}
    counts = Counter(name.upper() for name in bare.values())
    return {
        name: word
        if re.fullmatch(r"[^\W\d_][\w-]*", word) and counts[word.upper()] == 1
        else f'"{word}"'
        for name, word in bare.items()
    }


def _mesh_lines(cells: Sequence[ndarray], points: ndarray, name: str) -> Iterator[str]:
    n_nodes = 1 + max(cell.max() for cell in cells)
    yield "*NODE"
    yield from node_lines(range(1, 1 + n_nodes), points[:, :n_nodes])
    first = 1
    for cell in cells:
        own = f", ELSET={name}" if name else ""
        yield f"*ELEMENT, TYPE={_TYPES_OF_CELLS[len(cell)]}{own}"
        for i, nodes in enumerate((cell.T + 1).tolist(), first):
            yield ", ".join(map(str, [i, *nodes]))
        first += cell.shape[1]


def node_lines(numbers: Sequence[int], points: ndarray) -> Iterator[str]:
    """Data lines of nodes at points of shape (3, n)."""
    for number, x in zip(numbers, points.T.tolist(), strict=True):
        yield ", ".join([str(number), *map(real_word, x)])


def set_lines(keyword: str, name: str, numbers: Sequence[int]) -> Iterator[str]:
    """Set of nodes or elements by their numbers; none if it is empty."""
    if len(numbers):
        yield f"*{keyword}, {keyword}={name}"
    for i in range(0, len(numbers), _IN_A_LINE):
        yield ", ".join(map(str, numbers[i : i + _IN_A_LINE]))


#: Format of the values of distributions, by the kind of the values.
AXES, ANGLE, LENGTH = "COORD3D, COORD3D", "ANGLE", "LENGTH"


def distribution_lines(
    name: str, table: str, default: list[float], numbers: Sequence[int], values: ndarray
) -> Iterator[str]:
    """Distribution of values on elements, shape (n_values, n)."""
    yield f"*DISTRIBUTION, NAME={name}, LOCATION=ELEMENT, TABLE={table}"
    yield ", ".join(["", *map(real_word, default)])
    for number, row in zip(numbers, values.T.tolist(), strict=True):
        yield ", ".join([str(number), *map(real_word, row)])


def axes_lines(
    name: str, table: str, numbers: Sequence[int], a: ndarray, b: ndarray
) -> Iterator[str]:
    """Orientation with points a and b of each element, shape (3, n)."""
    yield f"*ORIENTATION, NAME={name}, SYSTEM=RECTANGULAR"
    yield f"{name}_AXES"
    yield "3, 0."
    values, x_y = np.vstack([a, b]), [1.0, 0.0, 0.0, 0.0, 1.0, 0.0]
    yield from distribution_lines(f"{name}_AXES", table, x_y, numbers, values)
