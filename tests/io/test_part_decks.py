"""Decks of parts are read as they mean, and their copies have the fibres of a ply.

Copies are read by the code below, which knows the angles of each format, not by the
package.
"""

import re
import shutil
from collections import Counter

import meshio
import numpy as np
import pytest

from skfem_textile import MeshError, drape
from skfem_textile.io import read_part_deck, write_part_deck
from skfem_textile.io.layups import SEQUENCE
from tests.helpers.part_decks import FORMATS, deck

# Seed of the sample.
SEED = 20_261_130

REST = 0.36  # mm


def unit(v):
    return v / np.linalg.norm(v, axis=-1, keepdims=True)


def normal_of(corners):
    """Normal by the order of nodes."""
    return unit(np.cross(corners[2] - corners[0], corners[-1] - corners[1]))


def families(corners):
    """Warp, weft and shear angle in an element, None where there is no ply."""
    x, y, _ = corners.mean(axis=0)
    upper = normal_of(corners)
    upper = upper if upper @ (0.3, 0.2, 1.0) > 0 else -upper
    turn, shear = 0.02 * x - 0.01 * y + 0.4, 0.6 * np.sin(0.01 * (x + y))
    if np.sin(0.15 * x + 0.06 * y) < -0.5:
        return None
    one = unit(np.cross(np.cross(upper, (0.8, 0.5, 0.3)), upper))
    two = np.cross(upper, one)
    angles = turn, turn + np.pi / 2 - shear
    return *(np.cos(a) * one + np.sin(a) * two for a in angles), shear


def fibres_on(mesh):
    """Fibres in the elements of a mesh."""
    corners = [mesh.points[:, c].T for cell in mesh.cells for c in cell.T]
    none = np.full(3, np.nan), np.full(3, np.nan), np.nan
    warp, weft, shear = zip(*(families(x) or none for x in corners), strict=True)
    axes = np.array(warp).T, np.array(weft).T
    axis = np.array([1.0, 0, 0])
    return drape.FibresInSpace(mesh, mesh.normals(), *axes, np.array(shear), axis)


def turned(corners, axis, degrees):
    """Axis projected onto an element, turned about the normal."""
    n, a = normal_of(corners), np.radians(degrees)
    x = unit(axis - n * (n @ axis))
    return np.cos(a) * x + np.sin(a) * np.cross(n, x)


# Readers of the copies: by instance and number, warp, weft and thickness


def inp_blocks(path):
    """Keyword, parameters and rows of an Abaqus deck with its include files."""
    for line in path.read_text().splitlines():
        if line.lower().startswith("*include"):
            name = re.search("(?i)input=(.*)", line)[1].strip()
            yield from inp_blocks(path.parent / name)
        elif line.startswith("*") and not line.startswith("**"):
            keyword, *words = (x.strip() for x in line[1:].split(","))
            pairs = (x.partition("=") for x in words)
            yield keyword.upper(), {k.strip().upper(): v.strip() for k, _, v in pairs}
        elif line.strip() and not line.startswith("**"):
            yield [x.strip() for x in line.split(",") if x.strip() or line[0] == ","]


def of_inp(made, path):
    scope, data, tables, sets, layups, part = {}, None, {}, {}, [], ""
    patches = {p.name.upper().removesuffix("-1"): p for p in made.patches}
    for item in inp_blocks(path):
        if isinstance(item, tuple):
            keyword, given = item
            if keyword == "PART":
                part = given["NAME"].upper()
            name = given.get("ELSET", given.get("NAME", "")).upper()
            data = []
            if keyword == "DISTRIBUTION":
                tables[part, name] = data
            elif keyword == "ELSET":
                data = sets.setdefault((part, name), [])
            elif keyword.endswith("SECTION"):
                layups.append((part, name, given, data))
            elif keyword == "ORIENTATION":
                scope[part, name] = data
        else:
            data.append(item)
    found, assigned = {}, Counter()
    for part, name, given, layers in layups:
        numbers = [int(n) for row in sets[part, name] for n in row]
        assigned.update((part, n) for n in set(numbers))
        if "COMPOSITE" not in given:
            continue
        assert [row[4].split("_")[0] for row in layers] == list(SEQUENCE)
        axes = scope[part, given["ORIENTATION"]][0][0]
        rows = {
            key: {row[0]: [*map(float, row[1:])] for row in tables[part, key]}
            for key in (axes, layers[0][0], layers[1][3])
        }
        for number in numbers:
            patch = patches[part]
            corners = patch.corners(number)
            a = patch.turn @ rows[axes][str(number)][:3]
            b = patch.turn @ rows[axes][str(number)][3:]
            np.testing.assert_allclose(np.cross(a, b), normal_of(corners), atol=1e-9)
            angle = rows[layers[1][3]][str(number)][0]
            thick = rows[layers[0][0]][str(number)][0] * len(layers)
            both = turned(corners, a, 0.0), turned(corners, a, angle)
            found[patch.name, number] = *both, thick
    assert set(assigned.values()) == {1}  # each element has one section
    every = {(k, e) for k, p in patches.items() for e in p.elements}
    assert set(assigned) == every
    return found


