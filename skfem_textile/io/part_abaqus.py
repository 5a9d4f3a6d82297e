"""Shells of Abaqus decks with parts, instances and include files, and their layups."""

import re
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from itertools import count, takewhile
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy import ndarray

from ..mesh.checks import MeshError, refuse_positions
from ..mesh.user_input import excerpt, printable
from .abaqus import (
    ANGLE,
    AXES,
    GENERATING,
    LENGTH,
    NOT_COVERED,
    SECTIONS,
    Block,
    Deck,
    axes_lines,
    blocks,
    distribution_lines,
    find_include,
    members_of,
    motion,
    name_of,
    read_block,
    refuse_parameters,
    set_lines,
    set_members,
)
from .deck_text import UTF8, DeckCopy, DeckText
from .file_numbers import errors_about, real_word
from .layups import LAYERS, WARP, Element, Layup
from .vtk import in_space

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

_OF_MESH = ("NODE", "ELEMENT", "NSET", "ELSET")

# Names of what the include file defines, and integration points of a layer.
_AXES, _TURN, _LAYER, _SET = "FIBRE", "FIBRE_TURN", "FIBRE_LAYER", "FIBRES"
_POINTS = 3

_TABLES = (AXES, ANGLE, LENGTH)

# Parameters of a section that a layup keeps.
_KEPT = ("OFFSET", "CONTROLS", "STACK DIRECTION", "POISSON", "DENSITY")

# Parameters that layers do not have, and keywords that may follow a section.
_LEFT_OUT = ("ORIENTATION", "NODAL THICKNESS", "SHELL THICKNESS")
_OF_SECTION = (
    *("TRANSVERSE SHEAR STIFFNESS", "HOURGLASS STIFFNESS", "REBAR LAYER"),
    *("DAMPING", "EXPANSION"),
)

# Largest angle in degrees between equal fibres of several instances.
_SAME_DEG = 0.1


class _Instance(NamedTuple):
    name: str
    turn: ndarray
    shift: ndarray

    def is_moved(self) -> bool:
        return bool(self.shift.any()) or not np.array_equal(self.turn, np.eye(3))


