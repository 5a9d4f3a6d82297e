"""Shells of decks of cards: Nastran, LS-DYNA and OpenRadioss, and their layups.

Nastran and LS-DYNA have one material angle in each element, measured from its side from
the first to the second node about the normal by the order of its nodes: that of the
warp.  Of a quadratic quadrilateral of Nastran it is measured from the line between the
middles of the sides 4-1 and 2-3.  In OpenRadioss a ply has an angle of its own
(``/DRAPE``), measured from a direction projected onto the shell.
"""

import re
from collections import Counter
from collections.abc import Iterator, Sequence
from itertools import pairwise, product
from pathlib import Path
from typing import ClassVar, NamedTuple

import numpy as np
from numpy import ndarray

from ..mesh.checks import MeshError
from ..mesh.user_input import excerpt
from ..surfaces.tool_mesh import unit
from .deck_text import DeckText, Include
from .file_numbers import errors_about, from_words, real_word
from .layups import SEQUENCE, WARP, WEFT, Element, Layup
from .radioss import COLUMN, Option, options

Written = tuple[list[Path], list[str]]


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

    COMMENT: ClassVar[bytes] = b"$"

    def __init__(self, path: Path) -> None:
        self.text = DeckText.read(path, self._include, self.COMMENT)
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
    def _include(lines: list[bytes], line: int) -> Include | None:
        raise NotImplementedError

    def _read(self) -> None:
        raise NotImplementedError

    def _add_node(self, number: int, position: Sequence[float]) -> None:
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

    def _warp_deg(self, elements: Sequence[Element], layup: Layup) -> list[float]:
        sides = np.array([self._side(element) for element in elements]).T
        return layup.angles_deg(sides)[0].tolist()

    @staticmethod
    def _one_angle(layup: Layup, material: str | None) -> list[str]:
        if material is not None:
            raise MeshError(
                "the property of the elements defines the material: omit it"
            )
        skew = layup.skew_deg()
        return [
            "elements have one angle, that of the warp; the weft deviates from 90° to "
            f"it by up to {skew:.1f}°"
        ] * (skew > 0.05)


# Nastran

_WIDTH, _LARGE, _IN_LINE = 8, 16, 4


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
# Field of the thickness at the first corner.
_T1 = 10
_OTHERS = re.compile(
    r"C(HEXA|PENTA|TETRA|PYRAM|BAR|BEAM|ROD|ONROD|ELAS\d|BUSH\d?|SHEAR|GAP|ONM\d"
    r"|MASS\d|DAMP\d|VISC|QUAD|QUADX\d?|TRIAX\d?|WELD|FAST|TUBE|BEND)"
)


