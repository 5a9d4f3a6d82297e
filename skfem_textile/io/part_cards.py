"""Shells of decks of cards: Nastran, LS-DYNA and OpenRadioss, and their layups.

Nastran and LS-DYNA have one material angle in each element, measured from its side from
the first to the second node about the normal by the order of its nodes: the angle
of the warp.  In a quadratic quadrilateral of Nastran it is measured from the line
between the middles of the sides 4-1 and 2-3.  In OpenRadioss each ply has an angle
(``/DRAPE``), measured from a direction projected onto the shell.
"""

import re
from collections import Counter
from collections.abc import Iterator, Sequence
from itertools import count, pairwise, product
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy import ndarray

from ..mesh.checks import MeshError, refuse_positions
from ..mesh.user_input import excerpt
from ..surfaces.tool_mesh import unit
from .deck_text import UTF8, DeckCopy, DeckText, Include
from .file_numbers import errors_about, from_words, real_word
from .layups import LAYERS, WARP, WEFT, Element, Layup
from .radioss import COLUMN, Option, options

Written = tuple[dict[str, bytes], list[str]]

# Deviation of the weft from 90° that a remark reports.
_SKEW_DEG = 0.05


class CardDeck:
    """Nodes and shells of a deck of cards.

    Attributes
    ----------
    text
        Its lines.
    positions
        Positions of nodes by instance, here none, and number.
    elements
        The shells, in the order of the file.
    left
        Numbers of other elements by type.
    """

    def __init__(self, path: Path) -> None:
        self.text = DeckText(path, self._include)
        self.positions: dict[tuple[str, int], ndarray] = {}
        self.elements: list[Element] = []
        self.left = Counter[str]()
        self._read()

    @property
    def sets(self) -> dict[str, list[tuple[str, int]]]:
        """Instance and number of the elements of each part or property."""
        found: dict[str, list[tuple[str, int]]] = {}
        for element in self.elements:
            found.setdefault(element.owner, []).append(("", element.number))
        return found

    @staticmethod
    def _include(lines: list[str], line: int) -> Include | None:
        raise NotImplementedError

    def _read(self) -> None:
        raise NotImplementedError

    def _add_node(self, number: int, position: Sequence[float] | ndarray) -> None:
        if ("", number) in self.positions:
            raise MeshError(f"node number {number} is used twice: use unique numbers")
        self.positions["", number] = np.array(position, dtype=float)

    def _side(self, element: Element) -> ndarray:
        """Vector from which the material angle of an element is measured."""
        x = [self.positions["", n] for n in element.corners]
        if element.nodes[0] == element.nodes[1]:
            raise MeshError(
                f"element {element.number}: its first two nodes are the same, so that "
                "its material angle is undefined"
            )
        return x[1] - x[0]

    def _angles(self, layup: Layup) -> tuple[list[float], list[str]]:
        """Angles of the warp in degrees, and a remark about the weft."""
        if layup.material is not None:
            raise MeshError("the properties define the material: omit it")
        sides = np.array([self._side(element) for element in layup.elements]).T
        skew = layup.skew_deg()
        remark = (
            "elements have one angle, here of the warp; the weft deviates from 90° to "
            f"it by up to {skew:.1f}°"
        )
        return layup.angles_deg(sides)[0].tolist(), [remark] * (skew > _SKEW_DEG)


# Nastran

_WIDTH, _LARGE, _IN_LINE, _N_FIELDS = 8, 16, 4, 24


class _Card(NamedTuple):
    """Corners and nodes of a shell, and fields from 0 on of its angle and flag."""

    n_corners: int
    n_nodes: int
    theta: int
    flag: int  # 1: thickness is relative


_CARDS = {
    "CQUAD4": _Card(4, 4, 6, 9),
    "CQUADR": _Card(4, 4, 6, 9),
    "CTRIA3": _Card(3, 3, 5, 9),
    "CTRIAR": _Card(3, 3, 5, 9),
    "CQUAD8": _Card(4, 8, 14, 16),
    "CTRIA6": _Card(3, 6, 8, 13),
}
# Fields that repeat or increment fields of the card before.
_REPEATED = re.compile(r"=.*|\*\(?[-+]?[\d.].*")