def of_bdf(made, path):
    found, corners = {}, made.patches[0].corners
    text = "".join(
        x for x in path.read_text().splitlines(True) if not x.startswith("$")
    )
    for card in re.findall(r"^C(?:QUAD|TRIA)\d\*.*(?:\n\*.*)*", text, re.M):
        name = card[:6]
        words = [
            line[8 + 16 * k : 24 + 16 * k].strip()
            for line in card.splitlines()
            for k in range(4)
        ]
        fields = {"CQUAD4": (6, 4), "CTRIA3": (5, 3), "CQUAD8": (14, 4)}
        at, n = fields.get(name, (8, 3))
        thick = words[10 : 10 + n] if words[10:11] != [""] else [""]
        if thick in ([], [""]):
            continue
        assert len(set(thick)) == 1
        assert "." in words[at]  # an integer would be a coordinate system
        x = corners(int(words[0]))
        side = x[1] - x[0] if name != "CQUAD8" else x[1] + x[2] - x[0] - x[3]
        warp = turned(x, side, float(words[at]))
        found["", int(words[0])] = warp, None, float(thick[0])
    return found


def of_k(made, path):
    found, head, own = {}, "", []
    for line in [*path.read_text().splitlines(), "*END"]:
        if line.startswith("$"):
            continue
        if line.startswith("*"):
            if "_BETA" in head:
                k = 1 + ("OFFSET" in head) + 1
                k += made.patches[0].quadratic
                assert len(own) % k == 0
                for row, thick, *_ in zip(*(own[i::k] for i in range(k)), strict=True):
                    a, b = {"%": (10, 16), "+": (20, 20)}.get(head[-1], (8, 16))
                    number = int(row.split(",")[0] if "," in row else row[:a])
                    words = [thick[b * i : b * (i + 1)] for i in range(5)]
                    t = [*map(float, thick.split(",") if "," in thick else words)]
                    if t[4] == 33.0:
                        continue
                    assert len(set(t[:4])) == 1
                    x = made.patches[0].corners(number)
                    found["", number] = turned(x, x[1] - x[0], t[4]), None, t[0]
            head, own = line.strip(), []
        else:
            own.append(line)
    return found


def of_rad(made, path):
    text = path.read_text() + (path.parent / "part_0000_fibres.inc").read_text()
    blocks = [
        (m[1].split("/"), m[2].splitlines())
        for m in re.finditer(r"^/(.*)\n((?:[^/].*\n|\n)*)", text, re.M)
    ]
    by = {}
    for name, lines in blocks:
        kept = [x for x in lines if not x.startswith("#")]
        by.setdefault("/".join(name), []).extend(kept)
    stack = next(lines for name, lines in by.items() if name.startswith("STACK"))
    axis = np.array([float(stack[4][20 * k : 20 * k + 20]) for k in range(3)])
    plies = [by[f"PLY/{int(x[:10])}"] for x in stack[5::2]]
    found, families = {}, {"WARP": {}, "WEFT": {}}
    total, order = Counter(), {}
    for title, card, more in plies:
        if title == "NOT_COVERED":
            continue
        t, drape = float(card[10:30]), by[f"DRAPE/{int(more[:10])}"]
        assert drape[0] == title
        members = "".join(by.get(f"GRSHEL/SHEL/{int(card[50:60])}", [])[1:])
        members += "".join(by.get(f"GRSH3N/SH3N/{int(card[60:70])}", [])[1:])
        assert {int(x[10:20]) for x in drape[1:]} == set(map(int, members.split()))
        for row in drape[1:]:
            number = int(row[10:20])
            total[number] += t * float(row[20:40])
            order.setdefault(number, []).append(title)
            families[title][number] = float(row[40:60])
    for number, thick in total.items():
        assert order[number] == list(SEQUENCE)
        x = made.patches[0].corners(number)
        both = (turned(x, axis, families[k][number]) for k in ("WARP", "WEFT"))
        found["", number] = *both, thick
    return found


