"""Writes sound meshes as files of Abaqus."""

from collections.abc import Iterable
from itertools import pairwise

from numpy.random import Generator

from .sound_meshes import SoundMesh

# Types of elements by their number of nodes.
_TYPES = {
    2: ("T3D2", "B31"),
    3: ("S3", "CPS3", "M3D3"),
    4: ("S4R", "CPS4", "M3D4R"),
}


def abaqus(mesh: SoundMesh, rng: Generator) -> bytes:
    """A file of nodes, elements and sets."""
    gap, first = int(rng.integers(1, 4)), int(rng.integers(1, 10))
    z = ", 0." if rng.integers(0, 2) else ""
    tag = [first + gap * i for i in range(len(mesh.points))]
    lines = ["*Heading", " a mesh", "** nodes", "*NODE" + [", NSET=All", ""][gap % 2]]
    for i, (x, y) in enumerate(mesh.points):
        lines.append(f"{tag[i]}, {x}, {y}{z}")
    number, of_cell = 0, {}
    for corners in mesh.kinds:
        kind = str(rng.choice(_TYPES[corners]))
        lines.append(f"*ELEMENT, TYPE={kind.lower() if gap == 3 else kind}")
        for i, cell in enumerate(mesh.cells):
            if len(cell) == corners:
                number += 1
                of_cell[i] = number
                lines.append(", ".join(map(str, [number, *(tag[n] for n in cell)])))
    for name, pairs in mesh.edges.items():
        shown = name.replace(" ", "_")
        if rng.integers(0, 2):
            lines.append(f"*ELEMENT, TYPE={rng.choice(_TYPES[2])}, ELSET={shown}")
            for a, b in pairs:
                number += 1
                lines.append(f"{number}, {tag[a]}, {tag[b]}")
        else:
            members = sorted({tag[n] for pair in pairs for n in pair})
            lines += [f"*NSET, NSET={shown}", *_rows(members)]
    for name, cells in mesh.regions.items():
        numbers = [of_cell[i] for i in cells]
        lines += _set("ELSET", name.replace(" ", "_"), numbers)
    for name, nodes in mesh.nodes.items():
        lines += _set("NSET", name.replace(" ", "_"), [tag[n] for n in nodes])
    if rng.integers(0, 3) == 0:
        lines += ["*MATERIAL, NAME=glass", "*ELASTIC", "1000., 0.3"]
    lower = rng.integers(0, 4) == 0
    lines = [x.lower() if lower and x.startswith("*") else x for x in lines]
    return ("\n".join(lines) + "\n").encode()


def _set(keyword: str, name: str, members: list[int]) -> list[str]:
    """A set; first, last and step where its members are evenly spaced."""
    steps = {b - a for a, b in pairwise(members)}
    if len(steps) == 1 and min(steps) > 0:
        row = f"{members[0]}, {members[-1]}, {min(steps)}"
        return [f"*{keyword}, {keyword}={name}, GENERATE", row]
    return [f"*{keyword}, {keyword}={name}", *_rows(members)]


def _rows(members: Iterable[int]) -> list[str]:
    """Rows of eight members; Abaqus allows up to sixteen."""
    words = list(map(str, members))
    return [", ".join(words[i : i + 8]) + "," for i in range(0, len(words), 8)]