# Field of the thickness at the first corner.
_T1 = 10
_OTHERS = re.compile(
    r"C(HEXA|PENTA|TETRA|PYRAM|BAR|BEAM|ROD|ONROD|ELAS\d|BUSH\d?|SHEAR|GAP|ONM\d"
    r"|MASS\d|DAMP\d|VISC|QUAD|QUADX\d?|TRIAX\d?|WELD|FAST|TUBE|BEND)"
)


class NastranDeck(CardDeck):
    """Nodes and shells of a Nastran deck."""

    @staticmethod
    def _include(lines: list[str], line: int) -> Include | None:
        found = re.match(r"\s*include\s*[=\s]?\s*['\"]?([^'\"]+)", lines[line], re.I)
        return Include({0: found[1].rstrip()}, ["$"]) if found else None

    def _read(self) -> None:
        self._fields: dict[tuple[int, int], list[str]] = {}  # by lines
        self._layered: dict[str, str] = {}  # cards of layers by property
        grids, usual = list[list[str]](), ""
        axes: dict[int, tuple[str, list[str]]] = {}
        for name, fields, lines in self._cards():
            with errors_about(f"{excerpt(name)} {excerpt(fields[0])}"):
                is_read = name in ("GRID", *_CARDS) or _OTHERS.fullmatch(name)
                if name.startswith("=") or (
                    is_read and any(map(_REPEATED.fullmatch, fields))
                ):
                    raise MeshError(
                        "repeated fields (=, *1) are not supported: write out all cards"
                    )
                if name == "GRID":
                    grids.append(fields)
                elif name == "GRDSET":
                    usual = fields[1]
                elif name in ("PCOMP", "PCOMPG"):
                    owner = _integer(fields[0])
                    self._layered[f"property {owner}"] = f"{name} {owner}"
                elif name.startswith("CORD2"):
                    axes[_integer(fields[0])] = name[5:], fields[1:11]
                elif name in _CARDS:
                    card = _CARDS[name]
                    number, owner = map(_integer, fields[:2])
                    nodes = tuple(map(_integer, fields[2 : 2 + card.n_nodes]))
                    n, of = card.n_corners, f"property {owner or number}"
                    self.elements.append(Element(number, name, nodes, n, "", of, lines))
                    self._fields[lines] = fields
                elif _OTHERS.fullmatch(name):
                    self.left[name] += 1
        for label, system, *words in (fields[:5] for fields in grids):
            with errors_about(f"GRID {excerpt(label)}"):
                x = np.array([_real(word) for word in words])
                refuse_positions(x[:, None])
                at = _basic(x, _integer(system or usual), axes)
                self._add_node(_integer(label), at)

    def _cards(self) -> Iterator[tuple[str, list[str], tuple[int, int]]]:
        """Name, fields after it, and the lines of each card of the bulk data."""
        lines = self.text.lines
        begin = [i for i, x in enumerate(lines) if re.match(r"\s*BEGIN\b", x, re.I)]
        cards: list[tuple[str, list[str], list[int]]] = []
        for i in range(begin[0] + 1 if begin else 0, len(lines)):
            line = lines[i].partition("$")[0].rstrip().expandtabs(_WIDTH)
            if not line:
                continue
            head, fields = _fields_of(line)
            if head and head[0] not in "+*":
                cards.append((head.rstrip("*").upper(), fields, [i, i + 1]))
                if cards[-1][0] == "ENDDATA":
                    break
            elif cards:
                cards[-1][1].extend(fields)
                cards[-1][2][1] = i + 1
        for name, fields, (first, end) in cards:
            # Blank fields up to the last that is used here.
            yield name, fields + [""] * (_N_FIELDS - len(fields)), (first, end)

    def written(self, layup: Layup) -> Written:
        """Copy with the angle of the warp and the thickness in its elements."""
        copy, (angles, remarks) = DeckCopy(self.text), self._angles(layup)
        for i in layup.indices():
            element = layup.elements[i]
            words, card = list(self._fields[element.lines]), _CARDS[element.kind]
            words[card.theta], words[card.flag] = real_word(angles[i], _LARGE), ""
            for k in range(card.n_corners):
                words[_T1 + k] = real_word(layup.thickness[i], _LARGE)
            first, end = element.lines
            copy.comment_out(list(range(first, end)), "$")
            copy.insert(first, _large_card(element.kind, words))
        owners = dict.fromkeys(layup.elements[i].owner for i in layup.indices())
        if layered := [self._layered[x] for x in owners if x in self._layered]:
            remarks.append(
                f"{', '.join(layered)}: its layers keep their thickness, T1 to T4 of "
                "elements are ignored"
            )
        return copy.files({}), remarks

    def _side(self, element: Element) -> ndarray:
        if element.kind != "CQUAD8":
            return super()._side(element)
        a, b, c, d = (self.positions["", n] for n in element.nodes[:4])
        return b + c - a - d


