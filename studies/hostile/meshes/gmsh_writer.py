"""Writes sound meshes as files of Gmsh, versions 2.2 and 4.1."""

import struct
from collections.abc import Callable
from itertools import pairwise

import numpy as np
from numpy.random import Generator

from .sound_meshes import SoundMesh

# Gmsh's number of a kind of element by its number of nodes.
_KINDS = {1: 15, 2: 1, 3: 2, 4: 3}

# Dimension, nodes and groups of an element.
_Element = tuple[int, tuple[int, ...], tuple[int, ...]]


def _groups(mesh: SoundMesh, rng: Generator) -> tuple[bytes, list[_Element]]:
    """The section of names, and elements with the numbers of their groups."""
    named = [(0, mesh.nodes), (1, mesh.edges), (2, mesh.regions)]
    lines, members, number = [], {}, 0
    for dimension, groups in named:
        for name, group in groups.items():
            number += int(rng.integers(1, 3))
            lines.append(f'{dimension} {number} "{name}"\n')
            for member in group:
                nodes = (member,) if dimension == 0 else member
                nodes = mesh.cells[member] if dimension == 2 else nodes
                members.setdefault((dimension, tuple(nodes)), []).append(number)
    elements = [(2, cell, tuple(members.pop((2, cell), ()))) for cell in mesh.cells]
    rest = [(d, nodes, tuple(numbers)) for (d, nodes), numbers in members.items()]
    text = f"$PhysicalNames\n{len(lines)}\n{''.join(lines)}$EndPhysicalNames\n"
    return text.encode() if lines else b"", sorted(rest + elements, key=lambda e: e[0])


def _tags(rng: Generator, count: int) -> np.ndarray:
    """Tags: 1, 2, ..., or with gaps in any order."""
    if rng.integers(0, 2):
        return np.arange(1, count + 1)
    return rng.permutation(2 * count + 3)[:count] + 1


def _head(version: str, binary: bool) -> bytes:
    byte_order = struct.pack("<i", 1) + b"\n" if binary else b""
    head = f"$MeshFormat\n{version} {int(binary)} 8\n".encode()
    return head + byte_order + b"$EndMeshFormat\n"


def _text(code: str, *values: float) -> bytes:
    return " ".join(map(str, values)).encode() + b"\n"


def _packed(code: str, *values: float) -> bytes:
    return struct.pack("<" + code, *values)


def gmsh_22(mesh: SoundMesh, rng: Generator) -> bytes:
    """A file of version 2.2."""
    binary = bool(rng.integers(0, 2))
    names, elements = _groups(mesh, rng)
    tags = _tags(rng, len(mesh.points))
    nodes, cells = b"", b""
    for tag, (x, y) in zip(tags, mesh.points, strict=True):
        nodes += (_packed if binary else _text)("i3d", tag, x, y, 0)
    number = 0
    for _, corners, groups in elements:
        for group in groups or (0,):
            number += 1
            own = [int(tags[node]) for node in corners]
            kind = _KINDS[len(corners)]
            if binary:
                row = [kind, 1, 2, number, group, 1, *own]
                cells += _packed(f"{len(row)}i", *row)
            else:
                cells += _text("", number, kind, 2, group, 1, *own)
    end = b"\n" if binary else b""
    return (
        _head("2.2", binary)
        + names
        + b"$Nodes\n%d\n" % len(tags)
        + nodes
        + end
        + b"$EndNodes\n$Elements\n%d\n" % number
        + cells
        + end
        + b"$EndElements\n"
    )


def gmsh_41(mesh: SoundMesh, rng: Generator) -> bytes:
    """A file of version 4.1."""
    binary = bool(rng.integers(0, 2))
    put = _packed if binary else _text
    names, elements = _groups(mesh, rng)
    entities: dict[tuple[int, tuple[int, ...], int], list[tuple[int, ...]]] = {}
    for dimension, nodes, groups in elements:
        entities.setdefault((dimension, groups, len(nodes)), []).append(nodes)
    tags = _tags(rng, len(mesh.points))
    end = b"\n" if binary else b""
    return (
        _head("4.1", binary)
        + names
        + (b"$Entities\n" + _entities(entities, put) + end + b"$EndEntities\n")
        + (b"$Nodes\n" + _nodes(mesh, tags, rng, put) + end + b"$EndNodes\n")
        + (b"$Elements\n" + _elements(entities, tags, put) + end + b"$EndElements\n")
    )


def _entities(entities: dict, put: Callable[..., bytes]) -> bytes:
    """Each with its groups; no bounds."""
    counts = [sum(key[0] == dimension for key in entities) for dimension in range(4)]
    text = put("4Q", *counts)
    for tag, (dimension, groups, _) in enumerate(entities, 1):
        n = len(groups)
        box = [0.0] * (3 if dimension == 0 else 6)
        text += put(f"i{len(box)}dQ{n}i", tag, *box, n, *groups)
        text += put("Q", 0) if dimension else b""
    return text


def _nodes(
    mesh: SoundMesh, tags: np.ndarray, rng: Generator, put: Callable[..., bytes]
) -> bytes:
    """In one block or in two."""
    n = len(tags)
    cuts = [0, int(rng.integers(1, n)), n] if rng.integers(0, 2) else [0, n]
    text = put("4Q", len(cuts) - 1, n, tags.min(), tags.max())
    for first, last in pairwise(cuts):
        text += put("3iQ", 2, 1, 0, last - first)
        text += b"".join(put("Q", tag) for tag in tags[first:last])
        text += b"".join(put("3d", x, y, 0.0) for x, y in mesh.points[first:last])
    return text


def _elements(entities: dict, tags: np.ndarray, put: Callable[..., bytes]) -> bytes:
    total = sum(map(len, entities.values()))
    text, number = put("4Q", len(entities), total, 1, total), 0
    for tag, ((dimension, _, corners), members) in enumerate(entities.items(), 1):
        text += put("3iQ", dimension, tag, _KINDS[corners], len(members))
        for nodes in members:
            number += 1
            text += put(f"{1 + corners}Q", number, *(int(tags[n]) for n in nodes))
    return text
