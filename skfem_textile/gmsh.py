"""Files of Gmsh, versions 2.2 and 4.1, as text or as bytes."""

import re
from collections.abc import Iterator
from typing import Any, NamedTuple

import meshio
import numpy as np
from numpy import ndarray

from .file_numbers import Bytes, Words, places, refuse_twice
from .meshes import MeshError
from .naming import printable

# By Gmsh's number: what the cells are, their dimension and number of nodes.
_KINDS = {
    15: ("vertex", 0, 1),
    1: ("line", 1, 2),
    2: ("triangle", 2, 3),
    3: ("quad", 2, 4),
}

# Sections that are read.
_READ = ("MeshFormat", "PhysicalNames", "Entities", "Nodes", "Elements")

# Of a group: dimension, number, and its name.
_GROUP = re.compile(r'[ \t]*([0-9]{1,9})[ \t]+([0-9]{1,9})[ \t]+"([^"]+)"[ \t\r]*')

# What may stand around a line.
_BLANK = b" \t\r\n"

_Numbers = Words | Bytes
_Names = dict[tuple[int, int], str]


class _Cells(NamedTuple):
    """Cells of one kind, and which of them belong to groups.

    Gmsh's number of the kind, numbers, shape (n,), and nodes, shape (n, corners).
    Members of groups among these cells, and the number of the group of each.
    """

    kind: int
    numbers: ndarray
    nodes: ndarray
    members: ndarray
    groups: ndarray


def read(content: bytes) -> tuple[meshio.Mesh, list[str]]:
    """Read a file of Gmsh; its groups with a name are sets of cells.

    Returns
    -------
    tuple
        The mesh, and names of the sections that are not read.

    Raises
    ------
    MeshError
        If the file departs from its format, or has other cells than points, edges,
        triangles and four-node quadrilaterals.
    """
    sections: dict[str, bytes] = {}
    for name, body in _sections(content):
        if name in sections and name in _READ:
            raise MeshError(f"there is more than one ${name}")
        sections[name] = body
    for name in ("MeshFormat", "Nodes", "Elements"):
        if name not in sections:
            raise MeshError(f"it has no ${name}")
    version, as_bytes = _format(sections["MeshFormat"])
    names = _group_names(sections.get("PhysicalNames", b"0"))

    def parsed(name: str, parse: Any, *more: Any) -> Any:
        try:
            numbers = (Bytes if as_bytes else Words)(sections[name])
            result = parse(numbers, *more)
            numbers.end()
        except MeshError as error:
            raise MeshError(f"${name}: {error}") from None
        return result

    if version == "4.1":
        groups = parsed("Entities", _entities) if "Entities" in sections else None
        tags, points = parsed("Nodes", _nodes_41)
        cells = parsed("Elements", _cells_41, groups)
    else:
        tags, points = parsed("Nodes", _nodes_22)
        cells = [_once(block, names) for block in parsed("Elements", _cells_22)]
    ignored = [f"${name}" for name in sections if name not in (*_READ, "Comments")]
    return _mesh(names, tags, points, cells), ignored


def _sections(content: bytes) -> Iterator[tuple[str, bytes]]:
    """The name of each section and what it holds."""
    at = 0
    while at < len(content):
        end = content.find(b"\n", at) + 1 or len(content)
        line, at = content[at:end].strip(_BLANK), end
        shown = printable(line[:30].decode(errors="replace"))
        if not line:
            continue
        if not line.startswith(b"$") or line.startswith(b"$End"):
            raise MeshError(f"{shown!r} stands where a section of Gmsh should begin")
        last = b"$End" + line[1:]
        close = content.find(last, end)
        if close < 0:
            raise MeshError(f"the end of {shown} is missing")
        at = content.find(b"\n", close) + 1 or len(content)
        if content[close:at].strip(_BLANK) != last:
            raise MeshError(f"{shown} does not end with its line")
        yield line[1:].decode(errors="replace"), content[end:close]