def _basic(
    x: ndarray,
    system: int,
    axes: dict[int, tuple[str, list[str]]],
    within: tuple[int, ...] = (),
) -> ndarray:
    """Coordinates in the basic system of those in another, shape (3,)."""
    if system == 0:
        return x
    if system not in axes or system in within:
        raise MeshError(
            f"it is in the coordinate system {system}, which no CORD2R, CORD2C or "
            "CORD2S defines"
        )
    kind, words = axes[system]
    numbers = np.array([_real(word) for word in words[1:]]).reshape(3, 3)
    refuse_positions(numbers.T)
    outer = _integer(words[0]), axes, (*within, system)
    origin, on_z, in_plane = (_basic(point, *outer) for point in numbers)
    z, across = on_z - origin, in_plane - origin
    y = np.cross(z, across)
    if not np.linalg.norm(y) > 0:
        raise MeshError(f"the axes of the coordinate system {system} are undefined")
    z, y = unit(z), unit(y)
    if kind in ("C", "S"):
        distance, angle = x[0], np.radians(x[1:])
        along, height = distance, x[2]
        if kind == "S":
            along, height = distance * np.sin(angle[0]), distance * np.cos(angle[0])
        turn = angle[0 if kind == "C" else 1]
        x = np.array([along * np.cos(turn), along * np.sin(turn), height])
    return origin + np.array([np.cross(y, z), y, z]).T @ x


def _fields_of(line: str) -> tuple[str, list[str]]:
    """Name of a card, or continuation, and the fields of a line."""
    large = "*" in line.partition(",")[0][:_WIDTH]
    n, width = (_IN_LINE, _LARGE) if large else (2 * _IN_LINE, _WIDTH)
    head, *fields = _words(line, [_WIDTH, *[width] * n])
    return head, fields


def _integer(word: str) -> int:
    return int(from_words([word.encode(*UTF8) or b"0"], "i8")[0])


def _real(word: str) -> float:
    """Number with an exponent that may have no letter, such as 1.5-3."""
    text = re.sub(r"(?<=[\d.])([+-])", r"e\1", word.upper().replace("D", "E"))
    x = float(from_words([text.encode(*UTF8) or b"0"], "f8")[0])
    if not np.isfinite(x):
        raise MeshError(f"{excerpt(word)!r} is not finite")
    return x


def _large_card(name: str, fields: list[str]) -> list[str]:
    while not fields[-1]:
        fields = fields[:-1]
    rows = [fields[k : k + _IN_LINE] for k in range(0, len(fields), _IN_LINE)]
    heads = [f"{name}*", *["*"] * (len(rows) - 1)]
    return [
        head.ljust(_WIDTH) + "".join(word.rjust(_LARGE) for word in row)
        for head, row in zip(heads, rows, strict=True)
    ]


# LS-DYNA

# Widths of integers and of numbers: standard, of the mark %, and long.
_WIDTHS = {"-": (8, 16), "%": (10, 16), "+": (20, 20)}
_OPTIONS = {"THICKNESS", "BETA", "MCID", "OFFSET", "DOF"}
_N_NODES = 8


