"""Variants of Abaqus decks for CalculiX, which has layers in S8R and S6 alone.

CalculiX ignores ``*DISTRIBUTION`` under shells.  Each class of similar directions and
thickness has its own section and orientations.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy import ndarray

from ..mesh.checks import MeshError
from .abaqus import Block, members_of, node_lines, set_lines
from .file_numbers import real_word
from .layups import SEQUENCE, WARP, Element, Layup
from .part_abaqus import AbaqusDeck, first_words, section_again, type_of

# Width of classes of directions in degrees, and of classes of relative thickness.
_CLASS_DEG, _CLASS_THICKNESS = 0.1, 1e-3

_LINEAR_OR_QUADRATIC = ("S3", "S4", "S6", "S8", "S9", "STRI")

# Numbers of an `*ELASTIC` line, the first of two, with engineering constants.
_IN_FIRST_LINE = 8


@dataclass
class _MidNodes:
    """New nodes on edges, by their end nodes; ``last`` is the largest number so far."""

    positions: dict[int, ndarray]
    last: int
    of_edges: dict[tuple[int, int], int] = field(default_factory=dict)
    new: list[int] = field(default_factory=list)

    def between(self, a: int, b: int) -> int:
        edge = min(a, b), max(a, b)
        if edge not in self.of_edges:
            self.last += 1
            self.of_edges[edge] = self.last
            self.positions[self.last] = (self.positions[a] + self.positions[b]) / 2
            self.new.append(self.last)
        return self.of_edges[edge]


def calculix_deck(
    deck: AbaqusDeck, elements: Sequence[Element], layup: Layup, material: str | None
) -> tuple[bytes, list[str]]:
    """Deck in one file with elements raised to S8R and S6, and remarks.

    Raises
    ------
    MeshError
        If the deck has parts, which CalculiX does not read, or covered membranes.
    """
    part = deck.flat
    if part.deck.tags is None or any(element.scope for element in elements):
        raise MeshError("CalculiX reads decks without *PART alone")
    index = {x.number: i for i, x in enumerate(elements)}
    plies = {n: i for n, i in index.items() if layup.covered[i]}
    if other := [i for i in plies.values() if not _is_raised(elements[i].kind)]:
        element = elements[other[0]]
        raise MeshError(f"element {element.number} is a {element.kind}: use S3 to S8R")
    nodes = _MidNodes({n: x for (_, n), x in deck.positions.items()}, 0)
    nodes.last = max(nodes.positions)
    text, remarks = deck.text.unchanged(), list[str]()
    for block in deck.blocks:
        if block.keyword == "ELEMENT" and _is_raised(type_of(block)):
            text.comment_out(block.lines, b"**")
            own = [elements[index[n]] for n in first_words(block.data) if n in index]
            lines = _raised(own, nodes, block.parameters.get("ELSET"))
            text.insert(block.lines[0], [x.encode("latin-1") for x in lines])
        elif block.keyword == "ELASTIC" and type_of(block) == "LAMINA":
            text.comment_out(block.lines, b"**")
            text.insert(block.lines[0], [x.encode() for x in _engineering(block)])
        elif block.keyword == "BOUNDARY" and any(x[0].isdigit() for x in block.data):
            remarks.append(
                "*BOUNDARY on single nodes: new nodes between them are free; use sets"
            )
    lines = []
    for (keyword, name), members in part.deck.sets.items():
        if keyword == "NSET":
            of = set(members.tolist())
            ends = nodes.of_edges.items()
            more = [n for (a, b), n in ends if a in of and b in of]
            lines += set_lines("NSET", name, more)
    for members, chosen, section in deck.groups(part, set(plies), material):
        lines += _classes(members, plies, layup, chosen, len(lines))
        if section is None:
            continue
        text.comment_out(section.lines, b"**")
        name = section.parameters.get("ELSET", "")
        every = set(members_of(part.deck, "ELSET", name.encode()).tolist())
        if others := sorted(every - set(members)):
            lines += set_lines("ELSET", f"REST_{len(lines)}", others)
            lines += section_again(section, f"REST_{len(lines)}")
    text.insert(part.end, [x.encode("latin-1") for x in lines])
    return b"\n".join([*text.changed(), b""]), remarks


def _is_raised(kind: str) -> bool:
    return kind.upper().startswith(_LINEAR_OR_QUADRATIC)


def _raised(own: list[Element], nodes: _MidNodes, name: str | None) -> list[str]:
    """Lines of quadratic elements, and of their new nodes before them."""
    rows: dict[str, list[str]] = {"S8R": [], "S6": []}
    nodes.new.clear()
    for element in own:
        corners, n = element.corners, len(element.corners)
        ends = zip(corners, (*corners[1:], corners[0]), strict=True)
        given = element.nodes[element.n_corners : 2 * element.n_corners]
        if len(given) < n or n < element.n_corners:
            given = tuple(nodes.between(a, b) for a, b in ends)
        kind = "S8R" if n == 4 else "S6"
        row = element.number, *corners, *given
        rows[kind].append(", ".join(map(str, row)))
    lines = ["*NODE"] * bool(nodes.new)
    points = np.array([nodes.positions[n] for n in nodes.new]).reshape(-1, 3).T
    lines += node_lines(nodes.new, points)
    for kind, some in rows.items():
        own_set = f", ELSET={name}" if name else ""
        lines += [f"*ELEMENT, TYPE={kind}{own_set}"] * bool(some) + some
    return lines


def _engineering(block: Block) -> Iterator[str]:
    """Constants of a lamina in space.

    Poisson's ratios through the thickness are zero, so that the solids into which
    CalculiX expands shells have the stiffness of a lamina in plane stress, though all
    layers of a shell thin by the same share.
    """
    yield "*ELASTIC, TYPE=ENGINEERING CONSTANTS"
    for row in block.data:
        E1, E2, nu, G12, G13, G23 = (float(x or b"0") for x in row[:6])
        yield ", ".join(map(real_word, (E1, E2, E2, nu, 0.0, 0.0, G12, G13)))
        yield ", ".join([real_word(G23), *(x.decode() for x in row[6:7] if x)])


def _classes(
    members: list[int], plies: dict[int, int], layup: Layup, material: str, first: int
) -> Iterator[str]:
    """Orientations and sections of covered elements."""
    at = np.array([plies[n] for n in members])
    frame = np.vstack([layup.warp, layup.weft, layup.normal])[:, at]
    thick = layup.thickness[at]
    steps = np.vstack(
        [frame / np.radians(_CLASS_DEG), np.log(thick) / _CLASS_THICKNESS]
    )
    _, of_class = np.unique(np.round(steps).T, axis=0, return_inverse=True)
    of_class = of_class.ravel()
    for number in range(of_class.max() + 1):
        own = np.flatnonzero(of_class == number)
        warp, weft, normal = frame[:, own].mean(axis=1).reshape(3, 3)
        name = f"CLASS_{first}_{number}"
        yield from set_lines("ELSET", name, [members[i] for i in own.tolist()])
        for family, a in (("P", warp), ("F", weft)):
            yield f"*ORIENTATION, NAME={name}{family}, SYSTEM=RECTANGULAR"
            yield ", ".join(map(real_word, [*a, *np.cross(normal, a)]))
        yield f"*SHELL SECTION, COMPOSITE, ELSET={name}"
        layer = float(thick[own].mean()) / len(SEQUENCE)
        for family in SEQUENCE:
            axes = f"{name}{'P' if family == WARP else 'F'}"
            yield f"{real_word(layer)}, , {material}, {axes}"
