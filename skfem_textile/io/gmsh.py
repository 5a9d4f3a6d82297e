"""Files of Gmsh, versions 2.2 and 4.1, as text or binary."""

import re
from collections.abc import Iterator
from typing import Any

import meshio
import numpy as np
from numpy import ndarray

from ..mesh.checks import MeshError
from ..mesh.user_input import excerpt
from .file_numbers import BinaryNumbers, TextNumbers, refuse_duplicates, tag_positions
from .gmsh_sections import (
    CELL_TYPES,
    CellBlock,
    cells_22,
    cells_41,
    entities,
    nodes_22,
    nodes_41,
)

# Sections that are read, others than comments.
_READ = ("MeshFormat", "PhysicalNames", "Entities", "Nodes", "Elements")

# A line of a group: dimension, number and name.
_GROUP = re.compile(r'[ \t]*([0-9]{1,9})[ \t]+([0-9]{1,9})[ \t]+"([^"]+)"[ \t\r]*')

# Characters that may surround a line.
_BLANK = b" \t\r\n"

_Names = dict[tuple[int, int], str]


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
    version, binary = _format(sections["MeshFormat"])
    names = _group_names(sections.get("PhysicalNames", b"0"))

    def parsed(name: str, parse: Any, *more: Any) -> Any:
        try:
            numbers = (BinaryNumbers if binary else TextNumbers)(sections[name])
            result = parse(numbers, *more)
            numbers.refuse_rest()
        except MeshError as error:
            raise MeshError(f"${name}: {error}") from None
        return result

    if version == "4.1":
        groups = parsed("Entities", entities) if "Entities" in sections else None
        tags, points = parsed("Nodes", nodes_41)
        cells = parsed("Elements", cells_41, groups)
    else:
        tags, points = parsed("Nodes", nodes_22)
        cells = [_merge_copies(block, names) for block in parsed("Elements", cells_22)]
    ignored = [f"${name}" for name in sections if name not in (*_READ, "Comments")]
    return _mesh(names, tags, points, cells), ignored


def _sections(content: bytes) -> Iterator[tuple[str, bytes]]:
    """Name and content of each section."""
    position = 0
    while position < len(content):
        end = content.find(b"\n", position) + 1 or len(content)
        line, position = content[position:end].strip(_BLANK), end
        shown = excerpt(line)
        if not line:
            continue
        if not line.startswith(b"$") or line.startswith(b"$End"):
            raise MeshError(f"{shown!r} stands where a section of Gmsh should begin")
        last = b"$End" + line[1:]
        close = content.find(last, end)
        if close < 0:
            raise MeshError(f"the end of {shown} is missing")
        position = content.find(b"\n", close) + 1 or len(content)
        if content[close:position].strip(_BLANK) != last:
            raise MeshError(f"{shown} does not end with its line")
        yield line[1:].decode(errors="replace"), content[end:close]


def _format(body: bytes) -> tuple[str, bool]:
    """The version, and whether numbers are binary."""
    head, _, marker = body.partition(b"\n")
    version, kind, size, *more = [*head.decode(errors="replace").split(), "", "", ""]
    if version not in ("2", "2.2", "4.1"):
        raise MeshError(
            f"version {excerpt(version)!r} of Gmsh's files is not read; save it "
            "as 2.2 or 4.1"
        )
    if kind not in ("0", "1") or size != "8" or any(more):
        raise MeshError("$MeshFormat must name a version, 0 or 1, and the size 8")
    if kind == "1" and marker[:4] != np.array(1, "i4").tobytes():
        raise MeshError("its bytes are in the order of another machine")
    if marker[4 if kind == "1" else 0 :].strip():
        raise MeshError("$MeshFormat holds more than a format")
    return version, kind == "1"


def _group_names(body: bytes) -> _Names:
    """Names of groups by dimension and number."""
    try:
        lines = [line for line in body.decode().split("\n") if line.strip()]
    except UnicodeDecodeError:
        raise MeshError("a name in $PhysicalNames is not in UTF-8") from None
    names: _Names = {}
    if not lines or lines[0].strip() != str(len(lines) - 1):
        raise MeshError(f"$PhysicalNames must count its {len(lines[1:])} names")
    for line in lines[1:]:
        match = _GROUP.fullmatch(line)
        if match is None or int(match[1]) > 3:
            shown = excerpt(line.strip())
            raise MeshError(f"$PhysicalNames: {shown} is no dimension, number and name")
        if match[3] in names.values():
            raise MeshError(f"two groups are named {match[3]!r}; name them apart")
        if (key := (int(match[1]), int(match[2]))) in names:
            raise MeshError(f"group {match[3]!r} has the number of another")
        names[key] = match[3]
    return names


def _merge_copies(cells: CellBlock, names: _Names) -> CellBlock:
    """Merge the copies of a cell that version 2.2 writes for each of its groups.

    Other copies stay, so that `check_mesh` refuses them.
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
    sets: dict[str, Any] = {
        name: [
            np.unique(block.members[block.groups == number])
            if CELL_TYPES[block.kind][1] == dimension
            else np.empty(0, dtype=int)
            for block in cells
        ]
        for (dimension, number), name in names.items()
    }
    blocks: list[Any] = [
        (CELL_TYPES[block.kind][0], tag_positions(tags, block.nodes, "node"))
        for block in cells
    ]
    return meshio.Mesh(points, blocks, cell_sets=sets)