def _format(body: bytes) -> tuple[str, bool]:
    """The version, and whether numbers are written as bytes."""
    head, _, one = body.partition(b"\n")
    version, kind, size, *more = [*head.decode(errors="replace").split(), "", "", ""]
    if version not in ("2", "2.2", "4.1"):
        raise MeshError(
            f"version {printable(version[:9])!r} of Gmsh's files is not read; save it "
            "as 2.2 or 4.1"
        )
    if kind not in ("0", "1") or size != "8" or any(more):
        raise MeshError("$MeshFormat must name a version, 0 or 1, and the size 8")
    if kind == "1" and one[:4] != np.array(1, "i4").tobytes():
        raise MeshError("its bytes are in the order of another machine")
    if one[4 if kind == "1" else 0 :].strip():
        raise MeshError("$MeshFormat holds more than a format")
    return version, kind == "1"


def _group_names(body: bytes) -> _Names:
    """Names of groups by dimension and number."""
    try:
        lines = [x for x in body.decode().split("\n") if x.strip()]
    except UnicodeDecodeError:
        raise MeshError("a name in $PhysicalNames is not in UTF-8") from None
    names: _Names = {}
    if not lines or lines[0].strip() != str(len(lines) - 1):
        raise MeshError(f"$PhysicalNames must count its {len(lines[1:])} names")
    for line in lines[1:]:
        found = _GROUP.fullmatch(line)
        if found is None or int(found[1]) > 3:
            shown = printable(line[:60].strip())
            raise MeshError(f"$PhysicalNames: {shown} is no dimension, number and name")
        if found[3] in names.values():
            raise MeshError(f"two groups are named {found[3]!r}; name them apart")
        if (key := (int(found[1]), int(found[2]))) in names:
            raise MeshError(f"group {found[3]!r} has the number of another")
        names[key] = found[3]
    return names


def _nodes_22(numbers: _Numbers) -> tuple[ndarray, ndarray]:
    """Tags, shape (n,), and positions, shape (n, 3)."""
    count = _count_22(numbers)
    if isinstance(numbers, Bytes):
        nodes = numbers.take(count, [("tag", "i4"), ("x", "f8", 3)])
        return nodes["tag"], nodes["x"]
    rows = [(numbers.take(1, "i4"), numbers.take(3, "f8")) for _ in range(count)]
    tags = np.array([tag for (tag,), _ in rows], dtype="i4")
    return tags, np.array([x for _, x in rows]).reshape(-1, 3)


def _count_22(numbers: _Numbers) -> int:
    """How many nodes or elements there are; always as text."""
    words = Words(numbers.line()) if isinstance(numbers, Bytes) else numbers
    (count,) = words.take(1, "i4").tolist()
    return count


def _cells_22(numbers: _Numbers) -> list[_Cells]:
    """Cells by kind, each a member of a group."""
    left = _count_22(numbers)
    found: dict[int, list[ndarray]] = {}
    while left > 0:
        first, second, n_tags = numbers.take(3, "i4").tolist()
        as_bytes = isinstance(numbers, Bytes)
        kind, count = (first, second) if as_bytes else (second, 1)
        width = as_bytes + n_tags + _corners(kind)
        if not 0 < count <= left or n_tags < 0:
            raise MeshError(f"{count} elements with {n_tags} tags, {left} are due")
        rows = numbers.take(count * width, "i4").reshape(count, width)
        if not as_bytes:
            rows = np.array([[first, *rows[0]]])
        group = rows[:, 1:2] if n_tags else np.zeros((count, 1), dtype="i4")
        cells = np.hstack([rows[:, :1], np.abs(group), rows[:, 1 + n_tags :]])
        found.setdefault(kind, []).append(cells)
        left -= count
    blocks = []
    for kind, parts in found.items():
        cells = np.concatenate(parts)
        members = np.arange(len(cells))
        blocks.append(_Cells(kind, cells[:, 0], cells[:, 2:], members, cells[:, 1]))
    return blocks


def _corners(kind: int) -> int:
    """Number of nodes of a cell."""
    if kind not in _KINDS:
        found = meshio.gmsh.common._gmsh_to_meshio_type.get(kind, f"type {kind}")
        raise MeshError(
            f"only triangles and four-node quadrilaterals are supported, found {found}"
        )
    return _KINDS[kind][2]


