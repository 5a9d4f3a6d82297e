"""Shells of Abaqus decks with parts, instances and include files, and their layups."""

import re
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy import ndarray

from ..mesh.checks import MeshError
from ..mesh.user_input import excerpt
from .abaqus import (
    GENERATING,
    NOT_COVERED,
    Block,
    Deck,
    axes_lines,
    blocks,
    distribution_lines,
    in_space,
    members_of,
    motion,
    read_block,
    set_lines,
)
from .deck_text import DeckText, Include
from .file_numbers import errors_about, real_word
from .layups import SEQUENCE, WARP, Element, Layup

# Types by number of corners and of nodes.  Continuum shells have two faces.
_TYPES = {
    (3, 3): "S3 S3R S3RS S3T S3RT STRI3 M3D3",
    (3, 6): "STRI65 S6 M3D6 SC6R SC6RT",
    (4, 4): "S4 S4R S4RS S4RSW S4R5 S4T S4RT M3D4 M3D4R",
    (4, 8): "S8 S8R S8R5 S8RT M3D8 M3D8R SC8R SC8RT",
    (4, 9): "S9R5 M3D9 M3D9R",
}
_CORNERS = {name: n for (n, _), names in _TYPES.items() for name in names.split()}
_SHELLS = {x: (x, n) for (_, n), names in _TYPES.items() for x in names.split()}

_SECTIONS = ("SHELL SECTION", "SHELL GENERAL SECTION", "MEMBRANE SECTION")
_OF_MESH = ("NODE", "ELEMENT", "NSET", "ELSET")

# Names of what the include file defines, and integration points of a layer.
_AXES, _TURN, _THICKNESS, _SET = "FIBRE", "FIBRE_TURN", "FIBRE_LAYER", "FIBRES"
_POINTS = 3

# Parameters of a section that a layup keeps.
_KEPT = ("OFFSET", "CONTROLS", "STACK DIRECTION", "POISSON", "DENSITY")

# Largest angle in degrees between equal fibres of several instances.
_SAME_DEG = 0.1


class _Instance(NamedTuple):
    name: str
    turn: ndarray
    shift: ndarray


@dataclass
class _Part:
    """Content of a part; ``end`` is the line before which a file can be included."""

    name: str
    deck: Deck
    sections: list[Block] = field(default_factory=list)
    instances: list[_Instance] = field(default_factory=list)
    end: int | None = None


def _include(lines: list[bytes], line: int) -> Include | None:
    found = re.match(rb"\s*\*include\s*,\s*input\s*=\s*\"?([^\",]+)", lines[line], re.I)
    return Include(found[1], 1) if found else None


