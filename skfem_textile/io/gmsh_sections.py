"""Nodes, elements and entities of files of Gmsh, as text or binary."""

from collections.abc import Iterator
from typing import Any, NamedTuple

import meshio
import numpy as np
from numpy import ndarray

from ..mesh.checks import MeshError
from .file_numbers import BinaryNumbers, TextNumbers, from_words

#: Name, dimension and number of nodes of a cell, by Gmsh's number of its type.
CELL_TYPES = {
    15: ("vertex", 0, 1),
    1: ("line", 1, 2),
    2: ("triangle", 2, 3),
    3: ("quad", 2, 4),
}

Numbers = TextNumbers | BinaryNumbers


class CellBlock(NamedTuple):
    """Cells of one type, and their groups.

    ``kind`` is Gmsh's number of the type; ``numbers`` has shape (n,), ``nodes`` (n,
    corners).  ``members`` are positions in the block, ``groups`` the group of each.
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
    """Number of nodes or elements, which is always text."""
    words = (
        TextNumbers(numbers.line()) if isinstance(numbers, BinaryNumbers) else numbers
    )
    (count,) = words.take(1, "i4").tolist()
    if words is not numbers:
        words.refuse_rest()
    return count


def cells_22(numbers: Numbers) -> list[CellBlock]:
    """Cells by type, each a member of a group."""
    count = _count_22(numbers)
    if isinstance(numbers, BinaryNumbers):
        rows = _binary_rows(numbers, count)
    else:
        rows = _text_rows(numbers, count)
    by_kind: dict[int, list[Any]] = {}
    for kind, values in rows:
        by_kind.setdefault(kind, []).append(values)
    blocks = []
    for kind, parts in by_kind.items():
        cells = np.vstack(parts)
        members = np.arange(len(cells))
        groups = np.abs(cells[:, 1])
        blocks.append(CellBlock(kind, cells[:, 0], cells[:, 2:], members, groups))
    return blocks


def _text_rows(numbers: TextNumbers, count: int) -> Iterator[tuple[int, Any]]:
    """Kind of each element, and its number, group and nodes."""
    words = numbers.take(numbers.left, "i4").tolist()
    position = 0
    for _ in range(count):
        head = words[position : position + 3]
        number, kind, n_tags = head if len(head) == 3 else (0, 1, 0)
        first = position + 3 + n_tags
        position = first + _n_corners(kind)
        if n_tags < 0 or position > len(words):
            raise MeshError(f"{count} elements are due, and it is cut off")
        yield (
            kind,
            [number, words[first - n_tags] if n_tags else 0, *words[first:position]],
        )
    if position < len(words):
        raise MeshError(f"{len(words) - position} more words than its counts state")


def _binary_rows(numbers: BinaryNumbers, left: int) -> Iterator[tuple[int, Any]]:
    """Kind of consecutive elements, and their numbers, groups and nodes."""
    while left > 0:
        kind, count, n_tags = numbers.take(3, "i4").tolist()
        width = 1 + n_tags + _n_corners(kind)
        if not 0 < count <= left or n_tags < 0:
            raise MeshError(f"{count} elements with {n_tags} tags, {left} are due")
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
                raise MeshError(f"two entities {tag} of dimension {dimension}")
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
            raise MeshError("a block of nodes must have a dimension, and 0 or 1")
        (count,) = numbers.take(1, "u8").tolist()
        width = 3 + dimension * parametric
        tags.append(numbers.take(count, "u8"))
        points.append(numbers.take(count * width, "f8").reshape(count, width)[:, :3])
    _refuse_count(n_nodes, sum(map(len, tags)))
    return np.concatenate(tags), np.concatenate(points)


def _refuse_count(stated: int, actual: int) -> None:
    if stated != actual:
        raise MeshError(f"it states {stated}, and has {actual}")


def cells_41(
    numbers: Numbers, groups: dict[tuple[int, int], list[int]] | None
) -> list[CellBlock]:
    """Cells by entity, members of its groups."""
    n_blocks, n_cells, _, _ = numbers.take(4, "u8").tolist()
    blocks = []
    for _ in range(n_blocks):
        dimension, tag, kind = numbers.take(3, "i4").tolist()
        (count,) = numbers.take(1, "u8").tolist()
        width = 1 + _n_corners(kind)
        if dimension != CELL_TYPES[kind][1]:
            raise MeshError(f"a {CELL_TYPES[kind][0]} in an entity of {dimension}D")
        if groups is not None and (dimension, tag) not in groups:
            raise MeshError(f"entity {tag} of dimension {dimension} is not there")
        rows = numbers.take(count * width, "u8").reshape(count, width)
        own_groups = np.array((groups or {}).get((dimension, tag), []), dtype="i4")
        members = np.repeat(np.arange(count), len(own_groups))
        block = CellBlock(
            kind, rows[:, 0], rows[:, 1:], members, np.tile(own_groups, count)
        )
        blocks.append(block)
    _refuse_count(n_cells, sum(len(block.numbers) for block in blocks))
    return blocks