class NastranDeck(CardDeck):
    """Nodes and shells of a Nastran deck."""

    def __init__(self, path: Path) -> None:
        self._fields: dict[tuple[int, int], list[str]] = {}
        super().__init__(path)

    @staticmethod
    def _include(lines: list[bytes], line: int) -> Include | None:
        found = re.match(rb"\s*include\s*[=\s]?\s*['\"]?([^'\"]+)", lines[line], re.I)
        return Include(found[1].rstrip(), 1) if found else None

    def _read(self) -> None:
        for name, fields, lines in self._cards():
            with errors_about(f"{name} {excerpt(fields[0])}"):
                if name == "GRID" or name == "GRDSET":
                    if _integer(fields[1]):
                        raise MeshError(
                            f"nodes are in the coordinate system {fields[1]}: export "
                            "them in the basic system"
                        )
                    if name == "GRID":
                        self._add_node(_integer(fields[0]), [*map(_real, fields[2:5])])
                elif name in _CARDS:
                    card = _CARDS[name]
                    number, owner = map(_integer, fields[:2])
                    nodes = tuple(map(_integer, fields[2 : 2 + card.n_nodes]))
                    n, of = card.n_corners, f"property {owner or number}"
                    self.elements.append(Element(number, name, nodes, n, "", of, lines))
                    self._fields[lines] = fields
                elif _OTHERS.fullmatch(name):
                    self.left[name] += 1

    def _cards(self) -> Iterator[tuple[str, list[str], tuple[int, int]]]:
        """Name, fields after it, and the lines of each card of the bulk data."""
        lines = [line.decode("latin-1") for line in self.text.lines]
        begin = [i for i, x in enumerate(lines) if re.match(r"\s*BEGIN\b", x, re.I)]
        card: tuple[str, list[str], int] | None = None
        end = 0
        for i in range(begin[0] + 1 if begin else 0, len(lines)):
            line = lines[i].partition("$")[0].rstrip().expandtabs(_WIDTH)
            if not line:
                continue
            head, fields = _fields_of(line)
            if head and head[0] not in "+*":
                if card is not None:
                    yield card[0], _padded(card[1]), (card[2], end)
                card = head.rstrip("*").upper(), fields, i
                if card[0] == "ENDDATA":
                    return
            elif card is not None:
                card[1].extend(fields)
            end = i + 1
        if card is not None:
            yield card[0], _padded(card[1]), (card[2], end)

    def write(
        self,
        folder: Path,
        elements: Sequence[Element],
        layup: Layup,
        material: str | None,
    ) -> Written:
        """Write a copy with the angle of the warp and the thickness in its elements."""
        text, remarks = self.text.unchanged(), self._one_angle(layup, material)
        angles = self._warp_deg(elements, layup)
        for i in np.flatnonzero(layup.covered).tolist():
            element = elements[i]
            words, card = list(self._fields[element.lines]), _CARDS[element.kind]
            words[card.theta], words[card.flag] = real_word(angles[i], _LARGE), ""
            for k in range(card.n_corners):
                words[_T1 + k] = real_word(layup.thickness[i], _LARGE)
            first, end = element.lines
            text.comment_out(list(range(first, end)), b"$")
            text.insert(first, _large_card(element.kind, words))
        return text.write(folder), remarks

    def _side(self, element: Element) -> ndarray:
        if element.kind != "CQUAD8":
            return super()._side(element)
        a, b, c, d = (self.positions["", n] for n in element.nodes[:4])
        return b + c - a - d


def _fields_of(line: str) -> tuple[str, list[str]]:
    """Name of a card, or continuation, and the fields of a line."""
    if "," in line:
        head, *words = (word.strip() for word in line.split(","))
        n = _IN_LINE if "*" in head else 2 * _IN_LINE
        return head, (words[:n] + n * [""])[:n]
    head = line[:_WIDTH].strip()
    n, width = (_IN_LINE, _LARGE) if "*" in head else (2 * _IN_LINE, _WIDTH)
    starts = (_WIDTH + k * width for k in range(n))
    return head, [line[a : a + width].strip() for a in starts]


def _padded(fields: list[str]) -> list[str]:
    """Fields of a card with blank ones up to the last that is used here."""
    return fields + [""] * (24 - len(fields))


def _integer(word: str) -> int:
    return int(from_words([word.encode("latin-1") or b"0"], "i8")[0])


def _real(word: str) -> float:
    """Number with an exponent that may have no letter, such as 1.5-3."""
    text = re.sub(r"(?<=[\d.])([+-])", r"e\1", word.upper().replace("D", "E"))
    x = float(from_words([text.encode("latin-1") or b"0"], "f8")[0])
    if not np.isfinite(x):
        raise MeshError(f"{excerpt(word)!r} is not finite")
    return x


def _large_card(name: str, fields: list[str]) -> list[bytes]:
    while not fields[-1]:
        fields = fields[:-1]
    rows = [fields[k : k + _IN_LINE] for k in range(0, len(fields), _IN_LINE)]
    heads = [f"{name}*", *["*"] * (len(rows) - 1)]
    return [
        (head.ljust(_WIDTH) + "".join(word.rjust(_LARGE) for word in row)).encode()
        for head, row in zip(heads, rows, strict=True)
    ]


# LS-DYNA

# Widths of integers and of numbers: standard, of the mark %, and long.
_WIDTHS = {"-": (8, 16), "%": (10, 16), "+": (20, 20)}
_OPTIONS = {"THICKNESS", "BETA", "MCID", "OFFSET", "DOF"}
_N_NODES = 8


