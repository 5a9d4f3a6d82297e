"""What meshio's reader of Abaqus files leaves out or would misread."""

from dataclasses import dataclass, field
from pathlib import Path

import meshio
import numpy as np
from meshio.abaqus._abaqus import abaqus_to_meshio_type

from ..mesh.checks import MeshError

# Membranes, which meshio does not know; added to its own table.
_MEMBRANES = {"M3D3": "triangle", "M3D4": "quad", "M3D4R": "quad"}
abaqus_to_meshio_type.update(_MEMBRANES)

# Keywords that are read, or say nothing of the mesh.
_KNOWN = {
    *("NODE", "ELEMENT", "NSET", "ELSET", "HEADING", "PREPRINT", "PART", "END PART"),
    *("ASSEMBLY", "END ASSEMBLY", "INSTANCE", "END INSTANCE"),
}


@dataclass
class Deck:
    """The keywords of an Abaqus file.

    Attributes
    ----------
    ignored
        Keywords that are not read.
    blocks
        The element set that each ``*ELEMENT`` names, or none.
    all_nodes
        The node set that ``*NODE`` names, or none.
    sizes
        Number of elements of each ``*ELSET``.
    """

    ignored: list[str] = field(default_factory=list)
    blocks: list[str | None] = field(default_factory=list)
    all_nodes: str | None = None
    sizes: dict[str, int] = field(default_factory=dict)


def scan(path: Path) -> Deck:
    """Read the keywords of an Abaqus file.

    Raises
    ------
    MeshError
        If there are keywords that meshio would misread.
    """
    lines = path.read_text(errors="replace").splitlines()
    starts = [i for i, line in enumerate(lines) if line.startswith("*")]
    starts = [i for i in starts if not lines[i].startswith("**")]
    deck = Deck()
    sets: set[tuple[str, str]] = set()
    for start, end in zip(starts, [*starts[1:], len(lines)], strict=True):
        keyword, *words = lines[start][1:].split(",")
        keyword = " ".join(keyword.upper().split())
        pairs = (word.partition("=") for word in words)
        given = {key.strip().upper(): value.strip() for key, _, value in pairs}
        data = [x for x in lines[start + 1 : end] if x.strip() and x[:2] != "**"]
        if keyword == "INCLUDE":
            raise MeshError("*INCLUDE is not followed; put the mesh in one file")
        if keyword == "NODE":
            _read_node(deck, given, ("NODE", "") in sets)
            sets.add(("NODE", ""))
        elif keyword == "ELEMENT":
            deck.blocks.append(given.get("ELSET"))
        elif keyword in ("NSET", "ELSET"):
            name = given.get(keyword, "")
            if (keyword, name) in sets:
                raise MeshError(f"*{keyword} {name!r} is given twice; name them apart")
            sets.add((keyword, name))
            size = _size(f"*{keyword} {name!r}", keyword, given, data, len(lines))
            if keyword == "ELSET":
                deck.sizes[name] = size
        elif keyword not in _KNOWN or (keyword == "INSTANCE" and data):
            deck.ignored.append(f"*{keyword}")
    if both := set(deck.sizes) & set(deck.blocks):
        name = min(map(str, both))
        raise MeshError(f"*ELSET {name!r} is a set of *ELEMENT too; name them apart")
    return deck


def _read_node(deck: Deck, given: dict[str, str], again: bool) -> None:
    if again:
        raise MeshError("there is more than one *NODE block; put all nodes in one")
    if other := set(given) - {"NSET"}:
        raise MeshError(
            f"*NODE with {min(other)!r} is not read; give plain coordinates"
        )
    deck.all_nodes = given.get("NSET")


def _size(
    what: str, keyword: str, given: dict[str, str], data: list[str], most: int
) -> int:
    """Number of members of a set."""
    words = [
        word.strip() for line in data for word in line.strip().strip(",").split(",")
    ]
    others = {"NSET", "ELSET"} - {keyword}
    if others & set(given) or not all(word.isdecimal() for word in words):
        raise MeshError(f"{what} is given by other sets; give it by numbers")
    numbers = list(map(int, words))
    if "GENERATE" in given:
        if len(numbers) != 3 or numbers[2] < 1:
            raise MeshError(f"{what}: GENERATE takes one line: first, last, step")
        first, last, step = numbers
        if (last - first) // step > most:
            raise MeshError(f"{what} has more members than the file has lines")
        return len(range(first, last + 1, step))
    return len(set(numbers))


def mend(raw: meshio.Mesh, deck: Deck) -> None:
    """Put right the sets of a mesh that meshio has read.

    meshio takes it that every ``*ELEMENT`` names a set of its own, leaves out the set
    of ``*NODE``, and cuts an ``*ELSET`` to the elements that it knows.

    Raises
    ------
    MeshError
        If a set names elements that are not there.
    """
    for name, size in deck.sizes.items():
        there = sum(np.size(members) for members in raw.cell_sets[name])
        if there != size:
            raise MeshError(
                f"*ELSET {name!r} names {size} elements, and {there} of these numbers "
                "stand before it; give each element a number of its own"
            )
    for name in {name for name in deck.blocks if name is not None}:
        raw.cell_sets[name] = [
            np.arange(len(block.data) if own == name else 0)
            for own, block in zip(deck.blocks, raw.cells, strict=True)
        ]
    if deck.all_nodes is not None:
        raw.point_sets[deck.all_nodes] = np.arange(len(raw.points))
