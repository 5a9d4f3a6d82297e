"""Variants of Abaqus decks for CalculiX, which has layers in S8R and S6 alone.

CalculiX ignores ``*DISTRIBUTION`` under shells.  Each class of similar directions and
thickness has its own section and orientations.  Where the thickness or the number of
layers changes, CalculiX makes nodes rigid or stops.  Outer layers without stiffness
and mass therefore fill all sections to the same thickness, also of elements that the
ply does not cover.
"""

import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from itertools import count
from typing import NamedTuple

import numpy as np
from numpy import ndarray

from ..mesh.checks import MeshError
from ..mesh.user_input import excerpt
from .abaqus import Block, name_of, node_lines, set_lines
from .deck_text import UTF8, DeckCopy
from .file_numbers import from_words, real_word
from .layups import LAYERS, WARP, WEFT, Element, Layup
from .part_abaqus import AbaqusDeck, FreeNames, Group, Part, first_words, type_of

# Width of classes of directions in degrees, and of classes of relative thickness.
_CLASS_DEG, _CLASS_THICKNESS = 0.1, 1e-3

# Material of the outer layers: a modulus (N/mm2) far below fibres and resins, also for
# thin plies beside thick sections, and a density (t/mm3) that makes its own frequencies
# high.
_FILLING, _SOFT = "FILLING", ("*ELASTIC", "1e-4, 0.", "*DENSITY", "1e-19")

# Thickness of all sections relative to the thickest ply or section.
_FILLED = 1.01

# Parameters of sections that cannot be filled.
_NOT_FILLED = ("COMPOSITE", "OFFSET", "NODAL THICKNESS", "SHELL THICKNESS")

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
    covered = [layup.elements[i] for i in layup.indices()]
    if other := [x for x in covered if not _is_raised(x.kind)]:
        raise MeshError(
            f"element {other[0].number} is a {other[0].kind}: use S3 to S8R"
        )
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
    sections, more = _sections(deck, part, elements, layup, copy)
    lines, remarks = [*lines, *sections], [*remarks, *more]
    copy.insert(deck.flat.end, lines)
    return copy.content(), remarks


def _sections(
    deck: AbaqusDeck,
    part: Part,
    elements: dict[int, Element],
    layup: Layup,
    copy: DeckCopy,
) -> tuple[list[str], list[str]]:
    """Lines of all sections that are replaced, and remarks about others."""
    plies = {layup.elements[i].number: i for i in layup.indices()}
    free, remarks = deck.free_names(), list[str]()
    rest: list[tuple[Group, float]] = []
    for section, members in deck.sections(part):
        covered, left = sorted(members & plies.keys()), sorted(members - plies.keys())
        is_raised = all(n in elements and _is_raised(elements[n].kind) for n in left)
        thick = _thickness(section[0]) if is_raised else 0.0
        if left:
            rest.append((Group(covered, left, "", section, False), thick))
    thickest = max(float(np.nanmax(layup.thickness)), *(t for _, t in rest), 0.0)
    filling = _Filling(free(_FILLING), _FILLED * thickest)
    lines = [f"*MATERIAL, NAME={filling.material}", *_SOFT]
    for k, group in enumerate(deck.groups(part, set(plies), layup.material)):
        lines += _classes(group, plies, layup, f"CLASS_{k}", free, filling)
        list(group.comment_out(copy))
        if "OFFSET" in group.parameters:
            remarks.append(f"{_named(group)}: its layers have no OFFSET in CalculiX")
    for group, thick in rest:
        if thick > 0:
            lines += _filled(group, thick, free, filling)
            list(group.comment_out(copy))
            continue
        lines += group.rest_lines(free) if group.members else ()
        remarks.append(
            f"{_named(group)} keeps its thickness for CalculiX, which makes nodes "
            "rigid where the thickness changes"
        )
    return lines, remarks


def _named(group: Group) -> str:
    """Section of a group with its set."""
    return f"{group.section[0]} of {excerpt(group.parameters.get('ELSET', ''))}"


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


class _Filling(NamedTuple):
    """Material of the outer layers, and thickness with them."""

    material: str
    whole: float

    def around(self, layers: list[str], thickness: float, axes: str) -> list[str]:
        """Data lines of layers of a thickness between two of the filling."""
        own = _layer(0.5 * (self.whole - thickness), self.material, axes)
        return [own, *layers, own]


def _layer(thickness: float, material: str, axes: str) -> str:
    """Data line of a layer with an orientation, which may be empty."""
    return f"{real_word(thickness)}, , {material}" + f", {axes}" * bool(axes)


def _thickness(section: Block) -> float:
    """Thickness of a section that can be filled, or 0."""
    given = section.parameters
    is_plain = section.keyword == "SHELL SECTION" and "MATERIAL" in given
    if not is_plain or any(key in given for key in _NOT_FILLED) or not section.data:
        return 0.0
    return float(from_words(section.data[0][:1], "f8")[0])


def _filled(
    group: Group, thickness: float, free: FreeNames, filling: _Filling
) -> Iterator[str]:
    """Section of the elements of a group that the ply does not cover."""
    given, name = group.parameters, free(group.rest_name())
    axes = given.get("ORIENTATION", "")
    yield from set_lines("ELSET", name, group.rest)
    yield f"*SHELL SECTION, COMPOSITE, ELSET={name}"
    layers = [_layer(thickness * share, given["MATERIAL"], axes) for _, share in LAYERS]
    yield from filling.around(layers, thickness, axes)  # as many as of a ply


def _classes(
    group: Group,
    plies: dict[int, int],
    layup: Layup,
    first: str,
    free: FreeNames,
    filling: _Filling,
) -> Iterator[str]:
    """Orientations and sections of covered elements."""
    members = group.members
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
        name = free(f"{first}_{number}")
        axes = {family: free(f"{name}{family[-1]}") for family in (WARP, WEFT)}
        yield from set_lines("ELSET", name, [members[i] for i in own.tolist()])
        for family, a in ((WARP, warp), (WEFT, weft)):
            yield f"*ORIENTATION, NAME={axes[family]}, SYSTEM=RECTANGULAR"
            yield ", ".join(map(real_word, [*a, *np.cross(normal, a)]))
        yield f"*SHELL SECTION, COMPOSITE, ELSET={name}"
        mean = float(thick[own].mean())
        layers = [_layer(mean * s, group.material, axes[x]) for x, s in LAYERS]
        yield from filling.around(layers, mean, axes[WARP])
