"""Nodes, elements and entities of Gmsh's files, as text or as bytes."""

from collections.abc import Iterator
from typing import Any, NamedTuple

import meshio
import numpy as np
from numpy import ndarray

from ..mesh.checks import MeshError
from .file_numbers import Bytes, Words, from_words

#: By Gmsh's number: what the cells are, their dimension and number of nodes.
KINDS = {
    15: ("vertex", 0, 1),
    1: ("line", 1, 2),
    2: ("triangle", 2, 3),
    3: ("quad", 2, 4),
}

Numbers = Words | Bytes


class Cells(NamedTuple):
    """Cells of one kind, and which of them belong to groups.

    Gmsh's number of the kind, numbers, shape (n,), and nodes, shape (n, corners).
    Members of groups among these cells, and the number of the group of each.
    """

    kind: int
    numbers: ndarray
    nodes: ndarray
    members: ndarray
    groups: ndarray


def nodes_22(numbers: Numbers) -> tuple[ndarray, ndarray]:
    """Tags, shape (n,), and positions, shape (n, 3)."""
    count = _count_22(numbers)
    if isinstance(numbers, Bytes):
        nodes = numbers.take(count, [("tag", "i4"), ("x", "f8", 3)])
        return nodes["tag"], nodes["x"]
    words = numbers.words(4 * count)
    x = [from_words(words[i::4], "f8") for i in (1, 2, 3)]
    return from_words(words[::4], "i4"), np.stack(x, axis=1)


def _count_22(numbers: Numbers) -> int:
    """How many nodes or elements there are; always as text."""
    words = Words(numbers.line()) if isinstance(numbers, Bytes) else numbers
    (count,) = words.take(1, "i4").tolist()
    if words is not numbers:
        words.end()
    return count


def cells_22(numbers: Numbers) -> list[Cells]:
    """Cells by kind, each a member of a group."""
    count = _count_22(numbers)
    if isinstance(numbers, Bytes):
        rows = _packed_rows(numbers, count)
    else:
        rows = _written_rows(numbers, count)
    found: dict[int, list[Any]] = {}
    for kind, some in rows:
        found.setdefault(kind, []).append(some)
    blocks = []
    for kind, parts in found.items():
        cells = np.vstack(parts)
        members = np.arange(len(cells))
        groups = np.abs(cells[:, 1])
        blocks.append(Cells(kind, cells[:, 0], cells[:, 2:], members, groups))
    return blocks


def _written_rows(numbers: Words, count: int) -> Iterator[tuple[int, Any]]:
    """Kind of each element, and its number, group and nodes."""
    words = numbers.take(numbers.left, "i4").tolist()
    at = 0
    for _ in range(count):
        head = words[at : at + 3]
        number, kind, n_tags = head if len(head) == 3 else (0, 1, 0)
        first = at + 3 + n_tags
        at = first + _corners(kind)
        if n_tags < 0 or at > len(words):
            raise MeshError(f"{count} elements are due, and it is cut off")
        yield kind, [number, words[first - n_tags] if n_tags else 0, *words[first:at]]
    if at < len(words):
        raise MeshError(f"{len(words) - at} more words than its counts say")


def _packed_rows(numbers: Bytes, left: int) -> Iterator[tuple[int, Any]]:
    """Kind of elements that stand together, and their numbers, groups and nodes."""
    while left > 0:
        kind, count, n_tags = numbers.take(3, "i4").tolist()
        width = 1 + n_tags + _corners(kind)
        if not 0 < count <= left or n_tags < 0:
            raise MeshError(f"{count} elements with {n_tags} tags, {left} are due")
        rows = numbers.take(count * width, "i4").reshape(count, width)
        group = rows[:, 1:2] if n_tags else np.zeros((count, 1), dtype="i4")
        yield kind, np.hstack([rows[:, :1], group, rows[:, 1 + n_tags :]])
        left -= count


def _corners(kind: int) -> int:
    """Number of nodes of a cell."""
    if kind not in KINDS:
        found = meshio.gmsh.common._gmsh_to_meshio_type.get(kind, f"type {kind}")
        raise MeshError(
            f"only triangles and four-node quadrilaterals are supported, found {found}"
        )
    return KINDS[kind][2]


def entities(numbers: Numbers) -> dict[tuple[int, int], list[int]]:
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


def _refuse_count(said: int, found: int) -> None:
    if said != found:
        raise MeshError(f"{said} are said to be there, and there are {found}")


def cells_41(
    numbers: Numbers, groups: dict[tuple[int, int], list[int]] | None
) -> list[Cells]:
    """Cells by entity, members of its groups."""
    n_blocks, n_cells, _, _ = numbers.take(4, "u8").tolist()
    blocks = []
    for _ in range(n_blocks):
        dimension, tag, kind = numbers.take(3, "i4").tolist()
        (count,) = numbers.take(1, "u8").tolist()
        width = 1 + _corners(kind)
        if dimension != KINDS[kind][1]:
            raise MeshError(f"a {KINDS[kind][0]} in an entity of {dimension}D")
        if groups is not None and (dimension, tag) not in groups:
            raise MeshError(f"entity {tag} of dimension {dimension} is not there")
        rows = numbers.take(count * width, "u8").reshape(count, width)
        own = np.array((groups or {}).get((dimension, tag), []), dtype="i4")
        members = np.repeat(np.arange(count), len(own))
        block = Cells(kind, rows[:, 0], rows[:, 1:], members, np.tile(own, count))
        blocks.append(block)
    _refuse_count(n_cells, sum(len(block.numbers) for block in blocks))
    return blocks