class DynaDeck(CardDeck):
    """Nodes and shells of an LS-DYNA deck."""

    def __init__(self, path: Path) -> None:
        self._format, self._invariant = "-", False
        # By first line of an element: line and text of its keyword, options, its
        # further lines, and the width of numbers.
        self._of: dict[int, tuple[int, str, set[str], list[int], int]] = {}
        super().__init__(path)

    @staticmethod
    def _include(lines: list[bytes], line: int) -> Include | None:
        found = re.match(rb"\*INCLUDE(_\w+)?\s*$", lines[line], re.I)
        if found is None:
            return None
        if found[1]:
            raise MeshError(
                f"{excerpt(lines[line])} is not supported: use *INCLUDE alone"
            )
        n = 1
        while line + n < len(lines) and lines[line + n].startswith(b"$"):
            n += 1
        if line + n == len(lines):
            raise MeshError("*INCLUDE: the name of the file is missing")
        return Include(lines[line + n].strip(), n + 1)

    def _read(self) -> None:
        lines = [line.decode("latin-1") for line in self.text.lines]
        kept = [i for i, x in enumerate(lines) if x.strip() and not x.startswith("$")]
        starts = [k for k, i in enumerate(kept) if lines[i].startswith("*")]
        if starts[:1] != [0]:
            raise MeshError("the file does not begin with an LS-DYNA keyword")
        for start, end in zip(starts, [*starts[1:], len(kept)], strict=True):
            head, own = lines[kept[start]], kept[start + 1 : end]
            keyword, *marks = head[1:].upper().split()
            if keyword == "END":
                return
            mark = next((x for x in marks if x in _WIDTHS), self._format)
            with errors_about(f"*{excerpt(keyword)}"):
                if keyword == "KEYWORD":
                    long = re.search(r"LONG\s*=\s*([YSK])", head.upper())
                    self._format = "+" if long and long[1] == "Y" else self._format
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
        width, k = _WIDTHS[mark][0], 0
        while k < len(own):
            number, owner, *nodes = map(
                _integer, _words(lines[own[k]], [width] * (2 + _N_NODES))
            )
            extra = bool(given & {"THICKNESS", "BETA", "MCID"})
            extra += extra * any(nodes[4:])
            extra += ("OFFSET" in given) + ("DOF" in given)
            if k + extra >= len(own):
                raise MeshError(f"the element {number} is incomplete")
            n = 3 if nodes[3] in (0, nodes[2]) else 4
            corners = (*nodes[:n], *nodes[4:])
            at = own[k], own[k + extra] + 1
            kind = keyword.removeprefix("ELEMENT_")
            one = Element(number, kind, corners, n, "", f"part {owner}", at)
            self.elements.append(one)
            more = own[k + 1 : k + 1 + extra]
            self._of[own[k]] = head, lines[head], given, more, _WIDTHS[mark][1]
            k += 1 + extra

    def write(
        self,
        folder: Path,
        elements: Sequence[Element],
        layup: Layup,
        material: str | None,
    ) -> Written:
        """Write a copy whose shells have the angle of the warp and the thickness."""
        text, remarks = self.text.unchanged(), self._one_angle(layup, material)
        angles = self._warp_deg(elements, layup)
        current: dict[int, str] = {}
        order = sorted(range(len(elements)), key=lambda i: elements[i].lines)
        for i in order:
            first = elements[i].lines[0]
            head, line, given, more, width = self._of[first]
            wanted = line
            if layup.covered[i]:
                marks = line.split()[1:]
                options = ["BETA", *(x for x in ("OFFSET", "DOF") if x in given)]
                options[:0] = ["THICKNESS"] * ("THICKNESS" in given)
                wanted = " ".join(["_".join(["*ELEMENT_SHELL", *options]), *marks])
                n_thick = len(more) - ("OFFSET" in given) - ("DOF" in given)
                for at in more[:n_thick]:
                    text.replace(at, [])
                t = real_word(layup.thickness[i], width - 1).rjust(width)
                beta = real_word(angles[i], width - 1).rjust(width)
                cards = [4 * t + beta, *[4 * t] * any(elements[i].nodes[-4:])]
                text.replace(first, [self.text.lines[first], *map(str.encode, cards)])
            if head not in current and wanted != line:
                text.replace(head, [wanted.encode("latin-1")])
            elif current.get(head, wanted) != wanted:
                text.insert(first, [wanted.encode("latin-1")])
            current[head] = wanted
        return text.write(folder), remarks

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

