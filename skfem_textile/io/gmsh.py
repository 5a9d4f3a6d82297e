"""Gmsh files, versions 2.2 and 4.1, as text or binary."""

import re
from collections import Counter
from collections.abc import Iterator
from typing import Any, NamedTuple

import meshio
import numpy as np
from numpy import ndarray

from ..mesh.checks import MeshError
from ..mesh.user_input import excerpt
from .file_numbers import (
    BinaryNumbers,
    TextNumbers,
    errors_about,
    from_words,
    refuse_duplicates,
    tag_positions,
)

#: Name, dimension and number of nodes of a cell, by Gmsh type number.
CELL_TYPES = {
    15: ("vertex", 0, 1),
    1: ("line", 1, 2),
    2: ("triangle", 2, 3),
    3: ("quad", 2, 4),
    8: ("line3", 1, 3),
    9: ("triangle6", 2, 6),
    10: ("quad9", 2, 9),
    16: ("quad8", 2, 8),
}

# Cells by dimension.
_PLURALS = ("point(s)", "edge(s)", "element(s)")

Numbers = TextNumbers | BinaryNumbers


class CellBlock(NamedTuple):
    """Cells of one type, and their groups.

    ``kind`` is the Gmsh type number; ``numbers`` has shape (n,), ``nodes`` (n,
    corners).  ``members`` are indices in the block, ``groups`` the group of each.
    """

    kind: int
    numbers: ndarray
    nodes: ndarray
    members: ndarray
    groups: ndarray


def nodes_22(numbers: Numbers) -> tuple[ndarray, ndarray]:
    """Tags, shape (n,), and positions, shape (n, 3)."""
    count = _count_22(numbers)
    if isinstance(numbers, BinaryNumbers):
        nodes = numbers.take(count, [("tag", "i4"), ("x", "f8", 3)])
        return nodes["tag"], nodes["x"]
    words = numbers.words(4 * count)
    x = [from_words(words[i::4], "f8") for i in (1, 2, 3)]
    return from_words(words[::4], "i4"), np.stack(x, axis=1)


def _count_22(numbers: Numbers) -> int:
    """Number of nodes or elements, always as text."""
    if isinstance(numbers, TextNumbers):
        return numbers.take(1, "i4").item()
    line = TextNumbers(numbers.line())
    count = line.take(1, "i4").item()
    line.refuse_rest()
    return count


def cells_22(numbers: Numbers) -> list[CellBlock]:
    """Cells by type, each a member of a group."""
    count = _count_22(numbers)
    by_kind: dict[int, list[Any]] = {}
    rows: Any = _binary_rows if isinstance(numbers, BinaryNumbers) else _text_rows
    for kind, values in rows(numbers, count):
        by_kind.setdefault(kind, []).append(values)
    blocks = []
    for kind, parts in by_kind.items():
        cells = np.vstack(parts)
        of_each = np.arange(len(cells)), np.abs(cells[:, 1])
        blocks.append(CellBlock(kind, cells[:, 0], cells[:, 2:], *of_each))
    return blocks


def _text_rows(numbers: TextNumbers, count: int) -> Iterator[tuple[int, Any]]:
    """Type of each element, and its number, group and nodes."""
    words = numbers.take(numbers.left, "i4").tolist()
    position = 0
    for _ in range(count):
        head = words[position : position + 3]
        number, kind, n_tags = head if len(head) == 3 else (0, 1, 0)
        first = position + 3 + n_tags
        position = first + _n_corners(kind)
        if n_tags < 0 or position > len(words):
            raise MeshError(
                f"{count} elements are declared, but the section ends before the last "
                "one"
            )
        group = words[first - n_tags] if n_tags else 0
        yield kind, [number, group, *words[first:position]]
    if position < len(words):
        raise MeshError(
            f"it contains {len(words) - position} more words than its counts declare"
        )


