"""Decks of structural parts in four formats, made by a seed, and what they contain.

A part is a patch of a curved surface.  Numbers have gaps, normals are reversed in some
elements, some quadrilaterals are cut in two, nodes may be in an include file.
"""

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

FORMATS = ("inp", "bdf", "k", "rad")


@dataclass
class Patch:
    """Nodes and elements of a part by number, and its position in space."""

    name: str
    nodes: dict[int, np.ndarray]
    elements: dict[int, tuple[int, ...]]
    quadratic: bool
    turn: np.ndarray = field(default_factory=lambda: np.eye(3))
    shift: np.ndarray = field(default_factory=lambda: np.zeros(3))

    def corners(self, number):
        """Corners of an element in global axes, shape (n, 3)."""
        nodes = self.elements[number]
        nodes = nodes[: len(nodes) // 2] if self.quadratic else nodes
        return np.array([self.nodes[n] for n in nodes]) @ self.turn.T + self.shift


def patch(rng, name, first=(1, 1), quadratic=False, reverse=0.3):
    """Patch of a surface with numbers from ``first`` on, with gaps."""
    n, m = rng.integers(2, 5, 2)
    step = rng.integers(1, 8)
    number = first[0] + step * np.arange((n + 1) * (m + 1)).reshape(n + 1, m + 1)
    nodes = {}
    for i, j in np.ndindex(n + 1, m + 1):
        x, y = 10.0 * i + rng.uniform(-2, 2), 12.0 * j + rng.uniform(-2, 2)
        nodes[int(number[i, j])] = np.round([x, y, 4 * np.sin(x / 15) + y * x / 300], 6)
    cells = []
    for i, j in np.ndindex(n, m):
        quad = [number[i, j], number[i + 1, j], number[i + 1, j + 1], number[i, j + 1]]
        quad = np.roll(quad, rng.integers(0, 4)).tolist()
        split = rng.random() < 0.25
        cells += [quad[:3], [quad[0], *quad[2:]]] if split else [quad]
    cells = [cell[::-1] if rng.random() < reverse else cell for cell in cells]
    labels = np.cumsum(rng.integers(1, 9, len(cells))) + first[1]
    made = Patch(name, nodes, {}, quadratic)
    middles, last = {}, max(nodes)
    for label, cell in zip(labels.tolist(), cells, strict=True):
        row = list(cell)
        for a, b in zip(cell, [*cell[1:], cell[0]], strict=True) if quadratic else ():
            edge = min(a, b), max(a, b)
            if edge not in middles:
                last += 1
                middles[edge] = last
                nodes[last] = np.round((nodes[a] + nodes[b]) / 2, 6)
            row.append(middles[edge])
        made.elements[label] = tuple(map(int, row))
    return made


@dataclass
class Made:
    """Deck: its path, patches, and whether it must be refused."""

    path: Path
    patches: list[Patch]
    refused: str = ""


def deck(folder, form, seed, damage=True):
    """Deck of a format in a folder."""
    rng = np.random.default_rng(seed)
    refused = damage and bool(rng.random() < 0.08)
    made = {"inp": _abaqus, "bdf": _nastran, "k": _dyna, "rad": _radioss}[form]
    return made(Path(folder), rng, refused)


def _with_nodes(folder, rng, name, before, nodes, include, after):
    """Write a deck, with the lines of nodes in an include file or not."""
    if rng.random() < 0.5:
        apart = ["mesh/nodes.inc", "nodes.inc"][rng.integers(0, 2)]
        (folder / apart).parent.mkdir(exist_ok=True)
        (folder / apart).write_text("\n".join([*nodes, ""]))
        nodes = [line.format(apart) for line in include]
    end = ["\n", "\r\n"][rng.integers(0, 2)]
    content = end.join([*before, *nodes, *after, ""])
    (folder / name).write_bytes(content.encode())
    return folder / name


def _row(*words):
    return ", ".join(map(str, words))


def _part_of_abaqus(rng, name, kinds, quadratic):
    """Patch, lines of its nodes, and of its elements, sets and sections."""
    one = patch(rng, name, rng.integers(1, 5000, 2).tolist(), quadratic)
    nodes = [f"{n:7d}, {_row(*x)}" for n, x in _rows(one.nodes)]
    lines = []
    for corners, kind in kinds.items():
        of_kind = [
            _row(e, *x)
            for e, x in one.elements.items()
            if len(x) // (1 + quadratic) == corners
        ]
        lines += [f"*Element, type={kind}"] * bool(of_kind) + of_kind
    lines += ["*Element, type=B31, elset=beams", _row(99999, *list(one.nodes)[:2])]
    numbers = list(one.elements)
    cut = int(rng.integers(1, len(numbers) + 1))
    skin, rest = numbers[:cut], numbers[cut:]
    lines += ["*Elset, elset=Skin", _row(*skin[:15])]
    lines += ["*Elset, elset=Skin", _row(*skin[15:])] * (cut > 15)
    lines += ["*Elset, elset=Rest"] * bool(rest) + [f"{n}," for n in rest]
    lines += ["** Section: S1", "*Shell Section, elset=Skin, material=CFRP", "0.9, 5"]
    lines += ["*Shell Section, elset=Rest, material=GFRP", "1.1, 5"] * bool(rest)
    return one, nodes, lines


def _position(rng, one):
    """Move a patch, in some cases; returns the lines of its instance."""
    if rng.random() >= 0.7:
        return []
    axis = rng.normal(size=3)
    axis, degrees = axis / np.linalg.norm(axis), float(rng.uniform(-180, 180))
    through, shift = rng.uniform(-5, 5, 3), rng.uniform(-100, 100, 3)
    one.turn = Rotation.from_rotvec(np.radians(degrees) * axis).as_matrix()
    one.shift = through + one.turn @ (shift - through)
    points = *through.tolist(), *(through + axis).tolist()
    return [_row(*shift.tolist()), _row(*points, degrees)]


def _abaqus(folder, rng, refused):
    quadratic = bool(rng.random() < 0.3)
    kinds = ("S3R", "S4R"), ("S3", "S4")
    tri, quad = ("STRI65", "S8R") if quadratic else kinds[rng.integers(0, 2)]
    assembly = rng.random() < 0.5
    head, step = ["*HEADING", "a part, with a comma"], ["*Step", "*Static", "*End Step"]
    for name in ("GFRP", "CFRP"):
        step = [f"*Material, name={name}", "*Elastic", "7e4, 0.3", *step]
    parts = []
    for k in range(rng.integers(1, 4) if assembly else 1):
        made = _part_of_abaqus(rng, f"Part-{k + 1}", {3: tri, 4: quad}, quadratic)
        place = _position(rng, made[0]) if assembly else []
        within = assembly and not place and rng.random() < 0.4  # made in the assembly
        parts.append((*made, place, within))
    if not assembly:
        one, nodes, lines, _, _ = parts[0]
        one.name = ""
        after = ["*Ngen"] * refused + [*lines, *step]
        include = ["*Include, input={}"]
        before = [*head, "*Node"]
        if rng.random() < 0.5:
            before, nodes, include = head, ["*Node", *nodes], ["*Node, input={}"]
        path = _with_nodes(folder, rng, "part.inp", before, nodes, include, after)
        return Made(path, [one], "not supported" if refused else "")
    own = ["*Assembly, name=A"]
    for one, nodes, lines, place, within in parts:
        mesh = ["*Node", *nodes, *lines]
        head += [f"*Part, name={one.name}", *([] if within else mesh), "*End Part"]
        own += [f"*Instance, name={one.name}-1, part={one.name}", *place]
        own += [*(mesh if within else []), "*End Instance"]
    patches = [made[0] for made in parts]
    name = patches[0].name
    again = [f"*Instance, name=again, part={name}", "0., 500., 0.", "*End Instance"]
    own += again * refused
    own += [f"*Elset, elset=all, instance={name}-1", f"{min(patches[0].elements)},"]
    path = folder / "part.inp"
    path.write_text("\n".join([*head, *own, "*End Assembly", *step, ""]))
    for one in patches:
        one.name = f"{one.name}-1".upper()
    return Made(path, patches, "instances with different" if refused else "")


def _rows(nodes):
    return [(n, x.tolist()) for n, x in nodes.items()]


def _nastran(folder, rng, refused):
    quadratic = bool(rng.random() < 0.3)
    one = patch(rng, "", rng.integers(1, 5000, 2).tolist(), quadratic)
    one.nodes = {n: np.round(x, 3) for n, x in one.nodes.items()}
    nodes = [
        line
        for n, x in _rows(one.nodes)
        for line in _nastran_card(rng, "GRID", [n, 3 if refused else "", *x])
    ]
    after = []
    for label, cell in one.elements.items():
        n, row = len(cell) // (1 + quadratic), [label, 7, *cell]
        if n == 4 and not quadratic and rng.random() < 0.3:
            row += [12.5, 0.25]  # an old angle, and an offset that stays
        name = {3: "CTRIA3", 4: "CQUAD4", 6: "CTRIA6", 8: "CQUAD8"}[len(cell)]
        after += ["$ a comment"] * (rng.random() < 0.1)
        after += _nastran_card(rng, name, row)
    a, b = list(one.nodes)[:2]
    after += [f"CBAR,99999,8,{a},{b},0.,0.,1.", "PSHELL,7,1,0.9", "MAT1,1,7.+4,,.3"]
    before = ["SOL 103", "CEND", "SET 1 = ALL", "BEGIN BULK"]
    lines = before, nodes, ["INCLUDE '{}'"], [*after, "ENDDATA"]
    path = _with_nodes(folder, rng, "part.bdf", *lines)
    return Made(path, [one], "the coordinate system 3" if refused else "")


def _nastran_card(rng, name, fields):
    """Card in small, large or free field."""
    form = int(rng.integers(0, 3))
    words, n = list(map(str, fields)), 4 if form == 1 else 8
    rows = [words[k : k + n] for k in range(0, len(words), n)]
    if form == 2:
        heads = [name] + [""] * (len(rows) - 1)
        return [",".join([h, *row]) for h, row in zip(heads, rows, strict=True)]
    mark, width = ("*", 16) if form else ("", 8)
    heads = [name + mark] + [mark or ["+", ""][rng.integers(0, 2)]] * (len(rows) - 1)
    return [
        head.ljust(8) + "".join(word.rjust(width) for word in row)
        for head, row in zip(heads, rows, strict=True)
    ]


def _dyna(folder, rng, refused):
    quadratic = bool(rng.random() < 0.2)
    one = patch(rng, "", rng.integers(1, 5000, 2).tolist(), quadratic)
    mark = ["", " %", " +", ","][rng.integers(0, 4)]
    a, b = {"": (8, 16), " %": (10, 16), " +": (20, 20), ",": (0, 0)}[mark]

    def card(words, *widths):
        columns = zip(words, widths, strict=True)
        return _row(*words) if not a else "".join(f"{x!s:>{n}}" for x, n in columns)

    mark = mark.strip(",")
    nodes = [card((n, *x), a, b, b, b) for n, x in _rows(one.nodes)]
    option = ["", "_THICKNESS", "_OFFSET", "_BETA"][rng.integers(0, 4)]
    keyword = f"*ELEMENT_SHELL{'_COMPOSITE' if refused else option}{mark}"
    after = [keyword, "$ eid pid nodes"]
    for label, cell in one.elements.items():
        n = len(cell) // (1 + quadratic)
        corners, rest = list(cell[:n]), list(cell[n:])
        row = [label, 3, *corners, *corners[-1:] * (4 - n), *rest]
        after.append(card(row, *[a] * len(row)))
        if option in ("_THICKNESS", "_BETA"):
            t = [0.9] * 4 + [33.0] * (option == "_BETA")
            after.append(card(t, *[b] * len(t)))
            after += [card([0.9] * 4, *[b] * 4)] * quadratic
        elif option == "_OFFSET":
            after.append(card([0.125], b))
    beam = 99999, 4, *list(one.nodes)[:2]
    after += [f"*ELEMENT_BEAM{mark}", card(beam, *[a] * 4), "*END"]
    before = ["*KEYWORD", "*TITLE", "a part"]
    lines = before, [f"*NODE{mark}", *nodes], ["*INCLUDE", "{}"], after
    path = _with_nodes(folder, rng, "part.k", *lines)
    return Made(path, [one], "option is not supported" if refused else "")


def _radioss(folder, rng, refused):
    one = patch(rng, "", rng.integers(1, 5000, 2).tolist())

    def card(*numbers):
        return "".join(f"{n:>10}" for n in numbers)

    nodes = ["/NODE"]
    for n, x in _rows(one.nodes):
        nodes.append(card(n) + "".join(f"{v!r:>20}" for v in x))
    after, numbers = [], list(one.elements)
    cut = int(rng.integers(1, len(numbers) + 1))
    for part, own in ((11, numbers[:cut]), (12, numbers[cut:])):
        for n, keyword in ((4, "SHELL"), (3, "SH3N")):
            rows = [e for e in own if len(one.elements[e]) == n]
            after += [f"/{keyword}/{part}"] * bool(rows)
            after += [card(e, *one.elements[e]) for e in rows]
        after += [f"/PART/{part}", "skin", card(part + 10, 5)]
        shell = [f"/PROP/SHELL/{part + 10}", "skin", card(24), ""]
        shell.append(f"{5:>10}{'':10}{0.9:>20}")
        after += [] if refused else shell
    after += ["/BEAM/13", card(99999, *list(one.nodes)[:2]), "/END"]
    before = ["#RADIOSS STARTER", "/BEGIN", "part"]
    lines = before, nodes, ["#include {}"], after
    path = _with_nodes(folder, rng, "part_0000.rad", *lines)
    return Made(path, [one], "is not defined" if refused else "")
