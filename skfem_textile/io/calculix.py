"""Variants of Abaqus decks for CalculiX, which has layers in S8R and S6 alone.

CalculiX ignores ``*DISTRIBUTION`` under shells.  Each class of similar directions and
thickness has its own section and orientations.  Where the thickness changes, CalculiX
makes nodes rigid, and has no room for several layers there.  Outer layers without
stiffness and mass therefore fill all sections to the same thickness.
"""

import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from itertools import count

import numpy as np
from numpy import ndarray

from ..mesh.checks import MeshError
from .abaqus import Block, name_of, node_lines, set_lines
from .deck_text import UTF8, DeckCopy
from .file_numbers import real_word
from .layups import LAYERS, WARP, Element, Layup
from .part_abaqus import AbaqusDeck, Group, first_words, type_of

# Width of classes of directions in degrees, and of classes of relative thickness.
_CLASS_DEG, _CLASS_THICKNESS = 0.1, 1e-3

# Material of the outer layers: a modulus far below fibres and resins (N/mm2), and a
# density (t/mm3) that makes its own frequencies high.
_FILLING = "FILLING"
_FILLING_LINES = (
    *(f"*MATERIAL, NAME={_FILLING}", "*ELASTIC", "1., 0.", "*DENSITY", "1e-15"),
)

# Thickness of all sections relative to the thickest ply.
_FILLED = 1.01

# Keywords of an assembly, which are removed.
_OF_ASSEMBLY = ("PART", "ASSEMBLY", "INSTANCE")

_LINEAR_OR_QUADRATIC = ("S3", "S4", "S6", "S8", "S9", "STRI")


@dataclass
class _MidNodes:
    """New nodes in the middle of edges, by their end nodes."""

    positions: dict[int, ndarray]
    of_edges: dict[tuple[int, int], int] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self._numbers = count(max(self.positions) + 1)

    def between(self, a: int, b: int) -> int:
        """Number of the node of an edge."""
        edge = min(a, b), max(a, b)
        if edge not in self.of_edges:
            new = self.of_edges[edge] = next(self._numbers)
            self.positions[new] = (self.positions[a] + self.positions[b]) / 2
        return self.of_edges[edge]

    def within(self, ends: set[int]) -> list[int]:
        """Nodes of the edges whose end nodes are both in a set."""
        edges = self.of_edges.items()
        return [n for (a, b), n in edges if a in ends and b in ends]


def calculix_deck(deck: AbaqusDeck, layup: Layup) -> tuple[bytes, list[str]]:
    """Deck in one file with elements raised to S8R and S6, and remarks.

    CalculiX reads no parts.  Those of a deck with one instance are removed, and its
    nodes are moved.  Parts without an instance are left out.

    Raises
    ------
    MeshError
        If the deck has several instances, or fibres in membranes.
    """
    (part, instance), elements = deck.only(), {x.number: x for x in layup.elements}
    plies = {layup.elements[i].number: i for i in layup.indices()}
    if other := [n for n in plies if not _is_raised(elements[n].kind)]:
        kind = elements[other[0]].kind
        raise MeshError(f"element {other[0]} is a {kind}: use S3 to S8R")
    nodes = _MidNodes({n: x for (_, n), x in deck.positions.items()})
    copy, lines = DeckCopy(deck.text), list[str]()
    _rename(copy, deck.text.lines, instance.name)
    beams = ", ".join(kind for kind in deck.left if kind.startswith("B"))
    remarks = [f"CalculiX may fail on layers together with {beams}"] * bool(beams)
    is_used = True
    for block in deck.blocks:
        keyword, parameters = block.keyword, block.parameters
        if keyword in ("PART", "END PART"):
            is_used = keyword != "PART" or name_of(parameters, "NAME") == part.name
        if not is_used:
            copy.comment_out(block.lines, "**")
            continue
        if keyword == "BOUNDARY" and any(x[0].isdigit() for x in block.data):
            remarks.append(
                "*BOUNDARY on single nodes: new nodes between them are free; use sets"
            )
        new = list(_changed(block, elements, nodes))
        if new or keyword.removeprefix("END ") in _OF_ASSEMBLY:
            copy.comment_out(block.lines, "**")
            copy.insert(block.lines[0], new)
    own = {
        name: set(members.tolist())
        for (keyword, name), members in part.deck.sets.items()
        if keyword == "NSET"
    }
    own |= {name: {n for _, n in pairs} for name, pairs in deck.node_sets.items()}
    for name, members in own.items():
        lines += set_lines("NSET", name, nodes.within(members))
    lines += _FILLING_LINES
    for k, group in enumerate(deck.groups(part, set(plies), layup.material)):
        lines += _classes(group, plies, layup, f"CLASS_{k}")
        lines += group.rest_lines(str)
        list(group.comment_out(copy))
    copy.insert(deck.flat.end, lines)
    return copy.content(), remarks