class _ShellCard(NamedTuple):
    """Line of the keyword of a shell, its text and options, and further cards."""

    head: int
    line: str
    options: set[str]
    more: list[int]
    width: int

    def with_angle(self) -> str:
        """Keyword with an angle, and as before with thickness and offsets."""
        kept = {"BETA", *self.options}
        options = [x for x in ("THICKNESS", "BETA", "OFFSET", "DOF") if x in kept]
        keyword = "_".join(["*ELEMENT_SHELL", *options])
        return " ".join([keyword, *self.line.split()[1:]])

    def of_thickness(self) -> list[int]:
        """Lines of thickness and angle."""
        return self.more[: len(self.more) - len(self.options & {"OFFSET", "DOF"})]


class DynaDeck(CardDeck):
    """Nodes and shells of an LS-DYNA deck."""

    @staticmethod
    def _include(lines: list[str], line: int) -> Include | None:
        found = re.match(r"\*INCLUDE(_\w+)?\s*$", lines[line], re.I)
        if found is None:
            return None
        if found[1]:
            raise MeshError(
                f"{excerpt(lines[line])} is not supported: use *INCLUDE alone"
            )
        names, n = {}, 1
        while line + n < len(lines) and not lines[line + n].startswith("*"):
            if lines[line + n].strip() and not lines[line + n].startswith("$"):
                names[n] = lines[line + n].strip()
            n += 1
        if not names:
            raise MeshError("*INCLUDE: the name of the file is missing")
        return Include(names, ["$"] * n)

    def _read(self) -> None:
        self._invariant = False
        self._cards: dict[int, _ShellCard] = {}  # by first line
        lines = self.text.lines
        kept = [i for i, x in enumerate(lines) if x.strip() and not x.startswith("$")]
        starts = [k for k, i in enumerate(kept) if lines[i].startswith("*")]
        if starts[:1] != [0]:
            raise MeshError("the file does not begin with an LS-DYNA keyword")
        for start, end in zip(starts, [*starts[1:], len(kept)], strict=True):
            head, own = lines[kept[start]], kept[start + 1 : end]
            keyword, *marks = head[1:].upper().split()
            if keyword == "END":
                return
            mark = next((x for x in marks if x in _WIDTHS), "-")
            with errors_about(f"*{excerpt(keyword)}"):
                if keyword == "KEYWORD":
                    if option := re.search(r"(LONG|I10)\s*=\s*Y", head.upper()):
                        raise MeshError(
                            f"the option {option[1]}=Y is not supported: export the "
                            "deck in the standard format"
                        )
                elif keyword == "CONTROL_ACCURACY" and own:
                    inn = _words(lines[own[0]], [10, 10])[1]
                    self._invariant = bool(inn) and abs(_integer(inn)) > 1
                elif keyword == "NODE":
                    a, b = _WIDTHS[mark]
                    for i in own:
                        number, *x = _words(lines[i], [a, b, b, b])
                        self._add_node(_integer(number), [*map(_real, x)])
                elif keyword.startswith("ELEMENT_SHELL"):
                    self._read_shells(lines, kept[start], own, keyword, mark)
                elif keyword.startswith("ELEMENT"):
                    self.left[f"line(s) of *{keyword}"] += len(own)

    def _read_shells(
        self, lines: list[str], head: int, own: list[int], keyword: str, mark: str
    ) -> None:
        given = set(keyword.removeprefix("ELEMENT_SHELL").split("_")[1:])
        if given - _OPTIONS:
            raise MeshError("this option is not supported: use *ELEMENT_SHELL")
        (width, real), k = _WIDTHS[mark], 0
        while k < len(own):
            words = _words(lines[own[k]], [width] * (2 + _N_NODES))
            number, owner, *nodes = map(_integer, words)
            n = 3 if nodes[3] in (0, nodes[2]) else 4
            thick = int(bool(given & {"THICKNESS", "BETA", "MCID"}))
            more = thick * (1 + any(nodes[4:])) + len(given & {"OFFSET", "DOF"})
            end = k + 1 + more
            if end > len(own):
                raise MeshError(f"the element {number} is incomplete")
            kind, at = keyword.removeprefix("ELEMENT_"), (own[k], own[end - 1] + 1)
            corners = *nodes[:n], *nodes[4:]
            one = Element(number, kind, corners, n, "", f"part {owner}", at)
            self.elements.append(one)
            card = _ShellCard(head, lines[head], given, own[k + 1 : end], real)
            self._cards[own[k]] = card
            k = end

    def written(self, layup: Layup) -> Written:
        """Copy whose shells have the angle of the warp and the thickness."""
        copy, (angles, remarks) = DeckCopy(self.text), self._angles(layup)
        current: dict[int, str] = {}
        covered = layup.covered.tolist()
        for i in sorted(range(len(covered)), key=lambda i: layup.elements[i].lines):
            element = layup.elements[i]
            first, wanted = element.lines[0], self._cards[element.lines[0]].line
            card = self._cards[first]
            if covered[i]:
                wanted = card.with_angle()
                for at in card.of_thickness():
                    copy.replace(at, [])
                thick, beta = (
                    real_word(x, card.width - 1).rjust(card.width)
                    for x in (layup.thickness[i], angles[i])
                )
                cards = [4 * thick + beta, *[4 * thick] * any(element.nodes[-4:])]
                copy.replace(first, [self.text.lines[first], *cards])
            if card.head not in current and wanted != card.line:
                copy.replace(card.head, [wanted])
            elif current.get(card.head, wanted) != wanted:
                copy.insert(first, [wanted])
            current[card.head] = wanted
        return copy.files({}), remarks

    def _side(self, element: Element) -> ndarray:
        if not self._invariant:
            return super()._side(element)
        if len(element.corners) == 3:
            raise MeshError(
                f"element {element.number}: angles of triangles with INN of "
                "*CONTROL_ACCURACY are not supported: use INN = 1"
            )
        a, b, c, d = (self.positions["", n] for n in element.corners)
        one, two = unit(b + c - a - d), unit(c + d - a - b)
        middle, normal = one + two, unit(np.cross(one, two))
        return middle - np.cross(normal, middle)