class AbaqusDeck:
    """Nodes, shells and sections of an Abaqus deck.

    Attributes
    ----------
    positions
        Positions of nodes by instance and number.
    elements
        The shells, in the order of the instances.
    sets
        Instance and number of the members of each set of elements.
    left
        Numbers of other elements by type.
    flat
        What is outside of parts.
    blocks
        All keywords with their data.
    """

    def __init__(self, path: Path) -> None:
        self.text = DeckText.read(path, _include, b"**")
        self.positions: dict[tuple[str, int], ndarray] = {}
        self.elements: list[Element] = []
        self.sets: dict[str, list[tuple[str, int]]] = {}
        self.left = Counter[str]()
        self._parts: dict[str, _Part] = {}
        self.flat = self._part("")
        self._own: list[Block] = []  # sets of the assembly
        self._names: set[str] = set()
        self.blocks = list(blocks(self.text.content))
        self._read()
        for part in self._parts.values():
            for instance in part.instances:
                self._place(part, instance)
        for block in self._own:
            with errors_about(block):
                self._add_own_set(block)

    def _part(self, name: str) -> _Part:
        deck = Deck(cells=_SHELLS, n_lines=len(self.text.lines))
        self._parts[name] = _Part(name, deck)
        return self._parts[name]

    def _read(self) -> None:
        flat = scope = self.flat
        flat.instances.append(_Instance("", np.eye(3), np.zeros(3)))
        in_assembly = instance = False
        for block in self.blocks:
            keyword, parameters, data, lines = block
            self._names.add(parameters.get("NAME", "").upper())
            with errors_about(block):
                if keyword == "STEP":
                    flat.end = lines[0] if flat.end is None else flat.end
                    break
                if keyword == "PART":
                    scope = self._part(_name(parameters, "NAME"))
                elif keyword == "END PART":
                    scope.end, scope = lines[0], flat
                elif keyword in ("ASSEMBLY", "END ASSEMBLY"):
                    in_assembly = keyword == "ASSEMBLY"
                elif keyword == "INSTANCE":
                    name = _name(parameters, "PART")
                    if name not in self._parts:
                        raise MeshError(f"the part {excerpt(name)!r} is not defined")
                    place = _Instance(_name(parameters, "NAME"), *motion(data))
                    self._parts[name].instances.append(place)
                    instance = True
                elif keyword == "END INSTANCE":
                    instance = False
                elif instance and keyword in (*_OF_MESH, *_SECTIONS):
                    raise MeshError("within *INSTANCE: define it in *PART")
                elif in_assembly and keyword in ("NSET", "ELSET"):
                    self._own += [block] * (keyword == "ELSET")
                elif in_assembly and keyword == "ELEMENT":
                    self.left[f"{type_of(block)} of the assembly"] += len(data)
                elif keyword in _SECTIONS:
                    scope.sections.append(block)
                elif not in_assembly:
                    self._read_mesh(scope, block)

    def _read_mesh(self, part: _Part, block: Block) -> None:
        if block.keyword == "ELEMENT" and type_of(block) not in _SHELLS:
            numbers = list(first_words(block.data))
            self.left[type_of(block)] += len(numbers)
            name = block.parameters.get("ELSET")
            others = np.array(numbers, dtype=int), np.empty((len(numbers), 0), int)
            part.deck.blocks.append((type_of(block), *others, name))
        elif block.keyword in (*_OF_MESH, "INCLUDE") or block.keyword in GENERATING:
            read_block(part.deck, block)

    def _place(self, part: _Part, instance: _Instance) -> None:
        """Add an instance of a part."""
        deck, scope = part.deck, instance.name
        if deck.tags is None:
            return
        points = in_space(deck.points) @ instance.turn.T + instance.shift
        keys = [(scope, n) for n in deck.tags.tolist()]
        if len(set(keys)) < len(keys):
            raise MeshError(f"a node number is used twice{_in(scope)}")
        self.positions |= dict(zip(keys, points, strict=True))
        own = []
        for kind, numbers, nodes, name in deck.blocks:
            if kind in _SHELLS:
                own += self._elements(kind, numbers.tolist(), nodes.tolist(), scope)
            if name is not None:
                members = [(scope, n) for n in numbers.tolist()]
                self.sets.setdefault(_dotted(scope, name), []).extend(members)
        self.elements += own
        for (keyword, name), numbers in deck.sets.items():
            if keyword == "ELSET":
                members = [(scope, n) for n in numbers.tolist()]
                self.sets.setdefault(_dotted(scope, name), []).extend(members)

    def _elements(
        self, kind: str, numbers: list[int], rows: list[list[int]], scope: str
    ) -> Iterator[Element]:
        n = _CORNERS[kind]
        for number, nodes in zip(numbers, rows, strict=True):
            if kind.startswith("SC"):  # corners of the middle surface
                nodes = [
                    self._middle(scope, *ab)
                    for ab in zip(nodes[:n], nodes[n:], strict=True)
                ]
            yield Element(number, kind, tuple(nodes), n, scope, "", (0, 0))

    def _middle(self, scope: str, a: int, b: int) -> int:
        """Number of a node between two nodes, below zero."""
        pair = [(scope, a), (scope, b)]
        if missing := [n for _, n in pair if (scope, n) not in self.positions]:
            raise MeshError(f"node {missing[0]} is used, but not defined")
        number = -((a << 32) + b)
        self.positions[scope, number] = sum(self.positions[x] for x in pair) / 2
        return number

    def _add_own_set(self, block: Block) -> None:
        """Add a set of the assembly."""
        name, scope = (
            block.parameters.get("ELSET", ""),
            _name(block.parameters, "INSTANCE"),
        )
        part = next(
            (p for p in self._parts.values() if scope in [i.name for i in p.instances]),
            None,
        )
        if not scope or part is None:
            return
        copy = Block("ELSET", {**block.parameters, "ELSET": "OWN"}, *block[2:])
        del copy.parameters["INSTANCE"]
        deck = Deck(
            cells=_SHELLS,
            blocks=part.deck.blocks,
            sets=dict(part.deck.sets),
            spelled=dict(part.deck.spelled),
            instance=scope,
            n_lines=part.deck.n_lines,
        )
        read_block(deck, copy)
        members = [(scope, n) for n in deck.sets["ELSET", "OWN"].tolist()]
        self.sets.setdefault(name, []).extend(members)

    # Layups

    def write(
        self,
        folder: Path,
        elements: Sequence[Element],
        layup: Layup,
        material: str | None,
    ) -> tuple[list[Path], list[str]]:
        """Write a copy with an include file for each part with fibres.

        ``elements`` are in the order of the layup.  Returns the files, and remarks.
        """
        remarks: list[str] = []
        files: dict[str, list[str]] = {}
        text = self.text.unchanged()
        stem = self.text.files[0].path.stem
        for part in self._parts.values():
            if not (plies := self._plies(part, elements, layup)):
                continue
            lines = self._include_lines(
                text, part, plies, elements, layup, material, remarks
            )
            words = "_".join(filter(None, (stem, "fibres", part.name)))
            name = re.sub(r"[^\w-]", "_", words) + ".inp"
            files[name] = lines
            text.insert(part.end, [f"*INCLUDE, INPUT={name}".encode()])
        taken = {file.path.name for file in self.text.files} & set(files)
        if taken:
            raise MeshError(
                f"the deck includes {min(taken)} already: take the deck without it"
            )
        written = text.write(folder)
        for name, lines in files.items():
            written.append(folder / name)
            written[-1].write_text("\n".join([*lines, ""]), encoding="latin-1")
        return written, remarks

    def _plies(
        self, part: _Part, elements: Sequence[Element], layup: Layup
    ) -> dict[int, int]:
        """Index of each covered element by its number, checked over all instances."""
        scopes = [instance.name for instance in part.instances]
        own = [i for i, x in enumerate(elements) if x.scope in scopes]
        plies = {elements[i].number: i for i in own if layup.covered[i]}
        if not plies or len(scopes) == 1:
            return plies
        turns = {instance.name: instance.turn for instance in part.instances}
        for i in own:
            first = plies.get(elements[i].number)
            if first is None and not layup.covered[i]:
                continue
            turn = turns[elements[i].scope].T
            same = first is not None and layup.covered[i]
            if same:
                other = turns[elements[first].scope].T
                gap = turn @ layup.warp[:, i] - other @ layup.warp[:, first]
                same = np.abs(gap).max() < np.radians(_SAME_DEG)
            if not same:
                raise MeshError(
                    f"*PART {part.name!r} has {len(scopes)} instances with different "
                    "fibres: export a part for each instance"
                )
        return plies

    def _include_lines(
        self,
        text: DeckText,
        part: _Part,
        plies: dict[int, int],
        elements: Sequence[Element],
        layup: Layup,
        material: str | None,
        remarks: list[str],
    ) -> list[str]:
        """Lines of the include file of a part; its sections are commented out."""
        turn = {instance.name: instance.turn for instance in part.instances}
        numbers = np.array(sorted(plies))
        index = np.array([plies[n] for n in numbers.tolist()])
        turns = np.array([turn[elements[i].scope] for i in index.tolist()])
        a, b = (
            np.einsum("nij,in->jn", turns, v[:, index])
            for v in (layup.warp, layup.across())
        )
        axes, angle, layer = map(self._free, (_AXES, _TURN, _THICKNESS))
        thick, n = layup.thickness[index] / len(SEQUENCE), numbers.tolist()
        tables = [f"{name}_TABLE" for name in (axes, angle, layer)]
        lines = [
            "** fibres of a woven ply, by skfem_textile; lengths in mm",
            f"*DISTRIBUTION TABLE, NAME={tables[0]}",
            "COORD3D, COORD3D",
            *axes_lines(axes, tables[0], n, a, b),
            f"*DISTRIBUTION TABLE, NAME={tables[1]}",
            "ANGLE",
            *distribution_lines(
                angle, tables[1], "90.", n, layup.turn_of_weft()[None, index]
            ),
            f"*DISTRIBUTION TABLE, NAME={tables[2]}",
            "LENGTH",
            *distribution_lines(
                layer, tables[2], real_word(layup.rest / len(SEQUENCE)), n, thick[None]
            ),
        ]
        kinds = {x.number: x.kind for x in elements if x.scope in turn}
        rest = sorted(set(kinds) - set(plies))
        lines += set_lines("ELSET", self._free(NOT_COVERED), rest)
        for members, chosen, section in self.groups(part, set(plies), material):
            kept = section.parameters if section else {}
            lines += self._section(members, kinds, chosen, axes, angle, layer, kept)
            if section is None:
                continue
            name = section.parameters.get("ELSET", "")
            text.comment_out(section.lines, b"**")
            whose = "" if material else f"; its material {chosen} is that of the layers"
            remarks.append(
                f"{section} of {excerpt(name)} is commented out for {len(members)} "
                f"element(s) with fibres{whose}"
            )
            every = members_of(part.deck, "ELSET", name.encode()).tolist()
            again = self._free(f"{NOT_COVERED}_{name}")
            if others := sorted(set(every) - set(members)):
                lines += set_lines("ELSET", again, others)
                lines += section_again(section, again)
        return lines

    def groups(
        self, part: _Part, covered: set[int], material: str | None
    ) -> Iterator[tuple[list[int], str, Block | None]]:
        """Elements of a section with fibres, with their material and section."""
        left = set(covered)
        for section in part.sections:
            with errors_about(section):
                name = section.parameters.get("ELSET", "").encode()
                own = left & set(members_of(part.deck, "ELSET", name).tolist())
                left -= own
                if own:
                    yield sorted(own), material or _material(section), section
        if left and material is None:
            raise MeshError(f"element {min(left)} has no section: specify the material")
        if left:
            yield sorted(left), str(material), None

    def _section(
        self,
        members: list[int],
        kinds: dict[int, str],
        material: str,
        axes: str,
        angle: str,
        layer: str,
        given: dict[str, str],
    ) -> Iterator[str]:
        """Section of covered elements; thickness of continuum shells is relative."""
        by_shell: dict[str, list[int]] = {}
        for n in members:
            by_shell.setdefault(
                "SC" if kinds[n].startswith("SC") else kinds[n][0], []
            ).append(n)
        if "M" in by_shell:
            raise MeshError(
                f"element {by_shell['M'][0]} is a membrane {kinds[by_shell['M'][0]]}, "
                "which has no layers: use shells"
            )
        for shell, numbers in by_shell.items():
            name = self._free(_SET)
            yield from set_lines("ELSET", name, numbers)
            kept = [f", {key}={given[key]}" for key in _KEPT if key in given]
            yield (
                f"*SHELL SECTION, COMPOSITE, ELSET={name}, ORIENTATION={axes}"
                + "".join(kept)
            )
            thick = "1." if shell == "SC" else layer
            for i, family in enumerate(SEQUENCE, 1):
                turn = "0." if family == WARP else angle
                yield f"{thick}, {_POINTS}, {material}, {turn}, {family}_{i}"

    def _free(self, name: str) -> str:
        """Name that neither the deck nor an include file uses."""
        sets = {x.rpartition(".")[2].upper() for x in self.sets}
        for number in range(1, 10**6):
            free = name if number == 1 else f"{name}_{number}"
            if free.upper() not in self._names | sets:
                break
        self._names.add(free.upper())
        return free