def _rename(copy: DeckCopy, lines: list[str], instance: str) -> None:
    """Remove the name of the instance and a point before names."""
    prefix = re.compile(r"\b" + re.escape(instance) + r"\.", re.I)
    for number, line in enumerate(lines):
        if instance and prefix.search(line):
            copy.replace(number, [prefix.sub("", line)])


def _changed(
    block: Block, elements: dict[int, Element], nodes: _MidNodes
) -> Iterator[str]:
    """Lines in place of those that CalculiX does not read."""
    keyword, parameters = block.keyword, block.parameters
    if keyword == "ELEMENT" and _is_raised(type_of(block)):
        own = [elements[n] for n in first_words(block.data)]
        yield from _raised(own, nodes, parameters.get("ELSET"))
    elif keyword == "ELASTIC" and type_of(block) == "LAMINA":
        yield from _engineering(block)
    elif keyword == "NODE" and any(element.scope for element in elements.values()):
        numbers = [int(row[0]) for row in block.data]
        yield "*NODE" + "".join(f", NSET={parameters[k]}" for k in parameters)
        yield from node_lines(
            numbers, np.array([nodes.positions[n] for n in numbers]).T
        )
    elif keyword in ("NSET", "ELSET") and "INSTANCE" in parameters:
        words = [k for k in parameters if k == "GENERATE"]
        prefix = re.compile(re.escape(parameters["INSTANCE"]) + r"\.", re.I)
        yield ", ".join([f"*{keyword}", f"{keyword}={parameters[keyword]}", *words])
        for row in block.data:
            line = b", ".join(row).decode(*UTF8)
            yield prefix.sub("", line)


def _is_raised(kind: str) -> bool:
    return kind.upper().startswith(_LINEAR_OR_QUADRATIC)


def _raised(own: list[Element], nodes: _MidNodes, name: str | None) -> list[str]:
    """Lines of quadratic elements, and of their new nodes before them."""
    rows: dict[str, list[str]] = {"S8R": [], "S6": []}
    before = len(nodes.of_edges)
    for element in own:
        corners, n = element.corners, len(element.corners)
        ends = zip(corners, (*corners[1:], corners[0]), strict=True)
        given = element.nodes[element.n_corners : 2 * element.n_corners]
        if len(given) < n or n < element.n_corners:
            given = tuple(nodes.between(a, b) for a, b in ends)
        kind = "S8R" if n == 4 else "S6"
        row = element.number, *corners, *given
        rows[kind].append(", ".join(map(str, row)))
    new = list(nodes.of_edges.values())[before:]
    lines = ["*NODE"] * bool(new)
    lines += node_lines(new, np.array([nodes.positions[n] for n in new]).T)
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
    group: Group, plies: dict[int, int], layup: Layup, first: str
) -> Iterator[str]:
    """Orientations and sections of covered elements."""
    members = group.members
    at = np.array([plies[n] for n in members])
    frame = np.vstack([layup.warp, layup.weft, layup.normal])[:, at]
    thick, whole = layup.thickness[at], _FILLED * float(np.nanmax(layup.thickness))
    steps = np.vstack(
        [frame / np.radians(_CLASS_DEG), np.log(thick) / _CLASS_THICKNESS]
    )
    _, of_class = np.unique(np.round(steps).T, axis=0, return_inverse=True)
    of_class = of_class.ravel()
    for number in range(of_class.max() + 1):
        own = np.flatnonzero(of_class == number)
        warp, weft, normal = frame[:, own].mean(axis=1).reshape(3, 3)
        name = f"{first}_{number}"
        yield from set_lines("ELSET", name, [members[i] for i in own.tolist()])
        for family, a in (("P", warp), ("F", weft)):
            yield f"*ORIENTATION, NAME={name}{family}, SYSTEM=RECTANGULAR"
            yield ", ".join(map(real_word, [*a, *np.cross(normal, a)]))
        yield f"*SHELL SECTION, COMPOSITE, ELSET={name}"
        mean = float(thick[own].mean())
        filling = f"{real_word(0.5 * (whole - mean))}, , {_FILLING}, {name}P"
        yield filling
        for family, share in LAYERS:
            axes = f"{name}{'P' if family == WARP else 'F'}"
            yield f"{real_word(mean * share)}, , {group.material}, {axes}"
        yield filling