def _words(line: str, widths: list[int]) -> list[str]:
    """Fields of a card in columns, or between commas; missing ones are empty."""
    if "," in line:
        words = [word.strip() for word in line.split(",")]
        return (words + [""] * len(widths))[: len(widths)]
    ends = np.cumsum([0, *widths]).tolist()
    return [line[a:b].strip() for a, b in pairwise(ends)]


# OpenRadioss

# Properties with the thickness in the second pair of columns of their third line.
_WITH_THICKNESS = ("SHELL", "TYPE1", "SH_ORTH", "TYPE9", "SH_COMP", "TYPE10")

# Directions whose projection onto shells angles may be measured from, x first.
_AXES = [v for v in product((0, 1, -1), repeat=3) if v > (0, 0, 0)]
_AXES = sorted(_AXES, key=lambda v: (sum(map(abs, v)), [-x for x in v]))

# Least sine between this direction and the normals, beyond which others are tried.
_STEEP = 0.1

_IN_GROUP = 10

# Integration points of a layer, and `def_orth` of angles from a projected direction.
_POINTS, _PROJECTED = 3, 2

# Title of groups of elements without fibres.
_NOT_COVERED = "NOT_COVERED"


class RadiossDeck(CardDeck):
    """Nodes and shells of an OpenRadioss starter deck."""

    @staticmethod
    def _include(lines: list[str], line: int) -> Include | None:
        found = re.match(r"#include\s+(\S.*)", lines[line])
        return Include({0: found[1].rstrip()}, ["#"]) if found else None

    def _read(self) -> None:
        self._options = options(self.text.content)
        for option in self._options:
            keyword = option.name[0].upper()
            cards = [x for x in option.cards if x.strip()]
            with errors_about("/" + excerpt("/".join(option.name))):
                if keyword == "NODE":
                    for card in cards:
                        number, *x = _words(card, [COLUMN, *[2 * COLUMN] * 3])
                        self._add_node(_integer(number), [*map(_real, x)])
                elif keyword in ("SHELL", "SH3N"):
                    n = 4 if keyword == "SHELL" else 3
                    part = _integer(option.name[1]) if option.name[1:] else 0
                    for card in cards:
                        words = _words(card, [COLUMN] * (1 + n))
                        label, *nodes = map(_integer, words)
                        own = tuple(nodes), n, "", f"part {part}"
                        self.elements.append(Element(label, keyword, *own))
                elif keyword == "TRANSFORM":
                    raise MeshError("nodes are moved: export them in place")
                elif keyword in ("BRICK", "TETRA4", "BEAM", "TRUSS", "SPRING", "QUAD"):
                    self.left[keyword] += len(cards)

    def written(self, layup: Layup) -> Written:
        """Copy with a file of plies, whose angles are in ``/DRAPE``."""
        copy, remarks, numbers = DeckCopy(self.text), list[str](), self._numbers()
        name = f"{self.text.files[0].path.stem}_fibres.inc"
        ends = [o.lines[0] for o in self._options if o.name[0].upper() == "END"]
        copy.insert(ends[0] if ends else None, [f"#include {name}"])
        groups, stacks = self._groups(layup)
        axis = _axis(layup)
        angles = layup.angles_deg(np.tile(axis[:, None], len(layup.elements)))
        lines = ["# plies of a woven ply, by skfem_textile; mm"]
        for group in groups:
            stacks[group.owner] += _write_plies(group, layup, angles, numbers, lines)
        for number, plies in stacks.items():
            option = self._property(number)
            copy.comment_out(option.lines, "#")
            remarks.append(f"{_named(option)} is commented out for the plies")
            lines += [f"/PROP/PCOMPP/{number}", "FIBRES"]
            shell = _first_card(option)[: 4 * COLUMN]
            lines += [f"/STACK/{next(numbers)}", "FIBRES", shell, "", ""]
            lines.append("".join(map(_word20, axis.tolist())) + 3 * f"{0:>10}")
            for ply in plies:
                lines += [f"{ply:>10}{0:>20}{0:>20}", ""]
        with_plies = {i for group in groups for i in group.members}
        left = [x for i, x in enumerate(layup.elements) if i not in with_plies]
        _write_group(left, _NOT_COVERED, numbers, lines)
        return copy.files({name: lines}), remarks

    def has_material(self, number: str) -> bool:
        """True if a material is defined."""
        names = [o.name for o in self._options]
        return any(x[0].upper() == "MAT" and x[2:3] == [number] for x in names)

    def _groups(self, layup: Layup) -> tuple[list["_Group"], dict[str, list[int]]]:
        """Elements with the same layers; the properties with fibres, without plies."""
        parts, covered = self._parts(), layup.covered.tolist()
        for element in layup.elements:
            if not all(parts.get(element.owner, [""])):
                raise MeshError(
                    f"the {element.owner} of element {element.number} has no property "
                    "and material: define /PART"
                )
        of = [parts[element.owner] for element in layup.elements]
        properties = sorted({of[i][0] for i in layup.indices()})
        found: dict[tuple[str, str, float], list[int]] = {}
        for i, (number, own) in enumerate(of):
            if covered[i]:
                found.setdefault((number, layup.material or own, 0.0), []).append(i)
            elif number in properties:
                key = number, own, self._thickness(number)
                found.setdefault(key, []).append(i)
        groups = [_Group(*key, at) for key, at in found.items()]
        return groups, {number: [] for number in properties}

    def _numbers(self) -> Iterator[int]:
        """Numbers that no keyword uses."""
        names = (part for option in self._options for part in option.name[1:])
        last = max((int(part) for part in names if part.isdigit()), default=0)
        return count(last + 1)

    def _parts(self) -> dict[str, list[str]]:
        """Numbers of the property and the material of each part."""
        of = [o for o in self._options if o.name[0].upper() == "PART" and o.name[1:]]
        return {f"part {o.name[1]}": _words(_first_card(o), [COLUMN] * 2) for o in of}

    def _property(self, number: str) -> Option:
        for option in self._options:
            if option.name[0].upper() == "PROP" and option.name[2:3] == [number]:
                return option
        raise MeshError(f"the property {number} of covered elements is not defined")

    def _thickness(self, number: str) -> float:
        """Thickness of a property that elements without the ply keep."""
        option = self._property(number)
        cards = option.cards[1:]
        known = option.name[1].upper() in _WITH_THICKNESS and len(cards) > 2
        t = _real(_words(cards[2], [2 * COLUMN] * 2)[1]) if known else 0.0
        if not t > 0:
            raise MeshError(
                f"{_named(option)} has elements without fibres, but no thickness that "
                "can be read: give them another part"
            )
        return t