def _binary_rows(numbers: BinaryNumbers, left: int) -> Iterator[tuple[int, Any]]:
    """Type of consecutive elements, and their numbers, groups and nodes."""
    while left > 0:
        kind, count, n_tags = numbers.take(3, "i4").tolist()
        width = 1 + n_tags + _n_corners(kind)
        if not 0 < count <= left or n_tags < 0:
            raise MeshError(
                f"a block declares {count} elements with {n_tags} tags, but {left} "
                "elements remain"
            )
        rows = numbers.take(count * width, "i4").reshape(count, width)
        group = rows[:, 1:2] if n_tags else np.zeros((count, 1), dtype="i4")
        yield kind, np.hstack([rows[:, :1], group, rows[:, 1 + n_tags :]])
        left -= count


def _n_corners(kind: int) -> int:
    """Number of nodes of a cell."""
    if kind not in CELL_TYPES:
        name = meshio.gmsh.common._gmsh_to_meshio_type.get(kind, f"type {kind}")
        raise MeshError(
            f"only triangles and four-node quadrilaterals are supported, found {name}"
        )
    return CELL_TYPES[kind][2]


def entities(numbers: Numbers) -> dict[tuple[int, int], list[int]]:
    """Numbers of groups by dimension and tag of an entity."""
    groups = {}
    for dimension, count in enumerate(numbers.take(4, "u8").tolist()):
        for _ in range(count):
            (tag,) = numbers.take(1, "i4").tolist()
            numbers.take(3 if dimension == 0 else 6, "f8")  # its position
            if (dimension, tag) in groups:
                raise MeshError(
                    f"entity {tag} of dimension {dimension} is defined twice"
                )
            tags = numbers.take(numbers.take(1, "u8").item(), "i4")
            groups[dimension, tag] = np.unique(np.abs(tags)).tolist()
            if dimension > 0:
                numbers.take(numbers.take(1, "u8").item(), "i4")  # its boundary
    return groups


def nodes_41(numbers: Numbers) -> tuple[ndarray, ndarray]:
    """Tags, shape (n,), and positions, shape (n, 3)."""
    n_blocks, n_nodes, _, _ = numbers.take(4, "u8").tolist()
    tags, points = [np.empty(0, dtype="u8")], [np.empty((0, 3))]
    for _ in range(n_blocks):
        dimension, _, parametric = numbers.take(3, "i4").tolist()
        if not 0 <= dimension <= 3 or parametric not in (0, 1):
            raise MeshError(
                "a block of nodes must begin with a dimension from 0 to 3, a tag, and "
                "0 or 1"
            )
        (count,) = numbers.take(1, "u8").tolist()
        width = 3 + dimension * parametric
        tags.append(numbers.take(count, "u8"))
        points.append(numbers.take(count * width, "f8").reshape(count, width)[:, :3])
    _refuse_count(n_nodes, sum(map(len, tags)))
    return np.concatenate(tags), np.concatenate(points)


def _refuse_count(stated: int, actual: int) -> None:
    if stated != actual:
        raise MeshError(f"the declared number is {stated}, but {actual} are listed")


def cells_41(
    numbers: Numbers, groups: dict[tuple[int, int], list[int]] | None
) -> list[CellBlock]:
    """Cells by entity, each a member of the groups of its entity."""
    n_blocks, n_cells, _, _ = numbers.take(4, "u8").tolist()
    blocks = []
    for _ in range(n_blocks):
        dimension, tag, kind = numbers.take(3, "i4").tolist()
        (count,) = numbers.take(1, "u8").tolist()
        width = 1 + _n_corners(kind)
        if dimension != CELL_TYPES[kind][1]:
            raise MeshError(
                f"a {CELL_TYPES[kind][0]} must be in an entity of dimension "
                f"{CELL_TYPES[kind][1]}, not {dimension}"
            )
        if groups is not None and (dimension, tag) not in groups:
            raise MeshError(f"entity {tag} of dimension {dimension} is undefined")
        rows = numbers.take(count * width, "u8").reshape(count, width)
        own_groups = np.array((groups or {}).get((dimension, tag), []), dtype="i4")
        members = np.repeat(np.arange(count), len(own_groups))
        of_each = members, np.tile(own_groups, count)
        blocks.append(CellBlock(kind, rows[:, 0], rows[:, 1:], *of_each))
    _refuse_count(n_cells, sum(len(block.numbers) for block in blocks))
    return blocks