@dataclass
class Part:
    """Content of a part; ``end`` is the line before which a file can be included."""

    name: str
    deck: Deck
    sections: list[Block] = field(default_factory=list)
    instances: list[_Instance] = field(default_factory=list)
    end: int | None = None


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
    node_sets
        The same of each set of nodes of the assembly.
    left
        Numbers of other elements by type.
    flat
        Content outside of parts.
    blocks
        All keywords with their data.
    """

    def __init__(self, path: Path) -> None:
        self.text = DeckText(path, find_include)
        self.positions: dict[tuple[str, int], ndarray] = {}
        self.elements: list[Element] = []
        self.sets: dict[str, list[tuple[str, int]]] = {}
        self.left = Counter[str]()
        self._parts: dict[str, Part] = {}
        self.flat = self._part("")
        self._own: list[Block] = []  # sets of the assembly
        self._has_own_nodes = False
        self.node_sets: dict[str, list[tuple[str, int]]] = {}
        self._names: set[str] = set()
        self.blocks = list(blocks(self.text.content))
        self._read()
        for part, instance in self._instances():
            self._place(part, instance)
        for block in self._own:
            with errors_about(block):
                self._add_own_set(block)

    def _part(self, name: str) -> Part:
        deck = Deck(cells=_SHELLS, n_lines=len(self.text.lines))
        self._parts[name] = Part(name, deck)
        return self._parts[name]

    def _instances(self) -> list[tuple[Part, _Instance]]:
        return [(p, i) for p in self._parts.values() for i in p.instances]

    def _read(self) -> None:
        flat = scope = self.flat
        flat.instances.append(_Instance("", np.eye(3), np.zeros(3)))
        in_assembly = False
        for block in self.blocks:
            keyword, parameters, data, lines = block
            self._names.add(name_of(parameters, "NAME"))
            with errors_about(block):
                if keyword == "STEP":
                    flat.end = lines[0] if flat.end is None else flat.end
                    break
                if keyword == "PART":
                    scope = self._part(name_of(parameters, "NAME"))
                elif keyword == "END PART":
                    scope.end, scope = lines[0], flat
                elif keyword in ("ASSEMBLY", "END ASSEMBLY"):
                    scope, in_assembly = flat, keyword == "ASSEMBLY"
                elif keyword == "INSTANCE":
                    scope, in_assembly = self._instance(parameters, data), False
                elif keyword == "END INSTANCE":
                    scope.end, in_assembly = scope.end or lines[0], True
                elif in_assembly and keyword in ("NSET", "ELSET"):
                    self._own.append(block)
                elif in_assembly and keyword == "ELEMENT":
                    self.left[f"{type_of(block)} of the assembly"] += len(data)
                elif in_assembly and keyword == "NODE":
                    self._has_own_nodes = True
                elif not in_assembly:
                    self._read_mesh(scope, block)

    def _instance(self, parameters: dict[str, str], data: list[list[bytes]]) -> Part:
        """Add an instance; returns its part, or a new one if that has no nodes.

        A mesh made in the assembly is in the instance, and its part is empty.
        """
        part, name = name_of(parameters, "PART"), name_of(parameters, "NAME")
        if part not in self._parts:
            raise MeshError(f"the part {excerpt(part)!r} is not defined")
        known = self._parts[part]
        if known.deck.tags is None:
            known = self._part(f"{part}.{name}")
        known.instances.append(_Instance(name, *motion(data)))
        return known

    def _read_mesh(self, part: Part, block: Block) -> None:
        of_mesh = block.keyword in (*_OF_MESH, *SECTIONS)
        if of_mesh and part is not self.flat and part.end is not None:
            raise MeshError("within *INSTANCE: define it in *PART")
        for instance in part.instances:
            if block.keyword == "NODE" and instance.is_moved():
                raise MeshError("within a moved *INSTANCE: define it in *PART")
        if block.keyword in SECTIONS:
            part.sections.append(block)
        elif block.keyword == "ELEMENT" and type_of(block) not in _SHELLS:
            numbers = list(first_words(block.data))
            self.left[type_of(block)] += len(numbers)
            name = None
            if "ELSET" in block.parameters:
                name = part.deck.spelling("ELSET", block.parameters)
            others = np.array(numbers, dtype=int), np.empty((len(numbers), 0), int)
            part.deck.blocks.append((type_of(block), *others, name))
        elif block.keyword in (*_OF_MESH, "INCLUDE") or block.keyword in GENERATING:
            read_block(part.deck, block)

    def _place(self, part: Part, instance: _Instance) -> None:
        """Add an instance of a part."""
        deck, scope = part.deck, instance.name
        if deck.tags is None:
            return
        refuse_positions(deck.points.T)
        points = in_space(deck.points) @ instance.turn.T + instance.shift
        keys = [(scope, n) for n in deck.tags.tolist()]
        if len(set(keys)) < len(keys):
            where = f" in the instance {excerpt(scope)}" if scope else ""
            raise MeshError(f"a node number is used twice{where}")
        self.positions |= dict(zip(keys, points, strict=True))
        sets = [(x, n) for (keyword, x), n in deck.sets.items() if keyword == "ELSET"]
        for kind, numbers, nodes, name in deck.blocks:
            if kind in _SHELLS:
                rows = numbers.tolist(), nodes.tolist()
                self.elements += self._elements(kind, *rows, scope)
            if name is not None:
                sets.append((name, numbers))
        for name, numbers in sets:
            of_name = self.sets.setdefault(f"{scope}.{name}" if scope else name, [])
            of_name.extend((scope, n) for n in numbers.tolist())

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
            yield Element(number, kind, tuple(nodes), n, scope)

    def _middle(self, scope: str, a: int, b: int) -> int:
        """Number of a node between two nodes, below zero."""
        pair = [(scope, a), (scope, b)]
        if missing := [n for _, n in pair if (scope, n) not in self.positions]:
            raise MeshError(f"node {missing[0]} is used, but not defined")
        number = -((a << 32) + b)
        one, other = (self.positions[x] for x in pair)
        self.positions[scope, number] = (one + other) / 2
        return number

    def _add_own_set(self, block: Block) -> None:
        """Add a set of the assembly with members in one instance."""
        scope = name_of(block.parameters, "INSTANCE")
        decks = [part.deck for part, i in self._instances() if i.name == scope]
        if not scope or not decks:
            return
        refuse_parameters(block)
        numbers = set_members(replace(decks[0], instance=scope), block)
        found = self.sets if block.keyword == "ELSET" else self.node_sets
        members = found.setdefault(block.parameters.get(block.keyword, ""), [])
        members.extend((scope, n) for n in numbers.tolist())

    def only(self) -> tuple[Part, _Instance]:
        """The part and the instance of a deck with one of each.

        Raises
        ------
        MeshError
            If there are several, or nodes of the assembly.
        """
        known = [(p, i) for p, i in self._instances() if p.deck.tags is not None]
        if len(known) != 1 or self._has_own_nodes:
            raise MeshError(
                "CalculiX reads decks with one instance, and no nodes of the assembly"
            )
        return known[0]

    # Layups

    def written(self, layup: Layup) -> tuple[dict[str, bytes], list[str]]:
        """Copy with an include file for each part with shells, and remarks.

        Tables of distributions are outside of parts, as Abaqus demands.
        """
        copy, remarks, free = DeckCopy(self.text), list[str](), self.free_names()
        stem, free_file = self.text.files[0].path.stem, FreeNames(set())
        tables = {kind: free(f"FIBRE_{kind.partition('3')[0]}S") for kind in _TABLES}
        main = ["** fibres of a woven ply, by skfem_textile; lengths in mm"]
        for kind, name in tables.items():
            main += [f"*DISTRIBUTION TABLE, NAME={name}", kind]
        of_main = free_file(_file(stem, "")) + ".inp"
        files = {of_main: main}
        for part in self._parts.values():
            plies = self._plies(part, layup)
            own = list(self._include_lines(part, plies, layup, tables, free))
            if not own:
                continue
            is_flat = part is self.flat
            name = of_main if is_flat else free_file(_file(stem, part.name)) + ".inp"
            files.setdefault(name, []).extend(own)
            copy.insert(part.end, [f"*INCLUDE, INPUT={name}"])
            for group in self.groups(part, set(plies), layup.material):
                remarks += group.comment_out(copy)
        if len(files) > 1:
            first = next(x.lines[0] for x in self.blocks if x.keyword == "PART")
            copy.insert(first, [f"*INCLUDE, INPUT={of_main}"])
        return copy.files(files), remarks

    def free_names(self) -> "FreeNames":
        """Names that neither the deck nor its include files use."""
        sets = {name.rpartition(".")[2].upper() for name in self.sets}
        return FreeNames(self._names | sets)

    def has_material(self, name: str) -> bool:
        """True if a material is defined."""
        own = (x.parameters for x in self.blocks if x.keyword == "MATERIAL")
        return name.upper() in {name_of(parameters, "NAME") for parameters in own}

    def _plies(self, part: Part, layup: Layup) -> dict[int, int]:
        """Index of each covered element by its number, ascending.

        All instances of a part must have the same fibres.
        """
        turns = {instance.name: instance.turn for instance in part.instances}
        found: dict[int, tuple[ndarray, int]] = {}
        for i, element in enumerate(layup.elements):
            if element.scope not in turns:
                continue
            warp = turns[element.scope].T @ layup.warp[:, i]
            first, _ = found.setdefault(element.number, (warp, i))
            if not np.allclose(warp, first, 0, np.radians(_SAME_DEG), equal_nan=True):
                raise MeshError(
                    f"*PART {part.name!r} has {len(turns)} instances with different "
                    "fibres: export a part for each instance"
                )
        covered = layup.covered
        return {n: i for n, (_, i) in sorted(found.items()) if covered[i]}

    def _include_lines(
        self,
        part: Part,
        plies: dict[int, int],
        layup: Layup,
        tables: dict[str, str],
        free: "FreeNames",
    ) -> Iterator[str]:
        """Lines of the include file of a part."""
        turn = {instance.name: instance.turn for instance in part.instances}
        kinds = {x.number: x.kind for x in layup.elements if x.scope in turn}
        left = sorted(set(kinds) - set(plies))
        taken = ("ELSET", NOT_COVERED) in part.deck.spelled
        name = free(NOT_COVERED) if taken else NOT_COVERED
        yield from set_lines("ELSET", name, left)
        if not plies:
            return
        numbers, index = list(plies), list(plies.values())
        turns = np.array([turn[layup.elements[i].scope] for i in index])
        axes_of_part = (layup.warp[:, index], layup.across()[:, index])
        a, b = (np.einsum("nij,in->jn", turns, v) for v in axes_of_part)
        axes, angle = free(_AXES), free(_TURN)
        yield from axes_lines(axes, tables[AXES], numbers, a, b)
        weft, thick = layup.turn_of_weft()[None, index], layup.thickness[None, index]
        yield from distribution_lines(angle, tables[ANGLE], [90.0], numbers, weft)
        of_share = {}
        for share in dict.fromkeys(share for _, share in LAYERS):
            name, rest = free(_LAYER), [layup.rest * share]
            of_share[share] = name
            yield from distribution_lines(
                name, tables[LENGTH], rest, numbers, thick * share
            )
        for group in self.groups(part, set(plies), layup.material):
            for members in _by_shell(group.members, kinds):
                name, kind = free(_SET), kinds[members[0]]
                yield from set_lines("ELSET", name, members)
                given = [f"ELSET={name}", f"ORIENTATION={axes}", *group.kept()]
                yield ", ".join(["*SHELL SECTION, COMPOSITE", *given])
                for i, (family, share) in enumerate(LAYERS, 1):
                    words = str(_POINTS), group.material, f"{family}_{i}"
                    relative = kind.startswith("SC")
                    own = real_word(share) if relative else of_share[share]
                    turned = "0." if family == WARP else angle
                    yield ", ".join([own, *words[:2], turned, words[2]])
            yield from group.rest_lines(free)

    def groups(
        self, part: Part, covered: set[int], material: str | None
    ) -> Iterator["Group"]:
        """Elements of each section with fibres."""
        left = set(covered)
        for section, members in self.sections(part) if covered else ():
            if own := members & left:
                chosen = material or _material(section[0])
                rest = sorted(members - covered)
                yield Group(sorted(own), rest, chosen, section, material is None)
            left -= members
        if left and material is None:
            raise MeshError(f"element {min(left)} has no section: specify the material")
        if left:
            yield Group(sorted(left), [], str(material), [], False)

    def sections(self, part: Part) -> Iterator[tuple[list[Block], set[int]]]:
        """Each section with the keywords that belong to it, and its elements."""
        for section in part.sections:
            after = self.blocks[self.blocks.index(section) + 1 :]
            options = takewhile(lambda x: x.keyword in _OF_SECTION, after)
            name = section.parameters.get("ELSET", "").encode()
            with errors_about(section):
                members = members_of(part.deck, "ELSET", name)
            yield [section, *options], set(members.tolist())


class FreeNames:
    """Gives names that are not taken, in upper case, and not given before."""

    def __init__(self, taken: set[str]) -> None:
        self._taken = taken

    def __call__(self, name: str) -> str:
        """Name, or with a number if it is taken."""
        names = (name if n == 1 else f"{name}_{n}" for n in count(1))
        free = next(x for x in names if x.upper() not in self._taken)
        self._taken.add(free.upper())
        return free


class Group(NamedTuple):
    """Elements of a section with fibres, without fibres, and the material of layers."""

    members: list[int]
    rest: list[int]
    material: str
    section: list[Block]  # and keywords that belong to it; may be empty
    own: bool  # if the material is taken from the section

    @property
    def parameters(self) -> dict[str, str]:
        """Parameters of the section."""
        return self.section[0].parameters if self.section else {}

    def kept(self) -> list[str]:
        """Parameters of the section for the layers."""
        given = self.parameters
        return [f"{key}={given[key]}" for key in _KEPT if key in given]

    def rest_name(self) -> str:
        """Name of the set of the elements without fibres."""
        name = re.sub(r"\W", "_", self.parameters.get("ELSET", ""))
        return f"{NOT_COVERED}_{name}"

    def rest_lines(self, free: FreeNames) -> Iterator[str]:
        """Section of the elements without fibres, and their set with a free name."""
        if not self.section or not self.rest:
            return
        name = free(self.rest_name())
        yield from set_lines("ELSET", name, self.rest)
        for block in self.section:
            pairs = dict(block.parameters)
            if block is self.section[0]:
                pairs["ELSET"] = name
            words = [f"{key}={value}" if value else key for key, value in pairs.items()]
            yield ", ".join([f"*{block.keyword}", *words])
            for row in block.data:
                yield ", ".join(word.decode(*UTF8) for word in row)

    def comment_out(self, copy: DeckCopy) -> Iterator[str]:
        """Comment out the section; yields a remark."""
        for block in self.section:
            copy.comment_out(block.lines, "**")
        if self.section:
            section, *options = self.section
            name = excerpt(self.parameters.get("ELSET", ""))
            material = printable(self.material)
            whose = f"; layers have its material {material}" * self.own
            lost = [key for key in _LEFT_OUT if key in self.parameters]
            lost += [str(block) for block in options]
            none = f"; no longer applied: {', '.join(lost)}" * bool(lost)
            yield (
                f"{section} of {name} is commented out for {len(self.members)} "
                f"element(s) with fibres{whose}{none}"
            )


def _by_shell(members: list[int], kinds: dict[int, str]) -> list[list[int]]:
    """Conventional and continuum shells, whose layers have relative thickness."""
    if other := [n for n in members if kinds[n].startswith("M3D")]:
        raise MeshError(
            f"element {other[0]} is a membrane {kinds[other[0]]}, which has no layers: "
            "use shells"
        )
    of_kind = [[n for n in members if kinds[n].startswith("SC") == k] for k in (0, 1)]
    return [some for some in of_kind if some]


def _file(stem: str, part: str) -> str:
    """Name of the include file of a part without suffix."""
    name = "_".join(filter(None, (stem, "fibres", part)))
    return re.sub(r"[^\w-]", "_", name)


def type_of(block: Block) -> str:
    """Type of elements or constants in upper case."""
    return block.parameters.get("TYPE", "").upper()


def first_words(data: list[list[bytes]]) -> Iterator[int]:
    """Numbers of elements that may continue on lines after a comma."""
    continues = False
    for words in data:
        if not continues and words[0].isdigit():
            yield int(words[0])
        continues = words[-1] == b""


def _material(section: Block) -> str:
    """Material of a section, or of its first layer."""
    layers = [row[2] for row in section.data if len(row) > 2]
    of_layer = b"".join(layers[:1]).decode(*UTF8)
    own = section.parameters.get("MATERIAL") or of_layer
    if not own:
        raise MeshError(f"{section}: the section has no material: specify the material")
    return own
