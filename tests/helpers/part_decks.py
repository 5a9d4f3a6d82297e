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


def _nodes_apart(folder, rng, path, before, nodes, after, include):
    """Write a deck, with the lines of nodes in an include file or not."""
    lines = nodes
    if rng.random() < 0.5:
        name = ["mesh/nodes.inc", "nodes.inc"][rng.integers(0, 2)]
        (folder / name).parent.mkdir(exist_ok=True)
        (folder / name).write_text("\n".join([*nodes, ""]))
        lines = include(name)
    end = ["\n", "\r\n"][rng.integers(0, 2)]
    path.write_bytes(end.join([*before, *lines, *after, ""]).encode())
    return path


def _abaqus(folder, rng, refused):
    quadratic = bool(rng.random() < 0.3)
    tri, quad = (
        ("STRI65", "S8R")
        if quadratic
        else (("S3R", "S4R"), ("S3", "S4"))[rng.integers(0, 2)]
    )
    assembly = rng.random() < 0.5
    patches, lines, own = [], ["*HEADING", "a part, with a comma"], []
    for k in range(rng.integers(1, 4) if assembly else 1):
        one = patch(rng, f"Part-{k + 1}", rng.integers(1, 5000, 2).tolist(), quadratic)
        patches.append(one)
        nodes = [f"{n:7d}, {x!r}, {y!r}, {z!r}" for n, (x, y, z) in _rows(one.nodes)]
        kinds = {3: tri, 4: quad}
        mesh = []
        for corners, kind in kinds.items():
            rows = [
                f"{e}, {', '.join(map(str, x))}"
                for e, x in one.elements.items()
                if len(x) // (1 + quadratic) == corners
            ]
            mesh += [f"*Element, type={kind}"] * bool(rows) + rows
        solid = [
            "*Element, type=B31, elset=beams",
            f"99999, {', '.join(map(str, list(one.nodes)[:2]))}",
        ]
        numbers = list(one.elements)
        cut = int(rng.integers(1, len(numbers) + 1))
        sets = ["*Elset, elset=Skin", ", ".join(map(str, numbers[:cut][:15]))]
        sets += ["*Elset, elset=Skin", ", ".join(map(str, numbers[:cut][15:]))] * (
            cut > 15
        )
        if cut < len(numbers):
            sets += ["*Elset, elset=Rest", *(f"{n}," for n in numbers[cut:])]
        sections = [
            "** Section: S1",
            "*Shell Section, elset=Skin, material=CFRP",
            "0.9, 5",
        ]
        if cut < len(numbers):
            sections += ["*Shell Section, elset=Rest, material=GFRP", "1.1, 5"]
        body = (["*Node", *nodes], [*mesh, *solid, *sets, *sections])
        if not assembly:
            break
        if rng.random() < 0.7:
            axis = rng.normal(size=3)
            axis, degrees = axis / np.linalg.norm(axis), rng.uniform(-180, 180)
            through = rng.uniform(-5, 5, 3)
            shift = rng.uniform(-100, 100, 3)
            one.turn = Rotation.from_rotvec(np.radians(degrees) * axis).as_matrix()
            one.shift = through + one.turn @ (shift - through)
            place = [
                ", ".join(map(repr, shift.tolist())),
                ", ".join(
                    map(
                        repr,
                        [*through.tolist(), *(through + axis).tolist(), float(degrees)],
                    )
                ),
            ]
        else:
            place = []
        part, head = f"*Part, name={one.name}", f"*Instance, name={one.name}-1"
        mesh = [*body[0], *body[1]]
        within = not place and rng.random() < 0.4  # a mesh made in the assembly
        lines += [part, *(() if within else mesh), "*End Part"]
        own += [f"{head}, part={one.name}", *place, *(mesh if within else ())]
        own.append("*End Instance")
    materials = [
        x
        for m in ("CFRP", "GFRP")
        for x in (f"*Material, name={m}", "*Elastic", "7e4, 0.3")
    ]
    step = [*materials, "*Step", "*Static", "*End Step"]
    path = folder / "part.inp"
    if assembly:
        name = patches[0].name
        if refused:
            own += [
                f"*Instance, name=again, part={name}",
                "0., 500., 0.",
                "*End Instance",
            ]
        lines += [
            "*Assembly, name=A",
            *own,
            f"*Elset, elset=all, instance={name}-1",
            f"{min(patches[0].elements)},",
            "*End Assembly",
        ]
        path.write_text("\n".join([*lines, *step, ""]))
        for one in patches:
            one.name = f"{one.name}-1".upper()
        return Made(path, patches, "instances with different" if refused else "")
    patches[0].name = ""
    after = [*body[1], *step]
    if refused:
        after.insert(0, "*Ngen")
    _nodes_apart(
        folder,
        rng,
        path,
        [*lines, body[0][0]],
        body[0][1:],
        after,
        lambda n: [f"*Include, input={n}"],
    )
    return Made(path, patches, "not supported" if refused else "")


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
        n = len(cell) // (1 + quadratic)
        name = {3: "CTRIA", 4: "CQUAD"}[n] + (
            {3: "6", 4: "8"}[n] if quadratic else str(n)
        )
        row = [label, 7, *cell]
        if n == 4 and not quadratic and rng.random() < 0.3:
            row += [12.5, 0.25]  # an old angle, and an offset that stays
        after += ["$ a comment"] * (rng.random() < 0.1)
        after += _nastran_card(rng, name, row)
    first = list(one.nodes)[:2]
    after += [
        f"CBAR,99999,8,{first[0]},{first[1]},0.,0.,1.",
        "PSHELL,7,1,0.9",
        "MAT1,1,7.+4,,.3",
    ]
    after += ["ENDDATA"]
    path = _nodes_apart(
        folder,
        rng,
        folder / "part.bdf",
        ["SOL 103", "CEND", "SET 1 = ALL", "BEGIN BULK"],
        nodes,
        after,
        lambda n: [f"INCLUDE '{n}'"],
    )
    return Made(path, [one], "the coordinate system 3" if refused else "")