# Supported sections, other than comments.
_READ = ("MeshFormat", "PhysicalNames", "Entities", "Nodes", "Elements")

# Line of a group: dimension, number and name.
_GROUP = re.compile(r'[ \t]*([0-9]{1,9})[ \t]+([0-9]{1,9})[ \t]+"([^"]+)"[ \t\r]*')

# Characters that may surround a line.
_BLANK = b" \t\r\n"

_Names = dict[tuple[int, int], str]


def read(content: bytes) -> tuple[meshio.Mesh, list[str]]:
    """Mesh of a Gmsh file, and names of the ignored sections.

    Groups with a name become sets of cells.

    Raises
    ------
    MeshError
        If the file violates its format, or has cells other than points, edges,
        triangles and four-node quadrilaterals.
    """
    sections: dict[str, bytes] = {}
    for name, body in _sections(content):
        if name in sections and name in _READ:
            raise MeshError(f"the file contains more than one ${name}")
        sections[name] = body
    for name in ("MeshFormat", "Nodes", "Elements"):
        if name not in sections:
            raise MeshError(f"the file contains no ${name}")
    version, binary = _format(sections["MeshFormat"])
    names = _group_names(sections.get("PhysicalNames", b"0"))

    def parsed(name: str, parse: Any, *more: Any) -> Any:
        with errors_about(f"${name}"):
            numbers = (BinaryNumbers if binary else TextNumbers)(sections[name])
            result = parse(numbers, *more)
            numbers.refuse_rest()
        return result

    if version == "4.1":
        groups = parsed("Entities", entities) if "Entities" in sections else None
        tags, points = parsed("Nodes", nodes_41)
        cells = parsed("Elements", cells_41, groups)
    else:
        tags, points = parsed("Nodes", nodes_22)
        cells = [_merge_copies(block, names) for block in parsed("Elements", cells_22)]
    ignored = [f"${name}" for name in sections if name not in (*_READ, "Comments")]
    ignored += _vanishing_groups(names, cells)
    return _mesh(names, tags, points, cells), ignored


def _vanishing_groups(names: _Names, cells: list[CellBlock]) -> list[str]:
    """Groups of cells without a name, and names without cells."""
    sizes: Counter[tuple[int, int]] = Counter()
    for block in cells:
        numbers, counts = np.unique(block.groups, return_counts=True)
        for number, count in zip(numbers.tolist(), counts.tolist(), strict=True):
            if number:  # version 2.2 writes 0 for cells without a group
                sizes[CELL_TYPES[block.kind][1], number] += count
    unnamed = [
        f"unnamed physical group {number} ({count} {_PLURALS[dimension]})"
        for (dimension, number), count in sorted(sizes.items())
        if (dimension, number) not in names
    ]
    empty = [f"empty group {n!r}" for key, n in names.items() if not sizes[key]]
    return unnamed + empty


def _sections(content: bytes) -> Iterator[tuple[str, bytes]]:
    """Name and content of each section."""
    position = 0
    while position < len(content):
        end = content.find(b"\n", position) + 1 or len(content)
        line, position = content[position:end].strip(_BLANK), end
        text = excerpt(line)
        if not line:
            continue
        if not line.startswith(b"$") or line.startswith(b"$End"):
            raise MeshError(f"expected the beginning of a Gmsh section, got {text!r}")
        last = b"$End" + line[1:]
        close = content.find(last, end)
        if close < 0:
            raise MeshError(f"the end of {text} is missing")
        position = content.find(b"\n", close) + 1 or len(content)
        if content[close:position].strip(_BLANK) != last:
            raise MeshError(f"the end of {text} must be on a separate line")
        yield line[1:].decode(errors="replace"), content[end:close]