READERS = {"inp": of_inp, "bdf": of_bdf, "k": of_k, "rad": of_rad}


# What may be added to a copy, and what marks lines that are commented out
ADDED = {"inp": r"\*INCLUDE, INPUT=part_fibres", "rad": "#include part_0000_fibres"}
ADDED |= {"bdf": r"C(QUAD|TRIA)\d\*|\* ", "k": r"[\d., -]+$|\*ELEMENT_SHELL"}
MARKS = {"inp": "**", "rad": "#", "bdf": "$", "k": "**"}


def check_kept(made, form, out):
    """All lines are kept in their order, and nothing else is added."""
    added = re.compile(ADDED[form])
    originals = [path for path in made.path.parent.rglob("*") if path.is_file()]
    for path in originals:
        copy = (out / path.relative_to(made.path.parent)).read_text().splitlines()
        for line in path.read_text().splitlines():
            marked, replaced = MARKS[form] + line, form == "k" and added.match(line)
            ends = [copy.index(x) for x in (marked, line) if x in copy[:9]]
            ends = [n for n in ends if all(map(added.match, copy[:n]))]
            assert ends or replaced, line
            copy = copy[ends[0] + 1 :] if ends else copy
        assert all(map(added.match, copy)), copy


def judge(made, form, out):
    """Read a deck and write its copy; errors are one clear line."""
    read = read_part_deck(made.path)
    known = {(p.name, e): p for p in made.patches for e in p.elements}
    found = zip(read.instances, read.labels.tolist(), strict=True)
    assert made.refused or sorted(found) == sorted(known)
    cells = [c for cell in read.mesh.cells for c in cell.T]
    for scope, number, cell in zip(read.instances, read.labels, cells, strict=True):
        if (scope, number) not in known:
            continue
        corners = known[scope, number].corners(number)
        np.testing.assert_allclose(read.mesh.points[:, cell].T, corners, atol=1e-9)
    fibres = fibres_on(read.mesh)
    if not fibres.covered.any():
        return
    written = write_part_deck(out, read, fibres, REST)
    assert written[0].name == made.path.name
    check_kept(made, form, out)
    vtu = meshio.read(written[-1]).cell_data
    np.testing.assert_array_equal(np.vstack(vtu["warp_direction"]), fibres.warp.T)
    found = READERS[form](made, written[0])
    expected = {key: families(p.corners(key[1])) for key, p in known.items()}
    assert set(found) == {key for key, ply in expected.items() if ply is not None}
    for key, (warp, weft, thick) in found.items():
        one, other, shear = expected[key]
        np.testing.assert_allclose(warp, one, atol=2e-8, err_msg=str(key))
        if weft is not None:
            np.testing.assert_allclose(weft, other, atol=2e-8, err_msg=str(key))
        assert thick == pytest.approx(REST / np.cos(shear), rel=1e-9)
    again = read_part_deck(written[0])
    assert again.types == read.types or form == "k"
    np.testing.assert_array_equal(again.labels, read.labels)
    np.testing.assert_allclose(again.mesh.points, read.mesh.points, atol=1e-12)
    for name, members in read.sets.items():
        np.testing.assert_array_equal(again.sets[name], members)


@pytest.mark.slow
def test_a_sample_of_decks_is_read_and_written_or_refused_in_one_line(tmp_path):
    counts = Counter()
    for k in range(100):
        form, folder = FORMATS[k % 4], tmp_path / str(k)
        folder.mkdir()
        made = deck(folder, form, SEED + k)
        if made.refused:
            with pytest.raises(MeshError, match=made.refused) as caught:
                judge(made, form, tmp_path / "out")
            assert "\n" not in str(caught.value)
        else:
            judge(made, form, tmp_path / "out")
        counts["refused" if made.refused else "right"] += 1
        shutil.rmtree(tmp_path / "out", ignore_errors=True)
    print(dict(counts))
    assert counts["right"] >= 85