def _first_card(option: Option) -> str:
    """First card after the title."""
    return [*option.cards, "", ""][1]


def _named(option: Option) -> str:
    return "/" + excerpt("/".join(option.name[:3]))


class _Group(NamedTuple):
    """Elements of a property: their material and thickness, 0 for fibres."""

    owner: str
    material: str
    thickness: float
    members: list[int]


def _write_plies(
    group: _Group,
    layup: Layup,
    angles: tuple[ndarray, ndarray],
    numbers: Iterator[int],
    lines: list[str],
) -> list[int]:
    """Append the plies of a group to lines; returns their numbers."""
    own, plies = [layup.elements[i] for i in group.members], []
    title = _NOT_COVERED if group.thickness else "FIBRES"
    drapes = dict.fromkeys([title], 0)
    at = _write_group(own, title, numbers, lines)
    layers: Sequence[tuple[str, float]] = [(title, 1.0)]
    if not group.thickness:
        layers = LAYERS
        for family, theta in zip((WARP, WEFT), angles, strict=True):
            drapes[family] = next(numbers)
            lines += [f"/DRAPE/{drapes[family]}", family]
            for i, x in zip(group.members, own, strict=True):
                both = layup.thickness[i] / layup.rest, theta[i]
                words = "".join(map(_word20, both))
                lines.append(f"{x.kind:<10}{x.number:>10}{words}")
    for family, share in layers:
        plies.append(next(numbers))
        thick = _word20((group.thickness or layup.rest) * share)
        card = f"{group.material:>10}{thick}{0:>20}{at}{_POINTS:>10}"
        more = f"{drapes[family]:>10}{_PROJECTED:>10}"
        lines += [f"/PLY/{plies[-1]}", family, card, more]
    return plies