def _nastran_card(rng, name, fields):
    """Card in small, large or free field."""
    form = int(rng.integers(0, 3))
    width = 16 if form == 1 else 8
    words = [repr(x) if isinstance(x, float) else str(x) for x in fields]
    if form == 2:
        rows = [words[k : k + 8] for k in range(0, len(words), 8)]
        return [",".join([name if not k else "", *row]) for k, row in enumerate(rows)]
    n = 4 if form else 8
    rows = [words[k : k + n] for k in range(0, len(words), n)]
    mark = "*" if form else ""
    heads = [name + mark] + [mark or ["+", ""][rng.integers(0, 2)]] * (len(rows) - 1)
    return [
        h.ljust(8) + "".join(w.rjust(width) for w in r)
        for h, r in zip(heads, rows, strict=True)
    ]


def _dyna(folder, rng, refused):
    quadratic = bool(rng.random() < 0.2)
    one = patch(rng, "", rng.integers(1, 5000, 2).tolist(), quadratic)
    mark = ["", " %", " +", ","][rng.integers(0, 4)]
    a, b = {"": (8, 16), " %": (10, 16), " +": (20, 20), ",": (0, 0)}[mark]
    if mark == ",":
        join = lambda row, _: ", ".join(row)  # noqa: E731
        mark = ""
    else:
        join = lambda row, w: "".join(x.rjust(k) for x, k in zip(row, w, strict=True))  # noqa: E731
    nodes = [join([str(n), *map(repr, x)], [a, b, b, b]) for n, x in _rows(one.nodes)]
    option = ["", "_THICKNESS", "_OFFSET", "_BETA"][rng.integers(0, 4)]
    keyword = f"*ELEMENT_SHELL{'_COMPOSITE' if refused else option}{mark}"
    after = [keyword, "$ eid pid nodes"]
    for label, cell in one.elements.items():
        n = len(cell) // (1 + quadratic)
        corners, rest = list(cell[:n]), list(cell[n:])
        row = [label, 3, *corners, *corners[-1:] * (4 - n), *rest]
        after.append(join(list(map(str, row)), [a] * len(row)))
        if option in ("_THICKNESS", "_BETA"):
            t = ["0.9"] * 4 + ["33."] * (option == "_BETA")
            after.append(join(t, [b] * len(t)))
            after += [join(["0.9"] * 4, [b] * 4)] * quadratic
        elif option == "_OFFSET":
            after.append(join(["0.125"], [b]))
    first = list(one.nodes)[:2]
    after += [
        f"*ELEMENT_BEAM{mark}",
        join(["99999", "4", *map(str, first)], [a] * 4),
        "*END",
    ]
    path = _nodes_apart(
        folder,
        rng,
        folder / "part.k",
        ["*KEYWORD", "*TITLE", "a part"],
        [f"*NODE{mark}", *nodes],
        after,
        lambda n: ["*INCLUDE", n],
    )
    return Made(path, [one], "option is not supported" if refused else "")


def _radioss(folder, rng, refused):
    one = patch(rng, "", rng.integers(1, 5000, 2).tolist())
    nodes = ["/NODE"] + [
        f"{n:>10}" + "".join(f"{v!r:>20}" for v in x) for n, x in _rows(one.nodes)
    ]
    after, numbers = [], list(one.elements)
    cut = int(rng.integers(1, len(numbers) + 1))
    for part, own in ((11, numbers[:cut]), (12, numbers[cut:])):
        for n, keyword in ((4, "SHELL"), (3, "SH3N")):
            rows = [e for e in own if len(one.elements[e]) == n]
            after += [f"/{keyword}/{part}"] * bool(rows)
            after += ["".join(f"{x:>10}" for x in (e, *one.elements[e])) for e in rows]
        after += [f"/PART/{part}", "skin", "".join(f"{x:>10}" for x in (part + 10, 5))]
        after += (
            []
            if refused
            else [
                f"/PROP/SHELL/{part + 10}",
                "skin",
                f"{24:>10}",
                "",
                f"{5:>10}{'':10}{0.9:>20}",
            ]
        )
    first = list(one.nodes)[:2]
    after += ["/BEAM/13", "".join(f"{x:>10}" for x in (99999, *first)), "/END"]
    path = _nodes_apart(
        folder,
        rng,
        folder / "part_0000.rad",
        ["#RADIOSS STARTER", "/BEGIN", "part"],
        nodes,
        after,
        lambda n: [f"#include {n}"],
    )
    return Made(path, [one], "is not defined" if refused else "")