# Properties whose third line has the thickness in its second pair of columns.
_WITH_THICKNESS = ("SHELL", "TYPE1", "SH_ORTH", "TYPE9", "SH_COMP", "TYPE10")

# Directions whose projection onto shells angles may be measured from, x first.
_AXES = [v for v in product((0, 1, -1), repeat=3) if v > (0, 0, 0)]
_AXES = sorted(_AXES, key=lambda v: (sum(map(abs, v)), [-x for x in v]))

# Least sine between this direction and the normals, beyond which others are tried.
_STEEP = 0.1

_IN_GROUP = 10


class RadiossDeck(CardDeck):
    """Nodes and shells of an OpenRadioss starter deck."""

    COMMENT: ClassVar[bytes] = b"#"

    @staticmethod
    def _include(lines: list[bytes], line: int) -> Include | None:
        found = re.match(rb"#include\s+(\S.*)", lines[line])
        return Include(found[1].rstrip(), 1) if found else None

    def _read(self) -> None:
        self._options = options(self.text.content)
        for option in self._options:
            keyword = option.name[0].upper()
            cards = [(i, x) for i, x in _cards_of(option) if x.strip()]
            with errors_about("/" + excerpt("/".join(option.name))):
                if keyword == "NODE":
                    for _, card in cards:
                        number, *x = _words(card, [COLUMN, *[2 * COLUMN] * 3])
                        self._add_node(_integer(number), [*map(_real, x)])
                elif keyword in ("SHELL", "SH3N"):
                    n = 4 if keyword == "SHELL" else 3
                    part = _integer(option.name[1]) if option.name[1:] else 0
                    for i, card in cards:
                        words = _words(card, [COLUMN] * (1 + n))
                        number, *nodes = map(_integer, words)
                        own = tuple(nodes), n, "", f"part {part}", (i, i + 1)
                        self.elements.append(Element(number, keyword, *own))
                elif keyword == "TRANSFORM":
                    raise MeshError("nodes are moved: export them in place")
                elif keyword in ("BRICK", "TETRA4", "BEAM", "TRUSS", "SPRING", "QUAD"):
                    self.left[keyword] += len(cards)

    def write(
        self,
        folder: Path,
        elements: Sequence[Element],
        layup: Layup,
        material: str | None,
    ) -> Written:
        """Write a copy with a file of plies, whose angles are in ``/DRAPE``."""
        text, remarks = self.text.unchanged(), list[str]()
        name = f"{self.text.files[0].path.stem}_fibres.inc"
        lines = self._include_lines(text, elements, layup, material, remarks)
        if name in [file.path.name for file in self.text.files]:
            raise MeshError(
                f"the deck includes {name} already: take the deck without it"
            )
        ends = [o.lines[0] for o in self._options if o.name[0].upper() == "END"]
        text.insert(ends[0] if ends else None, [f"#include {name}".encode()])
        written = text.write(folder)
        written.append(folder / name)
        written[-1].write_text("\n".join([*lines, ""]), encoding="latin-1")
        return written, remarks

    def _include_lines(
        self,
        text: DeckText,
        elements: Sequence[Element],
        layup: Layup,
        material: str | None,
        remarks: list[str],
    ) -> list[str]:
        """Plies of the covered elements; their properties are commented out."""
        parts, numbers = self._parts(), self._numbers()
        covered = layup.covered.tolist()
        of = [self._part_of(element, parts) for element in elements]
        properties = {one[0] for one, known in zip(of, covered, strict=True) if known}
        groups: dict[tuple[str, float], list[int]] = {}
        for i, (own, known) in enumerate(zip(of, covered, strict=True)):
            if own[0] in properties:
                thick = np.nan if known else self._thickness(own[0])
                mat = material if known and material else own[1]
                groups.setdefault((mat, -1.0 if known else thick), []).append(i)
        axis, lines = _axis(layup), ["# plies of a woven ply, by skfem_textile; mm"]
        warp, weft = layup.angles_deg(np.tile(axis[:, None], len(elements)))
        angles, plies, first = {WARP: warp, WEFT: weft}, list[int](), ""
        for (mat, thick), members in groups.items():
            title = "NOT_COVERED" if thick >= 0 else "FIBRES"
            shells = []
            for kind, group in (("SHELL", "GRSHEL/SHEL"), ("SH3N", "GRSH3N/SH3N")):
                own = [elements[i].number for i in members if elements[i].kind == kind]
                shells.append(next(numbers) if own else 0)
                if own:
                    lines += [f"/{group}/{shells[-1]}", title, *_ten_in_a_line(own)]
            drapes = {}
            for family in (WARP, WEFT) if thick < 0 else ():
                drapes[family] = next(numbers)
                lines += [f"/DRAPE/{drapes[family]}", family]
                for i in members:
                    thinning = layup.thickness[i] / layup.rest
                    lines.append(
                        f"{elements[i].kind:<10}{elements[i].number:>10}"
                        f"{_word20(thinning)}{_word20(angles[family][i])}"
                    )
            for family in SEQUENCE if thick < 0 else ("NOT_COVERED",):
                t = layup.rest / len(SEQUENCE) if thick < 0 else thick
                plies.append(next(numbers))
                lines += [
                    f"/PLY/{plies[-1]}",
                    family,
                    f"{mat:>10}{_word20(t)}{0:>20}{shells[0]:>10}{shells[1]:>10}{3:>10}",
                    f"{drapes.get(family, 0):>10}{2:>10}",
                ]
        for number in sorted(properties):
            option = self._property(number)
            first = first or _first_card(option)[:40]
            text.comment_out(option.lines, b"#")
            name = "/".join(option.name[:3])
            remarks.append(f"/{excerpt(name)} is commented out for the plies")
            lines += [f"/PROP/PCOMPP/{number}", "FIBRES"]
        lines += [f"/STACK/{next(numbers)}", "FIBRES", first, "", ""]
        lines.append("".join(map(_word20, axis.tolist())) + f"{0:>10}" * 3)
        for ply in plies:
            lines += [f"{ply:>10}{0:>20}{0:>20}", ""]
        return lines

    def _numbers(self) -> Iterator[int]:
        """Numbers that no keyword uses."""
        names = (part for option in self._options for part in option.name[1:])
        last = max((int(part) for part in names if part.isdigit()), default=0)
        yield from range(last + 1, last + 10**6)

    def _parts(self) -> dict[str, tuple[str, str]]:
        """Numbers of the property and the material of each part."""
        of = [o for o in self._options if o.name[0].upper() == "PART" and o.name[1:]]
        words = {o.name[1]: _words(_first_card(o), [COLUMN] * 2) for o in of}
        return {f"part {number}": (a, b) for number, (a, b) in words.items()}

    @staticmethod
    def _part_of(
        element: Element, parts: dict[str, tuple[str, str]]
    ) -> tuple[str, str]:
        if not all(parts.get(element.owner, ())) or element.owner not in parts:
            raise MeshError(
                f"the {element.owner} of element {element.number} has no property and "
                "material: define /PART"
            )
        return parts[element.owner]

    def _property(self, number: str) -> Option:
        for option in self._options:
            if option.name[0].upper() == "PROP" and option.name[2:3] == [number]:
                return option
        raise MeshError(f"the property {number} of covered elements is not defined")

    def _thickness(self, number: str) -> float:
        """Thickness of a property that elements without the ply keep."""
        option = self._property(number)
        name = "/" + excerpt("/".join(option.name[:3]))
        cards = [x for _, x in _cards_of(option)][1:]
        known = option.name[1].upper() in _WITH_THICKNESS and len(cards) > 2
        t = _real(_words(cards[2], [2 * COLUMN] * 2)[1]) if known else 0.0
        if not t > 0:
            raise MeshError(
                f"{name} has elements without fibres, but no thickness that can be "
                "read: give them a part of their own"
            )
        return t


def _cards_of(option: Option) -> list[tuple[int, str]]:
    """Cards of a keyword with the numbers of their lines."""
    return list(zip(option.lines[1:], option.cards, strict=True))


def _first_card(option: Option) -> str:
    """First card after the title."""
    return [*option.cards, "", ""][1]


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