def _write_group(
    elements: list[Element], title: str, numbers: Iterator[int], lines: list[str]
) -> str:
    """Append the groups of quadrilaterals and triangles; returns both numbers."""
    at = ""
    for kind, keyword in (("SHELL", "GRSHEL/SHEL"), ("SH3N", "GRSH3N/SH3N")):
        some = [element.number for element in elements if element.kind == kind]
        number = next(numbers) if some else 0
        at += f"{number:>10}"
        if some:
            lines += [f"/{keyword}/{number}", title, *_ten_in_a_line(some)]
    return at


def _axis(layup: Layup) -> ndarray:
    """Unit vector whose projection onto all covered elements is well defined."""
    normal = layup.normal[:, layup.covered]
    axes = unit(np.array(_AXES, dtype=float).T)
    sine = np.linalg.norm(
        np.cross(axes[:, :, None], normal[:, None], axis=0), axis=0
    ).min(axis=1)
    return axes[:, 0 if sine[0] > _STEEP else int(sine.argmax())]


def _ten_in_a_line(numbers: Sequence[int]) -> Iterator[str]:
    for k in range(0, len(numbers), _IN_GROUP):
        yield "".join(f"{n:>10}" for n in numbers[k : k + _IN_GROUP])


def _word20(x: float) -> str:
    return real_word(x, 19).rjust(20)