def _format(body: bytes) -> tuple[str, bool]:
    """Version, and whether numbers are binary."""
    head, _, marker = body.partition(b"\n")
    version, kind, size, *more = [*head.decode(errors="replace").split(), "", "", ""]
    if version not in ("2", "2.2", "4.1"):
        raise MeshError(
            f"version {excerpt(version)!r} of the Gmsh format is not supported: save "
            "the mesh in version 2.2 or 4.1"
        )
    if kind not in ("0", "1") or size != "8" or any(more):
        raise MeshError(
            "$MeshFormat must contain a version, a file type (0 or 1) and the data "
            "size 8"
        )
    if kind == "1" and marker[:4] != np.array(1, "i4").tobytes():
        raise MeshError(
            "the byte order of the file differs from the byte order of this machine: "
            "save the mesh as text"
        )
    if marker[4 if kind == "1" else 0 :].strip():
        raise MeshError("$MeshFormat contains unexpected data")
    return version, kind == "1"


def _group_names(body: bytes) -> _Names:
    """Names of groups by dimension and number."""
    try:
        lines = [line for line in body.decode().split("\n") if line.strip()]
    except UnicodeDecodeError:
        raise MeshError("a name in $PhysicalNames is not in UTF-8") from None
    names: _Names = {}
    if not lines or lines[0].strip() != str(len(lines) - 1):
        raise MeshError(
            f"$PhysicalNames must begin with the number of its names, {len(lines[1:])}"
        )
    for line in lines[1:]:
        match = _GROUP.fullmatch(line)
        if match is None or int(match[1]) > 3:
            text = excerpt(line.strip())
            raise MeshError(
                f"$PhysicalNames: expected a dimension, a number and a name, got {text}"
            )
        if match[3] in names.values():
            raise MeshError(f"two groups have the name {match[3]!r}: use unique names")
        if (key := (int(match[1]), int(match[2]))) in names:
            raise MeshError(
                f"group {match[3]!r} has the number of another group: use unique "
                "numbers"
            )
        names[key] = match[3]
    return names


def _merge_copies(cells: CellBlock, names: _Names) -> CellBlock:
    """Merge the copies of a cell that version 2.2 writes for each of its groups.

    Other copies are kept, so that `check_mesh` refuses them.
    """
    _, first, copy = np.unique(
        cells.nodes, axis=0, return_index=True, return_inverse=True
    )
    copy = copy.ravel()
    repeated = np.bincount(copy)[copy] > 1
    dimension = CELL_TYPES[cells.kind][1]
    named = [number for dim, number in names if dim == dimension]
    pairs = np.unique(np.stack([copy, cells.groups]), axis=1)
    if pairs.shape[1] < len(copy) or not np.isin(cells.groups[repeated], named).all():
        return cells
    unique = np.sort(first)
    members = np.searchsorted(unique, first[copy])
    return cells._replace(nodes=cells.nodes[unique], members=members)


def _mesh(
    names: _Names, tags: ndarray, points: ndarray, cells: list[CellBlock]
) -> meshio.Mesh:
    refuse_duplicates(tags, "node")
    if cells:
        refuse_duplicates(np.concatenate([block.numbers for block in cells]), "element")
    sets: dict[str, Any] = {name: [] for name in names.values()}
    for (dimension, number), name in names.items():
        for block in cells:
            of_group = block.groups == number
            of_group &= CELL_TYPES[block.kind][1] == dimension
            sets[name].append(np.unique(block.members[of_group]))
    blocks: list[Any] = [
        (CELL_TYPES[block.kind][0], tag_positions(tags, block.nodes, "node"))
        for block in cells
    ]
    return meshio.Mesh(points, blocks, cell_sets=sets)