def _once(cells: _Cells, names: _Names) -> _Cells:
    """Each cell once, which files of version 2.2 repeat for each of its groups.

    Cells that are repeated otherwise are left for `check_mesh` to refuse.
    """
    _, first, copy = np.unique(
        cells.nodes, axis=0, return_index=True, return_inverse=True
    )
    copy = copy.ravel()
    repeated = np.bincount(copy)[copy] > 1
    dimension = _KINDS[cells.kind][1]
    named = [number for of, number in names if of == dimension]
    pairs = np.unique(np.stack([copy, cells.groups]), axis=1)
    if pairs.shape[1] < len(copy) or not np.isin(cells.groups[repeated], named).all():
        return cells
    kept = np.sort(first)
    members = np.searchsorted(kept, first[copy])
    return cells._replace(nodes=cells.nodes[kept], members=members)


def _entities(numbers: _Numbers) -> dict[tuple[int, int], list[int]]:
    """Numbers of groups by dimension and tag of an entity."""
    groups = {}
    for dimension, count in enumerate(numbers.take(4, "u8").tolist()):
        for _ in range(count):
            (tag,) = numbers.take(1, "i4").tolist()
            numbers.take(3 if dimension == 0 else 6, "f8")  # where it lies
            if (dimension, tag) in groups:
                raise MeshError(f"two entities {tag} of dimension {dimension}")
            some = numbers.take(numbers.take(1, "u8").item(), "i4")
            groups[dimension, tag] = np.unique(np.abs(some)).tolist()
            if dimension > 0:
                numbers.take(numbers.take(1, "u8").item(), "i4")  # what bounds it
    return groups


def _nodes_41(numbers: _Numbers) -> tuple[ndarray, ndarray]:
    """Tags, shape (n,), and positions, shape (n, 3)."""
    n_blocks, n_nodes, _, _ = numbers.take(4, "u8").tolist()
    tags, points = [np.empty(0, dtype="u8")], [np.empty((0, 3))]
    for _ in range(n_blocks):
        dimension, _, parametric = numbers.take(3, "i4").tolist()
        if not 0 <= dimension <= 3 or parametric not in (0, 1):
            raise MeshError("a block of nodes must have a dimension, and 0 or 1")
        (count,) = numbers.take(1, "u8").tolist()
        width = 3 + dimension * parametric
        tags.append(numbers.take(count, "u8"))
        points.append(numbers.take(count * width, "f8").reshape(count, width)[:, :3])
    _refuse_count(n_nodes, sum(map(len, tags)))
    return np.concatenate(tags), np.concatenate(points)


def _refuse_count(said: int, found: int) -> None:
    if said != found:
        raise MeshError(f"{said} are said to be there, and there are {found}")


def _cells_41(
    numbers: _Numbers, groups: dict[tuple[int, int], list[int]] | None
) -> list[_Cells]:
    """Cells by entity, members of its groups."""
    n_blocks, n_cells, _, _ = numbers.take(4, "u8").tolist()
    blocks = []
    for _ in range(n_blocks):
        dimension, tag, kind = numbers.take(3, "i4").tolist()
        (count,) = numbers.take(1, "u8").tolist()
        width = 1 + _corners(kind)
        if dimension != _KINDS[kind][1]:
            raise MeshError(f"a {_KINDS[kind][0]} in an entity of {dimension}D")
        if groups is not None and (dimension, tag) not in groups:
            raise MeshError(f"entity {tag} of dimension {dimension} is not there")
        rows = numbers.take(count * width, "u8").reshape(count, width)
        own = np.array((groups or {}).get((dimension, tag), []), dtype="i4")
        members = np.repeat(np.arange(count), len(own))
        block = _Cells(kind, rows[:, 0], rows[:, 1:], members, np.tile(own, count))
        blocks.append(block)
    _refuse_count(n_cells, sum(len(block.numbers) for block in blocks))
    return blocks


def _mesh(
    names: _Names, tags: ndarray, points: ndarray, cells: list[_Cells]
) -> meshio.Mesh:
    refuse_twice(tags, "node")
    if cells:
        refuse_twice(np.concatenate([block.numbers for block in cells]), "element")
    sets: dict[str, Any] = {
        name: [
            np.unique(block.members[block.groups == number])
            if _KINDS[block.kind][1] == dimension
            else np.empty(0, dtype=int)
            for block in cells
        ]
        for (dimension, number), name in names.items()
    }
    blocks: list[Any] = [
        (_KINDS[block.kind][0], places(tags, block.nodes, "node")) for block in cells
    ]
    return meshio.Mesh(points, blocks, cell_sets=sets)