def _name(parameters: dict[str, str], key: str) -> str:
    return parameters.get(key, "").strip('"').upper()


def type_of(block: Block) -> str:
    """Type of elements or constants in upper case."""
    return block.parameters.get("TYPE", "").upper()


def _dotted(scope: str, name: str) -> str:
    """Name of a set of an instance."""
    return f"{scope}.{name}" if scope else name


def _in(scope: str) -> str:
    return f" in the instance {excerpt(scope)}" if scope else ""


def first_words(data: list[list[bytes]]) -> Iterator[int]:
    """Numbers of elements that may continue on lines after a comma."""
    continues = False
    for words in data:
        if not continues and words[0].isdigit():
            yield int(words[0])
        continues = words[-1] == b""


def _material(section: Block) -> str:
    """Material of a section, or of its first layer."""
    layers = [row[2].decode("latin-1") for row in section.data if len(row) > 2]
    own = section.parameters.get("MATERIAL") or (layers or [""])[0]
    if not own:
        raise MeshError("the section has no material: specify the material")
    return own


def section_again(section: Block, name: str) -> Iterator[str]:
    """Section for another set."""
    pairs = {**section.parameters, "ELSET": name}
    words = [f"{key}={value}" if value else key for key, value in pairs.items()]
    yield ", ".join([f"*{section.keyword}", *words])
    for row in section.data:
        yield ", ".join(word.decode("latin-1") for word in row)
